//! Sampling runs as jobs, one per kind of estimator.

use std::path::Path;

use super::crude::{checkpoints, crude_of_segments, sample_into};
use super::estimate_rows::crude_rows;
use super::plan_file::SEARCH_FILE;
use super::result::SampleResult;
use super::weighted::WeightedTally;
use super::{Sample, SampleHeadways, SampleKind, Weighted};
use crate::parts::{Computed, EachChunk, Job, Ledger, MergeableCounts, PLAN_FILE, Shard, leave_plan};
use lanesweep_engine::{Executor, LanePlan, SampleTally, SweepSummary};
use lanesweep_stats::density::Exposure;
use lanesweep_support::files::remove_file;
use lanesweep_support::{Error, Place, Result};

/// Record of a sampling run.
pub const ESTIMATE_RECORD: &str = "estimate.json";

/// Evaluates an expression for the job of a planned sample.
macro_rules! with_job {
    ($sample:expr, $job:ident => $run:expr) => {
        match $sample.job()? {
            SampleJob::Crude($job) => $run,
            SampleJob::Weighted($job) => $run,
        }
    };
}

/// The job of a planned sample, by its estimator.
pub enum SampleJob<'s> {
    /// Crude Monte Carlo.
    Crude(CrudeJob<'s>),
    /// Importance sampling.
    Weighted(WeightedJob<'s>),
}

/// Crude Monte Carlo.
#[derive(Clone, Copy)]
pub struct CrudeJob<'s> {
    sample: &'s Sample,
    plan: &'s LanePlan,
}

/// Importance sampling of a known proposal.
#[derive(Clone, Copy)]
pub struct WeightedJob<'s> {
    sample: &'s Sample,
    weighted: &'s Weighted,
}

impl Sample {
    /// The exposure, if the density draws the headway: lanes that begin at imposed headways have no rate per hour.
    pub(super) fn exposure(&self) -> Option<&Exposure> {
        self.density.exposure.as_ref().filter(|_| matches!(self.options.headways, SampleHeadways::Sampled))
    }

    /// The job of the estimator.
    ///
    /// # Errors
    /// [`Error::Internal`] before the search of importance sampling.
    pub fn job(&self) -> Result<SampleJob<'_>> {
        match &self.kind {
            SampleKind::Crude(plan) => Ok(SampleJob::Crude(CrudeJob { sample: self, plan })),
            SampleKind::Weighted(weighted) => Ok(SampleJob::Weighted(WeightedJob { sample: self, weighted })),
            SampleKind::Search(_) => Err(Error::Internal("a run without a proposal is no job yet".to_owned())),
        }
    }

    /// Runs in one piece, in memory; searches a proposal first if it needs one.
    ///
    /// # Errors
    /// Those of the lanes.
    pub fn run(&self, executor: &Executor) -> Result<SampleResult> {
        let SampleKind::Search(search) = &self.kind else { return with_job!(self, job => job.run(executor)) };
        let kind = SampleKind::Weighted(Box::new(self.search(search, executor)?));
        let (density, profile) = (self.density.clone(), self.profile.clone());
        Sample { density, profile, options: self.options.clone(), kind }.run(executor)
    }

    /// As [`Job::run_shard`].
    ///
    /// # Errors
    /// As [`Job::run_shard`]; [`Error::Internal`] before the search of importance sampling.
    pub fn run_shard(&self, out: &Path, shard: Shard, executor: &Executor) -> Result<()> {
        with_job!(self, job => job.run_shard(out, shard, executor))
    }

    /// Writes the plan file into a run's folder, or checks that the same one exists; many shards may do so at once.
    ///
    /// # Errors
    /// As [`Job::write_plan`]; [`Error::Internal`] before the search of importance sampling.
    pub fn write_plan(&self, out: &Path) -> Result<()> {
        with_job!(self, job => job.write_plan(out))
    }

    /// The run and the estimates of a folder of parts, bit for bit equal to those of the run in one piece. `again` returns
    /// the command that makes a shard.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] with the missing, duplicate, foreign or damaged parts.
    pub fn merge_parts(out: &Path, again: &dyn Fn(Shard) -> String) -> Result<(Sample, SampleResult)> {
        let sample = Sample::read(&out.join(PLAN_FILE))?;
        let result = with_job!(sample, job => job.merge(out, again))?;
        Ok((sample, result))
    }

    fn leave_plan(&self, out: &Path) -> Result<()> {
        let text = self.plan_file()?.0;
        leave_plan(out, &text, |file| file.write_all(&text))
    }
}

