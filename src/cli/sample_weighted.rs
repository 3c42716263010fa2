//! Importance sampling of one given proposal, or of those of a pilot: in one piece, as a shard, from a plan, and merged.

use std::path::Path;
use std::time::Instant;

use super::Exit;
use super::backend_flags::Opened;
use super::console::{self, Verbosity};
use super::dry_run::{BUDGET, DryRun, Part};
use super::format::FormatFlag;
use super::merge::command;
use super::sample::Sample;
use super::sample_lanes;
use super::weighted_plan::{PILOT_FILE, PlannedWeighted};
use crate::engine::{CpuBackend, Executor, Forecast, lanes_within_seconds};
use crate::model::driver::ModelId;
use crate::report::sampling::{EstimateFile, HostRecord};
use crate::run::parts::{Countable, Ledger, PLAN_FILE, RunDir, leave_plan, read_parts};
use crate::run::sampling::{EstimateRow, LaneLimitState, WeightedTally, proposal_text, scenario_shares, truncated};
use crate::stats::density::Mixture;
use crate::stats::estimate::{
    BlockSums, Defended, StopReason, WeightSums, defended, from_weight_sums, importance_sums,
};
use crate::support::interrupt;
use crate::support::readable::count;
use crate::support::run_dir::{ESTIMATE_RECORD, Results, RunFolder};
use crate::{Error, Place, Result};

/// Memory of a sample while it is judged (point, case, motion, outcome), bytes, measured.
const BYTES_PER_SAMPLE: u64 = 280;

/// Samples that are judged between two looks at the journal, at most.
const CHUNK: u64 = 1 << 16;

/// Kernels up to which weighing so many samples takes about a second.
const KERNELS: u64 = 1 << 10;

/// Samples between two looks at the journal and at a signal: so few that they take seconds, whatever a lane costs. A
/// power of two, as the sums' tree has it.
fn chunk_samples(step_cap: u32, models: u64, kernels: u64) -> u64 {
    let judged = lanes_within_seconds(step_cap) / models.max(1);
    let weighed = CHUNK / (kernels / KERNELS).max(1);
    1 << judged.min(weighed).clamp(1, CHUNK).ilog2()
}

/// Samples what was planned: the whole run, or a shard of it.
pub(super) fn run(
    flags: &Sample,
    planned: &PlannedWeighted,
    opened: &Opened,
    started: Instant,
    verbosity: Verbosity,
) -> Result<Exit> {
    let (samples, out, shard) = (planned.facts.samples, &flags.out, flags.shards.shard);
    if flags.dry_run {
        return forecast(planned, opened, flags.format);
    }
    let (text, run_sha256) = planned.seal()?;
    if flags.shards.plan_only || shard.is_some() {
        leave_plan(out, &text, std::io::empty())?;
    }
    if flags.shards.plan_only {
        let lanes = samples.saturating_mul(planned.facts.models.len() as u64);
        flags.format.print_plan(lanes, &out.join(PLAN_FILE))?;
        return Ok(Exit::Ok);
    }
    let run_dir = RunDir { out: out.clone(), record: ESTIMATE_RECORD, run_sha256, shard, unit_count: samples };
    if run_dir.is_done::<WeightedTally>()? {
        tracing::info!("this part is there already, and whole");
        return Ok(Exit::Ok);
    }
    let mut work = run_dir.begin::<WeightedTally>(&[], true)?;
    let left: u64 = work.ledger.missing(work.units.clone())?.iter().map(|range| range.end - range.start).sum();
    tracing::info!("{} samples on {}", count(left), opened.backend().describe());
    {
        let _resumable = interrupt::resumable();
        let bar = console::progress(verbosity, left, "sampling");
        let sampled = sample(planned, opened, &mut work.ledger, |samples| bar.inc(samples));
        bar.finish_and_clear();
        sampled?;
    }
    if shard.is_some() {
        run_dir.finish(work, [0, 0])?;
        return Ok(Exit::Ok);
    }
    let host = opened.host(0, started);
    let tally = work.ledger.counts(0..samples)?;
    write_run(planned, tally, host, work.folder.results()?, flags.format)?;
    if planned.facts.pilot.is_some() {
        // The journal that needs it goes next; without it the next run's pilot has the same bits.
        let path = out.join(PILOT_FILE);
        match std::fs::remove_file(&path) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => return Err(Error::io(&path, "remove", e)),
            _ => {}
        }
    }
    work.forget()?;
    Ok(Exit::Ok)
}

