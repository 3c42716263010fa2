//! The threshold set: lanes whose first step is exactly on a threshold of a model, a gate, a criterion or an end
//! rule, and neighbours one unit in the last place to each side. It detects contracted products, reordered sums, and
//! `<` instead of `≤`.

use std::sync::Arc;

use super::SetOptions;
use super::decision::{HEADWAYS, Threshold};
use super::first_step::ThresholdCases;
use crate::{Block, LanePlan};
use lanesweep_model::profile::Profile;
use lanesweep_model::scenario::Category;
use lanesweep_support::Result;

/// Variants of every unit: on the threshold (`S`), and the deciding quantity one ULP smaller and larger. Around 0 the
/// neighbours are ±2⁻³², which no device flushes; steps and times change by one step.
pub const SIDES: [&str; 3] = ["S", "below", "above"];

/// Plans the threshold set of a seed. Keys are `threshold-rss-lateral-cut-in-seed157-000012`; the number is that of
/// the unit in its category, for any size.
///
/// # Errors
/// [`Error::Usage`](lanesweep_support::Error::Usage) without a size, categories or models, or if a category is named twice.
pub fn threshold_plan(profile: &Profile, options: &SetOptions) -> Result<LanePlan> {
    options.check()?;
    let units = options.size * Threshold::ALL.len() as u64;
    let key = |category: Category, unit: u64| {
        let (threshold, category) = (Threshold::of_unit(unit).name(), category.key().replace('_', "-"));
        format!("threshold-{threshold}-{category}-seed{}-{unit:06}", options.seed)
    };
    let names = |category| (0..units).map(|unit| key(category, unit)).collect();
    let block = |&category: &Category| Block::new(category, names(category), SIDES.map(str::to_owned).to_vec());
    let blocks = options.categories.iter().map(block).collect();
    let source = ThresholdCases::new(profile, options.seed, &options.categories);
    LanePlan::new(profile.clone(), options.models.clone(), HEADWAYS.to_vec(), blocks, Arc::new(source))
}
