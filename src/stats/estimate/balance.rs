//! Several proposals, combined by the balance heuristic (Veach and Guibas, "Optimally combining sampling techniques for
//! Monte Carlo rendering", SIGGRAPH 1995; Owen and Zhou 2000). Every draw has the weight f/Σ α_i g_i, whichever
//! proposal it came from; α_i is the fraction of the draws from g_i. The combination is good wherever one proposal is
//! good. A weight is at most 1/α_i times that of proposal i alone.

use super::importance::{sums_of_stream, weighted_interval};
use super::problem::{Density, LimitState, purpose};
use super::stop::StopReason;
use super::summary::Estimate;
use super::weights::WeightSums;
use super::{blocks::Join, problem::Draw};
use crate::stats::random::Stream;
use crate::{Error, Place, Result};

/// One proposal and its number of draws.
pub struct Technique<'a> {
    /// The proposal, with a known validity fraction, because it enters the weights of the others' draws.
    pub proposal: &'a dyn Density,
    /// Draws, ≥ 2.
    pub draws: u64,
}

/// Σ α_i g_i / P_i, each part truncated separately.
struct Together<'a, 'b> {
    parts: &'b [(f64, &'a dyn Density)],
}

impl Density for Together<'_, '_> {
    fn dimensions(&self) -> usize {
        self.parts[0].1.dimensions()
    }

    fn log_density(&self, point: &[f64]) -> f64 {
        let logs: Vec<f64> = self
            .parts
            .iter()
            .map(|(weight, g)| libm::log(weight / g.validity_fraction()) + g.log_density(point))
            .collect();
        let top = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if top == f64::NEG_INFINITY {
            return top;
        }
        top + libm::log(logs.iter().map(|l| libm::exp(l - top)).sum())
    }

    fn attempt(&self, stream: &Stream, index: u64, attempt: u32) -> Vec<f64> {
        self.parts[0].1.attempt(stream, index, attempt)
    }

    fn draw(&self, _stream: &Stream, _index: u64) -> Option<Draw> {
        None // draws come from the parts
    }
}

/// Draws from every technique and combines them. The variance is that of a stratified sample, Σ α_i² s_i²/n_i, because
/// each technique has a fixed number of draws.
///
/// # Errors
/// Those of the limit state; [`Error::Usage`] if there is no technique, one has fewer than two draws, or the numbers of
/// parameters differ.
pub fn balance_heuristic(
    nominal: &dyn Density,
    techniques: &[Technique],
    limit_state: &dyn LimitState,
    seed: u64,
    level: f64,
) -> Result<Estimate> {
    let fits = |t: &Technique| t.draws >= 2 && t.proposal.dimensions() == nominal.dimensions();
    if techniques.is_empty() || !techniques.iter().all(fits) {
        return Err(Error::usage(
            Place::item("balance heuristic"),
            "there is no technique, or one has fewer than two draws or other parameters than the density",
            "give at least one technique, each with two draws or more over the density's parameters",
        ));
    }
    let all: u64 = techniques.iter().map(|t| t.draws).sum();
    let parts: Vec<(f64, &dyn Density)> =
        techniques.iter().map(|t| (t.draws as f64 / all as f64, t.proposal)).collect();
    let together = Together { parts: &parts };
    let (mut probability, mut variance) = (0.0, 0.0);
    let mut total: Option<WeightSums> = None;
    for (i, technique) in techniques.iter().enumerate() {
        let stream = Stream { seed, purpose: purpose::TECHNIQUE + i as u32 };
        let sums = sums_of_stream(nominal, technique.proposal, limit_state, stream, 0..technique.draws, &together)?;
        // The weights include the validity fractions: here each valid draw counts as one attempt.
        let own = sums.total().map(|s: WeightSums| WeightSums { tries: s.draws, ..s }).unwrap_or_default();
        if own.draws < 2 {
            return Err(super::importance::no_valid_point("technique of the balance heuristic"));
        }
        let (weight, n) = (parts[i].0, own.draws as f64);
        probability += weight * own.unbiased();
        variance += weight * weight * own.unbiased_variance() * n / (n - 1.0);
        total = Some(total.map_or(own, |t| WeightSums::join(&t, &own)));
    }
    let total = total.unwrap_or_default();
    let figures = total.figures();
    let probability = probability.min(1.0);
    let interval = weighted_interval(probability, variance, figures.effective_size_failures, level);
    let mut estimate = Estimate::new(
        "balance",
        probability,
        variance,
        interval,
        total.draws,
        total.failures,
        total.voids,
        StopReason::Samples,
    );
    estimate.trust.about_voids(total.voids, all);
    estimate.trust.about_weights(&figures, total.failures);
    estimate.weights = Some(figures);
    Ok(estimate)
}
