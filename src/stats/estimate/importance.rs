//! Importance sampling: draws of a proposal g with weights f/g, for one question or several about the same draws.
//!
//! The defensive mixture gives f the weight δ in the proposal. This bounds the weights by 1/δ.

use std::ops::Range;

use rayon::prelude::*;

use super::blocks::BlockSums;
use super::interval::{Interval, log_normal};
use super::problem::{Density, Draw, LimitState, batches, draw, evaluate_checked, purpose};
use super::stop::StopReason;
use super::summary::Estimate;
use super::trust::Warning;
use super::weights::{WeightSums, WeightedDraw};
use crate::random::Stream;
use crate::stats::density::Mixture;
use crate::stats::density::normal::uniform;
use crate::{Error, Place, Result};

/// (1 − δ) g + δ f, truncated like f. Every attempt selects g or f anew, so the mixture is truncated as a whole.
pub struct Defended<'a> {
    nominal: &'a dyn Density,
    proposal: Mixture,
    weight: f64,
}

/// Mixes the density into a proposal with weight δ in [0, 1]; with 0 only the validity rule is adopted.
///
/// # Errors
/// [`Error::Usage`] if the weight is outside [0, 1] or the numbers of parameters differ.
pub fn defended(proposal: Mixture, nominal: &dyn Density, weight: f64) -> Result<Defended<'_>> {
    if !(0.0..=1.0).contains(&weight) || proposal.dimensions() != nominal.dimensions() {
        return Err(Error::usage(
            Place::item("defensive mixture"),
            format!(
                "a share of {weight}, {} parameters of the proposal and {} of the density do not fit together",
                proposal.dimensions(),
                nominal.dimensions()
            ),
            "give a share from 0 to 1 and two densities over the same parameters",
        ));
    }
    Ok(Defended { nominal, proposal, weight })
}

impl Defended<'_> {
    /// The proposal alone.
    pub fn proposal(&self) -> &Mixture {
        &self.proposal
    }
}

impl Density for Defended<'_> {
    fn dimensions(&self) -> usize {
        self.proposal.dimensions()
    }

    fn log_density(&self, point: &[f64]) -> f64 {
        if !self.nominal.is_valid(point) {
            return f64::NEG_INFINITY;
        }
        let of = |weight: f64, log: &dyn Fn() -> f64| {
            if weight > 0.0 { libm::log(weight) + log() } else { f64::NEG_INFINITY }
        };
        let a = of(1.0 - self.weight, &|| self.proposal.log_density(point));
        let b = of(self.weight, &|| self.nominal.log_density(point));
        let top = a.max(b);
        if top == f64::NEG_INFINITY { top } else { top + libm::log(libm::exp(a - top) + libm::exp(b - top)) }
    }

    fn attempt(&self, stream: &Stream, index: u64, attempt: u32) -> Vec<f64> {
        let choice = Stream { purpose: stream.purpose.wrapping_add(purpose::CHOICE), ..*stream };
        if uniform(choice.words(index, attempt)[0]) < self.weight {
            self.nominal.attempt(stream, index, attempt)
        } else {
            self.proposal.draw(stream, index, attempt)
        }
    }

    fn is_valid(&self, point: &[f64]) -> bool {
        self.nominal.is_valid(point)
    }
}

/// Options for sampling a proposal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Importance {
    /// Seed.
    pub seed: u64,
    /// Level of the interval.
    pub level: f64,
    /// Number of draws, ≥ 1.
    pub samples: u64,
    /// Divides by the sum of the weights instead of the number of draws. The bias is of order 1/n, and the variance is
    /// lower only if many draws fail. Required if a density is known only up to a constant.
    pub self_normalised: bool,
}

impl Importance {
    /// `samples` samples, unbiased, level 95 %.
    pub fn new(seed: u64, samples: u64) -> Importance {
        Importance { seed, level: 0.95, samples, self_normalised: false }
    }
}