impl Job for CrudeJob<'_> {
    type Counts = SampleTally;
    type Result = SampleResult;
    const RECORD: &'static str = ESTIMATE_RECORD;

    fn unit_count(&self) -> u64 {
        self.plan.unit_count()
    }

    fn run_sha256(&self, _is_part: bool) -> Result<String> {
        Ok(self.sample.plan_file()?.1)
    }

    fn write_plan(&self, out: &Path) -> Result<()> {
        self.sample.leave_plan(out)
    }

    fn cuts(&self) -> Vec<u64> {
        checkpoints(self.unit_count())
    }

    fn compute(
        &self,
        ledger: &mut Ledger<SampleTally>,
        executor: &Executor,
        each: Option<&mut EachChunk>,
    ) -> Result<Computed> {
        let (options, exposure) = (&self.sample.options, self.sample.exposure());
        sample_into(self.plan, ledger, executor, options, exposure, each)
    }

    fn result(&self, counts: Vec<SampleTally>, computed: Computed, place: Place) -> Result<SampleResult> {
        let (options, exposure) = (&self.sample.options, self.sample.exposure());
        let run = crude_of_segments(self.plan, counts, options, exposure)?;
        if options.stop.is_fixed() && run.tally.samples() != self.unit_count() {
            let problem = "the parts do not hold every sample that their names stand for";
            return Err(Error::input(place, problem, "make them again"));
        }
        self.sample.against_recorded(SampleResult {
            rows: crude_rows(self.plan, &run.tally, options, exposure, computed.stopped),
            rechecked_lanes: computed.summary.rechecked_lanes,
            parts: computed.parts,
            crude: Some(run),
            ..SampleResult::default()
        })
    }
}

impl Job for WeightedJob<'_> {
    type Counts = WeightedTally;
    type Result = SampleResult;
    const RECORD: &'static str = ESTIMATE_RECORD;

    fn unit_count(&self) -> u64 {
        self.sample.samples()
    }

    fn run_sha256(&self, _is_part: bool) -> Result<String> {
        Ok(self.sample.plan_file()?.1)
    }

    fn write_plan(&self, out: &Path) -> Result<()> {
        self.sample.leave_plan(out)
    }

    fn compute(
        &self,
        ledger: &mut Ledger<WeightedTally>,
        executor: &Executor,
        _each: Option<&mut EachChunk>,
    ) -> Result<Computed> {
        self.sample.sample_weighted(self.weighted, ledger, executor)?;
        Ok(Computed::whole(SweepSummary::default()))
    }

    /// The journal depends on the file of the search and is deleted next; without the file the next run's search gives the
    /// same bits.
    fn tidy(&self, out: &Path) -> Result<()> {
        if self.weighted.search.is_some() { remove_file(&out.join(SEARCH_FILE)) } else { Ok(()) }
    }

    fn result(&self, counts: Vec<WeightedTally>, computed: Computed, place: Place) -> Result<SampleResult> {
        let mut counts = counts.into_iter();
        let first = counts.next();
        let tally = first.map(|first| counts.try_fold(first, WeightedTally::join)).transpose()?;
        let result = self.sample.weighted_result(self.weighted, tally, place)?;
        self.sample.against_recorded(SampleResult { parts: computed.parts, ..result })
    }
}
