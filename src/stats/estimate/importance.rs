//! Importance sampling: draws of a proposal g beside draws of the density f, for one question or several about the same
//! draws.
//!
//! A draw of f costs a lane and nothing else, because its weight matters only if it fails. So there are many of them, and
//! they meet what the proposal misses: no method excludes failures of probability p with much fewer than 3/p draws of f,
//! unless it assumes something about where failures lie.

use std::ops::Range;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::blocks::BlockSums;
use super::limit_state::{AT_ONCE, ATTEMPTS, Density, Failure, LimitState, batches, failing, purpose};
use super::stop::StopReason;
use super::summary::Estimate;
use super::warnings::Warning;
use super::weights::WeightSums;
use crate::density::Mixture;
use lanesweep_random::Stream;
use lanesweep_support::Result;

/// Draws of a proposal and of the density, as one sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Importance {
    /// Seed.
    pub seed: u64,
    /// Number of draws of the proposal, ≥ 1. An invalid one is a draw that does not fail.
    pub draws: u64,
    /// Draws of the density for each draw of the proposal.
    pub crude_per_draw: u64,
}

impl Importance {
    /// The same draws of the density beside another number of draws of the proposal.
    pub fn with_draws(self, draws: u64) -> Importance {
        let crude = self.crude_per_draw.saturating_mul(self.draws);
        let least = self.crude_per_draw.min(1);
        Importance { draws, crude_per_draw: crude.div_ceil(draws.max(1)).max(least), ..self }
    }

    /// The failures among a range of draws of the proposal, and then among the draws of the density that belong to them.
    ///
    /// # Errors
    /// Those of the limit state.
    pub fn failures(
        &self,
        nominal: &dyn Density,
        proposal: &Mixture,
        limit_state: &dyn LimitState,
        range: Range<u64>,
    ) -> Result<Vec<WeightedFailure>> {
        let purposes = [purpose::PROPOSAL, purpose::BESIDE_PROPOSAL];
        weighted_failures(nominal, proposal, limit_state, self, purposes, range)
    }
}

/// A failing draw of the proposal or of the density.
pub struct WeightedFailure {
    /// Its index among the draws of the same kind, its point, and what it fails.
    pub of: Failure,
    /// Whether it is a draw of the density.
    pub is_crude: bool,
    /// The draw of the proposal that it is or belongs to.
    pub draw: u64,
    /// 1/(m + g/f), with m draws of the density f for each draw of the proposal g.
    pub weight: f64,
}

/// As [`Importance::failures`], with the purposes of the draws of the proposal and of the density.
pub(super) fn weighted_failures(
    nominal: &dyn Density,
    proposal: &Mixture,
    limit_state: &dyn LimitState,
    options: &Importance,
    purposes: [u32; 2],
    range: Range<u64>,
) -> Result<Vec<WeightedFailure>> {
    let [of_proposal, of_density] = purposes.map(|purpose| Stream { seed: options.seed, purpose });
    let crude = options.crude_per_draw;
    let attempt = |index| Some((index, proposal.draw(&of_proposal, index, 0))).filter(|at| nominal.is_valid(&at.1));
    let attempts: Vec<Option<(u64, Vec<f64>)>> = range.clone().into_par_iter().map(attempt).collect();
    let (indices, points) = attempts.into_iter().flatten().unzip();
    let mut failures: Vec<(bool, Failure)> =
        failing(limit_state, indices, points)?.into_iter().map(|of| (false, of)).collect();
    if crude > 0 {
        let found = limit_state.failures(nominal, of_density, range.start * crude..range.end * crude)?;
        failures.extend(found.into_iter().map(|of| (true, of)));
    }
    let validity = nominal.validity_fraction();
    // An index of the density whose attempts are all invalid is a draw that does not fail.
    let beside = crude as f64 * (1.0 - (1.0 - validity).powi(ATTEMPTS as i32));
    let of_chunk = |chunk: &[(bool, Failure)]| {
        let points: Vec<&[f64]> = chunk.iter().map(|(_, of)| of.point.as_slice()).collect();
        let logs = proposal.log_densities(&points).into_iter().zip(nominal.log_densities(&points));
        logs.map(|(g, f)| 1.0 / (beside + libm::exp(g - f) * validity)).collect::<Vec<f64>>()
    };
    let weights: Vec<f64> = failures.par_chunks(AT_ONCE).flat_map_iter(of_chunk).collect();
    let weighted = |((is_crude, of), weight): ((bool, Failure), f64)| {
        let draw = if is_crude { of.index / crude } else { of.index };
        WeightedFailure { of, is_crude, draw, weight }
    };
    Ok(failures.into_iter().zip(weights).map(weighted).collect())
}

/// Draws, evaluates and weights a range of draws of the proposal, and the draws of the density that belong to them. Returns
/// the sums of every question. Sums of disjoint ranges merge to those of their union, bit for bit.
///
/// # Errors
/// Those of the limit state.
pub fn importance_sums(
    nominal: &dyn Density,
    proposal: &Mixture,
    limit_state: &dyn LimitState,
    options: &Importance,
    indices: Range<u64>,
) -> Result<Vec<BlockSums<WeightSums>>> {
    let unfailed = WeightSums { draws: 1, crude: options.crude_per_draw, ..WeightSums::default() };
    let mut sums: Vec<BlockSums<WeightSums>> = vec![BlockSums::default(); limit_state.questions()];
    for batch in batches(indices) {
        let failures = options.failures(nominal, proposal, limit_state, batch.clone())?;
        for (question, sums) in sums.iter_mut().enumerate() {
            let mut leaves = vec![unfailed; (batch.end - batch.start) as usize];
            for failure in failures.iter().filter(|failure| failure.of.fails[question]) {
                leaves[(failure.draw - batch.start) as usize].add_failure(failure.weight, failure.is_crude);
            }
            sums.merge(BlockSums::of_leaves(batch.start, &leaves))?;
        }
    }
    Ok(sums)
}

/// The estimate from sums.
pub fn from_weight_sums(sums: &WeightSums, level: f64) -> Estimate {
    let runs = sums.draws + sums.crude;
    let (probability, variance) = (sums.probability().min(1.0), sums.variance());
    let reason = StopReason::Samples;
    let mut estimate =
        Estimate::new("importance", probability, variance, sums.interval(level), runs, sums.failures, 0, reason);
    estimate.trust.about_weights(sums);
    estimate.weights = Some(sums.figures());
    estimate
}

/// The estimate from points that another program drew. `log_ratios` holds ln f − ln g of each: f is the density of the
/// question, normalized over its valid region (−∞ outside), g the density that the points were drawn from. Where g is
/// small and failures are possible, nothing bounds what was missed.
pub fn importance_of_points(log_ratios: &[f64], fails: &[bool], level: f64) -> Estimate {
    let leaf = |(log_ratio, fails): (&f64, &bool)| {
        let mut sums = WeightSums { draws: 1, ..WeightSums::default() };
        if *fails && *log_ratio > f64::NEG_INFINITY {
            sums.add_failure(libm::exp(*log_ratio), false);
        }
        sums
    };
    let leaves: Vec<WeightSums> = log_ratios.iter().zip(fails).map(leaf).collect();
    let mut estimate = from_weight_sums(&BlockSums::of_leaves(0, &leaves).total().unwrap_or_default(), level);
    estimate.trust.about_mean_weight(log_ratios);
    estimate.trust.warn_if(true, Warning::DataLeftOut);
    estimate
}
