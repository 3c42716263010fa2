//! The first failing lanes of a finished run, with their outcomes. The counts say how many failures there are and of which
//! kernels; the samples of these kernels are computed again on the CPU, in order, until enough failures are found. So the
//! lanes are the same whatever computed the run, in however many parts.

use std::ops::Range;

use rayon::prelude::*;

use super::limit_state::truncated;
use super::plan::plan_points;
use super::{Question, Sample, SampleKind, SampleResult};
use lanesweep_engine::{CpuBackend, Executor, LanePlan, Outcome, SampleTally, Wanted, cell_of};
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_model::scalar::Real;
use lanesweep_support::{Error, Result};

/// Samples whose points are drawn together.
const PIECE: u64 = 1 << 13;

/// A failing lane.
#[derive(Debug, Clone, PartialEq)]
pub struct FailingLane {
    /// Index of the sample.
    pub sample: u64,
    /// Its point, as the lane got it.
    pub point: Vec<f64>,
    /// Index of the headway; 0 if the density draws it.
    pub headway: usize,
    /// Driver model.
    pub model: ModelId,
    /// The outcome.
    pub outcome: Outcome<f64>,
    /// Where the sample comes from.
    pub origin: Origin,
}

/// Where a sample comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Origin {
    /// The kernel that it was drawn from, or that explains a draw of a proposal best; none of given points.
    pub kernel: Option<u32>,
    /// Its weight in the sum that gives P times the number of draws; 1 with crude Monte Carlo.
    pub weight: f64,
}

/// Takes the lanes.
type Each<'e> = &'e mut dyn FnMut(&FailingLane) -> Result<()>;
/// The origin of a sample with its index and point.
type OriginOf<'o> = &'o dyn Fn(u64, &[f64]) -> Origin;

/// The failures that are still to be found: one number per model and criterion.
struct Missing(Vec<[u64; Criterion::ALL.len()]>);

impl Missing {
    /// At most `limit` of each model and criterion, of what `failures` counts.
    fn new(models: &[ModelId], limit: u64, failures: impl Fn(usize, Criterion) -> u64) -> Missing {
        let of = |model: usize| Criterion::ALL.map(|criterion| failures(model, criterion).min(limit));
        Missing((0..models.len()).map(of).collect())
    }

    fn has_model(&self, model: usize) -> bool {
        self.0[model].iter().any(|missing| *missing > 0)
    }

    /// Takes a lane of a model; whether it is one of those to be found.
    fn take(&mut self, model: usize, outcome: &Outcome<f64>) -> bool {
        let mut is_first = false;
        for criterion in Criterion::ALL.into_iter().filter(|criterion| outcome.verdicts.failed(*criterion)) {
            let missing = &mut self.0[model][criterion.index()];
            is_first |= *missing > 0;
            *missing = missing.saturating_sub(1);
        }
        is_first
    }
}

impl Sample {
    /// Passes the first failing lanes of a run to `each`: the first `limit` of every model and criterion, ordered by sample,
    /// headway and model. With importance sampling, the samples are the draws of the proposal, and the criterion is that of
    /// the run.
    ///
    /// # Errors
    /// Those of the lanes and of `each`; [`Error::Interrupted`].
    pub fn failing_lanes(&self, result: &SampleResult, limit: u64, executor: &Executor, each: Each) -> Result<()> {
        let models = &self.options.models;
        match (&self.kind, &result.crude) {
            (SampleKind::Crude(plan), Some(run)) => {
                let tally = &run.tally;
                let counted = |model, criterion| cells(plan, model, criterion).map(|cell| tally.failures[cell]).sum();
                let missing = Missing::new(models, limit, counted);
                let origin = |index, _: &[f64]| {
                    let kernel = plan.generator().and_then(|of| of.points.component(index, of.draw(index).tries));
                    Origin { kernel, weight: 1.0 }
                };
                self.find(missing, tally.covered(), executor, (each, &origin), |missing| draws_of(plan, tally, missing))
            }
            (SampleKind::Weighted(weighted), _) => {
                let (nominal, asked) = (truncated(&self.density)?, self.options.asked());
                let counted = |model: usize, criterion| {
                    let is_of = |asked: &Question| (asked.model, asked.criterion) == (models[model], criterion);
                    let rows = asked.iter().zip(&result.rows).filter(|(asked, _)| is_of(asked));
                    rows.map(|(_, row)| row.estimate.failures).sum()
                };
                let draw = |index| weighted.draws.draw(&nominal, &weighted.proposal, index);
                let origin = |_, point: &[f64]| {
                    let explained = nominal.kernels().responsibilities(&[point]).remove(0).into_iter().zip(0..);
                    let (_, kernel) = explained.fold((0.0, 0), |best, of| if of.0 > best.0 { of } else { best });
                    let weight = weighted.draws.weights(&nominal, &weighted.proposal, &[point])[0];
                    Origin { kernel: Some(kernel), weight }
                };
                let all = 0..weighted.draws.draws;
                self.find(Missing::new(models, limit, counted), &[all], executor, (each, &origin), |_| draw)
            }
            _ => Err(Error::Internal("a run without counts has no failing lanes".to_owned())),
        }
    }

