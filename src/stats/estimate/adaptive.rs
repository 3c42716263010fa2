//! Importance sampling with a proposal that a search finds: the estimator of rare failures.

use serde::{Deserialize, Serialize};

use super::importance::{Importance, defended, importance};
use super::interval::Interval;
use super::problem::{Density, LimitState};
use super::search::{Found, Search, SearchRun, search};
use super::stop::StopReason;
use super::summary::Estimate;
use super::trust::Warning;
use crate::Result;
use crate::stats::density::normal_quantile;

/// Factor on the number of draws that a search predicts, because it knows the variance only roughly.
const RESERVE: f64 = 1.2;
/// Minimum number of final draws: fewer save nothing after a search.
const MIN_DRAWS: u64 = 4000;

/// The accuracy that is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Goal {
    /// Half the interval's width over the probability.
    pub half_width: f64,
    /// Maximum number of final draws.
    pub max_draws: u64,
}

impl Goal {
    /// The number of final draws after a search, for all questions together: the worst one decides.
    pub fn draws(&self, found: &[Found], level: f64) -> u64 {
        let z = normal_quantile(0.5 + 0.5 * level);
        let of = |found: &Found| found.relative_variance.unwrap_or(0.0) * (z / self.half_width).powi(2);
        let most = found.iter().map(of).fold(0.0, f64::max);
        ((RESERVE * most).ceil() as u64).max(MIN_DRAWS).min(self.max_draws)
    }
}

/// Result of [`adaptive`].
#[derive(Debug, Clone, PartialEq)]
pub struct AdaptiveRun {
    /// Question by question. Their runs include the search.
    pub estimates: Vec<Estimate>,
    /// The search.
    pub search: SearchRun,
}

/// Searches a proposal, then samples it. The final sample is independent of the search, so the estimate is unbiased.
///
/// # Errors
/// Those of the limit state; [`crate::Error::Usage`] if the density has no valid point.
pub fn adaptive(
    nominal: &dyn Density,
    limit_state: &dyn LimitState,
    options: &Search,
    goal: &Goal,
    seed: u64,
    level: f64,
) -> Result<AdaptiveRun> {
    let run = search(nominal, limit_state, options, seed)?;
    let estimates = match &run.proposal {
        Some(proposal) => {
            let samples = goal.draws(&run.questions, level);
            let proposal = defended(proposal.clone(), nominal, options.defence)?;
            importance(nominal, &proposal, limit_state, &Importance { level, ..Importance::new(seed, samples) })?
        }
        None => run.questions.iter().map(|_| nothing_found(level)).collect(),
    };
    let after = |(estimate, found): (Estimate, &Found)| after_search(estimate, found, run.points, options);
    let estimates = estimates.into_iter().zip(&run.questions).map(after).collect();
    Ok(AdaptiveRun { estimates, search: run })
}

/// The estimate of a question of which the search found no failure: nothing but the bound 1 is known.
fn nothing_found(level: f64) -> Estimate {
    Estimate::new("importance", 0.0, 0.0, Interval::nothing(level), 0, 0, 0, StopReason::Samples)
}

/// Adds the points of the search to an estimate, and what the search says against it.
pub fn after_search(mut estimate: Estimate, found: &Found, points: u64, options: &Search) -> Estimate {
    let draws = estimate.runs;
    estimate.set_runs(draws + points);
    let Some(variance) = found.relative_variance else {
        estimate.trust.warn_if(true, Warning::NothingFound { depth: found.depth });
        return estimate;
    };
    let p = estimate.probability;
    let shallow = found.depth > Warning::DEPTH * p;
    estimate.trust.warn_if(shallow, Warning::Shallow { depth: found.depth, probability: p });
    if p > 0.0 {
        let error = (variance / options.test as f64 + estimate.coefficient_of_variation.powi(2)).sqrt();
        let errors = libm::fabs(libm::log(p / found.probability)) / error;
        let disagrees = Warning::DisagreesWithSearch { search: found.probability, errors };
        estimate.trust.warn_if(errors > Warning::SEARCH_ERRORS, disagrees);
    }
    estimate
}
