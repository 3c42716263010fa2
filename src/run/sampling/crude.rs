//! Crude Monte Carlo: sampled lanes on a backend, counted chunk by chunk. Memory does not grow with the number of
//! samples. After the first samples, values are computed only for lanes that may still be among the worst.

use std::ops::Range;
use std::sync::Arc;
use std::time::Instant;

use serde::Serialize;

use super::estimate_rows::{EstimateRow, crude_rows};
use super::limit_state::marks_of;
use super::sample_options::{SampleHeadways, SampleOptions};
use super::tally::SampleTally;
use crate::engine::{Executor, LanePlan, SweepSummary, Wanted, Watch};
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::run::parts::{Computed, EachChunk, Ledger};
use crate::stats::density::Exposure;
use crate::stats::estimate::{Checkpoints, StopReason, StopRule};
use crate::{Error, Place, Result};

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
    /// The estimates.
    pub rows: Vec<EstimateRow>,
    /// Estimates at the checkpoints; empty for a range that does not begin at 0.
    pub convergence: Vec<Checkpoint>,
    /// How the sweep went.
    pub summary: SweepSummary,
}

/// Samples `range` of a plan that generates its own cases; risks follow from the exposure. The stop rules are evaluated
/// after 4,096·2^k samples. `each` receives every chunk, not with every outcome; without it, a device counts lanes where they
/// are.
///
/// # Errors
/// [`Error::Usage`] for stop rules with a partial range, or for an end beyond the plan; those of the backends and of
/// `each`.
pub fn sample_crude(
    plan: &LanePlan,
    range: Range<u64>,
    executor: &Executor,
    options: &SampleOptions,
    exposure: Option<&Exposure>,
    each: Option<&mut EachChunk>,
) -> Result<CrudeRun> {
    let mut ledger = Ledger::new(range.clone(), &cuts(plan.unit_count(), &range));
    let each = each.map(|each| (false, each));
    let computed = sample_into(plan, &mut ledger, executor, options, exposure, each)?;
    crude_of_segments(plan, ledger.take()?, options, exposure, &computed)
}

/// The sample sizes at which a run of `samples` samples is evaluated.
pub(crate) fn checkpoints(samples: u64) -> Vec<u64> {
    let next = |at: &u64| Some(Checkpoints::Doubling.next(*at)).filter(|next| *next > *at);
    std::iter::successors(next(&0), next).take_while(|at| *at < samples).chain([samples]).collect()
}

/// Units at which the counts of an interval are cut: the checkpoints, and the samples at which the watch of lanes
/// changes.
pub fn cuts(samples: u64, range: &Range<u64>) -> Vec<u64> {
    checkpoints(samples).into_iter().chain(ends(range)).collect()
}

