//! What a run would be: how many lanes, how much memory, how long. Some of its lanes are run to know; nothing is written.

use std::time::{Duration, Instant};

use crate::Result;
use crate::engine::{
    Block, Confusion, CpuBackend, Executor, Forecast, LanePlan, Outcome, Partial, Verdicts, Wanted, forecast,
};
use crate::model::criterion::Criterion;
use crate::run::compare::Compare;
use crate::run::grid::{GridPlan, Map};
use crate::run::parts::Ledger;
use crate::run::sampling::crude_plan::CrudePlan;
use crate::run::sampling::weighted_plan::WeightedPlan;
use crate::run::sampling::{Estimator, MAX_HELD, Sample, SampleKind, SampleTally, TallyOptions};
use crate::run::study::{Study, WINDOW};
use crate::stats::estimate::{CrossEntropy, StopRule, Subset};

/// Time that lanes are run for to know their speed.
const BUDGET: Duration = Duration::from_millis(200);

/// Bytes of the series whose lanes a study's forecast runs, at most.
const SERIES_BYTES: u64 = 64 << 20;

/// Memory of the counts of every checkpoint and of the figures of a sampling run, bytes, measured.
const BYTES_OF_TALLIES: u64 = 6 << 20;

/// Memory of a sample while it is judged (point, case, motion, outcome), bytes, measured.
const BYTES_PER_SAMPLE: u64 = 280;

/// Memory of a comparison's counts and figures, bytes, measured.
const BYTES_OF_COMPARISON: u64 = 8 << 20;

/// Memory of the sheets of a map that are being drawn, bytes: those of the presets, measured.
const BYTES_OF_SHEETS: u64 = 3 << 20;

/// Some of a run's lanes.
pub struct ForecastPart {
    /// Category, model or grid.
    pub of: String,
    /// Variant, headway or profile.
    pub what: String,
    /// Scenarios, samples or cells.
    pub units: u64,
    /// Their lanes.
    pub lanes: u64,
}

/// What a run would be.
pub struct RunForecast {
    /// What it would run on.
    pub data: String,
    /// All lanes.
    pub parts: Vec<ForecastPart>,
    /// What a part's units are: `scenarios`, `samples`, `cells`.
    pub units: &'static str,
    /// The lanes are the most that there can be.
    pub is_at_most: bool,
    /// Bytes that the run will hold beyond what is held now.
    pub more_bytes: u64,
    /// What those are.
    pub more: &'static str,
    /// Time of the lanes; `None` where they follow from one another.
    pub time: Option<Forecast>,
    /// What the lanes ran on.
    pub backend: String,
    /// What comes on top of the lanes' time.
    pub not_counted: &'static str,
}

/// A run that can tell what it would be.
pub trait DryRun {
    /// Runs some of the lanes and concludes on all.
    ///
    /// # Errors
    /// Of the backend.
    fn forecast(&self, executor: &Executor) -> Result<RunForecast>;
}

/// The lanes of a plan by category and variant.
fn parts(plan: &LanePlan) -> Vec<ForecastPart> {
    let of_block = |block: &'_ Block| {
        let lanes = block.units.len() * (plan.headways.len() * plan.models.len()) as u64;
        let (of, units) = (block.category.label().to_owned(), block.units.len());
        let part = move |what: &String| ForecastPart { of: of.clone(), what: what.clone(), units, lanes };
        block.variants.iter().map(part).collect::<Vec<_>>()
    };
    plan.blocks.iter().flat_map(of_block).collect()
}

impl DryRun for Study {
    fn forecast(&self, executor: &Executor) -> Result<RunForecast> {
        let plan = self.plan();
        let reference = CpuBackend::reference();
        let backend = if self.facts().reference { &reference } else { executor.backend };
        let some = self.cases().thinned(WINDOW, SERIES_BYTES)?;
        let count = |chunk| Partial::from_chunk(&some, &chunk).map(drop);
        let mut time = forecast(&some, backend, Wanted::Verdicts, BUDGET, count)?;
        time.seconds *= plan.lane_count() as f64 / some.lane_count().max(1) as f64;
        time.lanes = plan.lane_count();
        // The counts of every unit, in the ledger and joined.
        let cells_of = |block: &Block| (block.variants.len() * plan.models.len() * Criterion::ALL.len()) as u64;
        let of_unit = size_of::<Confusion<u32>>() as u64;
        let counts = |block: &Block| 2 * block.units.len() * (cells_of(block) * (of_unit + 2) + 100);
        Ok(RunForecast {
            data: self.facts().data.clone(),
            parts: parts(plan),
            units: "scenarios",
            is_at_most: false,
            more_bytes: plan.blocks.iter().map(counts).sum::<u64>()
                + self.cases().window_bytes().saturating_sub(2 * SERIES_BYTES),
            more: "counts and the series of a window",
            time: Some(time),
            backend: backend.describe(),
            not_counted: "scores, figures, the plan file",
        })
    }
}

