//! The first failing lanes of a finished run, with their outcomes. The counts say how many failures there are and of which
//! kernels; the samples of these kernels, or all of importance sampling, are computed again on the CPU, in order, until enough
//! failures are found. So the lanes are the same whatever computed the run, in however many parts.

use std::ops::Range;

use rayon::prelude::*;

use super::limit_state::truncated;
use super::plan::plan_points;
use super::{Question, Sample, SampleKind, SampleResult};
use lanesweep_engine::{CpuBackend, Executor, LanePlan, Outcome, SampleTally, Wanted, cell_of};
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_model::scalar::Real;
use lanesweep_stats::estimate::WeightedFailure;
use lanesweep_support::{Error, Result};

/// Samples whose points are drawn together.
const PIECE: u64 = 1 << 13;

/// A sample, and what it is of P.
#[derive(Debug, Clone, PartialEq)]
pub struct SampledPoint {
    /// Its index among the draws of the density, or of the proposal.
    pub sample: u64,
    /// The parameters, as the lanes get them.
    pub point: Vec<f64>,
    /// Whether it is a draw of the density, not of a proposal.
    pub is_of_density: bool,
    /// The kernel that it was drawn from, or that explains a sample of importance sampling best; none of given points.
    pub kernel: Option<u32>,
    /// What it adds to P where it fails; `None` as long as crude Monte Carlo, whose samples count the same, goes on.
    pub weight: Option<f64>,
}

/// Takes the lanes: sample, index of the headway (0 if the density draws it), driver model and outcome.
type Each<'e> = &'e mut dyn FnMut(&SampledPoint, usize, ModelId, &Outcome<f64>) -> Result<()>;

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
    /// headway and model. With importance sampling, the draws of the density follow the draw of the proposal that they belong
    /// to, and the criterion is that of the run.
    ///
    /// # Errors
    /// Those of the lanes and of `each`; [`Error::Interrupted`].
    pub fn failing_lanes(&self, result: &SampleResult, limit: u64, executor: &Executor, each: Each) -> Result<()> {
        let models = &self.options.models;
        match (&self.kind, &result.crude) {
            (SampleKind::Crude(plan), Some(tally)) => {
                let counted = |model, criterion| cells(plan, model, criterion).map(|cell| tally.failures[cell]).sum();
                let samples = pieces(tally.covered(), PIECE);
                let drawn = |missing: &Missing, piece| Ok(may_fail(plan, tally, missing, piece));
                self.find(Missing::new(models, limit, counted), samples, executor, each, drawn)
            }
            (SampleKind::Weighted(weighted), _) => {
                let (nominal, asked, draws) = (truncated(&self.density)?, self.options.asked(), &weighted.draws);
                let counted = |model: usize, criterion| {
                    let is_of = |asked: &Question| (asked.model, asked.criterion) == (models[model], criterion);
                    let rows = asked.iter().zip(&result.rows).filter(|(asked, _)| is_of(asked));
                    rows.map(|(_, row)| row.estimate.failures).sum()
                };
                let cpu = CpuBackend::lane_arithmetic();
                let lanes = self.limit_state(Executor::new(&cpu));
                let sampled = |WeightedFailure { of, is_crude, weight, .. }: WeightedFailure| {
                    let explained = nominal.kernels().responsibilities(&[&of.point]).remove(0).into_iter().zip(0..);
                    let (_, kernel) = explained.fold((0.0, 0), |best, of| if of.0 > best.0 { of } else { best });
                    let point = of.point.iter().map(|value| f64::from(f32::from_f64(*value))).collect();
                    let (kernel, weight) = (Some(kernel), Some(weight / draws.draws as f64));
                    SampledPoint { sample: of.index, point, is_of_density: is_crude, kernel, weight }
                };
                let drawn = |_: &Missing, piece| {
                    let mut failures = draws.failures(&nominal, &weighted.proposal, &lanes, piece)?;
                    failures.sort_by_key(|failure| failure.draw);
                    Ok(failures.into_par_iter().map(sampled).collect())
                };
                let all = 0..draws.draws;
                let samples = pieces(std::slice::from_ref(&all), self.chunk_samples(draws.crude_per_draw));
                self.find(Missing::new(models, limit, counted), samples, executor, each, drawn)
            }
            _ => Err(Error::Internal("a run without counts has no failing lanes".to_owned())),
        }
    }

    /// Finds the missing failures among samples. `drawn` returns those of a piece that may have them.
    fn find(
        &self,
        mut missing: Missing,
        pieces: impl Iterator<Item = Range<u64>> + Clone,
        executor: &Executor,
        each: Each,
        drawn: impl Fn(&Missing, Range<u64>) -> Result<Vec<SampledPoint>>,
    ) -> Result<()> {
        let all = pieces.clone().map(|piece| piece.end - piece.start).sum();
        let mut done = 0;
        for piece in pieces {
            let open: Vec<usize> = (0..self.options.models.len()).filter(|model| missing.has_model(*model)).collect();
            if open.is_empty() {
                return Ok(());
            }
            let samples = drawn(&missing, piece.clone())?;
            if !samples.is_empty() {
                self.find_among(&samples, &open, &mut missing, &mut *each)?;
            }
            done += piece.end - piece.start;
            executor.progress.iter().for_each(|progress| progress(piece.end - piece.start));
            executor.check_cancelled(done, all)?;
        }
        Ok(())
    }

    /// Computes these samples under the open models, and passes the lanes that are missing.
    fn find_among(&self, samples: &[SampledPoint], open: &[usize], missing: &mut Missing, each: Each) -> Result<()> {
        let models: Vec<ModelId> = open.iter().map(|model| self.options.models[*model]).collect();
        let points: Vec<Vec<f64>> = samples.iter().map(|sample| sample.point.clone()).collect();
        let plan = plan_points(&self.density, &points, &self.profile, &models, &self.options.headways)?;
        let lanes = plan.headways.len() * models.len();
        let cpu = CpuBackend::lane_arithmetic();
        Executor::new(&cpu).sweep(&plan, 0..plan.unit_count(), Wanted::Outcomes, |chunk| {
            for (unit, outcomes) in chunk.units.clone().zip(chunk.outcomes.chunks(lanes)) {
                for (at, outcome) in outcomes.iter().enumerate() {
                    let model = at % models.len();
                    if missing.take(open[model], outcome) {
                        each(&samples[unit as usize], at / models.len(), models[model], outcome)?;
                    }
                }
            }
            Ok(())
        })?;
        Ok(())
    }
}

