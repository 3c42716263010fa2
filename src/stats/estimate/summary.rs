//! The result of every estimator.

use serde::{Deserialize, Serialize};

use super::interval::Interval;
use super::ratio::ClusterRate;
use super::stop::StopReason;
use super::warnings::{Trust, Warning};
use super::weights::WeightFigures;

/// A probability of failure with measures of its accuracy.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Estimator: `monte_carlo`, `importance`.
    pub method: String,
    /// The estimate, in [0, 1].
    pub probability: f64,
    /// Interval for the probability.
    pub interval: Interval,
    /// Half the interval's width over the probability; ∞ at zero.
    pub relative_half_width: f64,
    /// Estimated variance of the probability.
    pub variance: f64,
    /// √variance over the probability; ∞ at zero.
    pub coefficient_of_variation: f64,
    /// Number of evaluations of the limit state, including those of a search.
    pub runs: u64,
    /// Number of failures in the sample of the estimate, without those of a search.
    pub failures: u64,
    /// Number of indices without a valid point.
    pub voids: u64,
    /// Variance of crude Monte Carlo with as many runs over this variance: P(1 − P)/(runs · variance).
    pub variance_reduction: f64,
    /// Figures of weighted samples.
    pub weights: Option<WeightFigures>,
    /// Reason for the end of the sample.
    pub stopped: StopReason,
    /// Warnings about the estimate.
    pub trust: Trust,
}

impl Estimate {
    /// Computes the derived figures.
    #[allow(clippy::too_many_arguments)]
    pub(crate) fn new(
        method: &str,
        probability: f64,
        variance: f64,
        interval: Interval,
        runs: u64,
        failures: u64,
        voids: u64,
        stopped: StopReason,
    ) -> Estimate {
        let mut trust = Trust::default();
        trust.about_failures(failures);
        trust.warn_if(!stopped.is_reproducible(), Warning::NotReproducible);
        let mut estimate = Estimate {
            method: method.to_owned(),
            probability,
            interval,
            relative_half_width: interval.relative_half_width(probability),
            variance,
            coefficient_of_variation: if probability > 0.0 { variance.sqrt() / probability } else { f64::INFINITY },
            runs,
            failures,
            voids,
            variance_reduction: f64::NAN,
            weights: None,
            stopped,
            trust,
        };
        estimate.set_runs(runs);
        estimate
    }

    /// Adds the uncertainty of the data: `clusters` are the draws around each scenario. Neither variance nor interval
    /// becomes smaller; the variance reduction remains that of the draws.
    pub fn over_scenarios(mut self, clusters: &ClusterRate) -> Estimate {
        let (own, with_data) = (self.interval, clusters.interval);
        self.interval.low = own.low.min(with_data.low);
        self.interval.high = own.high.max(with_data.high);
        self.interval.kind = with_data.kind;
        self.relative_half_width = self.interval.relative_half_width(self.probability);
        self.variance = self.variance.max(clusters.variance);
        if self.probability > 0.0 {
            self.coefficient_of_variation = self.variance.sqrt() / self.probability;
        }
        let scenarios = clusters.effective_failing;
        self.trust
            .warn_if(self.failures > 0 && scenarios < Warning::MIN_SCENARIOS, Warning::FewScenarios { scenarios });
        self
    }

    /// Adds the runs before the final sample.
    pub fn after_search(mut self, runs: u64) -> Estimate {
        self.set_runs(self.runs + runs);
        self
    }

    fn set_runs(&mut self, runs: u64) {
        self.runs = runs;
        let crude = self.probability * (1.0 - self.probability) / runs as f64;
        self.variance_reduction = if self.variance > 0.0 { crude / self.variance } else { f64::NAN };
    }
}
