//! From counts to estimates: one row per model, criterion and headway, and one over all headways. Risk: frequency of
//! failures, λ̂·P̂ per hour and per 1,000 km.

use serde::Serialize;

use super::Sample;
use super::bandwidth::{AtBandwidth, BandwidthVerdict};
use super::uncertainty::Uncertainty;
use lanesweep_engine::{LanePlan, SampleTally, cell_of};
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_stats::density::{Exposure, Rate, normal_quantile};
use lanesweep_stats::estimate::{
    Carrier, Clusters, Counts, Estimate, Interval, Ratio, StopReason, Warning, cluster_rate, from_clusters, from_counts,
};

/// What draws without possible traffic are of an estimate: the vehicle that cuts out drives through the one ahead of it. Maps and
/// tables of cases leave them out by the same rule.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct NoTraffic {
    /// Their fraction of the draws.
    pub fraction: f64,
    /// The probability that a draw with possible traffic fails.
    pub possible_probability: f64,
}

/// An estimate with its model, criterion and headway.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EstimateRow {
    /// Driver model.
    pub model: ModelId,
    /// Criterion.
    pub criterion: Criterion,
    /// Headway: `1.4s`, `sampled`, or `all` for the mean over the headways of the plan.
    pub headway: String,
    /// The probability that a sampled lane fails. If samples identify their scenarios, variance and interval include
    /// the uncertainty of the data.
    pub estimate: Estimate,
    /// Ends of the interval of the draws alone, given the density.
    pub draws: [f64; 2],
    /// Effective number of scenarios that the failures come from; `None` if samples do not identify their scenarios.
    pub failing_scenarios: Option<f64>,
    /// Failures per hour and per 1,000 km, if the exposure is known.
    pub risk: Risk,
    /// Sources of the uncertainty; `None` without failures, or if the interval covers the draws alone.
    pub uncertainty: Option<Uncertainty>,
    /// Ratios to the rate of the recorded scenarios; `None` if the density does not contain them.
    pub recorded: Option<RecordedRatios>,
    /// What draws without possible traffic are of it; `None` where every draw is possible.
    pub no_traffic: Option<NoTraffic>,
    /// The scenarios that carry most of P; none where samples do not identify them.
    pub carriers: Vec<CarrierRow>,
    /// P at the lower and at the upper end of the interval of the density's bandwidth; none if the density does not know it.
    pub at_bandwidths: [Option<AtBandwidth>; 2],
    /// What these say.
    pub bandwidth: Option<BandwidthVerdict>,
}

/// Ratios of failure rates to that of S, over the same scenarios, headways, model and criterion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RecordedRatios {
    /// S'/S: rates of the parameterized replays.
    pub replayed: Ratio,
    /// P/S: rates of the samples. Only for crude Monte Carlo, whose draws identify their scenario.
    pub sampled: Option<Ratio>,
}

/// A scenario that carries a part of P.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CarrierRow {
    /// Its id; `None` if the density does not hold it.
    pub scenario: Option<String>,
    /// Its kernel and fraction.
    #[serde(flatten)]
    pub of: Carrier,
}

impl EstimateRow {
    /// Whether the row is of importance sampling beside rows of crude Monte Carlo over all headways.
    pub fn is_rare_beside(&self, all: &[EstimateRow]) -> bool {
        self.estimate.weights.is_some() && !self.is_overall(all)
    }

    /// Whether the row is over all headways, if there are several.
    pub fn is_overall(&self, all: &[EstimateRow]) -> bool {
        self.headway == "all" || !all.iter().any(|row| row.headway == "all")
    }

    /// Whether it is told: P over all headways, and rare failures by importance sampling.
    pub fn is_told(&self, all: &[EstimateRow]) -> bool {
        self.is_overall(all) || self.is_rare_beside(all)
    }

    /// Whether P is below one in the kernels: it comes from the tails of the density's kernels, not from data.
    pub fn is_of_tails(&self, kernels: usize) -> bool {
        self.estimate.probability * (kernels as f64) < 1.0
    }