/// The same for samples that the ledger does not hold; its cuts must be those of [`cuts`]. `each` receives every chunk,
/// with the outcome of every lane if its flag is set.
///
/// # Errors
/// As [`sample_crude`], and those of the ledger's journal; [`Error::Interrupted`].
pub fn sample_into(
    plan: &LanePlan,
    ledger: &mut Ledger<SampleTally>,
    executor: &Executor,
    options: &SampleOptions,
    exposure: Option<&Exposure>,
    mut each: Option<(bool, &mut EachChunk)>,
) -> Result<Computed> {
    let started = Instant::now();
    let range = ledger.units();
    if range.start >= range.end || range.end > plan.unit_count() {
        let problem = format!("samples {}..{} are not among the run's {}", range.start, range.end, plan.unit_count());
        return Err(Error::usage(
            Place::option("shard"),
            problem,
            "give an interval that is not empty, counted from 0",
        ));
    }
    let is_whole = range == (0..plan.unit_count());
    if !is_whole && !options.stop.is_fixed() {
        let problem = "a part of a run cannot tell when the whole is good enough";
        return Err(Error::usage(Place::option("shard"), problem, "leave the stop rules out, or option `shard`"));
    }
    let counting = each.is_none().then(|| Arc::new(SampleTally::counting(plan, options)));
    let executor = &Executor { counting, ..executor.clone() };
    let mut tally = SampleTally::empty(plan, options);
    let mut summary = SweepSummary { device_s: Some(0.0), ..SweepSummary::default() };
    let looks = checkpoints(plan.unit_count());
    let mut at = range.start;
    loop {
        let look = looks[looks.partition_point(|look| *look <= at).min(looks.len() - 1)];
        let next = if is_whole { look } else { range.end };
        for missing in ledger.missing(at..next)? {
            let every_value = each.as_ref().is_some_and(|(every_value, _)| *every_value);
            let wanted = match (every_value, options.worst) {
                (true, _) => Wanted::Outcomes,
                // Contacts are too many to be computed one by one.
                _ if options.injury.is_some() => Wanted::Outcomes,
                (false, 0) => Wanted::Verdicts,
                (false, _) => {
                    // Whole segments only, so that a resumed run requests the same results in a segment as the first
                    // run.
                    let known = ledger.counts(range.start..ledger.segment_start(missing.start))?;
                    known.map_or(Wanted::Outcomes, |known| wanted(plan, &known, options))
                }
            };
            // The first chunk of a sweep is a short one.
            let mut is_checked = executor.recheck.is_none();
            let part = executor.sweep(plan, missing, wanted, |chunk| {
                if !std::mem::replace(&mut is_checked, true) {
                    SampleTally::check_counted(plan, &chunk, options, &executor.backend.describe())?;
                }
                each.as_mut().map_or(Ok(()), |(_, each)| each(plan, &chunk))?;
                ledger.add(SampleTally::of_chunk(plan, &chunk, options)?, chunk.redone_and_rechecked)
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
                tally = ledger.counts(before..at)?.into_iter().try_fold(tally, SampleTally::merge)?;
                let rows = rows_of(plan, &tally, options, exposure, StopReason::Samples);
                stopped(options, &rows, at, range.end, started)
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
pub(crate) fn crude_of_segments(
    plan: &LanePlan,
    mut segments: Vec<SampleTally>,
    options: &SampleOptions,
    exposure: Option<&Exposure>,
    computed: &Computed,
) -> Result<CrudeRun> {
    segments.sort_by_key(|segment| segment.covered().first().map_or(0, |range| range.start));
    let looks = checkpoints(plan.unit_count());
    let mut tally = SampleTally::empty(plan, options);
    let mut convergence = Vec::new();
    for segment in segments {
        tally = tally.merge(segment)?;
        // Checkpoints are evaluated only on samples from the first one on without a gap.
        if let [covered] = tally.covered()
            && covered.start == 0
            && looks.contains(&covered.end)
        {
            let rows = overall(&rows_of(plan, &tally, options, exposure, StopReason::Samples));
            convergence.push(Checkpoint { samples: covered.end, rows });
        }
    }
    let rows = rows_of(plan, &tally, options, exposure, computed.stopped);
    Ok(CrudeRun { tally, rows, convergence, summary: computed.summary })
}

fn rows_of(
    plan: &LanePlan,
    tally: &SampleTally,
    options: &SampleOptions,
    exposure: Option<&Exposure>,
    stopped: StopReason,
) -> Vec<EstimateRow> {
    let is_sampled_headway = options.headways == SampleHeadways::Sampled;
    crude_rows(plan, tally, exposure, is_sampled_headway, options.estimator.interval(), options.level, stopped)
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

/// The widest of the criterion's intervals over all models decides.
fn stopped(
    options: &SampleOptions,
    rows: &[EstimateRow],
    samples: u64,
    end: u64,
    started: Instant,
) -> Option<StopReason> {
    let judged = rows.iter().filter(|row| row.criterion == options.criterion && row.is_overall(rows));
    // More samples reduce the uncertainty of the draws, never that of the data.
    let widest = judged.max_by(|a, b| a.draws_half_width().total_cmp(&b.draws_half_width()))?;
    let rule = StopRule { samples: end, ..options.stop };
    rule.at(samples, widest.estimate.failures, widest.draws_half_width(), started)
}

/// Values of all lanes of the first samples are computed.
const FIRST_SAMPLES: u64 = 4096;
/// If more than one in this many lanes would be marked, all values are computed: recomputing a single lane costs about
/// forty times its verdicts.
const MARKED_ONE_IN: f64 = 1000.0;

/// Ends of pieces of an interval of samples. Each piece is as long as all earlier ones together, so that a list of
/// worst lanes finds as many new lanes in each piece.
fn ends(range: &Range<u64>) -> impl Iterator<Item = u64> {
    let (first, end) = (range.start, range.end);
    std::iter::successors(Some(FIRST_SAMPLES), |length| length.checked_mul(2))
        .map(move |length| first.saturating_add(length))
        .take_while(move |to| *to < end)
}

/// Results that lanes of further samples must return, so that the lists of worst lanes equal those from all values.
/// `options.worst` is at least 1, and the lanes of `tally` have smaller indices.
fn wanted(plan: &LanePlan, tally: &SampleTally, options: &SampleOptions) -> Wanted {
    let (mut watch, mut marked) = (Watch::NOTHING, 0.0);
    let lanes_per_model = (tally.valid() * plan.headways.len() as u64).max(1) as f64;
    for (at, model) in plan.models.iter().enumerate() {
        let last = tally.worst[at].get(options.worst - 1);
        let marks = last.and_then(|last| marks_of(&plan.profile, options.criterion, last.value));
        let Some((of_model, failures_of)) = marks else { return Wanted::Outcomes };
        watch.0[model.index()] = of_model;
        if let Some(criterion) = failures_of {
            let cells = tally.failures.chunks(Criterion::ALL.len()).skip(at).step_by(plan.models.len());
            let failures: u64 = cells.map(|cell| cell[criterion.index()]).sum();
            marked += failures as f64 / lanes_per_model / plan.models.len() as f64;
        }
    }
    if marked * MARKED_ONE_IN > 1.0 { Wanted::Outcomes } else { Wanted::Watched(watch) }
}
