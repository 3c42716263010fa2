//! A running sampling run: whole in memory, or whole or as a shard in a folder with a journal; and the merge of the
//! shards.

use std::ops::Range;
use std::path::Path;

use super::crude::{CrudeRun, EachChunk, crude_of_segments, cuts, sample_into};
use super::model_ratios::{ModelRatio, ProfileRatios};
use super::plan_file::SEARCH_FILE;
use super::rows::EstimateRow;
use super::sample_options::Estimator;
use super::tally::SampleTally;
use super::weighted::WeightedTally;
use super::{Sample, SampleKind};
use crate::engine::Executor;
use crate::run::parts::{Ledger, MergeableCounts, PLAN_FILE, RunDir, RunState, Shard, read_parts, units_of};
use crate::stats::density::Mixture;
use crate::stats::estimate::SearchRound;
use crate::support::run_dir::{ESTIMATE_RECORD, Results};
use crate::{Error, Place, Result};

/// A sampling run, or one of its shards, in a folder. It continues from the journal of an earlier process.
pub struct SampleRun<'s> {
    sample: &'s Sample,
    run_dir: RunDir,
    state: State,
    crude: Option<CrudeRun>,
    is_journalled: bool,
}

enum State {
    Crude(Box<RunState<SampleTally>>),
    Weighted(Box<RunState<WeightedTally>>),
}

impl Sample {
    /// Runs in one piece, in memory.
    ///
    /// # Errors
    /// Those of the lanes.
    pub fn run(&self, executor: &Executor) -> Result<SampleResult> {
        self.against_recorded(self.sampled(executor)?)
    }

    fn sampled(&self, executor: &Executor) -> Result<SampleResult> {
        let units = 0..self.samples();
        match &self.kind {
            SampleKind::Crude(plan) => {
                let mut ledger = Ledger::new(units.clone(), &cuts(units.end, &units));
                let (options, exposure) = (&self.options, self.exposure());
                let run = sample_into(plan, &mut ledger, executor, options, exposure, &mut |_| (), None)?;
                Ok(SampleResult::of_crude(run))
            }
            SampleKind::Weighted(weighted) => {
                let mut ledger = Ledger::new(units, &[]);
                self.sample_weighted(weighted, &mut ledger, executor, |_| ())?;
                self.weighted_result(weighted, ledger.take()?, Place::item("samples"))
            }
            SampleKind::Search(search) => {
                let kind = SampleKind::Weighted(Box::new(self.search(search, executor)?));
                let (density, profile) = (self.density.clone(), self.profile.clone());
                Sample { density, profile, options: self.options.clone(), kind }.sampled(executor)
            }
        }
    }

