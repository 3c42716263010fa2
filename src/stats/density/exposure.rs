//! How often scenarios occur: events per driven hour and kilometre, with the Poisson interval.
//!
//! Driven are the egos' data sets: every vehicle is an ego once, from its first sample to the end of its data
//! set. Events are the kept scenarios of the category.

use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Gamma};

use crate::traffic::Driven;

/// λ̂ = events per unit, with intervals of 95 %.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rate {
    /// Events per unit.
    pub estimate: f64,
    /// √n per unit: the standard deviation of a Poisson count, as published.
    pub standard_deviation: f64,
    /// Lower end of the exact (Garwood) interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Exposure to scenarios of one category.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Exposure {
    /// Scenarios of the category that the filters kept.
    pub events: u64,
    /// Time and distance driven.
    pub driven: Driven,
    /// Per hour, where the hours are known.
    pub per_hour: Option<Rate>,
    /// Per kilometre, where the kilometres are known.
    pub per_kilometre: Option<Rate>,
}

impl Exposure {
    /// From a count and what was driven.
    pub fn new(events: u64, driven: Driven) -> Exposure {
        let rate = |units: Option<f64>| units.map(|units| Rate::new(events, units));
        Exposure { events, driven, per_hour: rate(driven.hours), per_kilometre: rate(driven.kilometres) }
    }
}

impl Rate {
    /// `events` in `units` hours or kilometres, > 0.
    pub fn new(events: u64, units: f64) -> Rate {
        let [low, high] = garwood(events, 0.95);
        let n = events as f64;
        Rate { estimate: n / units, standard_deviation: n.sqrt() / units, low: low / units, high: high / units }
    }
}

/// Exact interval of a Poisson mean from one count (Garwood 1936): α/2 and 1 − α/2 quantiles of gamma
/// distributions with shapes n and n + 1.
pub fn garwood(events: u64, level: f64) -> [f64; 2] {
    let tail = 0.5 * (1.0 - level);
    let quantile = |shape: f64, p: f64| match Gamma::new(shape, 1.0) {
        Ok(gamma) => gamma.inverse_cdf(p),
        Err(_) => f64::NAN,
    };
    let n = events as f64;
    [if events == 0 { 0.0 } else { quantile(n, tail) }, quantile(n + 1.0, 1.0 - tail)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exact_interval_is_that_of_the_tables() {
        // Half of the quantiles of chi-square distributions with 2n and 2n + 2 degrees of freedom.
        for (n, low, high) in [
            (0, 0.0, 3.688_879_454_113_936),
            (1, 0.025_317_807_984_289_876, 5.571_643_390_938_898),
            (10, 4.795_388_696_132_433_5, 18.390_356_042_017_78),
            (100, 81.363_991_250_923_14, 121.626_793_792_426_38),
            (1_000_000, 998_040.983_340_293_9, 1_001_961.911_945_432_2),
        ] {
            let [a, b] = garwood(n, 0.95);
            assert!((a - low).abs() <= 1e-9 * low && (b - high).abs() <= 1e-9 * high, "{n}: {a} {b}");
        }
    }
}