/// Ranges of samples in pieces that are drawn together.
fn pieces(samples: &[Range<u64>], size: u64) -> impl Iterator<Item = Range<u64>> + Clone {
    let of = move |range: &Range<u64>| {
        let end = range.end;
        range.clone().step_by(size as usize).map(move |start| start..end.min(start + size))
    };
    samples.iter().flat_map(of)
}

/// The cells of a model and criterion, from every headway.
fn cells(plan: &LanePlan, model: usize, criterion: Criterion) -> impl Iterator<Item = usize> {
    let models = plan.models.len();
    (0..plan.headways.len()).map(move |headway| cell_of(models, headway, model, criterion))
}

/// The valid samples of kernels that have one of the missing failures.
fn may_fail(plan: &LanePlan, tally: &SampleTally, missing: &Missing, piece: Range<u64>) -> Vec<SampledPoint> {
    let Some(generator) = plan.generator() else { return Vec::new() };
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
    let weight = Some(1.0 / tally.valid() as f64);
    let sampled = |sample| {
        let drawn = generator.draw(sample);
        let kernel = generator.points.component(sample, drawn.tries);
        let may_fail = has_failures.as_ref().zip(kernel).is_none_or(|(has, kernel)| has[kernel as usize % has.len()]);
        (may_fail && !drawn.is_void()).then(|| {
            let point = drawn.values[..generator.points.dimensions].iter().map(|value| f64::from(*value)).collect();
            SampledPoint { sample, point, is_of_density: true, kernel, weight }
        })
    };
    piece.into_par_iter().filter_map(sampled).collect()
}