/// Draws, evaluates and weights a range of indices; returns the sums of every question, then those of every pair of
/// questions, over the draws that fail both. Sums of disjoint ranges merge to those of their union, bit for bit.
///
/// # Errors
/// Those of the limit state.
pub fn importance_sums(
    nominal: &dyn Density,
    proposal: &dyn Density,
    limit_state: &dyn LimitState,
    seed: u64,
    indices: Range<u64>,
    pairs: &[[usize; 2]],
) -> Result<Vec<BlockSums<WeightSums>>> {
    let stream = Stream { seed, purpose: purpose::PROPOSAL };
    let (questions, guides) = (limit_state.questions(), limit_state.guides());
    let asked: Vec<[usize; 2]> = (0..questions).map(|question| [question; 2]).chain(pairs.iter().copied()).collect();
    let mut sums: Vec<BlockSums<WeightSums>> = vec![BlockSums::default(); asked.len()];
    for batch in batches(indices) {
        let mut draws = draw(proposal, stream, batch.clone());
        let points: Vec<Vec<f64>> = draws.iter_mut().flatten().map(|drawn| std::mem::take(&mut drawn.point)).collect();
        let values = evaluate_checked(limit_state, &points)?;
        let ratio = |point: &Vec<f64>| libm::exp(nominal.log_density(point) - proposal.log_density(point));
        let ratios: Vec<f64> = points.par_iter().map(ratio).collect();
        for (of, sums) in asked.iter().zip(&mut sums) {
            let mut valid = 0;
            let leaf = |drawn: &Option<Draw>| {
                let Some(drawn) = drawn else { return WeightedDraw::void().into() };
                let value = |question: &usize| values[(valid * questions + question) * guides];
                let (ratio, fails) = (ratios[valid], of.iter().all(|question| value(question) <= 0.0));
                valid += 1;
                WeightedDraw {
                    weight: ratio / nominal.validity_fraction(),
                    response: f64::from(u8::from(fails)),
                    tries: drawn.tries,
                    is_void: false,
                    is_thin: ratio > Warning::THIN_RATIO,
                }
                .into()
            };
            let leaves: Vec<WeightSums> = draws.iter().map(leaf).collect();
            sums.merge(BlockSums::of_leaves(batch.start, &leaves))?;
        }
    }
    Ok(sums)
}

/// Student's interval on the scale of ln P; the degrees of freedom are the effective number of failures minus one.
fn weighted_interval(probability: f64, variance: f64, effective_failures: f64, level: f64) -> Interval {
    if probability <= 0.0 || variance <= 0.0 {
        return Interval::nothing(level);
    }
    log_normal(probability, variance.sqrt() / probability, effective_failures - 1.0, level)
}

/// The estimate from sums.
pub fn from_weight_sums(sums: &WeightSums, self_normalised: bool, level: f64) -> Estimate {
    let figures = sums.figures();
    let (method, probability, variance) = if self_normalised {
        ("importance_self_normalised", figures.self_normalised, figures.self_normalised_variance)
    } else {
        ("importance", sums.unbiased(), sums.unbiased_variance())
    };
    let probability = probability.min(1.0);
    let interval = weighted_interval(probability, variance, figures.effective_size_failures, level);
    let mut estimate = Estimate::new(
        method,
        probability,
        variance,
        interval,
        sums.draws,
        sums.failures,
        sums.voids,
        StopReason::Samples,
    );
    estimate.trust.about_voids(sums.voids, sums.draws + sums.voids);
    estimate.trust.about_weights(&figures, sums.failures);
    estimate.weights = Some(figures);
    estimate
}

/// Samples the proposal; returns the estimate of every question. The proposal must be valid wherever the density is. If
/// g = 0 where f > 0 and failure is possible, the estimate is too small without any warning.
///
/// # Errors
/// Those of the limit state.
pub fn importance(
    nominal: &dyn Density,
    proposal: &dyn Density,
    limit_state: &dyn LimitState,
    options: &Importance,
) -> Result<Vec<Estimate>> {
    let sums = importance_sums(nominal, proposal, limit_state, options.seed, 0..options.samples, &[])?;
    let of = |sums: &BlockSums<WeightSums>| {
        let total = sums.total().unwrap_or_default();
        from_weight_sums(&total, options.self_normalised, options.level)
    };
    Ok(sums.iter().map(of).collect())
}

/// The estimate from points that another program drew. `log_ratios` holds ln f − ln g of each: f is the density of the
/// question, normalized over its valid region (−∞ outside), g the density that the points were drawn from.
pub fn importance_of_points(log_ratios: &[f64], fails: &[bool], level: f64) -> Estimate {
    let leaf = |(log_ratio, fails): (&f64, &bool)| {
        let weight = libm::exp(*log_ratio);
        let response = f64::from(u8::from(*fails && weight > 0.0));
        // No defensive part is known, so no weight tells where the proposal is thin.
        WeightedDraw { weight, response, tries: 1, is_void: false, is_thin: false }.into()
    };
    let leaves: Vec<WeightSums> = log_ratios.iter().zip(fails).map(leaf).collect();
    let mut estimate = from_weight_sums(&BlockSums::of_leaves(0, &leaves).total().unwrap_or_default(), false, level);
    estimate.trust.warn_if(true, Warning::DataLeftOut);
    estimate
}

/// The error if no draw is valid.
pub(crate) fn no_valid_point(of: &str) -> Error {
    Error::usage(
        Place::item(of),
        "no draw of the density is valid",
        "check the bounds of the parameters: they must leave something of the density",
    )
}