    /// Finds the missing failures among samples. `draws` returns the points of those that may have them.
    fn find<D: Fn(u64) -> Option<Vec<f64>> + Sync>(
        &self,
        mut missing: Missing,
        samples: &[Range<u64>],
        executor: &Executor,
        (each, origin): (Each, OriginOf),
        draws: impl Fn(&Missing) -> D,
    ) -> Result<()> {
        let all = samples.iter().map(|range| range.end - range.start).sum();
        let pieces = samples.iter().flat_map(|range| {
            let starts = range.clone().step_by(PIECE as usize);
            starts.map(|start| start..range.end.min(start + PIECE))
        });
        let mut done = 0;
        for piece in pieces {
            let open: Vec<usize> = (0..self.options.models.len()).filter(|model| missing.has_model(*model)).collect();
            if open.is_empty() {
                return Ok(());
            }
            let draw = draws(&missing);
            let drawn = piece.clone().into_par_iter().filter_map(|index| Some((index, draw(index)?)));
            let (indices, points): (Vec<u64>, Vec<Vec<f64>>) = drawn.unzip();
            if !points.is_empty() {
                self.find_among(&indices, &points, &open, &mut missing, (&mut *each, origin))?;
            }
            done += piece.end - piece.start;
            executor.progress.iter().for_each(|progress| progress(piece.end - piece.start));
            executor.check_cancelled(done, all)?;
        }
        Ok(())
    }

    /// Computes these points under the open models, and passes the lanes that are missing.
    fn find_among(
        &self,
        indices: &[u64],
        points: &[Vec<f64>],
        open: &[usize],
        missing: &mut Missing,
        (each, origin): (Each, OriginOf),
    ) -> Result<()> {
        let models: Vec<ModelId> = open.iter().map(|model| self.options.models[*model]).collect();
        let plan = plan_points(&self.density, points, &self.profile, &models, &self.options.headways)?;
        let lanes = plan.headways.len() * models.len();
        let cpu = CpuBackend::lane_arithmetic();
        Executor::new(&cpu).sweep(&plan, 0..plan.unit_count(), Wanted::Outcomes, |chunk| {
            for (unit, outcomes) in chunk.units.clone().zip(chunk.outcomes.chunks(lanes)) {
                for (at, outcome) in outcomes.iter().enumerate() {
                    let model = at % models.len();
                    if missing.take(open[model], outcome) {
                        let point = points[unit as usize].iter().map(|value| f64::from(f32::from_f64(*value)));
                        each(&FailingLane {
                            sample: indices[unit as usize],
                            point: point.collect(),
                            headway: at / models.len(),
                            model: models[model],
                            outcome: *outcome,
                            origin: origin(indices[unit as usize], &points[unit as usize]),
                        })?;
                    }
                }
            }
            Ok(())
        })?;
        Ok(())
    }
}

/// The cells of a model and criterion, from every headway.
fn cells(plan: &LanePlan, model: usize, criterion: Criterion) -> impl Iterator<Item = usize> {
    let models = plan.models.len();
    (0..plan.headways.len()).map(move |headway| cell_of(models, headway, model, criterion))
}

/// The points of valid samples of kernels that have one of the missing failures.
fn draws_of<'p>(
    plan: &'p LanePlan,
    tally: &SampleTally,
    missing: &Missing,
) -> impl Fn(u64) -> Option<Vec<f64>> + Sync + use<'p> {
    let has_failures = tally.by_kernel.as_ref().map(|counts| {
        let mut has_failures = vec![false; counts.groups()];
        for (model, missing) in missing.0.iter().enumerate() {
            for criterion in Criterion::ALL.into_iter().filter(|criterion| missing[criterion.index()] > 0) {
                let failures = counts.over(&cells(plan, model, criterion).collect::<Vec<_>>()).1;
                has_failures.iter_mut().zip(failures).for_each(|(has, failures)| *has |= failures > 0);
            }
        }
        has_failures
    });
    move |index| {
        let generator = plan.generator()?;
        let drawn = generator.draw(index);
        if drawn.is_void() {
            return None;
        }
        let kernel = generator.points.component(index, drawn.tries);
        let may_fail = has_failures.as_ref().zip(kernel).is_none_or(|(has, kernel)| has[kernel as usize % has.len()]);
        may_fail.then(|| drawn.values[..generator.points.dimensions].iter().map(|value| f64::from(*value)).collect())
    }
}
