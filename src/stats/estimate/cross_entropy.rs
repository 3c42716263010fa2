//! Cross-entropy (Rubinstein and Kroese, "The Cross-Entropy Method", 2004; Kurtz and Song, "Cross-entropy-based
//! adaptive importance sampling using Gaussian mixture", Structural Safety 42, 2013). A Gaussian mixture moves towards
//! the failures level by level; the goal of each level is a quantile of the limit state. Importance sampling with the
//! last mixture and a defensive mixture weight gives the estimate.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use super::importance::{Importance, defended, importance, no_valid_point};
use super::problem::{Density, LimitState, evaluated, purpose};
use super::stop::StopRule;
use super::summary::Estimate;
use super::trust::Warning;
use crate::Result;
use crate::stats::density::moments::moments;
use crate::stats::density::{Mixture, MixtureFitOptions as FitOptions};
use crate::stats::random::Stream;

/// Every component of a fit has a widened copy, with this fraction of the density's covariance added to its own.
///
/// Beyond the limit, the density of failures decreases exponentially, but a Gaussian fitted to them decreases faster.
/// Without the copies, the variance of the weights is underestimated and the intervals are too short.
const WIDENING: f64 = 0.25;
/// Total weight of the widened copies in the mixture.
const WIDENED_WEIGHT: f64 = 0.5;

/// Components whose weight in the smoothed mixture falls below this are dropped.
const MIN_WEIGHT: f64 = 0.02;

/// Options for finding a proposal and sampling it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CrossEntropy {
    /// Seed.
    pub seed: u64,
    /// Level of the interval.
    pub level: f64,
    /// Draws of each level.
    pub samples_per_level: u64,
    /// ρ: a level's goal is this quantile of the limit state, 0 at the lowest.
    pub quantile: f64,
    /// Maximum number of components of a level's fit; the number is chosen by the Bayesian information criterion.
    pub components: usize,
    /// Weight of the new fit in the next mixture; the rest is the previous mixture.
    pub smoothing: f64,
    /// Maximum number of levels.
    pub levels: usize,
    /// Defensive mixture weight of the final proposal.
    pub defence: f64,
    /// When the final sample ends.
    pub stop: StopRule,
}

impl CrossEntropy {
    /// ρ = 0.1, up to four components, smoothing 0.7, defensive mixture weight 0.1. `final_samples` excludes the runs
    /// of the levels.
    pub fn new(seed: u64, samples_per_level: u64, final_samples: u64) -> CrossEntropy {
        CrossEntropy {
            seed,
            level: 0.95,
            samples_per_level,
            quantile: 0.1,
            components: 4,
            smoothing: 0.7,
            levels: 20,
            defence: 0.1,
            stop: StopRule::samples(final_samples),
        }
    }
}

/// One level.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CrossEntropyStep {
    /// Limit state at or below which draws are fitted.
    pub threshold: f64,
    /// Number of draws at or below it.
    pub elite: usize,
    /// Failures among the level's draws.
    pub failures: usize,
    /// Components of the mixture after the level.
    pub components: usize,
}

/// The estimate, its levels, and the proposal, which can be reused with other seeds or in parts.
#[derive(Debug, Clone, PartialEq)]
pub struct CrossEntropyRun {
    /// The estimate; its runs include those of the levels.
    pub estimate: Estimate,
    /// The levels.
    pub steps: Vec<CrossEntropyStep>,
    /// The last mixture, without the defensive part.
    pub proposal: Mixture,
}

