//! Crude Monte Carlo: the fraction of failures among draws of the density itself. Counts are exact integers.
//!
//! If one draw is used in several runs (for example headways), the draws are independent, but the runs of a draw are
//! not.

use super::interval::{rule_of_three, wilson};
use super::stop::StopReason;
use super::summary::Estimate;

/// Counts of a sample.
#[derive(Debug, Clone, Copy)]
pub struct Counts {
    /// Number of valid draws; all of them are evaluated.
    pub runs: u64,
    /// Number of failed draws.
    pub failures: u64,
    /// Number of indices without a valid point.
    pub voids: u64,
}

/// The estimate from counts, with Wilson's interval, or the rule of three without failures.
pub fn from_counts(counts: &Counts, level: f64, stopped: StopReason) -> Estimate {
    let Counts { runs, failures, voids } = *counts;
    let probability = if runs > 0 { failures as f64 / runs as f64 } else { 0.0 };
    let interval = match failures {
        0 => rule_of_three(runs, level),
        _ => wilson(failures as f64, runs as f64, level),
    };
    let variance = probability * (1.0 - probability) / runs.max(1) as f64;
    let mut estimate = Estimate::new("monte_carlo", probability, variance, interval, runs, failures, voids, stopped);
    estimate.trust.about_voids(voids, runs + voids);
    estimate
}

/// The mean fraction of failed runs over `draws` draws of `size` runs each, from Σ k and Σ k², where k is the number of
/// failed runs of a draw. The sums are exact integers. The variance is that of a mean of independent draws, (Σk²/size²
/// − n·P²)/(n(n − 1)) (Cochran, "Sampling Techniques", 9A: clusters of equal size).
///
/// The interval is Wilson's with the effective number of runs P(1 − P)/variance, or the number of draws if the variance
/// is 0. Without failures it is the rule of three over the draws.
pub fn from_clusters(draws: u64, size: u64, failed: u64, squares: u64, level: f64, stopped: StopReason) -> Estimate {
    let (n, m) = (draws as f64, size as f64);
    let probability = if draws > 0 { failed as f64 / (n * m) } else { 0.0 };
    let spread = squares as f64 / (m * m) - n * probability * probability;
    let variance = if draws > 1 { (spread / (n * (n - 1.0))).max(0.0) } else { probability * (1.0 - probability) };
    let interval = if failed == 0 {
        rule_of_three(draws, level)
    } else {
        let binomial = probability * (1.0 - probability);
        // The effective number lies between the number of draws and the number of runs.
        let effective = if variance > 0.0 { (binomial / variance).clamp(1.0, n * m) } else { n };
        wilson(probability * effective, effective, level)
    };
    Estimate::new("monte_carlo", probability, variance, interval, draws * size, failed, 0, stopped)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_that_fail_together_count_as_one_draw() {
        let together = from_clusters(1000, 10, 10 * 50, 100 * 50, 0.95, StopReason::Samples);
        let alone = from_clusters(1000, 1, 50, 50, 0.95, StopReason::Samples);
        assert_eq!(together.probability, alone.probability);
        assert!((together.variance / alone.variance - 1.0).abs() < 1e-12);
        assert!((together.interval.high - alone.interval.high).abs() < 1e-12);
    }

    #[test]
    fn runs_that_fail_independently_count_for_themselves() {
        // 1,000 draws of 10 runs, k = 1 in half of them: near a binomial of 10,000 runs.
        let spread = from_clusters(1000, 10, 500, 500, 0.95, StopReason::Samples);
        assert!(spread.variance < 0.05 * 0.95 / 1000.0 / 5.0);
        assert!(spread.interval.holds(0.05));
    }

    #[test]
    fn without_failures_only_the_draws_bound_it() {
        let none = from_clusters(1000, 10, 0, 0, 0.95, StopReason::Samples);
        assert_eq!(none.interval, rule_of_three(1000, 0.95));
    }
}