impl PlannedWeighted {
    fn chunk_samples(&self) -> u64 {
        let facts = &self.facts;
        let kernels = self.density.kde.points().len();
        chunk_samples(facts.profile.step_cap(), facts.models.len() as u64, kernels as u64)
    }
}

/// What the run would be: drawing and weighing cost more than the lanes, so all of it is measured.
fn forecast(planned: &PlannedWeighted, opened: &Opened, format: FormatFlag) -> Result<Exit> {
    let (facts, density) = (&planned.facts, &planned.density);
    let most = facts.samples.min(planned.chunk_samples());
    let (mut samples, mut took) = (most.min(256), 0.0);
    loop {
        let started = Instant::now();
        sample(planned, opened, &mut Ledger::new(0..samples, &[]), |_| ())?;
        let last = std::mem::replace(&mut took, started.elapsed().as_secs_f64());
        if samples >= most || took + last >= BUDGET.as_secs_f64() / 2.0 {
            break;
        }
        samples = (2 * samples).min(most);
    }
    let models = facts.models.len() as u64;
    let lanes = facts.samples.saturating_mul(models);
    let seconds = took / samples as f64 * facts.samples as f64;
    let part = |model: &ModelId| Part {
        of: model.name().to_owned(),
        what: format!("headway {}", planned.headway_name()),
        units: facts.samples,
        lanes: facts.samples,
    };
    DryRun {
        data: density.provenance.data.clone(),
        parts: facts.models.iter().map(part).collect(),
        units: "samples",
        is_at_most: false,
        more_bytes: most * BYTES_PER_SAMPLE,
        more: "the samples that are judged at once",
        forecast: Some(Forecast { lanes, seconds, measured_lanes: samples * models, lanes_at_once: most }),
        backend: opened.backend().describe(),
        before: None,
        besides: "",
    }
    .print(format)?;
    Ok(Exit::Ok)
}

/// Draws, judges and weighs what the ledger does not hold yet.
fn sample(
    planned: &PlannedWeighted,
    opened: &Opened,
    ledger: &mut Ledger<WeightedTally>,
    each: impl Fn(u64),
) -> Result<()> {
    let (facts, density) = (&planned.facts, &planned.density);
    let nominal = truncated(density)?;
    let prepared = |proposal: &Mixture| defended(proposal.clone(), &nominal, facts.defence);
    let proposals: Vec<Defended> = planned.proposals.iter().map(prepared).collect::<Result<_>>()?;
    let lanes_of = |model: ModelId| LaneLimitState {
        density,
        profile: &facts.profile,
        model,
        criterion: facts.criterion,
        headway: planned.headways(),
        executor: opened.executor(),
    };
    let (units, chunk) = (ledger.units(), planned.chunk_samples());
    for missing in ledger.missing(units)? {
        let mut at = missing.start;
        while at < missing.end {
            let next = (at / chunk + 1).saturating_mul(chunk).min(missing.end);
            // One proposal serves all models, or each has its own.
            let sums_of = |(&model, proposal): (&ModelId, &Defended)| {
                Ok((model, importance_sums(&nominal, proposal, &lanes_of(model), facts.seed, at..next)?))
            };
            let pairs = facts.models.iter().zip(proposals.iter().cycle());
            ledger.add(WeightedTally { sums: pairs.map(sums_of).collect::<Result<_>>()? })?;
            each(next - at);
            at = next;
        }
    }
    Ok(())
}

