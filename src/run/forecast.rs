//! Predicts a run before it starts: number of lanes, additional memory and duration.

use std::time::{Duration, Instant};

use super::compare::Compare;
use super::grid::{GridPlan, Map};
use super::parts::Ledger;
use super::sampling::{Sample, SampleKind, SampleOptions, SampleTally, Weighted};
use super::study::{Study, WINDOW};
use crate::Result;
use crate::engine::{
    Backend, Block, Confusion, Executor, Forecast, LanePlan, Outcome, Partial, Verdicts, Wanted, forecast,
};
use crate::model::criterion::Criterion;
use crate::stats::density::DensityKind;
use crate::support::readable;

/// Time for which lanes are run to measure their speed.
const BUDGET: Duration = Duration::from_millis(200);

/// Series memory for the forecast of a study, in addition to one scenario of each category: enough to measure the speed
/// of the lanes.
const STUDY_SERIES_BYTES: u64 = 64 << 20;
/// Memory of the counts of every checkpoint of a sampling run and of its figures, bytes, measured.
const SAMPLE_COUNTS_BYTES: u64 = 6 << 20;
/// Memory of a weighted sample during its evaluation (point, case, motion, outcome), bytes, measured.
const BYTES_PER_SAMPLE: u64 = 280;
/// Memory of the counts of a comparison's sampled lanes and of its figures, bytes, measured.
const COMPARE_COUNTS_BYTES: u64 = 8 << 20;
/// Memory of a map's sheets while they are drawn, bytes: those of the presets, measured.
const SHEETS_BYTES: u64 = 3 << 20;

/// Maximum number of points that an adaptive estimator holds at once.
pub const MAX_HELD: u64 = 10_000_000;

/// A part of a run's lanes.
pub struct ForecastPart {
    /// Category, grid or model.
    pub of: String,
    /// Variant, density or estimator.
    pub what: String,
    /// Its units.
    pub units: u64,
    /// Its lanes.
    pub lanes: u64,
}

/// Prediction for a run.
pub struct RunForecast {
    /// Data of the run.
    pub data: String,
    /// Its lanes.
    pub parts: Vec<ForecastPart>,
    /// What a part's units are: `scenarios`, `samples`, `cells`.
    pub units: &'static str,
    /// The number of lanes is an upper bound.
    pub is_at_most: bool,
    /// Additional memory of the run, bytes.
    pub more_bytes: u64,
    /// Contents of this memory.
    pub more: &'static str,
    /// Predicted duration of the lanes. `None` if they depend on one another.
    pub lanes: Option<Forecast>,
    /// Work in addition to the lanes.
    pub besides: &'static str,
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

fn counted(plan: &LanePlan, backend: &dyn Backend) -> Result<Forecast> {
    forecast(plan, backend, Wanted::Verdicts, BUDGET, |chunk| Partial::from_chunk(plan, &chunk).map(drop))
}

impl Study {
    /// Predicts the study.
    ///
    /// # Errors
    /// Those of the measured lanes.
    pub fn forecast(&self, backend: &dyn Backend) -> Result<RunForecast> {
        let plan = self.plan();
        let some = self.cases().thinned(WINDOW, STUDY_SERIES_BYTES)?;
        let mut forecast = counted(&some, backend)?;
        forecast.seconds *= plan.lane_count() as f64 / some.lane_count().max(1) as f64;
        forecast.lanes = plan.lane_count();
        // The counts of every unit, in the ledger and merged.
        let cells_of = |block: &Block| (block.variants.len() * plan.models.len() * Criterion::ALL.len()) as u64;
        let of_unit = size_of::<Confusion<u32>>() as u64;
        let counts = |block: &Block| 2 * block.units.len() * (cells_of(block) * (of_unit + 2) + 100);
        Ok(RunForecast {
            data: self.facts().data.clone(),
            parts: parts(plan),
            units: "scenarios",
            is_at_most: false,
            more_bytes: plan.blocks.iter().map(counts).sum::<u64>()
                + self.cases().window_bytes().saturating_sub(2 * STUDY_SERIES_BYTES),
            more: "counts and the series of a window",
            lanes: Some(forecast),
            besides: "scores, figures, the plan file; option `rows` and option `compare_reference`",
        })
    }
}

impl Compare<'_> {
    /// Predicts the comparison. Assumes that sampled lanes take as long as those of their category's scenarios.
    ///
    /// # Errors
    /// Those of the measured lanes.
    pub fn forecast(&self, backend: &dyn Backend) -> Result<RunForecast> {
        let (plan, options) = (self.lane_plan(), self.options());
        let mut parts = parts(plan);
        let mut whole = counted(plan, backend)?;
        let per_lane_s = whole.seconds / whole.lanes.max(1) as f64;
        let lanes = options.samples.saturating_mul((plan.headways.len() * plan.models.len()) as u64);
        for id in &options.parameterizations {
            let (of, what) = (id.category.label().to_owned(), format!("density {}", id.key));
            let forms = if options.every_form { DensityKind::ALL.len() as u64 } else { 1 };
            let lanes = lanes.saturating_mul(forms);
            parts.push(ForecastPart { of, what, units: options.samples * forms, lanes });
            whole.add(&Forecast { lanes, seconds: lanes as f64 * per_lane_s, measured_lanes: 0, lanes_at_once: 0 });
        }
        Ok(RunForecast {
            data: self.provenance().data.clone(),
            parts,
            units: "cases",
            is_at_most: false,
            more_bytes: COMPARE_COUNTS_BYTES,
            more: "counts per scenario and figures",
            lanes: Some(whole),
            besides: "fitting the densities",
        })
    }
}