/// Finds a proposal and samples it.
///
/// # Errors
/// Those of the limit state; [`crate::Error::Usage`] if the density has no valid point.
pub fn cross_entropy(
    nominal: &dyn Density,
    limit_state: &dyn LimitState,
    options: &CrossEntropy,
) -> Result<CrossEntropyRun> {
    let mut steps: Vec<CrossEntropyStep> = Vec::new();
    let mut proposal: Option<Mixture> = None;
    let mut runs = 0;
    let mut reached = f64::INFINITY;
    let mut nominal_covariance = DMatrix::zeros(0, 0);
    for level in 0..options.levels.max(1) {
        let stream = Stream { seed: options.seed, purpose: purpose::CROSS_ENTROPY + level as u32 };
        let indices = 0..options.samples_per_level;
        let guarded = proposal.as_ref().map(|p| defended(p.clone(), nominal, 0.0)).transpose()?;
        let source: &dyn Density = guarded.as_ref().map_or(nominal, |g| g);
        let sample = evaluated(source, limit_state, stream, indices)?;
        if sample.points.is_empty() {
            return Err(no_valid_point("level of cross-entropy"));
        }
        runs += sample.points.len() as u64;
        if level == 0 {
            let equal = sample.points.iter().map(|p| (p.as_slice(), 1.0));
            nominal_covariance = moments(equal, nominal.dimensions()).1;
        }
        let mut sorted = sample.values.clone();
        sorted.sort_by(f64::total_cmp);
        let at = ((options.quantile * sorted.len() as f64).ceil() as usize).clamp(1, sorted.len()) - 1;
        reached = sorted[at].max(0.0);
        let (mut points, mut logs) = (Vec::new(), Vec::new());
        for (point, _) in sample.points.into_iter().zip(&sample.values).filter(|(_, v)| **v <= reached) {
            logs.push(
                nominal.log_density(&point)
                    - guarded.as_ref().map_or_else(|| nominal.log_density(&point), |g| g.log_density(&point)),
            );
            points.push(point);
        }
        let top = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let weights: Vec<f64> = logs.iter().map(|l| libm::exp(l - top)).collect();
        let fit = FitOptions { components: options.components, seed: options.seed, ..FitOptions::default() };
        let narrow = Mixture::fit(&points, &weights, &fit)?;
        let wide = narrow.widened(&nominal_covariance, WIDENING)?;
        let fitted = Mixture::join(&[(1.0 - WIDENED_WEIGHT, &narrow), (WIDENED_WEIGHT, &wide)])?;
        let next = match &proposal {
            Some(last) => smoothed(&fitted, last, options.smoothing)?,
            None => fitted,
        };
        steps.push(CrossEntropyStep {
            threshold: reached,
            elite: points.len(),
            failures: sorted.partition_point(|v| *v <= 0.0),
            components: next.weights().len(),
        });
        proposal = Some(next);
        if reached <= 0.0 {
            break;
        }
    }
    let Some(proposal) = proposal else { return Err(no_valid_point("level of cross-entropy")) };
    let sampled = defended(proposal, nominal, options.defence)?;
    let last = Importance { seed: options.seed, level: options.level, stop: options.stop, self_normalised: false };
    let mut estimate = importance(nominal, &sampled, limit_state, &last)?;
    estimate.method = "cross_entropy".to_owned();
    estimate.set_runs(estimate.runs + runs);
    let not_reached = Warning::LevelsNotReached { levels: steps.len(), threshold: reached };
    estimate.trust.warn_if(reached > 0.0, not_reached);
    Ok(CrossEntropyRun { estimate, steps, proposal: sampled.proposal().clone() })
}

/// Mixes the new mixture with this `weight` and the old one; drops negligible components. Mixing the densities
/// replaces smoothing of the parameters, which is undefined for different numbers of components.
fn smoothed(new: &Mixture, old: &Mixture, weight: f64) -> Result<Mixture> {
    let both = Mixture::join(&[(weight, new), (1.0 - weight, old)])?;
    let kept: Vec<usize> = (0..both.weights().len()).filter(|k| both.weights()[*k] >= MIN_WEIGHT).collect();
    if kept.is_empty() {
        return Ok(both);
    }
    Mixture::new(
        kept.iter().map(|k| both.weights()[*k]).collect(),
        kept.iter().map(|k| both.mean(*k).to_vec()).collect(),
        kept.iter().map(|k| both.factor(*k).clone()).collect(),
        (0..kept.len()).collect(),
    )
}
