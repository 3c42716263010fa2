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
use crate::{Error, Place, Result};

/// Refuses an empty list of categories and one that names a category twice: keys would stand for two lanes.
fn check_categories(categories: &[Category]) -> Result<()> {
    let twice = categories.iter().enumerate().find(|(k, c)| categories[..*k].contains(c));
    let problem = match (categories.is_empty(), twice) {
        (true, _) => "the set has no category".to_owned(),
        (false, Some((_, category))) => format!("{} is named twice", category.label()),
        (false, None) => return Ok(()),
    };
    Err(Error::usage(Place::item("categories"), problem, "name each of cut_in, cut_out, lvd at most once"))
}
