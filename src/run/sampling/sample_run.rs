//! A sampling run as a job.

use std::ops::Range;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::crude::sample_into;
use super::estimate_rows::crude_rows;
use super::plan_file::SEARCH_FILE;
use super::result::SampleResult;
use super::weighted::WeightedTally;
use super::{Sample, SampleHeadways, SampleKind};
use crate::parts::{Computed, EachChunk, Job, Ledger, MergeableCounts, PLAN_FILE, Shard, leave_plan};
use lanesweep_engine::{Executor, SampleTally, SweepSummary};
use lanesweep_stats::density::Exposure;
use lanesweep_support::files::remove_file;
use lanesweep_support::{Error, Place, Result};

/// Samples at the first checkpoint of crude Monte Carlo; each further one has twice as many. Few evaluations, so repeated testing
/// affects the interval of a stop rule little, and neither the speed of a machine nor its number of threads changes the end.
const FIRST_CRUDE: u64 = 4096;
/// Draws of a proposal at the first checkpoint of importance sampling, which stops at none.
const FIRST_WEIGHTED: u64 = 64;

/// Record of a sampling run.
pub const ESTIMATE_RECORD: &str = "estimate.json";

/// Counts of some samples, by the estimator.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SampleCounts {
    /// Of crude Monte Carlo.
    Crude(SampleTally),
    /// Of importance sampling.
    Weighted(WeightedTally),
}

impl SampleCounts {
    /// Counts of crude Monte Carlo.
    pub(super) fn crude(self) -> Option<SampleTally> {
        match self {
            SampleCounts::Crude(tally) => Some(tally),
            SampleCounts::Weighted(_) => None,
        }
    }
}

impl MergeableCounts for SampleCounts {
    fn covered(&self) -> Vec<Range<u64>> {
        match self {
            SampleCounts::Crude(tally) => tally.covered().to_vec(),
            SampleCounts::Weighted(tally) => tally.covered(),
        }
    }

    fn join(self, other: Self) -> Result<Self> {
        match (self, other) {
            (SampleCounts::Crude(tally), SampleCounts::Crude(other)) => tally.merge(other).map(SampleCounts::Crude),
            (SampleCounts::Weighted(tally), SampleCounts::Weighted(other)) => {
                tally.join(other).map(SampleCounts::Weighted)
            }
            _ => Err(Error::Internal("counts of two estimators".to_owned())),
        }
    }
}

impl Sample {
    /// The exposure, if the density draws the headway: lanes that begin at imposed headways have no rate per hour.
    pub(super) fn exposure(&self) -> Option<&Exposure> {
        self.density.exposure.as_ref().filter(|_| matches!(self.options.headways, SampleHeadways::Sampled))
    }

    /// Runs in one piece, in memory; searches a proposal first if it needs one.
    ///
    /// # Errors
    /// Those of the lanes.
    pub fn run(&self, executor: &Executor) -> Result<SampleResult> {
        let SampleKind::Search(search) = &self.kind else { return Job::run(self, executor) };
        let kind = SampleKind::Weighted(Box::new(self.search(search, executor)?));
        let (density, profile) = (self.density.clone(), self.profile.clone());
        Job::run(&Sample { density, profile, options: self.options.clone(), kind }, executor)
    }

    /// The run and the estimates of a folder of parts, bit for bit equal to those of the run in one piece. `again` returns
    /// the command that makes a shard.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] with the missing, duplicate, foreign or damaged parts.
    pub fn merge_parts(out: &Path, again: &dyn Fn(Shard) -> String) -> Result<(Sample, SampleResult)> {
        let sample = Sample::read(&out.join(PLAN_FILE))?;
        let result = sample.merge(out, again)?;
        Ok((sample, result))
    }
}

/// The error of a run of importance sampling before its search.
fn not_searched() -> Error {
    Error::Internal("a run without a proposal is no job yet".to_owned())
}

impl Job for Sample {
    type Counts = SampleCounts;
    type Result = SampleResult;
    const RECORD: &'static str = ESTIMATE_RECORD;

    fn unit_count(&self) -> u64 {
        self.samples()
    }

    fn run_sha256(&self, _is_part: bool) -> Result<String> {
        Ok(self.plan_file()?.1)
    }

    fn write_plan(&self, out: &Path) -> Result<()> {
        if matches!(self.kind, SampleKind::Search(_)) {
            return Err(not_searched());
        }
        let text = self.plan_file()?.0;
        leave_plan(out, &text, |file| file.write_all(&text))
    }

    fn cuts(&self) -> Vec<u64> {
        let first = if matches!(self.kind, SampleKind::Crude(_)) { FIRST_CRUDE } else { FIRST_WEIGHTED };
        let doubled = std::iter::successors(Some(first), |at| at.checked_mul(2));
        doubled.take_while(|at| *at < self.samples()).chain([self.samples()]).collect()
    }

    fn compute(
        &self,
        ledger: &mut Ledger<SampleCounts>,
        executor: &Executor,
        each: Option<&mut EachChunk>,
    ) -> Result<Computed> {
        match &self.kind {
            SampleKind::Crude(plan) => sample_into(self, plan, ledger, executor, each),
            SampleKind::Weighted(weighted) => {
                self.sample_weighted(weighted, ledger, executor)?;
                Ok(Computed::whole(SweepSummary::default()))
            }
            SampleKind::Search(_) => Err(not_searched()),
        }
    }

    /// The journal depends on the file of the search and is deleted next; without the file the next run's search gives the
    /// same bits.
    fn tidy(&self, out: &Path) -> Result<()> {
        match &self.kind {
            SampleKind::Weighted(weighted) if weighted.search.is_some() => remove_file(&out.join(SEARCH_FILE)),
            _ => Ok(()),
        }
    }

    fn result(&self, counts: Vec<SampleCounts>, computed: Computed, place: Place) -> Result<SampleResult> {
        let (counts, convergence) = self.converged(counts)?;
        let result = match &self.kind {
            SampleKind::Crude(plan) => {
                let tally = counts.and_then(SampleCounts::crude).unwrap_or_else(|| SampleTally::empty(plan));
                if self.options.stop.is_fixed() && tally.samples() != self.unit_count() {
                    let problem = "the parts do not hold every sample that their names stand for";
                    return Err(Error::input(place, problem, "make them again"));
                }
                let rows = crude_rows(self, plan, &tally, computed.stopped);
                let rechecked_lanes = computed.summary.rechecked_lanes;
                SampleResult { rows, rechecked_lanes, crude: Some(tally), ..SampleResult::default() }
            }
            SampleKind::Weighted(weighted) => self.weighted_result(weighted, counts, place)?,
            SampleKind::Search(_) => return Err(not_searched()),
        };
        self.against_recorded(SampleResult { parts: computed.parts, convergence, ..result })
    }
}
