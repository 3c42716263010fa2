//! Runs: what is planned, computed in parts, merged and scored.
//!
//! [`study`] compares parameterizations with recordings, [`sampling`] estimates probabilities. [`grid`] sweeps maps, [`cases`] tables of concrete cases, [`check`] evaluates single ones.
//! [`reopen`] reruns single lanes of a finished run. [`parts`] splits and journals runs, [`Merged`] is the result of merged parts.
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
use lanesweep_support::run_folder::RunFolder;
use lanesweep_support::{Error, Place, Result};
use parts::{PLAN_FILE, Shard, kind_of};
use sampling::{ESTIMATE_RECORD, Sample, SampleResult};
use study::{STUDY_RECORD, Study, StudyResult};

/// A run with the merged result of its parts, bit for bit equal to that of the run in one piece.
pub enum Merged {
    /// A study.
    Study(Box<(Study, StudyResult)>),
    /// A sampling run.
    Sample(Box<(Sample, SampleResult)>),
}

/// Merges the parts of a folder and locks it. `again` returns the command that makes a shard.
///
/// # Errors
/// [`Error::Io`]; [`Error::Busy`] if another process writes there; [`Error::Input`] with the missing, duplicate,
/// foreign or damaged parts.
pub fn merge(dir: &Path, again: &dyn Fn(&str, Shard) -> String) -> Result<(RunFolder, Merged)> {
    check_run_folder(dir)?;
    let plan = dir.join(PLAN_FILE);
    if !plan.exists() {
        return Err(no_parts(dir));
    }
    match kind_of(&plan)?.as_str() {
        Study::KIND => {
            let folder = RunFolder::open(dir, STUDY_RECORD)?;
            let merged = Study::merge_parts(dir, &|shard| again("study", shard))?;
            Ok((folder, Merged::Study(Box::new(merged))))
        }
        kind if Sample::is_kind(kind) => {
            let folder = RunFolder::open(dir, ESTIMATE_RECORD)?;
            let merged = Sample::merge_parts(dir, &|shard| again("sample", shard))?;
            Ok((folder, Merged::Sample(Box::new(merged))))
        }
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