    /// How many times the lanes of crude Monte Carlo its weights cost for the same interval; `None` if they saved some.
    pub fn times_crude(&self) -> Option<f64> {
        let reduction = self.estimate.variance_reduction;
        (self.estimate.weights.is_some() && reduction < 1.0).then(|| 1.0 / reduction)
    }

    /// Why the run of these rows ended: the time limit tells more than the number of samples.
    pub fn stopped(all: &[EstimateRow]) -> StopReason {
        let stopped = all.iter().map(|row| row.estimate.stopped).max_by_key(|s| *s == StopReason::TimeLimit);
        stopped.unwrap_or(StopReason::Samples)
    }

    /// A row whose interval covers the draws alone.
    pub(crate) fn of_draws(
        model: ModelId,
        criterion: Criterion,
        headway: String,
        estimate: Estimate,
        exposure: Option<&Exposure>,
    ) -> EstimateRow {
        let draws = [estimate.interval.low, estimate.interval.high];
        let risk = Risk::of(&estimate, exposure);
        EstimateRow {
            model,
            criterion,
            headway,
            estimate,
            draws,
            failing_scenarios: None,
            risk,
            uncertainty: None,
            recorded: None,
            no_traffic: None,
            carriers: Vec::new(),
            at_bandwidths: [None; 2],
            bandwidth: None,
        }
    }

    /// Takes the estimate that includes the uncertainty of the data, the effective number of failing scenarios, and those
    /// that carry most.
    /// Without them the row gets a warning.
    pub(super) fn with_data(
        mut self,
        with: Option<(Estimate, f64, Vec<Carrier>)>,
        exposure: Option<&Exposure>,
    ) -> EstimateRow {
        let Some((estimate, failing_scenarios, carriers)) = with else {
            self.estimate.trust.warn_if(true, Warning::DataLeftOut);
            return self;
        };
        self.carriers = carriers.into_iter().map(|of| CarrierRow { scenario: None, of }).collect();
        let of_draws = self.estimate.variance;
        (self.estimate, self.failing_scenarios) = (estimate, Some(failing_scenarios));
        self.risk = Risk::of(&self.estimate, exposure);
        let square = self.estimate.probability.powi(2);
        let of_data = (self.estimate.variance - of_draws).max(0.0);
        let rate = exposure.and_then(|exposure| exposure.per_hour.or(exposure.per_kilometre));
        let of_rate = rate.map_or(0.0, |rate| (rate.standard_deviation / rate.estimate).powi(2));
        // The variance of ln X is about ln(1 + relative variance of X).
        self.uncertainty = Uncertainty::new([of_draws / square, of_data / square, of_rate].map(libm::log1p));
        self
    }

    /// Half the width of the draws' interval over the probability, which more samples reduce; ∞ at zero.
    pub(crate) fn draws_half_width(&self) -> f64 {
        let [low, high] = self.draws;
        Interval { low, high, ..self.estimate.interval }.relative_half_width(self.estimate.probability)
    }
}