impl Map {
    /// Predicts the maps.
    ///
    /// # Errors
    /// Those of the measured lanes.
    pub fn forecast(&self, backend: &dyn Backend) -> Result<RunForecast> {
        let all = self.lane_count();
        let mut whole = Forecast::default();
        for plan in self.lane_plans() {
            let budget = BUDGET.mul_f64(plan.lane_count() as f64 / all.max(1) as f64);
            whole.add(&forecast(plan, backend, Wanted::Verdicts, budget, |_| Ok(()))?);
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
            // A verdict per cell and model, and the sheets.
            more_bytes: all * (size_of::<Verdicts>() as u64 + 1) + SHEETS_BYTES,
            more: "verdicts and sheets",
            lanes: Some(whole),
            besides: "drawing and writing the sheets",
        })
    }
}

impl Sample {
    /// Predicts the sampling run.
    ///
    /// # Errors
    /// Those of the measured lanes.
    pub fn forecast(&self, executor: &Executor) -> Result<RunForecast> {
        let options = &self.options;
        let run = RunForecast {
            data: self.density.provenance.data.clone(),
            parts: Vec::new(),
            units: "samples",
            is_at_most: false,
            more_bytes: 0,
            more: "",
            lanes: None,
            besides: "",
        };
        Ok(match &self.kind {
            SampleKind::Crude(plan) => {
                // Values are computed for few lanes only.
                let verdicts = SampleOptions { worst: 0, ..options.clone() };
                let forecast = forecast(plan, &*executor.backend, Wanted::Verdicts, BUDGET, |chunk| {
                    SampleTally::of_chunk(plan, &chunk, &verdicts).map(drop)
                })?;
                let bytes_of_lane = if options.worst > 0 { size_of::<Outcome<f64>>() as u64 } else { 1 };
                RunForecast {
                    parts: parts(plan),
                    is_at_most: !options.stop.is_fixed(),
                    more_bytes: SAMPLE_COUNTS_BYTES + forecast.lanes_at_once * bytes_of_lane,
                    more: "lanes at once, counts and figures, however many samples",
                    lanes: Some(forecast),
                    besides: "figures; option `rows`",
                    ..run
                }
            }
            SampleKind::Weighted(weighted) => {
                let weighed = weighed(self, weighted, executor)?;
                RunForecast {
                    parts: vec![self.weighted_part("importance sampling", self.samples())],
                    more_bytes: weighed.lanes_at_once * BYTES_PER_SAMPLE,
                    more: "the samples that are judged at once",
                    lanes: Some(weighed),
                    ..run
                }
            }
            SampleKind::Search(search) => {
                let questions = options.asked().len() as u64;
                let points = search.most_points(questions as usize).saturating_add(self.samples());
                RunForecast {
                    parts: vec![self.weighted_part("search and importance sampling", points)],
                    is_at_most: true,
                    // The points of the search with their values and densities.
                    more_bytes: MAX_HELD.min(points)
                        * (self.density.space.parameters().len() as u64 + 8 + 3 * questions)
                        * 8,
                    more: "the points that are held at once",
                    ..run
                }
            }
        })
    }

    fn weighted_part(&self, of: &str, samples: u64) -> ForecastPart {
        ForecastPart {
            of: of.to_owned(),
            what: readable::counted(self.options.asked().len(), "question"),
            units: samples,
            lanes: samples.saturating_mul(self.lanes_per_sample()),
        }
    }
}

/// Measures drawing and weighting as well, because they cost more than the lanes.
fn weighed(sample: &Sample, weighted: &Weighted, executor: &Executor) -> Result<Forecast> {
    let all = sample.samples();
    let max_samples = all.min(sample.chunk_samples());
    let (mut samples, mut took) = (max_samples.min(256), 0.0);
    loop {
        let started = Instant::now();
        sample.sample_weighted(weighted, &mut Ledger::new(0..samples, &[]), executor, |_| ())?;
        let last = std::mem::replace(&mut took, started.elapsed().as_secs_f64());
        if samples >= max_samples || took + last >= BUDGET.as_secs_f64() / 2.0 {
            break;
        }
        samples = (2 * samples).min(max_samples);
    }
    Ok(Forecast {
        lanes: sample.lane_count(),
        seconds: took / samples as f64 * all as f64,
        measured_lanes: samples * sample.lanes_per_sample(),
        lanes_at_once: max_samples,
    })
}
