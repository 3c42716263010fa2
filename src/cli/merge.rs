//! `lanesweep cluster merge`: the parts of a run become its result, bit for bit that of the run in one piece.

use std::path::PathBuf;

use clap::Args;

use super::Exit;
use super::format::FormatFlag;
use super::sample_run;
use super::study_run::{Host, TablesFlag, finish_study};
use crate::interop::cluster::quoted_word;
use crate::report::run_record::Timings;
use crate::run::parts::{PLAN_FILE, Shard, kind_of};
use crate::run::sampling::Sample;
use crate::run::study::Study;
use crate::support::files::check_folder;
use crate::support::readable::counted;
use crate::support::run_dir::{ESTIMATE_RECORD, OutputDir, STUDY_RECORD};
use crate::{Error, Place, Result};

/// Merge the parts of a run into its result
///
/// Checks that the parts in DIR (left there by `--shard`) belong to the plan beside them, cover every lane exactly
/// once and are whole; names what is missing, doubled, foreign or damaged, with the command that makes it. The result
/// goes into DIR and is, bit for bit, that of the run in one piece.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  lanesweep study --shard 0/2 --out result\n  lanesweep study --shard 1/2 --out \
                        result\n  lanesweep cluster merge result")]
pub struct Merge {
    /// The run's folder
    #[arg(value_name = "DIR", help_heading = "Data")]
    dir: PathBuf,
    #[command(flatten)]
    tables: TablesFlag,
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
            ("there is nothing to merge: this is the result of an unsplit run", "give the folder of a run in parts")
        } else if names().any(|name| name.to_string_lossy().ends_with(".journal")) {
            ("there is nothing to merge: an unsplit run was interrupted here", "run its command again: it continues")
        } else {
            ("there is nothing to merge: plan.json is missing", "give the folder of the parts")
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
        let [plan_word, out] = [&plan, &self.dir].map(|path| quoted_word(&path.display().to_string()));
        let again = |verb: &'static str| {
            move |shard: Shard| format!("lanesweep {verb} --plan {plan_word} --shard {shard} --out {out}")
        };
        match kind.as_str() {
            Study::KIND => merge_study(
                &OutputDir::open(&self.dir, STUDY_RECORD)?,
                &again("study"),
                (self.format, self.tables.tables),
            ),
            kind if Sample::is_kind(kind) => {
                sample_run::merge(&OutputDir::open(&self.dir, ESTIMATE_RECORD)?, &again("sample"), self.format)
            }
            other => {
                let help = "give the folder (--out) of a run in parts";
                Err(Error::input(Place::file(plan), format!("this is a `{other}`, not the plan of a run"), help))
            }
        }
    }
}

fn merge_study(folder: &OutputDir, again: &dyn Fn(Shard) -> String, format: (FormatFlag, bool)) -> Result<Exit> {
    let (study, result) = Study::merge_or(folder.dir(), again)?;
    let host = Host {
        backend: format!("{} merged", counted(result.parts, "part")),
        device: None,
        swept: result.summary,
        timings: Timings::default(),
        settings: Vec::new(),
    };
    finish_study(&study, &result.counts, None, host, folder.results()?, format)
}
