//! The tables of the JRC's simulator that ship with the program: a build checks itself.

use std::path::Path;

use super::{Table, Tally, compare_functions, compare_jrc};
use crate::Result;
use crate::model::profile::Profile;
use crate::scenario::Category;

/// Compares this build with the tables that were made for this category under this profile: those of leader decelerations
/// and of model functions under `jrc-2021`. There are no others.
///
/// # Errors
/// None for tables that fit: they are part of the program.
pub fn check_shipped_tables(category: Category, profile: &Profile) -> Result<Vec<Tally>> {
    let table = |name: &str, text| Table::parse(text, Path::new(name));
    let jrc = Profile::load("jrc-2021")?;
    let mut all = Vec::new();
    if *profile != jrc {
        return Ok(all);
    }
    if category == Category::Lvd {
        all.extend(compare_jrc(&table("lvd.csv", include_str!("../../../tests/golden/lvd.csv"))?, &jrc)?);
    }
    all.extend(compare_functions(&table("functions.csv", include_str!("../../../tests/golden/functions.csv"))?, &jrc)?);
    Ok(all)
}