    /// Opens a run in a folder; `None` if the shard's complete part exists already. Without a journal, counts are lost
    /// when the process ends.
    ///
    /// # Errors
    /// [`Error::Busy`] if another process runs it; [`Error::Input`] for a damaged or foreign file in its place;
    /// [`Error::Io`]; [`Error::Internal`] before the search of importance sampling.
    pub fn open(&self, out: &Path, shard: Option<Shard>, is_journalled: bool) -> Result<Option<SampleRun<'_>>> {
        let (run_sha256, unit_count) = (self.seal()?.1, self.samples());
        let run_dir = RunDir { out: out.to_path_buf(), record: ESTIMATE_RECORD, run_sha256, shard, unit_count };
        let state = match &self.kind {
            SampleKind::Crude(_) => {
                if run_dir.is_done::<SampleTally>()? {
                    return Ok(None);
                }
                let cuts = cuts(unit_count, &units_of(shard, unit_count));
                State::Crude(Box::new(run_dir.begin(&cuts, is_journalled)?))
            }
            SampleKind::Weighted(_) => {
                if run_dir.is_done::<WeightedTally>()? {
                    return Ok(None);
                }
                State::Weighted(Box::new(run_dir.begin(&[], is_journalled)?))
            }
            SampleKind::Search(_) => {
                return Err(Error::Internal("a run without a proposal was opened in a folder".to_owned()));
            }
        };
        Ok(Some(SampleRun { sample: self, run_dir, state, crude: None, is_journalled }))
    }

    /// Runs a shard in a folder and writes plan and part there. An interrupted run continues at the next call.
    ///
    /// # Errors
    /// As [`Sample::open`] and [`Sample::run`]; [`Error::Interrupted`].
    pub fn run_shard(&self, out: &Path, shard: Shard, executor: &Executor) -> Result<()> {
        self.write_plan(out)?;
        let Some(mut run) = self.open(out, Some(shard), true)? else { return Ok(()) };
        run.sample(executor, &mut |_| (), None)?;
        run.write_part()
    }

    /// The run and the estimates of a folder of parts, bit for bit equal to those of the run in one piece.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] with the missing, duplicate, foreign or damaged parts.
    pub fn merge(out: &Path) -> Result<(Sample, SampleResult)> {
        Sample::merge_or(out, &|shard| format!("run shard {shard}"))
    }

    /// The same; `again` returns the command that makes a shard.
    pub(crate) fn merge_or(out: &Path, again: &dyn Fn(Shard) -> String) -> Result<(Sample, SampleResult)> {
        let sample = Sample::read(&out.join(PLAN_FILE))?;
        let run_sha256 = sample.seal()?.1;
        let result = match &sample.kind {
            SampleKind::Crude(plan) => {
                let parts = read_parts(out, &run_sha256, plan.unit_count(), again)?;
                let rechecked_lanes = parts.iter().map(|part| part.lanes_redone_and_rechecked[1]).sum();
                let count = parts.len();
                let segments = parts.into_iter().flat_map(|part| part.segments).collect();
                let crude = crude_of_segments(plan, segments, &sample.options, sample.exposure())?;
                if crude.tally.samples() != plan.unit_count() {
                    let problem = "the parts do not hold every sample that their names stand for";
                    return Err(Error::input(Place::file(out), problem, "make them again"));
                }
                SampleResult { parts: count, rechecked_lanes, ..SampleResult::of_crude(crude) }
            }
            SampleKind::Weighted(weighted) => {
                let parts = read_parts(out, &run_sha256, sample.samples(), again)?;
                let count = parts.len();
                let mut segments = parts.into_iter().flat_map(|part| part.segments);
                let first = segments.next();
                let tally = first.map(|first| segments.try_fold(first, WeightedTally::join)).transpose()?;
                SampleResult { parts: count, ..sample.weighted_result(weighted, tally, Place::file(out))? }
            }
            SampleKind::Search(_) => {
                return Err(Error::Internal("a plan file of a run without a proposal".to_owned()));
            }
        };
        let result = sample.against_recorded(result)?;
        Ok((sample, result))
    }
}

