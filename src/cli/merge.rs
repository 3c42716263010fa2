//! `lanesweep merge`: merges the parts of a run into the result of the whole run, bit for bit.

use std::path::PathBuf;

use clap::Args;

use super::configured::Configured;
use super::format::FormatFlag;
use super::sample::guard;
use super::sample_run::list_failures;
use super::{COMMIT, Output};
use lanesweep_report::host::{Host, Timings};
use lanesweep_report::lanes::sampled_table;
use lanesweep_report::study::StudyReport;
use lanesweep_run::parts::PLAN_FILE;
use lanesweep_run::sampling::{ESTIMATE_RECORD, Sample};
use lanesweep_run::study::{STUDY_RECORD, Study};
use lanesweep_run::{RunKind, run_kind};
use lanesweep_support::plain_text::quoted_word;
use lanesweep_support::run_folder::RunFolder;
use lanesweep_support::{Error, Place, Result};

/// Merge the parts of a run into its result
///
/// Checks that the parts in DIR (written by `--shard`) belong to the plan in DIR, are complete, and cover every lane
/// exactly once. Names each missing, duplicate, foreign or damaged part, with the command that recomputes it. The
/// result is written to DIR; it equals, bit for bit, the result of the unsplit run.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  lanesweep study --shard 0/2 --out result\n  lanesweep study --shard 1/2 --out \
                        result\n  lanesweep merge result")]
pub(super) struct Merge {
    /// The run's folder
    #[arg(value_name = "DIR", help_heading = "Data")]
    folder: PathBuf,
    /// Of a sampling run: also write the first failing lanes, as `sample --failures`
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    failures: Option<PathBuf>,
    #[command(flatten)]
    format: FormatFlag,
}

impl Merge {
    pub(super) fn run(&self, configured: &Configured) -> Result<Output> {
        if let Some(failures) = &self.failures {
            guard(failures, "failures", &self.folder, None)?;
        }
        let [plan, out] =
            [&self.folder.join(PLAN_FILE), &self.folder].map(|path| quoted_word(&path.display().to_string()));
        let again = |verb: &str, shard| format!("lanesweep {verb} --plan {plan} --shard {shard} --out {out}");
        match run_kind(&self.folder)? {
            RunKind::Study if self.failures.is_some() => {
                let help = "leave it out; `study --rows` writes every lane";
                Err(Error::usage(Place::option("failures"), "this is a study, not a sampling run", help))
            }
            RunKind::Study => {
                let folder = RunFolder::open(&self.folder, STUDY_RECORD)?;
                let (study, result) = Study::merge_parts(&self.folder, &|shard| again("study", shard))?;
                let (swept, timings) = (&result.summary, Timings::default());
                let host = Host::of_parts(COMMIT, result.parts, swept.rechecked_lanes);
                let report = StudyReport::of(&study, &result.counts, None, host, swept, timings)?;
                self.format.study(&report, folder.results()?, (study.facts().incomplete, false))
            }
            RunKind::Sample => {
                let folder = RunFolder::open(&self.folder, ESTIMATE_RECORD)?;
                let (sample, result) = Sample::merge_parts(&self.folder, &|shard| again("sample", shard))?;
                let host = Host::of_parts(COMMIT, result.parts, result.rechecked_lanes);
                let table = self.failures.as_deref().map(|path| sampled_table(path, &sample)).transpose()?;
                let table = table.map(|table| list_failures(table, &sample, &result, configured)).transpose()?;
                let mut results = folder.results()?;
                table.into_iter().for_each(|table| results.join(table));
                self.format.sample(&sample, &result, host, results)
            }
        }
    }
}
