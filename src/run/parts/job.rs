//! A job: lanes over an interval of units, and counts of them that can be merged. It runs whole or in shards, in memory or in
//! a folder with a journal, and its parts merge to the bits of the whole.

use std::ops::Range;
use std::path::Path;

use super::Shard;
use super::folder::read_parts;
use super::ledger::{Ledger, MergeableCounts};
use super::run_dir::{RunDir, RunState, units_of};
use crate::engine::{Chunk, Executor, LanePlan, SweepSummary};
use crate::stats::estimate::StopReason;
use crate::support::run_dir::Results;
use crate::{Error, Place, Result};

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
    pub fn whole(summary: SweepSummary) -> Computed {
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

    /// Units at which the counts of an interval are kept apart.
    fn cuts(&self, _units: &Range<u64>) -> Vec<u64> {
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
        let units = 0..self.unit_count();
        let mut ledger = Ledger::new(units.clone(), &self.cuts(&units));
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
        let (run_sha256, unit_count) = (self.run_sha256(shard.is_some())?, self.unit_count());
        let run_dir = RunDir { out: out.to_path_buf(), record: Self::RECORD, run_sha256, shard, unit_count };
        if run_dir.is_done::<Self::Counts>()? {
            return Ok(None);
        }
        let state = run_dir.begin(&self.cuts(&units_of(shard, unit_count)), is_journalled)?;
        Ok(Some(JobRun { job: self, run_dir, state, computed: None, is_journalled }))
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

/// A job, or one of its shards, in a folder. It continues from the journal of an earlier process.
pub struct JobRun<'j, J: Job> {
    job: &'j J,
    run_dir: RunDir,
    state: RunState<J::Counts>,
    computed: Option<Computed>,
    is_journalled: bool,
}

impl<J: Job> JobRun<'_, J> {
    /// The units of the shard, or of the whole run.
    pub fn units(&self) -> Range<u64> {
        self.state.units.clone()
    }

    /// Number of units that no earlier process has counted.
    ///
    /// # Errors
    /// Those of the journal's counts.
    pub fn missing(&mut self) -> Result<u64> {
        Ok(self.state.ledger.missing(self.units())?.iter().map(|range| range.end - range.start).sum())
    }

    /// Computes the units that are missing. `each` receives every chunk with its outcomes.
    ///
    /// # Errors
    /// As [`Job::compute`].
    pub fn compute(&mut self, executor: &Executor, each: Option<&mut EachChunk>) -> Result<()> {
        let _resumable = self.is_journalled.then(|| executor.cancel.resumable());
        self.computed = Some(self.job.compute(&mut self.state.ledger, executor, each)?);
        Ok(())
    }

    /// Writes the part of a shard and deletes its journal.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Internal`] if units are missing or the run is not a shard.
    pub fn write_part(self) -> Result<()> {
        self.run_dir.finish(self.state)
    }

    /// Takes the result of a whole run.
    ///
    /// # Errors
    /// [`Error::Internal`] before anything was computed; as [`Job::result`].
    pub fn take_result(&mut self) -> Result<J::Result> {
        let nothing = || Error::Internal("nothing was computed".to_owned());
        let computed = self.computed.take().ok_or_else(nothing)?;
        self.job.result(self.state.ledger.take()?, computed, Place::file(&self.run_dir.out))
    }

    /// The result files of a whole run in its folder.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn results(&self) -> Result<Results<'_>> {
        self.state.folder.results()
    }

    /// Deletes the journal of a whole run after its results are written.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn close(self) -> Result<()> {
        self.job.tidy(&self.run_dir.out)?;
        self.state.forget()
    }
}
