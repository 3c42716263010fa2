//! Risk: how often failures happen, λ̂·P̂ per hour and per 1,000 km.

use serde::Serialize;

use crate::density::{Exposure, Rate};
use crate::estimate::Estimate;

/// Failures per unit of exposure with the standard deviation of the product,
/// √(λ²σ_P² + P²σ_λ² + σ_λ²σ_P²): λ̂ and P̂ come from independent counts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RiskRate {
    /// λ̂·P̂.
    pub estimate: f64,
    /// Its standard deviation.
    pub standard_deviation: f64,
}

/// Risk in both units, where they are known.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Risk {
    /// Failures per hour driven.
    pub per_hour: Option<RiskRate>,
    /// Failures per 1,000 km driven.
    pub per_1000_km: Option<RiskRate>,
}

impl Risk {
    /// Of an estimate under an exposure.
    pub fn of(estimate: &Estimate, exposure: Option<&Exposure>) -> Risk {
        let product = |rate: &Rate, scale: f64| {
            let (rate_, deviation) = (rate.estimate * scale, rate.standard_deviation * scale);
            let (p, variance) = (estimate.probability, estimate.variance);
            let spread = rate_ * rate_ * variance + p * p * deviation * deviation + deviation * deviation * variance;
            RiskRate { estimate: rate_ * p, standard_deviation: spread.sqrt() }
        };
        Risk {
            per_hour: exposure.and_then(|e| e.per_hour.as_ref()).map(|rate| product(rate, 1.0)),
            per_1000_km: exposure.and_then(|e| e.per_kilometre.as_ref()).map(|rate| product(rate, 1000.0)),
        }
    }
}
