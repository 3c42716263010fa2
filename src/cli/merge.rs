//! `lanesweep merge`: the parts of a run become its result, bit for bit that of the run in one piece.

use std::path::{Path, PathBuf};

use clap::Args;

use super::Exit;
use super::format::FormatFlag;
use super::study_run::{Host, finish_study};
use super::{sample_crude, sample_plan, sample_weighted, weighted_plan};
use crate::interop::cluster::quoted_word;
use crate::report::run_record::Timings;
use crate::run::parts::{PLAN_FILE, Shard, kind_of};
use crate::run::study::Study;
use crate::support::files::check_folder;
use crate::support::run_dir::{ESTIMATE_RECORD, RunFolder, STUDY_RECORD};
use crate::{Error, Place, Result};

/// Make the result of a run that was computed in parts
///
/// Checks that the parts in DIR (left there by `--shard`) belong to the plan beside them, cover every lane exactly
/// once and are whole; names what is missing, doubled, foreign or damaged, with the command that makes it. The result
/// goes into DIR and is, bit for bit, that of the run in one piece.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  lanesweep study --shard 0/2 --out result\n  lanesweep study --shard 1/2 --out \
                        result\n  lanesweep merge result")]
pub struct Merge {
    /// The run's folder
    #[arg(value_name = "DIR")]
    dir: PathBuf,
    #[command(flatten)]
    format: FormatFlag,
}

impl Merge {
    /// Why there is nothing to merge.
    fn no_parts(&self) -> Error {
        let has = |name: &str| self.dir.join(name).exists();
        let names = || std::fs::read_dir(&self.dir).into_iter().flatten().flatten().map(|entry| entry.file_name());
        let (problem, help) = if !self.dir.is_dir() {
            ("there is no such folder", "check the path for typing errors")
        } else if has("run.json") || has("estimate.json") {
            ("there is nothing to merge: this is the result of a run in one piece", "give the folder of a run in parts")
        } else if names().any(|name| name.to_string_lossy().ends_with(".journal")) {
            (
                "there is nothing to merge: a run in one piece was interrupted here",
                "run its command again: it continues",
            )
        } else {
            ("there is nothing to merge: plan.json is missing", "give the folder that the parts were written to")
        };
        Error::input(Place::file(&self.dir), problem, help)
    }

    pub fn run(&self) -> Result<Exit> {
        let plan = self.dir.join(PLAN_FILE);
        check_folder(&self.dir)?;
        if !plan.exists() {
            return Err(self.no_parts());
        }
        let kind = kind_of(&plan)?;
        let (record, merge): (_, Merging) = match kind.as_str() {
            Study::KIND => (STUDY_RECORD, merge_study),
            sample_plan::KIND => (ESTIMATE_RECORD, sample_crude::merge),
            weighted_plan::KIND => (ESTIMATE_RECORD, sample_weighted::merge),
            other => {
                let help = "give the folder (--out) of a run in parts";
                return Err(Error::input(
                    Place::file(plan),
                    format!("this is a `{other}`, not the plan of a run"),
                    help,
                ));
            }
        };
        merge(&RunFolder::open(&self.dir, record)?, &plan, self.format)
    }
}

/// Makes the result of the parts in a folder.
type Merging = fn(&RunFolder, &Path, FormatFlag) -> Result<Exit>;

fn merge_study(folder: &RunFolder, _: &Path, format: FormatFlag) -> Result<Exit> {
    let dir = folder.dir();
    let (study, result) = Study::merge_or(dir, &command(dir, "study"))?;
    let host = Host {
        backend: format!("{} parts merged", result.parts),
        device: None,
        swept: result.summary,
        timings: Timings::default(),
        settings: Vec::new(),
    };
    finish_study(&study, &result.counts, None, host, folder.results()?, format)
}

/// The command that makes a shard of the run in this folder.
pub(super) fn command(dir: &Path, verb: &'static str) -> impl Fn(Shard) -> String {
    let [plan, out] = [&dir.join(PLAN_FILE), dir].map(|path| quoted_word(&path.display().to_string()));
    move |shard| format!("lanesweep {verb} --plan {plan} --shard {shard} --out {out}")
}
