//! The sources of an estimate's uncertainty, and what would reduce it.

use serde::Serialize;

use super::compare::{CategoryComparison, RateRecord};
use super::rows::EstimateRow;
use crate::stats::density::{Exposure, normal_quantile};

/// Parts of the variance of ln of the risk λ̂·P̂ (of ln P̂ where the exposure is not known). Bandwidth, scale and basis of
/// the density are in none of them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Uncertainty {
    /// Standard deviation of ln of the risk.
    pub deviation: f64,
    /// Fraction of its variance caused by the draws: more samples reduce it.
    pub draws: f64,
    /// Fraction caused by the recorded scenarios that the density is over: more recordings reduce it.
    pub scenarios: f64,
    /// Fraction caused by the frequency of scenarios: more recordings reduce it.
    pub exposure: f64,
    /// Fraction caused by the form of the density, from the spread over several; `None` if only one was sampled.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub form: Option<f64>,
    /// Fraction caused by the parameterization, from the spread over several; `None` if only one was sampled.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parameterization: Option<f64>,
    /// Factor on the recorded hours that halves the interval; `None` if the other parts alone keep it wider.
    pub hours_factor: Option<f64>,
    /// Factor on the samples that halves the interval; `None` if the other parts alone keep it wider.
    pub samples_factor: Option<f64>,
}

impl Uncertainty {
    /// From the variances of ln of the risk, part by part. `None` if their sum is 0 or not finite.
    fn new(
        [draws, scenarios, exposure]: [f64; 3],
        form: Option<f64>,
        parameterization: Option<f64>,
    ) -> Option<Uncertainty> {
        let choices = form.unwrap_or(0.0) + parameterization.unwrap_or(0.0);
        let sum = draws + scenarios + exposure + choices;
        let is_known = sum.is_finite() && sum > 0.0;
        // Half the width is a quarter of the variance.
        let factor = |reduced: f64| Some(reduced / (0.25 * sum - (sum - reduced))).filter(|factor| *factor > 0.0);
        is_known.then(|| Uncertainty {
            deviation: sum.sqrt(),
            draws: draws / sum,
            scenarios: scenarios / sum,
            exposure: exposure / sum,
            form: form.map(|form| form / sum),
            parameterization: parameterization.map(|of| of / sum),
            hours_factor: factor(scenarios + exposure),
            samples_factor: factor(draws),
        })
    }

    /// The uncertainty of the risk of a category under any of its parameterizations and forms: model × criterion. `None`
    /// where no density has a failure. A rate without failures counts as its upper bound, so what it differs by is a
    /// minimum.
    pub(crate) fn of_category(category: &CategoryComparison, level: f64) -> Vec<Option<Uncertainty>> {
        let z = normal_quantile(0.5 + 0.5 * level);
        let variance = |low: f64, high: f64| (libm::log(high / low) / (2.0 * z)).powi(2);
        let of_rate = |rate: &RateRecord| if rate.failures > 0 { variance(rate.low, rate.high) } else { 0.0 };
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        // Variance of ln rate over the choices, less that of the draws; `None` for a single choice.
        let between = |rates: &[&RateRecord]| {
            let log = |rate: &&RateRecord| libm::log(if rate.failures > 0 { rate.rate } else { rate.high });
            let logs: Vec<f64> = rates.iter().map(log).collect();
            let of_draws: Vec<f64> = rates.iter().map(|rate| of_rate(rate)).collect();
            let middle = mean(&logs);
            let squares: f64 = logs.iter().map(|log| (log - middle).powi(2)).sum();
            (logs.len() > 1).then(|| (squares / (logs.len() - 1) as f64 - mean(&of_draws)).max(0.0))
        };
        let all = &category.parameterizations;
        let cell = |at: usize| {
            let sampled = all.iter().map(|of| &of.cells[at].sampled);
            let failing: Vec<_> = sampled.clone().filter(|of| of.rate.failures > 0).collect();
            if failing.is_empty() {
                return None;
            }
            let of_draws: Vec<f64> = failing.iter().map(|of| of_rate(&of.rate)).collect();
            let with_data: Vec<f64> = failing.iter().map(|of| variance(of.with_data[0], of.with_data[1])).collect();
            let forms = all.iter().filter(|of| !of.forms.is_empty()).filter_map(|of| {
                let others = of.forms.iter().map(|form| &form.rates[at]);
                between(&std::iter::once(&of.cells[at].sampled.rate).chain(others).collect::<Vec<_>>())
            });
            let forms: Vec<f64> = forms.collect();
            let exposure = category.exposure.map_or(0.0, |of| 1.0 / of.events.max(1) as f64);
            let draws = mean(&of_draws);
            let parts = [draws, (mean(&with_data) - draws).max(0.0), exposure];
            let rates: Vec<&RateRecord> = sampled.map(|of| &of.rate).collect();
            Uncertainty::new(parts, (!forms.is_empty()).then(|| mean(&forms)), between(&rates))
        };
        (0..category.recorded.len()).map(cell).collect()
    }
}

impl EstimateRow {
    /// The sources of the uncertainty, once the row includes that of the data. `of_draws` is the variance of the draws.
    pub(super) fn with_sources(mut self, of_draws: f64, exposure: Option<&Exposure>) -> EstimateRow {
        let square = self.estimate.probability.powi(2);
        let of_data = (self.estimate.variance - of_draws).max(0.0);
        let rate = exposure.and_then(|exposure| exposure.per_hour.or(exposure.per_kilometre));
        let of_rate = rate.map_or(0.0, |rate| (rate.standard_deviation / rate.estimate).powi(2));
        // The variance of ln X is about ln(1 + relative variance of X).
        let parts = [of_draws / square, of_data / square, of_rate].map(libm::log1p);
        self.uncertainty = Uncertainty::new(parts, None, None);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_sum_to_one_and_the_factors_halve_the_width() {
        let of = Uncertainty::new([0.0001, 0.02, 0.003], None, None).unwrap();
        assert!((of.draws + of.scenarios + of.exposure - 1.0).abs() < 1e-12);
        let factor = of.hours_factor.unwrap();
        let after = of.draws + (of.scenarios + of.exposure) / factor;
        assert!((after - 0.25).abs() < 1e-12, "{after}");
        assert_eq!(of.samples_factor, None, "the recordings alone are wider");
        let of = Uncertainty::new([0.02, 0.0001, 0.0], None, None).unwrap();
        assert!((of.draws / of.samples_factor.unwrap() + of.scenarios - 0.25).abs() < 1e-12);
        assert_eq!(Uncertainty::new([f64::NAN, 0.0, 0.0], None, None), None);
        assert_eq!(Uncertainty::new([0.0; 3], None, None), None);
    }

    #[test]
    fn choices_that_data_cannot_settle_are_parts_too() {
        let of = Uncertainty::new([0.01, 0.05, 0.01], Some(0.02), Some(0.11)).unwrap();
        let choices = of.form.unwrap() + of.parameterization.unwrap();
        assert!((choices - 0.65).abs() < 1e-12 && (of.deviation - 0.2_f64.sqrt()).abs() < 1e-12);
        assert_eq!((of.hours_factor, of.samples_factor), (None, None), "neither halves the interval");
    }
}
