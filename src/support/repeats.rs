//! Lists that a user gives hold every value once: a repeated headway or model would count its failures twice, and two
//! lanes would have one key.

use std::collections::HashMap;
use std::fmt::Display;
use std::hash::Hash;

use super::error::{Error, Place, Result};

/// The first value that repeats an earlier one, in words. The list has pairs of what a value means and how it was
/// written: `0.60` repeats `0.6`.
pub(crate) fn repeated<K: Eq + Hash, S: Display>(list: impl IntoIterator<Item = (K, S)>) -> Option<String> {
    let mut known: HashMap<K, S> = HashMap::new();
    for (meaning, written) in list {
        if let Some(before) = known.get(&meaning) {
            let (before, written) = (before.to_string(), written.to_string());
            return Some(match before == written {
                true => format!("`{written}` is given twice"),
                false => format!("`{written}` repeats `{before}`"),
            });
        }
        known.insert(meaning, written);
    }
    None
}

/// Checks that no value of a list repeats an earlier one.
///
/// # Errors
/// [`Error::Usage`] at `place`, as [`repeated`] says it.
pub(crate) fn refuse_repeats<K: Eq + Hash, S: Display>(
    place: impl FnOnce() -> Place,
    list: impl IntoIterator<Item = (K, S)>,
) -> Result<()> {
    let refused = |problem| Error::usage(place(), problem, GIVE_ONCE);
    repeated(list).map_or(Ok(()), |problem| Err(refused(problem)))
}

/// What to do about a repeated value.
pub(crate) const GIVE_ONCE: &str = "give every value once";
