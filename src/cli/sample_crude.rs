//! `lanesweep sample` with crude Monte Carlo: in one piece, as a shard, from a plan, and merged.

use std::path::Path;
use std::time::Instant;

use super::Exit;
use super::backend_flags::Opened;
use super::console::{self, Verbosity};
use super::dry_run::{self, BUDGET, DryRun};
use super::format::FormatFlag;
use super::merge::command;
use super::sample::Sample;
use super::sample_lanes;
use super::sample_plan::PlannedSample;
use crate::engine::{Outcome, Wanted, forecast};
use crate::report::sampling::{DrawRecord, EstimateFile, HostRecord};
use crate::run::parts::{PLAN_FILE, RunDir, leave_plan, read_parts};
use crate::run::sampling::{
    BootstrapRecord, CrudeRun, SampleTally, bootstrap, checkpoints, conditional, crude_of_segments,
};
use crate::stats::estimate::StopRule;
use crate::support::atomic_file::StagedFile;
use crate::support::interrupt;
use crate::support::readable::count;
use crate::support::run_dir::{ESTIMATE_RECORD, Results, RunFolder};
use crate::{Error, Place, Result};

/// A condition that so few scenarios are near is outside the data.
const FEW_SCENARIOS: f64 = 5.0;

/// Memory of the counts of every checkpoint and of the figures, bytes, measured.
const BYTES_OF_COUNTS: u64 = 6 << 20;

/// Samples what was planned: the whole run, or a shard of it.
pub(super) fn run(
    flags: &Sample,
    planned: &PlannedSample,
    opened: &Opened,
    stop: StopRule,
    started: Instant,
    verbosity: Verbosity,
) -> Result<Exit> {
    let (plan, out, shard) = (&planned.plan, &flags.out, flags.shards.shard);
    if flags.dry_run {
        return forecast_crude(planned, opened, &stop, flags.format);
    }
    let (text, run_sha256) = planned.seal()?;
    if flags.shards.plan_only || shard.is_some() {
        leave_plan(out, &text, std::io::empty())?;
    }
    if flags.shards.plan_only {
        let path = out.join(PLAN_FILE);
        flags.format.print_plan(plan.lane_count(), &path)?;
        return Ok(Exit::Ok);
    }
    if planned.facts.sobol {
        tracing::warn!("Sobol points: the intervals are those of independent draws, and wider than need be");
    }
    if !planned.facts.given.is_empty() {
        let left = conditional(&planned.density, &planned.facts.given)?.effective_scenarios;
        let of = planned.density.kde.points().len();
        if left < FEW_SCENARIOS {
            tracing::warn!(
                "only {left:.1} of {of} scenarios are near the given values: what follows is the kernels', not data"
            );
        } else {
            tracing::info!("{left:.1} of {of} scenarios are near the given values");
        }
    }
    let run_dir =
        RunDir { out: out.clone(), record: ESTIMATE_RECORD, run_sha256, shard, unit_count: plan.unit_count() };
    if run_dir.is_done::<SampleTally>()? {
        tracing::info!("this part is there already, and whole");
        return Ok(Exit::Ok);
    }
    // Rows are written on the way: a run that writes them begins anew.
    let is_journalled = flags.rows.is_none();
    let mut work = run_dir.begin::<SampleTally>(&checkpoints(plan.unit_count()), is_journalled)?;
    let executor = opened.executor().with_recheck(planned.facts.seed);
    let counting = planned.counting();
    tracing::info!("{} samples on {}", count(work.units.end - work.units.start), executor.backend.describe());
    if work.units.is_empty() {
        run_dir.finish(work, [0, 0])?;
        return Ok(Exit::Ok);
    }
    let rows = flags.rows.as_deref().map(|path| (path, &planned.density));
    let (crude, rows) = {
        let _resumable = is_journalled.then(interrupt::resumable);
        sample_lanes::run(plan, &mut work.ledger, &executor, &counting, &planned.options(stop), rows, verbosity)?
    };
    if shard.is_some() {
        rows.map_or(Ok(()), StagedFile::publish)?;
        run_dir.finish(work, [crude.summary.redone_lanes, crude.summary.rechecked_lanes])?;
        return Ok(Exit::Ok);
    }
    let record = (flags.bootstrap > 0)
        .then(|| {
            let bar = console::progress(verbosity, flags.bootstrap.into(), "resampling");
            let record = bootstrap(
                &planned.density,
                &planned.facts.profile,
                &planned.facts.plan_options(),
                &executor,
                flags.bootstrap,
                flags.bootstrap_samples,
                || bar.inc(1),
            );
            bar.finish_and_clear();
            record
        })
        .transpose()?;
    let host = opened.host(crude.summary.rechecked_lanes, started);
    let mut results = work.folder.results()?;
    rows.into_iter().for_each(|table| results.join(table));
    write_run(planned, crude, record, host, results, flags.format)?;
    work.forget()?;
    Ok(Exit::Ok)
}

