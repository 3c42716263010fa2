//! A job: lanes over an interval of units, and counts of them that can be merged. It runs whole or in shards, in memory or in
//! a folder with a journal, and its parts merge to the bits of the whole.

use std::ops::Range;
use std::path::{Path, PathBuf};

use super::Shard;
use super::folder::{Part, read_part, read_parts, write_part};
use super::journal::Journal;
use super::ledger::{Ledger, MergeableCounts};
use lanesweep_engine::{Chunk, Executor, LanePlan, SweepSummary};
use lanesweep_stats::estimate::StopReason;
use lanesweep_support::files::make_folder;
use lanesweep_support::lock::FolderLock;
use lanesweep_support::readable::count;
use lanesweep_support::run_folder::{Results, RunFolder};
use lanesweep_support::{Error, Place, Result};

/// Receives the chunks of a sweep in order, with their plan.
pub type EachChunk<'c> = dyn FnMut(&LanePlan, &Chunk) -> Result<()> + 'c;

/// How the lanes of a job were computed.
#[derive(Debug, Clone, Copy)]
pub struct Computed {
    /// The sweeps.
    pub summary: SweepSummary,
    /// Why they ended.
    pub stopped: StopReason,
    /// Number of merged parts; 0 for a run in one piece.
    pub parts: usize,
}

impl Computed {
    /// Of sweeps up to the last unit.
    pub(crate) fn whole(summary: SweepSummary) -> Computed {
        Computed { summary, stopped: StopReason::Samples, parts: 0 }
    }
}

/// A planned job.
pub trait Job: Sized {
    /// Counts of a set of units.
    type Counts: MergeableCounts;
    /// What follows from the counts of all units.
    type Result;
    /// File name of the record of the whole run.
    const RECORD: &'static str;

    /// Number of units; the maximum if a rule may end the run earlier.
    fn unit_count(&self) -> u64;

    /// Hash of the run, by which its parts know each other. A run in one piece may have another one.
    ///
    /// # Errors
    /// [`Error::Io`] of the plan.
    fn run_sha256(&self, is_part: bool) -> Result<String>;

    /// Writes the plan file into a run's folder, or checks that the same one exists; many shards may do so at once.
    ///
    /// # Errors
    /// [`Error::Input`] if the folder holds the plan of another run; [`Error::Io`].
    fn write_plan(&self, out: &Path) -> Result<()>;

    /// Units at which counts are kept apart.
    fn cuts(&self) -> Vec<u64> {
        Vec::new()
    }

    /// Computes and counts the units that the ledger lacks. `each` receives every chunk with its outcomes.
    ///
    /// # Errors
    /// Those of the lanes and of `each`; [`Error::Interrupted`] after cancellation: finished counts are in the journal.
    fn compute(
        &self,
        ledger: &mut Ledger<Self::Counts>,
        executor: &Executor,
        each: Option<&mut EachChunk>,
    ) -> Result<Computed>;

    /// Removes what a whole run kept in its folder and its journal depends on.
    ///
    /// # Errors
    /// [`Error::Io`].
    fn tidy(&self, _out: &Path) -> Result<()> {
        Ok(())
    }

    /// The result of all counts, segment by segment.
    ///
    /// # Errors
    /// [`Error::Input`] at `place` if units are missing.
    fn result(&self, counts: Vec<Self::Counts>, computed: Computed, place: Place) -> Result<Self::Result>;

    /// Runs in one piece, in memory.
    ///
    /// # Errors
    /// As [`Job::compute`] and [`Job::result`].
    fn run(&self, executor: &Executor) -> Result<Self::Result> {
        let mut ledger = Ledger::new(0..self.unit_count(), &self.cuts());
        let computed = self.compute(&mut ledger, executor, None)?;
        self.result(ledger.finish()?.0, computed, Place::item("units"))
    }

    /// Opens a run in a folder; `None` if the shard's complete part exists already. Without a journal, counts are lost
    /// when the process ends.
    ///
    /// # Errors
    /// [`Error::Busy`] if another process runs it; [`Error::Input`] for a damaged or foreign file in its place;
    /// [`Error::Io`].
    fn open(&self, out: &Path, shard: Option<Shard>, is_journalled: bool) -> Result<Option<JobRun<'_, Self>>> {
        let (run_sha256, units) = (self.run_sha256(shard.is_some())?, units_of(shard, self.unit_count()));
        let part = shard.map(|shard| out.join(format!("{}.json", shard.stem())));
        if let Some(part) = part.as_ref().filter(|part| part.exists()) {
            read_part::<Self::Counts>(part, &run_sha256, &units, "run this command again")?;
            tracing::info!("this part exists already and is complete");
            return Ok(None);
        }
        // Parts share the folder; a run in one piece has it alone.
        let (folder, lock) = match shard {
            None => (RunFolder::open(out, Self::RECORD)?, None),
            Some(shard) => {
                let folder = RunFolder::share(out)?;
                let lock = FolderLock::acquire(&out.join(format!("{}.lock", shard.stem())))?;
                warn_of_another_split(out, shard);
                (folder, Some(lock))
            }
        };
        let mut ledger = Ledger::new(units.clone(), &self.cuts());
        if is_journalled {
            let run = &run_sha256[..16.min(run_sha256.len())];
            let name = shard.map_or(format!("run-{run}"), |shard| shard.stem()) + ".journal";
            let (journal, found) = Journal::open(&out.join(name), &run_sha256, units.clone())?;
            let done = ledger.resume(journal, found)?;
            if done > 0 {
                let (done, all) = (count(done), count(units.end - units.start));
                tracing::info!("{done} of {all} units are done already: this run continues");
            }
        }
        let (out, computed) = (out.to_path_buf(), None);
        Ok(Some(JobRun { job: self, out, part, run_sha256, ledger, computed, is_journalled, lock, folder }))
    }

    /// Runs a shard in a folder and writes plan and part there. An interrupted run continues at the next call.
    ///
    /// # Errors
    /// As [`Job::open`] and [`Job::compute`].
    fn run_shard(&self, out: &Path, shard: Shard, executor: &Executor) -> Result<()> {
        self.write_plan(out)?;
        let Some(mut run) = self.open(out, Some(shard), true)? else { return Ok(()) };
        run.compute(executor, None)?;
        run.write_part()
    }

    /// The result of a folder of parts, bit for bit equal to that of the run in one piece. `again` returns the command that
    /// makes a shard.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] with the missing, duplicate, foreign or damaged parts.
    fn merge(&self, out: &Path, again: &dyn Fn(Shard) -> String) -> Result<Self::Result> {
        let found = read_parts::<Self::Counts>(out, &self.run_sha256(true)?, self.unit_count(), again)?;
        let mut computed = Computed { parts: found.len(), ..Computed::whole(SweepSummary::default()) };
        let mut counts = Vec::new();
        for part in found {
            let [redone, rechecked] = part.lanes_redone_and_rechecked;
            computed.summary.redone_lanes += redone;
            computed.summary.rechecked_lanes += rechecked;
            counts.extend(part.segments);
        }
        self.result(counts, computed, Place::file(out))
    }
}

