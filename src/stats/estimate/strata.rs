//! Stratified sampling: the population is a mixture of strata with known weights (values of the headway, say), each
//! sampled by itself.

use serde::{Deserialize, Serialize};

use super::interval::{Interval, IntervalKind, wilson};
use super::stop::StopReason;
use super::summary::Estimate;
use crate::{Error, Place, Result};

/// Runs of one stratum. Strata must be drawn independently of each other; where the same draws serve all of them,
/// the variance of this file is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Stratum {
    /// Share of the population, > 0; shares are scaled to sum 1.
    pub weight: f64,
    /// Runs, ≥ 1.
    pub runs: u64,
    /// Failures among them.
    pub failures: u64,
}

/// Σ W_h p_h with the variance Σ W_h² p_h (1 − p_h)/(n_h − 1) (Cochran, "Sampling Techniques", 5.3).
///
/// The interval is Wilson's with the effective number of runs P(1 − P)/variance (Korn and Graubard 1998), the
/// variance being taken at (k + ½)/(n + 1) in every stratum: a stratum without failures is not certain never to fail.
/// Without any failure it is [0, max W_h/n_h · ln(1/(1 − level))], which holds whatever the strata's probabilities.
///
/// # Errors
/// [`Error::Usage`] where a stratum has no run, more failures than runs or no positive weight.
pub fn stratified(strata: &[Stratum], level: f64) -> Result<Estimate> {
    let total: f64 = strata.iter().map(|s| s.weight).sum();
    let is_wrong = |s: &Stratum| s.runs == 0 || s.failures > s.runs || s.weight.is_nan() || s.weight <= 0.0;
    if strata.is_empty() || strata.iter().any(is_wrong) || !total.is_finite() {
        return Err(Error::usage(
            Place::item("strata"),
            "a stratum has no run, more failures than runs or no positive weight",
            "give every stratum a positive weight and at least one run",
        ));
    }
    let (mut probability, mut variance, mut cautious) = (0.0, 0.0, 0.0);
    for s in strata {
        let (w, n, k) = (s.weight / total, s.runs as f64, s.failures as f64);
        let (p, smoothed) = (k / n, (k + 0.5) / (n + 1.0));
        probability += w * p;
        variance += w * w * p * (1.0 - p) / (n - 1.0).max(1.0);
        cautious += w * w * smoothed * (1.0 - smoothed) / n;
    }
    let runs = strata.iter().map(|s| s.runs).sum();
    let failures = strata.iter().map(|s| s.failures).sum();
    let interval = if failures == 0 {
        let heaviest = strata.iter().map(|s| s.weight / total / s.runs as f64).fold(0.0, f64::max);
        let high = (-heaviest * libm::log1p(-level)).min(1.0);
        Interval { low: 0.0, high, level, kind: IntervalKind::RuleOfThree }
    } else {
        let effective = (probability * (1.0 - probability) / cautious).max(1.0);
        wilson(probability * effective, effective, level)
    };
    Ok(Estimate::new("stratified", probability, variance, interval, runs, failures, 0, StopReason::Samples))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strata_that_differ_are_estimated_better_than_a_plain_sample() {
        let strata = [
            Stratum { weight: 1.0, runs: 1000, failures: 0 },
            Stratum { weight: 1.0, runs: 1000, failures: 500 },
            Stratum { weight: 2.0, runs: 2000, failures: 1990 },
        ];
        let estimate = stratified(&strata, 0.95).unwrap();
        assert!((estimate.probability - (0.25 * 0.5 + 0.5 * 0.995)).abs() < 1e-12);
        assert!(estimate.variance_reduction > 2.0);
        assert!(estimate.interval.holds(estimate.probability));
    }

    #[test]
    fn equal_strata_without_failure_are_bounded_as_one_sample() {
        let strata = vec![Stratum { weight: 0.1, runs: 1000, failures: 0 }; 10];
        let high = stratified(&strata, 0.95).unwrap().interval.high;
        assert!((high / super::super::rule_of_three(10_000, 0.95).high - 1.0).abs() < 1e-3);
        assert!(stratified(&[Stratum { weight: 0.1, runs: 0, failures: 0 }], 0.95).is_err());
        assert!(stratified(&[], 0.95).is_err());
    }
}
