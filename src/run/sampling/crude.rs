//! Crude Monte Carlo: sampled lanes on a backend, counted chunk by chunk. Memory does not grow with the number of
//! samples.

use std::time::Instant;

use serde::Serialize;

use super::Sample;
use super::estimate_rows::{EstimateRow, crude_rows};
use super::sample_run::SampleCounts;
use crate::parts::{Computed, EachChunk, Ledger};
use lanesweep_engine::{Executor, LanePlan, SampleTally, SweepSummary, Wanted};
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_stats::estimate::{StopReason, StopRule, next_checkpoint};
use lanesweep_support::{Error, Place, Result, option};

/// Estimates after a number of samples.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Checkpoint {
    /// Number of samples, including void ones.
    pub samples: u64,
    /// One per model and criterion: probability and interval. Over all headways if there are several.
    pub rows: Vec<CheckpointRow>,
}

/// One estimate at a checkpoint.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CheckpointRow {
    /// Driver model.
    pub model: ModelId,
    /// Criterion.
    pub criterion: Criterion,
    /// Estimate.
    pub probability: f64,
    /// Ends of the interval of the draws alone; more samples narrow it.
    pub interval: [f64; 2],
    /// Ends of the interval that includes the uncertainty of the data, and the effective number of failing scenarios.
    /// `None` if draws do not come from scenarios.
    pub with_data: Option<([f64; 2], f64)>,
}

/// Result of a run of crude Monte Carlo.
#[derive(Debug, Clone)]
pub struct CrudeRun {
    /// The counts.
    pub tally: SampleTally,
    /// Estimates at the checkpoints.
    pub convergence: Vec<Checkpoint>,
}

/// The sample sizes at which a run of `samples` samples is evaluated, and at which its counts are cut.
pub(super) fn checkpoints(samples: u64) -> Vec<u64> {
    let next = |at: &u64| Some(next_checkpoint(*at));
    std::iter::successors(next(&0), next).take_while(|at| *at < samples).chain([samples]).collect()
}

/// Samples the units that the ledger does not hold; its cuts must be the [`checkpoints`]. The stop rules are evaluated there.
/// `each` receives every chunk with its outcomes; without it, a device counts lanes where they are.
///
/// # Errors
/// [`Error::Usage`] for stop rules with a part of the samples; those of the backends, of `each` and of the ledger's journal;
/// [`Error::Interrupted`].
pub(super) fn sample_into(
    sample: &Sample,
    plan: &LanePlan,
    ledger: &mut Ledger<SampleCounts>,
    executor: &Executor,
    mut each: Option<&mut EachChunk>,
) -> Result<Computed> {
    let (started, options) = (Instant::now(), &sample.options);
    let range = ledger.units();
    if range.is_empty() {
        return Ok(Computed::whole(SweepSummary::default()));
    }
    let is_whole = range == (0..plan.unit_count());
    if !is_whole && !options.stop.is_fixed() {
        let problem = "a part of a run cannot tell when the whole is good enough";
        return Err(Error::usage(
            Place::option("shard"),
            problem,
            format!("leave the stop rules out, or {}", option("shard")),
        ));
    }
    let wanted = if each.is_some() { Wanted::Outcomes } else { Wanted::Counts };
    let mut tally = SampleTally::empty(plan);
    let mut summary = SweepSummary { device_s: Some(0.0), ..SweepSummary::default() };
    let looks = checkpoints(plan.unit_count());
    let mut at = range.start;
    loop {
        let look = looks[looks.partition_point(|look| *look <= at).min(looks.len() - 1)];
        let next = if is_whole { look } else { range.end };
        for missing in ledger.missing(at..next)? {
            // The first chunk of a sweep is a short one.
            let mut is_checked = executor.recheck.is_none();
            let part = executor.sweep(plan, missing, wanted, |chunk| {
                if !std::mem::replace(&mut is_checked, true) {
                    SampleTally::check_counted(plan, &chunk, &executor.backend.describe())?;
                }
                each.as_mut().map_or(Ok(()), |each| each(plan, &chunk))?;
                ledger.add(SampleCounts::Crude(SampleTally::of_chunk(plan, &chunk)?), chunk.redone_and_rechecked)
            });
            summary.add(&ledger.kept(part)?);
        }
        ledger.kept(executor.check_cancelled(next - range.start, range.end - range.start))?;
        // Rechecks of earlier processes are recorded in the journal.
        [summary.redone_lanes, summary.rechecked_lanes] = ledger.redone_and_rechecked();
        let before = std::mem::replace(&mut at, next);
        let reason = match options.stop.is_fixed() {
            true => (at >= range.end).then_some(StopReason::Samples),
            false => {
                let found = ledger.counts(before..at)?.and_then(SampleCounts::crude);
                tally = found.into_iter().try_fold(tally, SampleTally::merge)?;
                let rows = crude_rows(sample, plan, &tally, StopReason::Samples);
                // The widest of the criterion's intervals over all models decides. More samples reduce the uncertainty of the
                // draws, never that of the data.
                let judged = rows.iter().filter(|row| row.criterion == options.criterion && row.is_overall(&rows));
                let widest = judged.max_by(|a, b| a.draws_half_width().total_cmp(&b.draws_half_width()));
                let rule = StopRule { samples: range.end, ..options.stop };
                widest.and_then(|row| rule.at(at, row.estimate.failures, row.draws_half_width(), started))
            }
        };
        if let Some(stopped) = reason {
            return Ok(Computed { stopped, ..Computed::whole(summary) });
        }
    }
}

/// The run whose counts these are. Its convergence equals that of the run in one piece if all parts are given.
///
/// # Errors
/// [`Error::Input`] if parts are of different runs or contain the same samples.
pub(super) fn crude_of_segments(sample: &Sample, plan: &LanePlan, mut segments: Vec<SampleTally>) -> Result<CrudeRun> {
    segments.sort_by_key(|segment| segment.covered().first().map_or(0, |range| range.start));
    let looks = checkpoints(plan.unit_count());
    let mut tally = SampleTally::empty(plan);
    let mut convergence = Vec::new();
    for segment in segments {
        tally = tally.merge(segment)?;
        // Checkpoints are evaluated only on samples from the first one on without a gap.
        if let [covered] = tally.covered()
            && covered.start == 0
            && looks.contains(&covered.end)
        {
            let rows = overall(&crude_rows(sample, plan, &tally, StopReason::Samples));
            convergence.push(Checkpoint { samples: covered.end, rows });
        }
    }
    Ok(CrudeRun { tally, convergence })
}

/// The rows over all headways.
fn overall(rows: &[EstimateRow]) -> Vec<CheckpointRow> {
    let of = |row: &EstimateRow| CheckpointRow {
        model: row.model,
        criterion: row.criterion,
        probability: row.estimate.probability,
        interval: row.draws,
        with_data: row.failing_scenarios.map(|n| ([row.estimate.interval.low, row.estimate.interval.high], n)),
    };
    rows.iter().filter(|row| row.is_overall(rows)).map(of).collect()
}
