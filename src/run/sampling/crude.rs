//! Crude Monte Carlo: sampled lanes on a backend, counted chunk by chunk. Memory does not grow with the number of
//! samples.

use std::time::Instant;

use super::Sample;
use super::estimate_rows::crude_rows;
use super::sample_run::SampleCounts;
use crate::parts::{Computed, EachChunk, Job, Ledger};
use lanesweep_engine::{Executor, LanePlan, SampleTally, SweepSummary, Wanted};
use lanesweep_stats::estimate::{StopReason, StopRule};
use lanesweep_support::{Error, Place, Result, option};

/// Samples the units that the ledger does not hold; its cuts must be those of the run. The stop rules are evaluated there.
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
    let looks = sample.cuts();
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
