//! Crude Monte Carlo: the share of failures among draws of the density itself. Counts are integers and exact.

use serde::{Deserialize, Serialize};

use super::interval::{Interval, clopper_pearson, rule_of_three, wilson};
use super::stop::StopReason;
use super::summary::Estimate;

/// Which interval goes with a count of failures. With none, it is the rule of three in both cases.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BinomialInterval {
    /// Holds the truth at the nominal level on average.
    Wilson,
    /// Holds it at least at the nominal level.
    ClopperPearson,
}

/// What was counted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counts {
    /// Valid draws, all of them judged.
    pub runs: u64,
    /// Those that failed.
    pub failures: u64,
    /// Indices without a valid point.
    pub voids: u64,
    /// Attempts at valid points.
    pub tries: u64,
}

impl std::ops::Add for Counts {
    type Output = Counts;

    fn add(self, other: Counts) -> Counts {
        Counts {
            runs: self.runs + other.runs,
            failures: self.failures + other.failures,
            voids: self.voids + other.voids,
            tries: self.tries + other.tries,
        }
    }
}

/// The estimate of counts.
pub fn from_counts(counts: &Counts, interval: BinomialInterval, level: f64, stopped: StopReason) -> Estimate {
    let Counts { runs, failures, voids, .. } = *counts;
    let probability = if runs > 0 { failures as f64 / runs as f64 } else { 0.0 };
    let interval: Interval = match interval {
        _ if failures == 0 => rule_of_three(runs, level),
        BinomialInterval::Wilson => wilson(failures as f64, runs as f64, level),
        BinomialInterval::ClopperPearson => clopper_pearson(failures, runs, level),
    };
    let variance = probability * (1.0 - probability) / runs.max(1) as f64;
    let mut estimate = Estimate::new("monte_carlo", probability, variance, interval, runs, failures, voids, stopped);
    estimate.trust.about_voids(voids, runs + voids);
    estimate
}
