//! Verification: lanes for which a backend must give the same words as the CPU, and the comparison.
//!
//! This room has the comparison of a backend with the CPU and the f64 reference ([`compare`]), a random set of cases with
//! plausible numbers ([`random_plan`]), and a set on the decision thresholds ([`threshold_plan`]), where one unit in the
//! last place decides. Cases are pure functions of (seed, category, unit, variant), so the key of a lane is sufficient to
//! repeat it. Plans go to [`crate::engine`].

mod comparison;
mod decision;
mod draw;
mod first_step;
mod pool;
mod random;
mod series;
mod solve;
mod thresholds;

pub use comparison::{Comparison, DifferingLane, GroupComparison, SelfCheck, WORDS, compare, self_check};
pub use decision::Threshold;
pub use random::{RandomOptions, RandomUnit, VARIANTS, random_plan};
pub use thresholds::{SIDES, ThresholdOptions, threshold_plan};

use crate::scenario::Category;
use crate::support::ranges::refuse_repeats;
use crate::{Error, Place, Result};

/// Refuses an empty list of categories and one that names a category twice: keys would stand for two lanes.
fn check_categories(categories: &[Category]) -> Result<()> {
    let place = || Place::item("categories");
    if categories.is_empty() {
        return Err(Error::usage(place(), "the set has no category", "name at least one of cut_in, cut_out, lvd"));
    }
    refuse_repeats(place, categories.iter().map(|category| (*category, category.label())))
}