/// What the run would be.
fn forecast_crude(planned: &PlannedSample, opened: &Opened, stop: &StopRule, format: FormatFlag) -> Result<Exit> {
    let (plan, counting) = (&planned.plan, planned.counting());
    let wanted = if counting.worst > 0 { Wanted::Outcomes } else { Wanted::Verdicts };
    let forecast = forecast(plan, opened.backend(), wanted, BUDGET, |chunk| {
        SampleTally::of_chunk(plan, &chunk, &counting).map(drop)
    })?;
    let bytes_of_lane = if counting.worst > 0 { size_of::<Outcome<f64>>() as u64 } else { 1 };
    DryRun {
        data: planned.density.provenance.data.clone(),
        parts: dry_run::parts(plan),
        units: "samples",
        is_at_most: stop.relative_half_width.is_some() || stop.time_limit.is_some(),
        more_bytes: BYTES_OF_COUNTS + forecast.lanes_at_once * bytes_of_lane,
        more: "lanes at once, counts and figures, however many samples",
        forecast: Some(forecast),
        backend: opened.backend().describe(),
        before: None,
        besides: "figures; --bootstrap and --rows",
    }
    .print(format)?;
    Ok(Exit::Ok)
}

/// Makes the result of the parts in a folder.
pub(super) fn merge(folder: &RunFolder, plan: &Path, format: FormatFlag) -> Result<Exit> {
    let dir = folder.dir();
    let (planned, run_sha256) = PlannedSample::read(plan)?;
    let parts = read_parts::<SampleTally>(dir, &run_sha256, planned.plan.unit_count(), &command(dir, "sample"))?;
    let rechecked = parts.iter().map(|part| part.lanes_redone_and_rechecked[1]).sum();
    let host = HostRecord::of_parts(parts.len(), rechecked);
    let segments: Vec<SampleTally> = parts.into_iter().flat_map(|part| part.segments).collect();
    let options = planned.options(StopRule::samples(planned.facts.samples));
    let crude = crude_of_segments(&planned.plan, segments, &planned.counting(), &options)?;
    if crude.tally.samples() != planned.plan.unit_count() {
        let problem = "the parts do not hold every sample that their names stand for";
        return Err(Error::input(Place::file(dir), problem, "make them again"));
    }
    write_run(&planned, crude, None, host, folder.results()?, format)?;
    Ok(Exit::Ok)
}

/// Tables, figures, the record.
fn write_run(
    planned: &PlannedSample,
    crude: CrudeRun,
    bootstrap: Option<BootstrapRecord>,
    host: HostRecord,
    mut results: Results,
    format: FormatFlag,
) -> Result<()> {
    let out = results.dir().to_path_buf();
    let figures = sample_lanes::write(&mut results, &planned.plan, &planned.density, &crude, &planned.counting())?;
    let mut file = EstimateFile::new(&planned.density, planned.run_facts(), crude.rows, host)?;
    file.plan_sha256 = Some(planned.plan.hash().to_owned());
    file.draws = Some(DrawRecord::of(&crude.tally, &planned.plan));
    file.bootstrap = bootstrap;
    sample_lanes::write_estimates(results, &planned.density, &mut file, figures)?;
    format.print(|| file.text(), || file.json())?;
    tracing::info!("results written to {}", out.display());
    Ok(())
}