impl DryRun for Compare<'_> {
    /// Sampled lanes are taken to cost what those of their category's scenarios do.
    fn forecast(&self, executor: &Executor) -> Result<RunForecast> {
        let (plan, samples) = (&self.plan, self.options.samples);
        let count = |chunk| Partial::from_chunk(plan, &chunk).map(drop);
        let mut time = forecast(plan, executor.backend, Wanted::Verdicts, BUDGET, count)?;
        let per_lane_s = time.seconds / time.lanes.max(1) as f64;
        let lanes = samples.saturating_mul((plan.headways.len() * plan.models.len()) as u64);
        let mut parts = parts(plan);
        for id in &self.options.parameterizations {
            let (of, what) = (id.category.label().to_owned(), format!("density {}", id.key));
            parts.push(ForecastPart { of, what, units: samples, lanes });
            time.add(&Forecast { lanes, seconds: lanes as f64 * per_lane_s, ..Forecast::default() });
        }
        Ok(RunForecast {
            data: self.facts.data.clone(),
            parts,
            units: "cases",
            is_at_most: false,
            more_bytes: BYTES_OF_COMPARISON,
            more: "counts per scenario and figures",
            time: Some(time),
            backend: executor.backend.describe(),
            not_counted: "fitting the densities",
        })
    }
}

impl DryRun for Map {
    fn forecast(&self, executor: &Executor) -> Result<RunForecast> {
        let all = self.lane_count();
        let mut time = Forecast::default();
        for plan in self.lane_plans() {
            let budget = BUDGET.mul_f64(plan.lane_count() as f64 / all.max(1) as f64);
            time.add(&forecast(plan, executor.backend, Wanted::Verdicts, budget, |_| Ok(()))?);
        }
        let part = |(other, plan): (Option<&str>, &GridPlan)| ForecastPart {
            of: plan.grid.name().to_owned(),
            what: other.map_or(String::new(), |name| format!("under {name}")),
            units: plan.grid.cell_count() as u64,
            lanes: plan.lane_count(),
        };
        Ok(RunForecast {
            data: "the grids' own cases".to_owned(),
            parts: self.plans().map(part).collect(),
            units: "cells",
            is_at_most: false,
            // A verdict per cell and model, and the sheets drawn of them.
            more_bytes: all * (size_of::<Verdicts>() as u64 + 1) + BYTES_OF_SHEETS,
            more: "verdicts and sheets",
            time: Some(time),
            backend: executor.backend.describe(),
            not_counted: "drawing and writing the sheets",
        })
    }
}

impl DryRun for Sample {
    fn forecast(&self, executor: &Executor) -> Result<RunForecast> {
        let (estimator, lanes, models) = match &self.0 {
            SampleKind::Crude(planned, stop) => return of_crude(planned, stop, executor),
            SampleKind::Weighted(planned) => return of_weighted(planned, executor),
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
        let part = |name: &str| ForecastPart {
            of: name.to_owned(),
            what: format!("estimator {estimator}"),
            units: lanes,
            lanes,
        };
        Ok(RunForecast {
            data: self.density().provenance.data.clone(),
            parts: models.iter().map(|model| part(model.name())).collect(),
            units: "samples",
            // How many levels there are is seen on the way.
            is_at_most: true,
            // The points of a level or pilot, with their limit states and the fit's responsibilities.
            more_bytes: lanes.min(MAX_HELD) * (self.density().space.parameters().len() as u64 + 8) * 8,
            more: "the points that are held at once",
            time: None,
            backend: executor.backend.describe(),
            not_counted: "",
        })
    }
}

fn of_crude(planned: &CrudePlan, stop: &StopRule, executor: &Executor) -> Result<RunForecast> {
    let (plan, counting) = (&planned.plan, planned.counting());
    // Few lanes are valued.
    let verdicts = TallyOptions { worst: 0, ..counting.clone() };
    let count = |chunk| SampleTally::of_chunk(plan, &chunk, &verdicts).map(drop);
    let time = forecast(plan, executor.backend, Wanted::Verdicts, BUDGET, count)?;
    let bytes_of_lane = if counting.worst > 0 { size_of::<Outcome<f64>>() as u64 } else { 1 };
    Ok(RunForecast {
        data: planned.density.provenance.data.clone(),
        parts: parts(plan),
        units: "samples",
        is_at_most: stop.relative_half_width.is_some() || stop.time_limit.is_some(),
        more_bytes: BYTES_OF_TALLIES + time.lanes_at_once * bytes_of_lane,
        more: "lanes at once, counts and figures, however many samples",
        time: Some(time),
        backend: executor.backend.describe(),
        not_counted: "figures",
    })
}

/// Drawing and weighing cost more than the lanes, so all of it is measured.
fn of_weighted(planned: &WeightedPlan, executor: &Executor) -> Result<RunForecast> {
    let facts = &planned.facts;
    let most = facts.samples.min(planned.chunk_samples());
    let (mut samples, mut took) = (most.min(256), 0.0);
    loop {
        let started = Instant::now();
        planned.sample(&mut Ledger::new(0..samples, &[]), executor, |_| ())?;
        let last = std::mem::replace(&mut took, started.elapsed().as_secs_f64());
        if samples >= most || took + last >= BUDGET.as_secs_f64() / 2.0 {
            break;
        }
        samples = (2 * samples).min(most);
    }
    let models = facts.models.len() as u64;
    let (lanes, measured_lanes) = (facts.samples.saturating_mul(models), samples * models);
    let seconds = took / samples as f64 * facts.samples as f64;
    let what = format!("headway {}", planned.headway_name());
    let part = |name: &str| ForecastPart {
        of: name.to_owned(),
        what: what.clone(),
        units: facts.samples,
        lanes: facts.samples,
    };
    Ok(RunForecast {
        data: planned.density.provenance.data.clone(),
        parts: facts.models.iter().map(|model| part(model.name())).collect(),
        units: "samples",
        is_at_most: false,
        more_bytes: most * BYTES_PER_SAMPLE,
        more: "the samples that are judged at once",
        time: Some(Forecast { lanes, seconds, measured_lanes, lanes_at_once: most }),
        backend: executor.backend.describe(),
        not_counted: "",
    })
}
