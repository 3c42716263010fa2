//! The accuracy of importance sampling with a proposal that a search finds.

use serde::{Deserialize, Serialize};

use super::importance::Importance;
use super::search::Found;
use crate::density::normal_quantile;

/// Factor on the number of draws that a search predicts, because it knows the variance only roughly.
const RESERVE: f64 = 1.2;
/// Minimum number of final draws: fewer save nothing after a search.
const MIN_DRAWS: u64 = 4000;
/// Fraction of the half-width that the draws of the proposal may take; the rest is for what they may have missed.
const OF_PROPOSAL: f64 = 0.8;
/// Draws of the density for a question of which no failure was found.
const CRUDE_WITHOUT_FAILURE: f64 = (1 << 21) as f64;

/// The accuracy that is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Goal {
    /// Half the interval's width over the probability.
    pub half_width: f64,
    /// Maximum number of final draws of the proposal.
    pub max_draws: u64,
    /// Maximum number of final draws of the density; with 0 nothing bounds what the search missed.
    pub max_crude: u64,
}

impl Goal {
    /// Half-width if none is asked for.
    pub const HALF_WIDTH: f64 = 0.1;

    /// Failures that the final draws of the density are expected to hold: one failure more or less moves the end of the
    /// interval by a third of the half-width, and those that may be missed are less than half of P.
    pub fn crude_failures(half_width: f64) -> f64 {
        (3.0 / half_width).max(8.0)
    }

    /// The final draws after a search, for all questions together: the worst one decides.
    pub fn draws(&self, found: &[Found], seed: u64, level: f64) -> Importance {
        let z = normal_quantile(0.5 + 0.5 * level);
        let of = |found: &Found| found.relative_variance.unwrap_or(0.0) * (z / (OF_PROPOSAL * self.half_width)).powi(2);
        let most = found.iter().map(of).fold(0.0, f64::max);
        let draws = ((RESERVE * most).ceil() as u64).max(MIN_DRAWS).min(self.max_draws);
        let crude = |found: &Found| match found.probability > 0.0 {
            true => Goal::crude_failures(self.half_width) / found.probability,
            false => CRUDE_WITHOUT_FAILURE,
        };
        let crude = found.iter().map(crude).fold(0.0, f64::max).min(self.max_crude as f64);
        let least = u64::from(self.max_crude > 0);
        Importance { seed, draws, crude_per_draw: ((crude / draws as f64).ceil() as u64).max(least) }
    }
}
