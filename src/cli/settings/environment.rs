//! The environment's variables: `LANESWEEP_` and a key's name in capitals.

use std::ffi::{OsStr, OsString};

use super::keys::{Key, nearest};
use crate::{Error, Place, Result};

/// Names the configuration file, where `--config` names none.
pub const FILE_VARIABLE: &str = "LANESWEEP_CONFIG";

/// Variables of the program's own tests; the program does not read them.
pub const TEST_VARIABLES: [&str; 9] = [
    "LANESWEEP_DLR_HT",
    "LANESWEEP_KILLS",
    "LANESWEEP_MUTATED_FIRST",
    "LANESWEEP_MUTATED_INPUTS",
    "LANESWEEP_RENEW_FIGURES",
    "LANESWEEP_REQUIRE_DEVICE",
    "LANESWEEP_SHARED",
    "LANESWEEP_SLURM_TEST",
    "LANESWEEP_TEST_RESUMABLE_RUN",
];

const PREFIX: &str = "LANESWEEP_";

/// The variable of a key: `LANESWEEP_MINING_CUT_IN_MAX_THW_S` of `mining.cut_in.max_thw_s`.
pub fn variable_of(key: &str) -> String {
    format!("{PREFIX}{}", key.replace('.', "_").to_ascii_uppercase())
}

/// The variables that set keys: key, name, word. An empty variable is one that is not set.
///
/// # Errors
/// [`Error::Usage`] for a variable of the program's that it does not know, with the nearest one.
pub(super) fn read<'k>(variables: &[(OsString, OsString)], keys: &'k [Key]) -> Result<Vec<(&'k Key, String, String)>> {
    let known: Vec<(String, &Key)> = keys.iter().map(|key| (variable_of(&key.name), key)).collect();
    let mut found = Vec::new();
    for (name, word) in variables {
        let Some(name) = name.to_str().filter(|name| name.starts_with(PREFIX)) else { continue };
        if name == FILE_VARIABLE || TEST_VARIABLES.contains(&name) || word.is_empty() {
            continue;
        }
        let place = || Place::item(format!("environment variable {name}"));
        let Some(key) = known.iter().find(|(variable, _)| variable == name).map(|(_, key)| *key) else {
            let names = known.iter().map(|(variable, _)| variable.as_str()).chain([FILE_VARIABLE]);
            let help = nearest(name, names).map_or(String::new(), |near| format!("did you mean {near}? "));
            let help = format!("{help}Variables are LANESWEEP_ and a key of `lanesweep config show` in capitals");
            return Err(Error::usage(place(), "there is no such variable", help));
        };
        let Some(word) = word.to_str() else {
            return Err(Error::usage(place(), "it is not UTF-8 text", format!("expected {}", key.expected())));
        };
        found.push((key, name.to_owned(), word.to_owned()));
    }
    found.sort_by(|a, b| a.1.cmp(&b.1));
    Ok(found)
}

/// The file that the environment names.
pub(super) fn file(value: Option<&OsStr>) -> Option<std::path::PathBuf> {
    value.filter(|path| !path.is_empty()).map(Into::into)
}
