//! P_valid: the fraction of a density inside the valid region, by counting draws. The truncated density is f/P_valid.

use std::collections::BTreeMap;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::kde::Kde;
use super::normal::normal_quantile;
use super::parameters::{Invalid, ParameterSpace};
use lanesweep_random::Stream;
use lanesweep_support::{Error, Place, Result};

/// [`Stream::purpose`] of these draws.
const VALID_FRACTION_PURPOSE: u32 = 0x7661_6c64;

/// Default number of draws: the standard error is at most 0.0016.
pub(super) const VALID_FRACTION_DRAWS: u64 = 100_000;

/// Number of draws that violate one bound first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Refused {
    /// The parameter, or the value that depends on several, whose bound they violate first.
    pub parameter: String,
    /// The violated condition.
    pub bound: String,
    /// How many draws.
    pub draws: u64,
}

/// P̂_valid with its 95 % interval.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ValidFraction {
    /// Valid draws over draws.
    pub estimate: f64,
    /// Lower end of the Wilson interval of 95 %.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Draws.
    pub draws: u64,
    /// Number of valid draws.
    pub valid: u64,
    /// The other draws by the bound that they violate first, most frequent first.
    pub refused: Vec<Refused>,
    /// Seed of the draws.
    pub seed: u64,
}

impl ValidFraction {
    /// Counts the valid ones among draws of a density. The count does not depend on the number of threads.
    ///
    /// # Errors
    /// [`Error::Input`] if no draw is valid; [`Error::Usage`] for 0 draws.
    pub fn count(kde: &Kde, space: &ParameterSpace, draws: u64, seed: u64) -> Result<ValidFraction> {
        if draws == 0 {
            return Err(Error::usage(Place::item("draws"), "0 draws count nothing", "give at least 1, like 100000"));
        }
        let stream = Stream { seed, purpose: VALID_FRACTION_PURPOSE };
        let broken = |index: u64| space.check_draw(&kde.draw(&stream, index)).err();
        // A bound that depends on the draw (v1 < v0) is reported by its parameter only.
        let by =
            |invalid: Invalid| (invalid.parameter, invalid.bound.split(" = ").next().unwrap_or_default().to_owned());
        // Counted in each thread, because most of 10⁹ draws may be invalid.
        let add = |mut counts: BTreeMap<(String, String), u64>, (by, draws): ((String, String), u64)| {
            *counts.entry(by).or_default() += draws;
            counts
        };
        let counts = (0..draws).into_par_iter().filter_map(broken).map(|invalid| (by(invalid), 1));
        let counts = counts.fold(BTreeMap::new, add).reduce(BTreeMap::new, |a, b| b.into_iter().fold(a, add));
        let valid = draws - counts.values().sum::<u64>();
        if valid == 0 {
            return Err(Error::input(
                Place::item("density"),
                format!("none of {draws} draws is a valid scenario"),
                "look at the scenarios: nearly all of the density lies outside of the bounds",
            ));
        }
        let [low, high] = wilson(valid, draws);
        let refused = counts.into_iter().map(|((parameter, bound), draws)| Refused { parameter, bound, draws });
        let mut refused: Vec<Refused> = refused.collect();
        // The sort is stable: equal counts stay in the order of their names.
        refused.sort_by_key(|refused| std::cmp::Reverse(refused.draws));
        Ok(ValidFraction { estimate: valid as f64 / draws as f64, low, high, draws, valid, refused, seed })
    }
}

/// 95 % Wilson interval of a fraction.
fn wilson(hits: u64, n: u64) -> [f64; 2] {
    let z = normal_quantile(0.975);
    let (n, p) = (n as f64, hits as f64 / n as f64);
    let middle = (p + z * z / (2.0 * n)) / (1.0 + z * z / n);
    let half = z / (1.0 + z * z / n) * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
    [(middle - half).max(0.0), (middle + half).min(1.0)]
}