/// All rows of crude Monte Carlo. Headways share their samples, so the mean over them treats samples as clusters.
pub(crate) fn crude_rows(
    sample: &Sample,
    plan: &LanePlan,
    tally: &SampleTally,
    stopped: StopReason,
) -> Vec<EstimateRow> {
    let (exposure, level) = (sample.exposure(), sample.options.level);
    let (headways, models, criteria) = (plan.headways.len(), plan.models.len(), Criterion::ALL.len());
    let runs = tally.valid();
    let kernels = plan.generator().map_or(0, |of| of.points.components() as usize);
    let mut rows = Vec::new();
    for (model, &id) in plan.models.iter().enumerate() {
        for criterion in Criterion::ALL {
            let cell = |headway: usize| cell_of(models, headway, model, criterion);
            let mut push = |headway: String, estimate: Estimate, cells: &[usize]| {
                let with = tally.by_kernel.as_ref().map(|counts| {
                    let (runs, failures) = counts.over(cells);
                    let of = cluster_rate(Clusters { runs: &runs, failures: &failures }, level);
                    // Kernels of large densities are counted in groups.
                    let is_each = failures.len() == kernels;
                    let carriers = Carrier::most(failures.iter().filter(|_| is_each).map(|of| *of as f64));
                    (estimate.clone().over_scenarios(&of), of.effective_failing, carriers)
                });
                let row = EstimateRow::of_draws(id, criterion, headway, estimate, exposure);
                rows.push(row.with_data(with, exposure));
            };
            if headways > 1 {
                let sum = (0..headways).map(|headway| tally.failures[cell(headway)]).sum();
                let squares = tally.squares[model * criteria + criterion.index()];
                let mut all = from_clusters(runs, headways as u64, sum, squares, level, stopped);
                all.voids = tally.voids;
                push("all".to_owned(), all, &(0..headways).map(cell).collect::<Vec<_>>());
            }
            for headway in 0..headways {
                let failures = tally.failures[cell(headway)];
                let counts = Counts { runs, failures, voids: tally.voids };
                let estimate = from_counts(&counts, level, stopped);
                push(sample.options.headway_name(headway), estimate, &[cell(headway)]);
            }
        }
    }
    rows
}

/// Failures per unit of exposure.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RiskRate {
    /// λ̂·P̂.
    pub estimate: f64,
    /// Standard deviation of the product, √(λ²σ_P² + P²σ_λ² + σ_λ²σ_P²), because λ̂ and P̂ come from independent
    /// counts.
    pub standard_deviation: f64,
    /// Lower end of the interval at the estimate's level; 0 without failures. It combines the interval of P and a
    /// log-normal interval of λ: their distances from the estimate on the log scale add as squares (Zou and Donner,
    /// Statistics in Medicine 27, 2008).
    pub low: f64,
    /// Upper end; without failures the product of the upper ends of both intervals.
    pub high: f64,
}

/// Risk in both units; `None` if unknown.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Risk {
    /// Failures per hour driven.
    pub per_hour: Option<RiskRate>,
    /// Failures per 1,000 km driven.
    pub per_1000_km: Option<RiskRate>,
}

impl RiskRate {
    /// The product of a rate, times `scale`, and an estimate.
    fn of(rate: &Rate, scale: f64, estimate: &Estimate) -> RiskRate {
        let (events, deviation) = (rate.estimate * scale, rate.standard_deviation * scale);
        let (p, variance) = (estimate.probability, estimate.variance);
        let spread = events * events * variance + p * p * deviation * deviation + deviation * deviation * variance;
        let product = events * p;
        let standard_deviation = spread.sqrt();
        if product <= 0.0 {
            let high = rate.high * scale * estimate.interval.high;
            return RiskRate { estimate: product, standard_deviation, low: 0.0, high };
        }
        let z = normal_quantile(0.5 + 0.5 * estimate.interval.level);
        let of_events = z * libm::sqrt(libm::log1p((deviation / events).powi(2)));
        let factor = |of_p: f64| libm::exp(libm::hypot(libm::log(of_p), of_events));
        let (low, high) = (product / factor(p / estimate.interval.low), product * factor(estimate.interval.high / p));
        RiskRate { estimate: product, standard_deviation, low, high }
    }
}

impl Risk {
    /// Risk of an estimate under an exposure.
    pub(crate) fn of(estimate: &Estimate, exposure: Option<&Exposure>) -> Risk {
        let product = |rate: Option<&Rate>, scale: f64| rate.map(|rate| RiskRate::of(rate, scale, estimate));
        Risk {
            per_hour: product(exposure.and_then(|e| e.per_hour.as_ref()), 1.0),
            per_1000_km: product(exposure.and_then(|e| e.per_kilometre.as_ref()), 1000.0),
        }
    }
}
