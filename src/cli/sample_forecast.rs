//! `lanesweep sample --dry-run`: what a run would be.

use std::time::Instant;

use super::Exit;
use super::backend_flags::Opened;
use super::dry_run::{self, BUDGET, DryRun, ForecastPart};
use super::format::FormatFlag;
use super::sample_checks::MAX_HELD;
use crate::Result;
use crate::engine::{Forecast, LanePlan, Outcome, Wanted, forecast};
use crate::model::driver::ModelId;
use crate::run::parts::Ledger;
use crate::run::sampling::{Estimator, Proposals, Sample, SampleKind, SampleOptions, SampleTally};
use crate::stats::estimate::{CrossEntropy, Subset};

/// Memory of the counts of every checkpoint and of the figures, bytes, measured.
const BYTES_OF_COUNTS: u64 = 6 << 20;

/// Memory of a sample while it is judged (point, case, motion, outcome), bytes, measured.
const BYTES_PER_SAMPLE: u64 = 280;

/// Prints what the run would be.
pub(super) fn forecast_sample(sample: &Sample, opened: &Opened, format: FormatFlag) -> Result<Exit> {
    match &sample.kind {
        SampleKind::Crude(plan) => forecast_crude(sample, plan, opened, format),
        SampleKind::Weighted(proposals) => forecast_weighted(sample, proposals, opened, format),
        SampleKind::Pilot(_) | SampleKind::Sequential => forecast_adaptive(sample, opened, format),
    }
}

/// Lanes of a driver model, at most.
fn lanes_at_most(options: &SampleOptions) -> u64 {
    let (samples, seed) = (options.stop.samples, options.seed);
    match &options.estimator {
        Estimator::Subset => {
            let subset = Subset::new(seed, samples);
            subset.samples_per_level.saturating_mul(subset.levels as u64)
        }
        Estimator::CrossEntropy { .. } => {
            let levels = CrossEntropy::new(seed, (samples / 10).max(2000), samples);
            samples.saturating_add(levels.samples_per_level.saturating_mul(levels.levels as u64))
        }
        Estimator::Pilot(pilot) => samples.saturating_add(pilot.runs),
        Estimator::Crude { .. } | Estimator::Given { .. } => samples,
    }
}

/// At most: how many levels there are is seen on the way.
fn forecast_adaptive(sample: &Sample, opened: &Opened, format: FormatFlag) -> Result<Exit> {
    let (density, options) = (&sample.density, &sample.options);
    let lanes = lanes_at_most(options);
    let part = |model: &ModelId| ForecastPart {
        of: model.name().to_owned(),
        what: format!("estimator {}", options.estimator.key()),
        units: lanes,
        lanes,
    };
    DryRun {
        data: density.provenance.data.clone(),
        parts: options.models.iter().map(part).collect(),
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
fn forecast_crude(sample: &Sample, plan: &LanePlan, opened: &Opened, format: FormatFlag) -> Result<Exit> {
    let options = &sample.options;
    // Few lanes are valued.
    let verdicts = SampleOptions { worst: 0, ..options.clone() };
    let forecast = forecast(plan, opened.backend(), Wanted::Verdicts, BUDGET, |chunk| {
        SampleTally::of_chunk(plan, &chunk, &verdicts).map(drop)
    })?;
    let bytes_of_lane = if options.worst > 0 { size_of::<Outcome<f64>>() as u64 } else { 1 };
    DryRun {
        data: sample.density.provenance.data.clone(),
        parts: dry_run::parts(plan),
        units: "samples",
        is_at_most: !options.stop.is_fixed(),
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
fn forecast_weighted(sample: &Sample, proposals: &Proposals, opened: &Opened, format: FormatFlag) -> Result<Exit> {
    let (all, models) = (sample.samples(), &sample.options.models);
    let most = all.min(sample.chunk_samples());
    let (mut samples, mut took) = (most.min(256), 0.0);
    loop {
        let started = Instant::now();
        sample.sample_weighted(proposals, &mut Ledger::new(0..samples, &[]), &opened.executor(), |_| ())?;
        let last = std::mem::replace(&mut took, started.elapsed().as_secs_f64());
        if samples >= most || took + last >= BUDGET.as_secs_f64() / 2.0 {
            break;
        }
        samples = (2 * samples).min(most);
    }
    let (lanes, measured_lanes) = (sample.lane_count(), samples * models.len() as u64);
    let seconds = took / samples as f64 * all as f64;
    let part = |model: &ModelId| ForecastPart {
        of: model.name().to_owned(),
        what: format!("headway {}", sample.options.headway_name()),
        units: all,
        lanes: all,
    };
    DryRun {
        data: sample.density.provenance.data.clone(),
        parts: models.iter().map(part).collect(),
        units: "samples",
        is_at_most: false,
        more_bytes: most * BYTES_PER_SAMPLE,
        more: "the samples that are judged at once",
        forecast: Some(Forecast { lanes, seconds, measured_lanes, lanes_at_once: most }),
        backend: opened.backend().describe(),
        before: None,
        besides: "",
    }
    .print(format)?;
    Ok(Exit::Ok)
}
