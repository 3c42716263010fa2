//! Risk: how often failures happen, λ̂·P̂ per hour and per 1,000 km.

use serde::Serialize;

use crate::stats::density::{Exposure, Rate, normal_quantile};
use crate::stats::estimate::Estimate;

/// Failures per unit of exposure.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RiskRate {
    /// λ̂·P̂.
    pub estimate: f64,
    /// Standard deviation of the product, √(λ²σ_P² + P²σ_λ² + σ_λ²σ_P²): λ̂ and P̂ come from independent counts.
    pub standard_deviation: f64,
    /// Lower end of the interval at the estimate's level: that of P and a log-normal one of λ, whose distances from the
    /// estimate add as squares on the logarithm (Zou and Donner, Statistics in Medicine 27, 2008); 0 without failures.
    pub low: f64,
    /// Upper end; without failures the upper ends of both intervals multiplied.
    pub high: f64,
}

/// Risk in both units, where they are known.
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
    /// Of an estimate under an exposure.
    pub fn of(estimate: &Estimate, exposure: Option<&Exposure>) -> Risk {
        let product = |rate: Option<&Rate>, scale: f64| rate.map(|rate| RiskRate::of(rate, scale, estimate));
        Risk {
            per_hour: product(exposure.and_then(|e| e.per_hour.as_ref()), 1.0),
            per_1000_km: product(exposure.and_then(|e| e.per_kilometre.as_ref()), 1000.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::estimate::{BinomialInterval, Counts, StopReason, from_counts};
    use crate::traffic::Driven;

    #[test]
    fn risk_without_failures_is_bounded_and_not_zero() {
        let exposure = Exposure::new(100, Driven { hours: Some(50.0), kilometres: Some(5000.0) });
        let counts = |failures| Counts { runs: 10_000, failures, voids: 0, tries: 10_000 };
        let of = |failures| {
            let estimate = from_counts(&counts(failures), BinomialInterval::Wilson, 0.95, StopReason::Samples);
            Risk::of(&estimate, Some(&exposure)).per_hour.unwrap()
        };
        let none = of(0);
        assert!(none.estimate == 0.0 && none.high > 2.0 * 2.9e-4 && none.high < 3.0 * 3.0e-4);
        let some = of(100);
        // 10 % from the events, 10 % from the failures.
        assert!((some.estimate - 0.02).abs() < 1e-12);
        assert!((some.standard_deviation / some.estimate - 0.141).abs() < 2e-3);
        assert!(some.low < some.estimate && some.high > some.estimate);
    }
}