impl SampleRun<'_> {
    /// The samples of the shard, or of the whole run.
    pub fn units(&self) -> Range<u64> {
        match &self.state {
            State::Crude(state) => state.units.clone(),
            State::Weighted(state) => state.units.clone(),
        }
    }

    /// Number of samples that no earlier process has counted.
    ///
    /// # Errors
    /// Those of the journal's counts.
    pub fn missing(&mut self) -> Result<u64> {
        let units = self.units();
        let missing = match &mut self.state {
            State::Crude(state) => state.ledger.missing(units)?,
            State::Weighted(state) => state.ledger.missing(units)?,
        };
        Ok(missing.iter().map(|range| range.end - range.start).sum())
    }

    /// Samples what is missing. `progress` receives the number of samples of every chunk; `chunks` receives the chunks
    /// of crude Monte Carlo, with all values.
    ///
    /// # Errors
    /// Those of the lanes and of `chunks`; [`Error::Interrupted`] after cancellation: finished counts are in the
    /// journal.
    pub fn sample(
        &mut self,
        executor: &Executor,
        progress: &mut dyn FnMut(u64),
        chunks: Option<&mut EachChunk<'_>>,
    ) -> Result<()> {
        let _resumable = self.is_journalled.then(|| executor.cancel.resumable());
        match (&mut self.state, &self.sample.kind) {
            (State::Crude(state), SampleKind::Crude(plan)) => {
                if state.units.is_empty() {
                    return Ok(());
                }
                let (options, exposure) = (&self.sample.options, self.sample.exposure());
                let chunks = chunks.map(|each| (true, each));
                let ledger = &mut state.ledger;
                let run = sample_into(plan, ledger, executor, options, exposure, progress, chunks)?;
                self.crude = Some(run);
                Ok(())
            }
            (State::Weighted(state), SampleKind::Weighted(weighted)) => {
                self.sample.sample_weighted(weighted, &mut state.ledger, executor, progress)
            }
            _ => Err(Error::Internal("a run has the counts of another estimator".to_owned())),
        }
    }

    /// Writes the part of a shard and deletes its journal.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Internal`] if samples are missing or the run is not a shard.
    pub fn write_part(self) -> Result<()> {
        match self.state {
            State::Crude(state) => self.run_dir.finish(*state),
            State::Weighted(state) => self.run_dir.finish(*state),
        }
    }

    /// Takes the estimates of a whole run.
    ///
    /// # Errors
    /// [`Error::Internal`] before anything was sampled; of the lanes of recorded scenarios.
    pub fn take_result(&mut self) -> Result<SampleResult> {
        let result = match (&mut self.state, &self.sample.kind) {
            (State::Weighted(state), SampleKind::Weighted(weighted)) => {
                let tally = state.ledger.counts(0..self.sample.samples())?;
                self.sample.weighted_result(weighted, tally, Place::file(&self.run_dir.out))?
            }
            _ => {
                let nothing = || Error::Internal("nothing was sampled".to_owned());
                SampleResult::of_crude(self.crude.take().ok_or_else(nothing)?)
            }
        };
        self.sample.against_recorded(result)
    }

    /// The result files of a whole run in its folder.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn results(&self) -> Result<Results<'_>> {
        match &self.state {
            State::Crude(state) => state.folder.results(),
            State::Weighted(state) => state.folder.results(),
        }
    }

    /// Deletes the journal of a whole run after its results are written, and the file of its search.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn close(self) -> Result<()> {
        if matches!(self.sample.options.estimator, Estimator::Search(_)) {
            // The journal depends on this file and is deleted next; without the file the next run's search gives the
            // same bits.
            let path = self.run_dir.out.join(SEARCH_FILE);
            match std::fs::remove_file(&path) {
                Err(e) if e.kind() != std::io::ErrorKind::NotFound => return Err(Error::io(&path, "remove", e)),
                _ => {}
            }
        }
        match self.state {
            State::Crude(state) => state.forget(),
            State::Weighted(state) => state.forget(),
        }
    }
}

/// Result of a sampling run.
#[derive(Debug, Clone, Default)]
pub struct SampleResult {
    /// The estimates.
    pub rows: Vec<EstimateRow>,
    /// Ratios of the rates of two models by importance sampling.
    pub ratios: Vec<ModelRatio>,
    /// Ratios to the rates under another profile, if it was asked for.
    pub profiles: Option<ProfileRatios>,
    /// Counts and convergence of crude Monte Carlo.
    pub crude: Option<CrudeRun>,
    /// The rounds of the search.
    pub search: Vec<SearchRound>,
    /// The proposal found.
    pub proposal: Option<Mixture>,
    /// Number of merged parts; 0 for a run in one piece.
    pub parts: usize,
    /// Lanes that were rechecked.
    pub rechecked_lanes: u64,
}

impl SampleResult {
    fn of_crude(mut run: CrudeRun) -> SampleResult {
        let (rows, rechecked_lanes) = (std::mem::take(&mut run.rows), run.summary.rechecked_lanes);
        SampleResult { rows, rechecked_lanes, crude: Some(run), ..SampleResult::default() }
    }
}