/// The units of a shard, or of the whole run.
pub(crate) fn units_of(shard: Option<Shard>, count: u64) -> Range<u64> {
    shard.map_or(0..count, |shard| shard.units(count))
}

/// Parts of two splits overlap; this warns before the computation, not only at the merge.
fn warn_of_another_split(out: &Path, ours: Shard) {
    let names = std::fs::read_dir(out).into_iter().flatten().flatten();
    let mut names = names.filter_map(|entry| entry.file_name().into_string().ok());
    let is_other = |name: &String| {
        let shard = name.strip_suffix(".json").and_then(Shard::of_stem);
        shard.is_some_and(|shard| shard.of != ours.of)
    };
    if let Some(name) = names.find(is_other) {
        tracing::warn!("{name} in this folder is of a run cut into another number of shards: they cannot be merged");
    }
}

/// A job, or one of its shards, in a folder. It continues from the journal of an earlier process.
pub struct JobRun<'j, J: Job> {
    job: &'j J,
    out: PathBuf,
    /// The part file of a shard.
    part: Option<PathBuf>,
    run_sha256: String,
    ledger: Ledger<J::Counts>,
    computed: Option<Computed>,
    is_journalled: bool,
    // Dropped last, the lock of the shard first: until then no other process computes these units.
    lock: Option<FolderLock>,
    folder: RunFolder,
}

impl<J: Job> JobRun<'_, J> {
    /// The units of the shard, or of the whole run.
    pub fn units(&self) -> Range<u64> {
        self.ledger.units()
    }

    /// Number of units that no earlier process has counted.
    ///
    /// # Errors
    /// Those of the journal's counts.
    pub fn missing(&mut self) -> Result<u64> {
        Ok(self.ledger.missing(self.units())?.iter().map(|range| range.end - range.start).sum())
    }

    /// Computes the units that are missing. `each` receives every chunk with its outcomes.
    ///
    /// # Errors
    /// As [`Job::compute`].
    pub fn compute(&mut self, executor: &Executor, each: Option<&mut EachChunk>) -> Result<()> {
        let _resumable = self.is_journalled.then(|| executor.cancel.resumable());
        self.computed = Some(self.job.compute(&mut self.ledger, executor, each)?);
        Ok(())
    }

    /// Writes the part of a shard and deletes its journal.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Internal`] if units are missing or the run is not a shard.
    pub fn write_part(mut self) -> Result<()> {
        if self.missing()? > 0 {
            return Err(Error::Internal("a part is not complete".to_owned()));
        }
        let JobRun { part, run_sha256, ledger, lock, folder, out, .. } = self;
        let Some(path) = part else { return Err(Error::Internal("the whole run is no part".to_owned())) };
        let (units, lanes_redone_and_rechecked) = (ledger.units(), ledger.redone_and_rechecked());
        let (segments, journal) = ledger.finish()?;
        // The folder existed at the start; if it was deleted since, it is recreated to save the part.
        make_folder(&out)?;
        write_part(&path, &Part { run_sha256, units, lanes_redone_and_rechecked, segments })?;
        journal.map_or(Ok(()), Journal::remove)?;
        drop((lock, folder));
        tracing::info!("part written to {}", path.display());
        Ok(())
    }

    /// Takes the result of a whole run.
    ///
    /// # Errors
    /// [`Error::Internal`] before anything was computed; as [`Job::result`].
    pub fn take_result(&mut self) -> Result<J::Result> {
        let nothing = || Error::Internal("nothing was computed".to_owned());
        let computed = self.computed.take().ok_or_else(nothing)?;
        self.job.result(self.ledger.take()?, computed, Place::file(&self.out))
    }

    /// The result files of a whole run in its folder.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn results(&self) -> Result<Results<'_>> {
        self.folder.results()
    }

    /// Deletes the journal of a whole run after its results are written.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn close(self) -> Result<()> {
        self.job.tidy(&self.out)?;
        let (_, journal) = self.ledger.finish()?;
        journal.map_or(Ok(()), Journal::remove)
    }
}
