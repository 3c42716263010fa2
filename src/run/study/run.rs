//! A study's run: whole in memory, or whole or as a shard in a folder with a journal; and the merge of the shards.

use std::ops::Range;
use std::path::Path;

use super::Study;
use crate::engine::{Chunk, Executor, LanePlan, Partial, SweepSummary, Wanted};
use crate::run::parts::{PLAN_FILE, RunDir, RunState, Shard, read_parts};
use crate::support::run_dir::{Results, STUDY_RECORD};
use crate::{Error, Place, Result};

/// Result of a whole study.
#[derive(Debug, Clone)]
pub struct StudyResult {
    /// The counts of every unit; [`Study::score`] computes the score table from them.
    pub counts: Partial,
    /// Summary of the sweep.
    pub summary: SweepSummary,
    /// Number of merged parts; 0 for a run in one piece.
    pub parts: usize,
}

/// A run of a study, or of one of its shards, in a folder. It continues from the journal of an earlier process.
pub struct StudyRun<'s> {
    study: &'s Study,
    run_dir: RunDir,
    state: RunState<Partial>,
    summary: SweepSummary,
}

/// Receives the chunks of a study's sweep in order, with the plan of their window.
pub type ChunkSink<'c> = dyn FnMut(&LanePlan, &Chunk) -> Result<()> + 'c;

impl Study {
    /// Runs every lane, in memory.
    ///
    /// # Errors
    /// As [`Executor::sweep`]; [`Error::Usage`] for a time step that is too long for a case.
    pub fn run(&self, executor: &Executor) -> Result<StudyResult> {
        let mut counts = Vec::new();
        let units = 0..self.plan().unit_count();
        let summary = self.cases.sweep(units, Wanted::Verdicts, executor, |plan, chunk| {
            counts.push(Partial::from_chunk(plan, &chunk)?);
            Ok(())
        })?;
        let counts = counts.into_iter().try_fold(Partial::empty(self.plan()), Partial::merge)?;
        Ok(StudyResult { counts, summary, parts: 0 })
    }

    /// Opens a run in a folder; `None` if the shard's complete part exists already.
    ///
    /// # Errors
    /// [`Error::Busy`] where another process runs it; [`Error::Input`] for a damaged or foreign file in its place;
    /// [`Error::Io`].
    pub fn open(&self, out: &Path, shard: Option<Shard>) -> Result<Option<StudyRun<'_>>> {
        let run_dir = RunDir {
            out: out.to_path_buf(),
            record: STUDY_RECORD,
            run_sha256: self.run_sha256(shard.is_some())?,
            shard,
            unit_count: self.plan().unit_count(),
        };
        if run_dir.is_done::<Partial>()? {
            return Ok(None);
        }
        let state = run_dir.begin(&[], true)?;
        let summary = SweepSummary { device_s: Some(0.0), ..SweepSummary::default() };
        Ok(Some(StudyRun { study: self, run_dir, state, summary }))
    }

    /// Runs a shard in a folder and writes plan and part there. An interrupted run continues at the next call.
    ///
    /// # Errors
    /// As [`Study::open`] and [`Study::run`]; [`Error::Interrupted`].
    pub fn run_shard(&self, out: &Path, shard: Shard, executor: &Executor) -> Result<()> {
        self.write_plan(out)?;
        let Some(mut run) = self.open(out, Some(shard))? else { return Ok(()) };
        run.sweep(executor, None)?;
        run.write_part()
    }

    /// The study and the counts of a folder of parts, bit for bit equal to those of the run in one piece.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] with the missing, duplicate, foreign or damaged parts.
    pub fn merge(out: &Path) -> Result<(Study, StudyResult)> {
        Study::merge_or(out, &|shard| format!("run shard {shard}"))
    }

    /// The same; `again` returns the command that makes a shard.
    pub(crate) fn merge_or(out: &Path, again: &dyn Fn(Shard) -> String) -> Result<(Study, StudyResult)> {
        // Merging needs only counts and no scenarios.
        let study = Study::read_units(&out.join(PLAN_FILE), |_| 0..0)?;
        let plan = study.plan();
        let found = read_parts::<Partial>(out, &study.run_sha256(true)?, plan.unit_count(), again)?;
        let mut summary = SweepSummary { lanes: plan.lane_count(), ..SweepSummary::default() };
        let parts = found.len();
        let mut counts = Partial::empty(plan);
        for part in found {
            summary.redone_lanes += part.lanes_redone_and_rechecked[0];
            summary.rechecked_lanes += part.lanes_redone_and_rechecked[1];
            counts = part.segments.into_iter().try_fold(counts, Partial::merge)?;
        }
        if !counts.is_complete(plan) {
            let problem = "the parts do not hold every unit that their names stand for";
            return Err(Error::input(Place::file(out), problem, "make them again"));
        }
        Ok((study, StudyResult { counts, summary, parts }))
    }
}

impl StudyRun<'_> {
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

    /// Runs the missing lanes. `rows` receives their chunks in order, with outcomes; if an earlier process has counted
    /// lanes, their chunks come too, for which these lanes run again.
    ///
    /// # Errors
    /// As [`Study::run`]; those of `rows`; [`Error::Interrupted`] after cancellation: finished counts are in the journal.
    pub fn sweep(&mut self, executor: &Executor, mut rows: Option<&mut ChunkSink>) -> Result<SweepSummary> {
        let _resumable = executor.cancel.resumable();
        let (units, ledger) = (self.state.units.clone(), &mut self.state.ledger);
        let missing = ledger.missing(units.clone())?;
        let is_fresh = missing == [units.clone()];
        let wanted = if rows.is_some() && is_fresh { Wanted::Outcomes } else { Wanted::Verdicts };
        for range in missing {
            let part = self.study.cases.sweep(range, wanted, executor, |plan, chunk| {
                if let Some(rows) = rows.as_mut().filter(|_| is_fresh) {
                    rows(plan, &chunk)?;
                }
                ledger.add(Partial::from_chunk(plan, &chunk)?, chunk.redone_and_rechecked)
            });
            self.summary.add(&ledger.kept(part)?);
        }
        if let Some(rows) = rows.filter(|_| !is_fresh) {
            let again = self.study.cases.sweep(units, Wanted::Outcomes, executor, |plan, chunk| rows(plan, &chunk))?;
            self.summary.add(&again);
        }
        // Rechecks of earlier processes are recorded in the journal.
        [self.summary.redone_lanes, self.summary.rechecked_lanes] = ledger.redone_and_rechecked();
        Ok(self.summary)
    }

    /// Writes the part of a shard and deletes its journal.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Internal`] if lanes are missing or the run is not a shard.
    pub fn write_part(self) -> Result<()> {
        self.run_dir.finish(self.state)
    }

    /// Removes and returns the counts of a whole run.
    ///
    /// # Errors
    /// None for counts of this program.
    pub fn take_result(&mut self) -> Result<StudyResult> {
        let counts = self.state.ledger.take()?.unwrap_or_else(|| Partial::empty(self.study.plan()));
        Ok(StudyResult { counts, summary: self.summary, parts: 0 })
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
        self.state.forget()
    }
}