/// Makes the result of the parts in a folder.
pub(super) fn merge(folder: &RunFolder, plan: &Path, format: FormatFlag) -> Result<Exit> {
    let dir = folder.dir();
    let (planned, run_sha256) = PlannedWeighted::read(plan)?;
    let parts = read_parts::<WeightedTally>(dir, &run_sha256, planned.facts.samples, &command(dir, "sample"))?;
    let host = HostRecord::of_parts(parts.len(), 0);
    let mut segments = parts.into_iter().flat_map(|part| part.segments);
    let first = segments.next();
    let tally = first.map(|first| segments.try_fold(first, WeightedTally::join)).transpose()?;
    write_run(&planned, tally, host, folder.results()?, format)?;
    Ok(Exit::Ok)
}

/// Table, density, the record.
fn write_run(
    planned: &PlannedWeighted,
    tally: Option<WeightedTally>,
    host: HostRecord,
    mut results: Results,
    format: FormatFlag,
) -> Result<()> {
    let out = results.dir().to_path_buf();
    let (facts, density) = (&planned.facts, &planned.density);
    let tally = tally.filter(|tally| {
        let models: Vec<ModelId> = tally.sums.iter().map(|(model, _)| *model).collect();
        tally.covered().as_slice() == std::slice::from_ref(&(0..facts.samples)) && models == facts.models
    });
    let Some(tally) = tally else {
        let problem = "the parts do not hold every sample of every driver model";
        return Err(Error::input(Place::file(out), problem, "make them again"));
    };
    let (cpu, exposure) = (CpuBackend::lane_arithmetic(), density.exposure.as_ref());
    let row = |(at, (model, sums)): (usize, &(ModelId, BlockSums<WeightSums>))| {
        let total = sums.total().unwrap_or_default();
        let mut estimate = from_weight_sums(&total, false, facts.level, StopReason::Samples);
        facts.pilots.get(at).into_iter().for_each(|pilot| pilot.add_to(&mut estimate));
        let row = EstimateRow::of_draws(*model, facts.criterion, planned.headway_name(), estimate, exposure);
        // A few lanes more, on the CPU: a merge has no other backend, and all have the same bits.
        let lanes = LaneLimitState {
            density,
            profile: &facts.profile,
            model: *model,
            criterion: facts.criterion,
            headway: planned.headways(),
            executor: Executor::new(&cpu),
        };
        let proposal = &planned.proposals[at % planned.proposals.len()];
        let shares = scenario_shares(&lanes, proposal, facts.defence, facts.seed)?;
        Ok(row.with_data(shares.as_ref(), exposure))
    };
    let rows = tally.sums.iter().enumerate().map(row).collect::<Result<_>>()?;
    let mut file = EstimateFile::new(density, planned.run_facts(), rows, host)?;
    if facts.pilot.is_none() {
        // A proposal in this folder may be the one that was given.
        results.keep(|name| name.starts_with("proposal-"));
    }
    for (model, proposal) in facts.models.iter().zip(&planned.proposals).filter(|_| facts.pilot.is_some()) {
        results.add(&format!("proposal-{}.json", model.name()), proposal_text(density, proposal)?.as_bytes())?;
    }
    sample_lanes::write_estimates(results, density, &mut file, Vec::new())?;
    format.print(|| file.text(), || file.json())?;
    tracing::info!("results written to {}", out.display());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A look at the signal comes after a bounded number of lane-steps and of weighed kernels, whatever the time step.
    #[test]
    fn a_chunk_is_bounded_by_its_work() {
        for step_cap in [1, 349, 3000, 120_000, 1_200_000, 4_000_000] {
            for (models, kernels) in [(1, 10), (4, 300), (4, 1_000_000)] {
                let samples = chunk_samples(step_cap, models, kernels);
                let lanes = lanes_within_seconds(step_cap);
                assert!(samples.is_power_of_two() && (samples * models <= lanes || samples == 1), "{samples}");
                assert!(samples * kernels <= CHUNK * 2 * KERNELS, "{samples}");
            }
        }
    }
}
