//! The sources of an estimate's uncertainty, and what would reduce it.

use serde::Serialize;

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
    /// Factor on the recorded hours that halves the interval; `None` if the other parts alone keep it wider.
    pub hours_factor: Option<f64>,
    /// Factor on the samples that halves the interval; `None` if the other parts alone keep it wider.
    pub samples_factor: Option<f64>,
}

impl Uncertainty {
    /// From the variances of ln of the risk, part by part. `None` if their sum is 0 or not finite.
    pub(super) fn new([draws, scenarios, exposure]: [f64; 3]) -> Option<Uncertainty> {
        let sum = draws + scenarios + exposure;
        let is_known = sum.is_finite() && sum > 0.0;
        // Half the width is a quarter of the variance.
        let factor = |reduced: f64| Some(reduced / (0.25 * sum - (sum - reduced))).filter(|factor| *factor > 0.0);
        is_known.then(|| Uncertainty {
            deviation: sum.sqrt(),
            draws: draws / sum,
            scenarios: scenarios / sum,
            exposure: exposure / sum,
            hours_factor: factor(scenarios + exposure),
            samples_factor: factor(draws),
        })
    }
}
