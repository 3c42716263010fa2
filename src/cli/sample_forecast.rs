//! `lanesweep sample --dry-run`: what a run would be.

use std::time::Instant;

use super::Exit;
use super::dry_run::{self, BUDGET, DryRun, ForecastPart};
use super::format::FormatFlag;
use super::sample_checks::MAX_HELD;
use crate::Result;
use crate::engine::{Forecast, OpenBackend, Outcome, Wanted, forecast};
use crate::model::driver::ModelId;
use crate::run::parts::Ledger;
use crate::run::sampling::crude_plan::CrudePlan;
use crate::run::sampling::weighted_plan::WeightedPlan;
use crate::run::sampling::{Estimator, Sample, SampleKind, SampleTally, TallyOptions};
use crate::stats::density::DensityModel;
use crate::stats::estimate::{CrossEntropy, StopRule, Subset};

/// Memory of the counts of every checkpoint and of the figures, bytes, measured.
const BYTES_OF_COUNTS: u64 = 6 << 20;

/// Memory of a sample while it is judged (point, case, motion, outcome), bytes, measured.
const BYTES_PER_SAMPLE: u64 = 280;

/// Prints what the run would be.
pub(super) fn forecast_sample(sample: &Sample, opened: &OpenBackend, format: FormatFlag) -> Result<Exit> {
    let (estimator, lanes, models) = match &sample.0 {
        SampleKind::Crude(planned, stop) => return forecast_crude(planned, opened, stop, format),
        SampleKind::Weighted(planned) => return forecast_weighted(planned, opened, format),
        SampleKind::Pilot(planned, pilot) => {
            ("is", planned.facts.samples.saturating_add(pilot.runs), &planned.facts.models)
        }
        SampleKind::Sequential(run) => {
            let (samples, seed) = (run.options.stop.samples, run.options.seed);
            let lanes = match &run.options.estimator {
                Estimator::Subset => {
                    let options = Subset::new(seed, samples);
                    options.samples_per_level.saturating_mul(options.levels as u64)
                }
                Estimator::CrossEntropy { .. } => {
                    let options = CrossEntropy::new(seed, (samples / 10).max(2000), samples);
                    samples.saturating_add(options.samples_per_level.saturating_mul(options.levels as u64))
                }
                Estimator::Pilot(pilot) => samples.saturating_add(pilot.runs),
                Estimator::Crude { .. } | Estimator::Given { .. } => samples,
            };
            (run.options.estimator.key(), lanes, &run.options.models)
        }
    };
    forecast_adaptive(sample.density(), (estimator, lanes, models), opened, format)
}

/// At most: how many levels there are is seen on the way.
fn forecast_adaptive(
    density: &DensityModel,
    (estimator, lanes, models): (&str, u64, &[ModelId]),
    opened: &OpenBackend,
    format: FormatFlag,
) -> Result<Exit> {
    let part = |model: &ModelId| ForecastPart {
        of: model.name().to_owned(),
        what: format!("estimator {estimator}"),
        units: lanes,
        lanes,
    };
    DryRun {
        data: density.provenance.data.clone(),
        parts: models.iter().map(part).collect(),
        units: "samples",
        is_at_most: true,
        // The points of a level or pilot, with their limit states and the fit's responsibilities.
        more_bytes: lanes.min(MAX_HELD) * (density.space.parameters().len() as u64 + 8) * 8,
        more: "the points that are held at once",
        forecast: None,
        backend: opened.backend().describe(),
        before: None,
        besides: "",
    }
    .print(format)?;
    Ok(Exit::Ok)
}

/// What the run would be.
fn forecast_crude(planned: &CrudePlan, opened: &OpenBackend, stop: &StopRule, format: FormatFlag) -> Result<Exit> {
    let (plan, counting) = (&planned.plan, planned.counting());
    // Few lanes are valued.
    let verdicts = TallyOptions { worst: 0, ..counting.clone() };
    let forecast = forecast(plan, opened.backend(), Wanted::Verdicts, BUDGET, |chunk| {
        SampleTally::of_chunk(plan, &chunk, &verdicts).map(drop)
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
        besides: "figures; --rows",
    }
    .print(format)?;
    Ok(Exit::Ok)
}

/// What the run would be: drawing and weighing cost more than the lanes, so all of it is measured.
fn forecast_weighted(planned: &WeightedPlan, opened: &OpenBackend, format: FormatFlag) -> Result<Exit> {
    let (facts, density) = (&planned.facts, &planned.density);
    let most = facts.samples.min(planned.chunk_samples());
    let (mut samples, mut took) = (most.min(256), 0.0);
    loop {
        let started = Instant::now();
        planned.sample(&mut Ledger::new(0..samples, &[]), &opened.executor(), |_| ())?;
        let last = std::mem::replace(&mut took, started.elapsed().as_secs_f64());
        if samples >= most || took + last >= BUDGET.as_secs_f64() / 2.0 {
            break;
        }
        samples = (2 * samples).min(most);
    }
    let models = facts.models.len() as u64;
    let lanes = facts.samples.saturating_mul(models);
    let seconds = took / samples as f64 * facts.samples as f64;
    let part = |model: &ModelId| ForecastPart {
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
