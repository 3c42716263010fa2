//! The sources of an estimate's uncertainty, and what would reduce it.

use serde::Serialize;

use super::rows::EstimateRow;
use crate::stats::density::Exposure;

/// Parts of the variance of ln of the risk λ̂·P̂ (of ln P̂ where the exposure is not known). Bandwidth, scale and basis of
/// the density, and the parameterization, are in none of them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Uncertainty {
    /// Fraction caused by the draws: more samples reduce it.
    pub draws: f64,
    /// Fraction caused by the recorded scenarios that the density is over: more recordings reduce it.
    pub scenarios: f64,
    /// Fraction caused by the frequency of scenarios: more recordings reduce it.
    pub exposure: f64,
    /// Factor on the recorded hours that halves the interval; `None` if the draws alone keep it wider.
    pub hours_factor: Option<f64>,
    /// Factor on the samples that halves the interval; `None` if the recordings alone keep it wider.
    pub samples_factor: Option<f64>,
}

impl Uncertainty {
    /// From relative variances: of the draws, over other scenarios, of the exposure. `None` if their sum is 0 or not
    /// finite.
    pub(super) fn new(draws: f64, scenarios: f64, exposure: f64) -> Option<Uncertainty> {
        let [draws, scenarios, exposure] = [draws, scenarios, exposure].map(libm::log1p);
        let sum = draws + scenarios + exposure;
        let is_known = sum.is_finite() && sum > 0.0;
        // Half the width is a quarter of the variance.
        let factor = |reduced: f64, kept: f64| Some(reduced / (0.25 * sum - kept)).filter(|factor| *factor > 0.0);
        is_known.then(|| Uncertainty {
            draws: draws / sum,
            scenarios: scenarios / sum,
            exposure: exposure / sum,
            hours_factor: factor(scenarios + exposure, draws),
            samples_factor: factor(draws, scenarios + exposure),
        })
    }
}

impl EstimateRow {
    /// The sources of the uncertainty, once the row includes that of the data. `of_draws` is the variance of the draws.
    pub(super) fn with_sources(mut self, of_draws: f64, exposure: Option<&Exposure>) -> EstimateRow {
        let square = self.estimate.probability.powi(2);
        let of_data = (self.estimate.variance - of_draws).max(0.0);
        let rate = exposure.and_then(|exposure| exposure.per_hour.or(exposure.per_kilometre));
        let of_rate = rate.map_or(0.0, |rate| (rate.standard_deviation / rate.estimate).powi(2));
        self.uncertainty = Uncertainty::new(of_draws / square, of_data / square, of_rate);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_sum_to_one_and_the_factors_halve_the_width() {
        let of = Uncertainty::new(0.0001, 0.02, 0.003).unwrap();
        assert!((of.draws + of.scenarios + of.exposure - 1.0).abs() < 1e-12);
        let factor = of.hours_factor.unwrap();
        let after = of.draws + (of.scenarios + of.exposure) / factor;
        assert!((after - 0.25).abs() < 1e-12, "{after}");
        assert_eq!(of.samples_factor, None, "the recordings alone are wider");
        let of = Uncertainty::new(0.02, 0.0001, 0.0).unwrap();
        assert!((of.draws / of.samples_factor.unwrap() + of.scenarios - 0.25).abs() < 1e-12);
        assert_eq!(Uncertainty::new(f64::NAN, 0.0, 0.0), None);
        assert_eq!(Uncertainty::new(0.0, 0.0, 0.0), None);
    }
}
