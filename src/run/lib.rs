//! Runs: what is planned, computed in parts, merged and scored.
//!
//! [`study`] compares parameterizations with recordings, [`sampling`] estimates probabilities. [`grid`] sweeps maps, [`cases`] tables of concrete cases, [`check`] evaluates single ones.
//! [`reopen`] reruns single lanes of a finished run. [`parts`] splits and journals runs.
//! [`score`] computes recall, precision and F1 from a study's counts.

pub mod cases;
pub mod check;
pub mod explorer;
pub mod grid;
pub mod parts;
pub mod reopen;
pub mod sampling;
pub mod score;
pub mod study;

use std::path::Path;

use lanesweep_support::files::check_run_folder;
use lanesweep_support::{Error, Place, Result};
use parts::{PLAN_FILE, kind_of};
use sampling::{ESTIMATE_RECORD, SAMPLING_PLAN};
use study::{STUDY_RECORD, Study};

/// Kinds of runs in parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RunKind {
    /// A [`Study`].
    Study,
    /// A [`Sample`](sampling::Sample).
    Sample,
}

/// The kind of the run whose plan is in a folder.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] for a folder without a plan of a run.
pub fn run_kind(dir: &Path) -> Result<RunKind> {
    check_run_folder(dir)?;
    let plan = dir.join(PLAN_FILE);
    if !plan.exists() {
        return Err(no_parts(dir));
    }
    match kind_of(&plan)?.as_str() {
        Study::KIND => Ok(RunKind::Study),
        SAMPLING_PLAN => Ok(RunKind::Sample),
        other => {
            let help = format!("give the folder ({}) of a run in parts", lanesweep_support::option("out"));
            Err(Error::input(Place::file(plan), format!("this is a `{other}`, not the plan of a run"), help))
        }
    }
}

/// The reason why there is nothing to merge.
fn no_parts(dir: &Path) -> Error {
    let has = |name: &str| dir.join(name).exists();
    let names = || std::fs::read_dir(dir).into_iter().flatten().flatten().map(|entry| entry.file_name());
    let (problem, help) = if !dir.is_dir() {
        ("there is no such folder", "check the path for typing errors")
    } else if has(STUDY_RECORD) || has(ESTIMATE_RECORD) {
        ("there is nothing to merge: this is the result of an unsplit run", "give the folder of a run in parts")
    } else if names().any(|name| name.to_string_lossy().ends_with(".journal")) {
        ("there is nothing to merge: an unsplit run was interrupted here", "run its command again: it continues")
    } else {
        ("there is nothing to merge: plan.json is missing", "give the folder of the parts")
    };
    Error::input(Place::file(dir), problem, help)
}
