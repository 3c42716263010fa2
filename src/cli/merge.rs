//! `lanesweep cluster merge`: the parts of a run become its result, bit for bit that of the run in one piece.

use std::path::{Path, PathBuf};

use clap::Args;

use super::Exit;
use super::format::FormatFlag;
use super::shard_flags::PLAN_FILE;
use super::study_plan::{self, PlannedStudy};
use super::study_run::{Host, finish_study};
use super::{sample_crude, sample_plan, sample_weighted, weighted_plan};
use crate::engine::{Partial, SweepSummary};
use crate::interop::cluster::quoted_word;
use crate::report::run_record::Timings;
use crate::run::parts::{Countable, Part, Shard, collect, kind_of, read_part};
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
                        result\n  lanesweep cluster merge result")]
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
            study_plan::KIND => (STUDY_RECORD, merge_study),
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

fn merge_study(folder: &RunFolder, plan: &Path, format: FormatFlag) -> Result<Exit> {
    let dir = folder.dir();
    // Counts are all that is joined: no scenario is needed.
    let (study, run_sha256) = PlannedStudy::read_some(plan, |_| 0..0)?;
    let parts = read_parts::<Partial>(dir, plan, "study", &run_sha256, study.plan().unit_count())?;
    let mut swept = SweepSummary { lanes: study.plan().lane_count(), ..SweepSummary::default() };
    let count = parts.len();
    let mut partial = Partial::empty(study.plan());
    for part in parts {
        swept.redone_lanes += part.lanes_redone_and_rechecked[0];
        swept.rechecked_lanes += part.lanes_redone_and_rechecked[1];
        partial = part.segments.into_iter().try_fold(partial, Partial::merge)?;
    }
    if !partial.is_complete(study.plan()) || !partial.fits(study.plan()) {
        let problem = "the parts do not hold every unit that their names stand for";
        return Err(Error::input(Place::file(dir), problem, "make them again"));
    }
    let host = Host {
        backend: format!("{count} parts merged"),
        device: None,
        swept,
        timings: Timings::default(),
        settings: Vec::new(),
    };
    finish_study(&study, &partial, None, host, folder.results()?, format)
}

/// All parts of a folder, checked: of this run, whole, together everything exactly once.
pub(super) fn read_parts<T: Countable>(
    dir: &Path,
    plan: &Path,
    verb: &str,
    run_sha256: &str,
    units: u64,
) -> Result<Vec<Part<T>>> {
    let [plan, out] = [plan, dir].map(|path| quoted_word(&path.display().to_string()));
    let command = |shard: Shard| format!("lanesweep {verb} --plan {plan} --shard {shard} --out {out}");
    let found = collect(dir, units, command)?;
    let read = |(shard, path): &(Shard, PathBuf)| {
        let part: Part<T> = read_part(path, run_sha256, &shard.units(units), &command(*shard))?;
        let wrong = |problem: &str| {
            let help = format!("delete it and make it again: {}", command(*shard));
            Error::input(Place::file(path), problem, help)
        };
        let mut covered: Vec<_> = part.segments.iter().flat_map(Countable::covered).collect();
        covered.sort_by_key(|range| range.start);
        let mut at = part.units.start;
        for range in covered {
            if range.start != at {
                return Err(wrong("it does not hold each of its units exactly once"));
            }
            at = range.end;
        }
        if at == part.units.end { Ok(part) } else { Err(wrong("it does not hold all of its units")) }
    };
    found.parts.iter().map(read).collect()
}
