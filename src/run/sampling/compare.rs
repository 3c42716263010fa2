//! Rates of failure of recorded scenarios, of their parameterized replays and of densities fitted on them, set beside
//! one another: a parameterization may label most scenarios rightly and still give a wrong risk, and the reverse.
//!
//! All three rest on the same scenarios, so they go up and down together: a set that happens to hold hard scenarios
//! has a high rate of S and of the density. Each draw of a kernel density comes from one kernel, which is one
//! scenario. So every scenario is a cluster with three shares: its recorded lanes, its replayed lanes and the lanes
//! drawn around it. The ratio's interval is that of [`paired_ratio`]: what the three share cancels, the noise of the
//! draws is in it. It is conditional on the density's scale, bandwidth and mean sizes, and on a decomposition's
//! basis. A difference that data alone make is not in it either: S and the density see the same data, so agreement
//! says that the parameterization and the density represent *these* scenarios, not that these are enough.

use serde::Serialize;

use super::crude::sample_crude;
use super::plan::SampleHeadways;
use super::rows::{EstimateRow, Risk};
use super::sample_options::{Estimator, SampleOptions};
use super::tally::SampleTally;
use crate::engine::{Chunk, Confusion, Executor, LanePlan, Partial, SweepSummary};
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::run::close_following::CloseFollowing;
use crate::scenario::{Category, Scenario};
use crate::stats::density::{DensityModel, Exposure};
use crate::stats::estimate::{
    Clusters, Enough, Estimate, Ratio, StopReason, cluster_rate, from_clusters, paired_ratio,
};
use crate::{Error, Result};

/// Lanes and failed lanes per scenario of one category. Cells are model × criterion, the last innermost.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScenarioCounts {
    /// Lanes of one cell, per scenario.
    pub lanes: Vec<u64>,
    /// Failed lanes: one list per cell, each with one number per scenario.
    pub failures: Vec<Vec<u64>>,
}

impl ScenarioCounts {
    /// Nothing yet.
    pub fn empty(scenarios: usize, cells: usize) -> ScenarioCounts {
        ScenarioCounts { lanes: vec![0; scenarios], failures: vec![vec![0; scenarios]; cells] }
    }

    /// Those of a variant of a study (0 is S).
    ///
    /// # Errors
    /// [`Error::Internal`] for a partial that is not the whole of the plan, or a variant that there is not.
    pub fn of_variant(plan: &LanePlan, partial: &Partial, block: usize, variant: usize) -> Result<ScenarioCounts> {
        let cells = plan.models.len() * Criterion::ALL.len();
        let mut counts = ScenarioCounts::empty(0, cells);
        for cell in units(plan, partial, block, variant)? {
            counts.lanes.push(plan.headways.len() as u64);
            for (list, confusion) in counts.failures.iter_mut().zip(cell) {
                list.push(failures(confusion, variant));
            }
        }
        Ok(counts)
    }

    /// Adds the lanes of a chunk of samples. `scenarios` tells which scenario a kernel is.
    fn add(&mut self, plan: &LanePlan, chunk: &Chunk, scenarios: &[usize]) -> Result<()> {
        let missing = || Error::Internal("a sample does not tell its kernel".to_owned());
        let generator = plan.generator().ok_or_else(missing)?;
        let (headways, models) = (plan.headways.len(), plan.models.len());
        let units = chunk.units.clone();
        for (unit, lanes) in units.zip(chunk.verdicts.chunks_exact(headways * models)) {
            let drawn = generator.draw(unit);
            if drawn.is_void() {
                continue;
            }
            let kernel = generator.points.component(unit, drawn.tries).ok_or_else(missing)?;
            let scenario = *scenarios.get(kernel as usize).ok_or_else(missing)?;
            self.lanes[scenario] += headways as u64;
            for (at, verdicts) in lanes.iter().enumerate() {
                for criterion in Criterion::ALL {
                    let cell = at % models * Criterion::ALL.len() + criterion.index();
                    self.failures[cell][scenario] += u64::from(verdicts.failed(criterion));
                }
            }
        }
        Ok(())
    }

    /// One cell.
    pub fn cell(&self, cell: usize) -> Clusters<'_> {
        Clusters { runs: &self.lanes, failures: &self.failures[cell] }
    }
}

/// The cells of one variant, scenario by scenario.
fn units<'a>(
    plan: &LanePlan,
    partial: &'a Partial,
    block: usize,
    variant: usize,
) -> Result<impl Iterator<Item = &'a [Confusion<u32>]>> {
    let of = &plan.blocks[block];
    if !partial.is_complete(plan) || variant >= of.variants.len() {
        return Err(Error::Internal("a comparison needs every lane of the study".to_owned()));
    }
    let width = plan.models.len() * Criterion::ALL.len();
    let first = of.first_unit as usize;
    let units = &partial.units()[first..first + of.units.len() as usize];
    Ok(units.iter().map(move |unit| &unit.cells[variant * width..][..width]))
}

fn failures(confusion: &Confusion<u32>, variant: usize) -> u64 {
    // Variant 0 is S against itself.
    u64::from(confusion.tp) + if variant == 0 { 0 } else { u64::from(confusion.fp) }
}

/// Which of the category's kept scenarios each kernel of a density is.
///
/// # Errors
/// [`Error::Internal`] where the density was fitted on others.
pub fn kernel_scenarios(density: &DensityModel, scenarios: &[Scenario]) -> Result<Vec<usize>> {
    let kept = scenarios.iter().filter(|s| s.category == density.category() && s.kept);
    let is_kernel = |s: &Scenario| density.space.point(s).is_ok_and(|point| density.space.check(&point).is_ok());
    let used: Vec<usize> = kept.enumerate().filter(|(_, s)| is_kernel(s)).map(|(at, _)| at).collect();
    if used.len() != density.kde.points().len() {
        let problem = format!("{} kernels, but {} scenarios", density.kde.points().len(), used.len());
        return Err(Error::Internal(problem));
    }
    Ok(used)
}

/// Failures of a density's samples, in all and per scenario.
pub struct SampledScenarios {
    /// Per scenario of the category's kept ones.
    pub counts: ScenarioCounts,
    /// Over all headways: model × criterion.
    pub rows: Vec<EstimateRow>,
    /// The draws.
    pub tally: SampleTally,
    /// How the sweep went.
    pub summary: SweepSummary,
}

/// Crude Monte Carlo over the whole of a plan, with the failures told apart by scenario. `kernels` is of
/// [`kernel_scenarios`], `scenarios` the number of kept ones.
///
/// # Errors
/// As [`sample_crude`].
pub fn sample_by_scenario(
    plan: &LanePlan,
    kernels: &[usize],
    scenarios: usize,
    executor: &Executor,
    exposure: Option<&Exposure>,
    level: f64,
) -> Result<SampledScenarios> {
    let headways = SampleHeadways::Each(plan.headways.clone());
    let options = SampleOptions { level, ..SampleOptions::new(Estimator::CRUDE, plan.unit_count(), headways) };
    let mut counts = ScenarioCounts::empty(scenarios, plan.models.len() * Criterion::ALL.len());
    let run = sample_crude(plan, 0..plan.unit_count(), executor, &options, exposure, |chunk| {
        counts.add(plan, chunk, kernels)
    })?;
    let is_over_all = |row: &EstimateRow| plan.headways.len() == 1 || row.headway == "all";
    let rows = run.rows.into_iter().filter(is_over_all).collect();
    Ok(SampledScenarios { counts, rows, tally: run.tally, summary: run.summary })
}

/// A rate with its interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RateRecord {
    /// Failed lanes.
    pub failures: u64,
    /// Lanes.
    pub lanes: u64,
    /// Failures over lanes.
    pub rate: f64,
    /// Lower end of its interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl RateRecord {
    fn of(estimate: &Estimate) -> RateRecord {
        let Estimate { failures, runs, probability, interval, .. } = *estimate;
        RateRecord { failures, lanes: runs, rate: probability, low: interval.low, high: interval.high }
    }
}

/// Failures of the recorded scenarios in one cell.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RecordedCell {
    /// Driver model.
    pub model: ModelId,
    /// Criterion.
    pub criterion: Criterion,
    /// The rate; its interval counts scenarios as clusters.
    pub rate: RateRecord,
    /// Scenarios with a failure.
    pub failing_scenarios: u64,
    /// Failures per hour and per 1,000 km, where the exposure is known.
    pub risk: Risk,
}

/// The same of parameterized replays (S').
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ReplayedCell {
    /// The rate; its interval counts scenarios as clusters.
    pub rate: RateRecord,
    /// S'/S.
    pub ratio: Ratio,
    /// Its labels against those of S, lane by lane.
    pub labels: Confusion,
}

/// The same of a density's samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SampledCell {
    /// The rate; its interval is Monte Carlo's, of this density.
    pub rate: RateRecord,
    /// Ends of the interval that counts scenarios as clusters: of other data too.
    pub with_data: [f64; 2],
    /// P/S.
    pub ratio: Ratio,
    /// Failures per hour and per 1,000 km, where the exposure is known.
    pub risk: Risk,
}

/// One model and criterion under one parameterization.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ComparedCell {
    /// Driver model.
    pub model: ModelId,
    /// Criterion.
    pub criterion: Criterion,
    /// S'.
    pub replayed: ReplayedCell,
    /// The density.
    pub sampled: SampledCell,
}

/// One parameterization.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ComparedParameterization {
    /// Its name in the paper.
    pub key: String,
    /// Number of its parameters.
    pub parameters: usize,
    /// SHA-256 of its density.
    pub density_sha256: String,
    /// Kernels of the density: kept scenarios that are points of its space.
    pub kernels: usize,
    /// SHA-256 of the plan of its samples.
    pub plan_sha256: String,
    /// Samples without a valid point, which no rate counts.
    pub voids: u64,
    /// Model × criterion.
    pub cells: Vec<ComparedCell>,
}

/// One category.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CategoryComparison {
    /// Kind of scenario.
    pub category: Category,
    /// Kept scenarios.
    pub scenarios: u64,
    /// Events per hour and kilometre, where they are known.
    pub exposure: Option<Exposure>,
    /// S: model × criterion.
    pub recorded: Vec<RecordedCell>,
    /// Failures of S from headways below 0.5 s; `None` where the headways are gaps in metres.
    pub close_following: Option<CloseFollowing>,
    /// Parameterizations, in the registry's order.
    pub parameterizations: Vec<ComparedParameterization>,
}

/// Model and criterion of every cell, in order.
fn cells(plan: &LanePlan) -> impl Iterator<Item = (usize, ModelId, Criterion)> + '_ {
    let pairs = plan.models.iter().flat_map(|&m| Criterion::ALL.into_iter().map(move |c| (m, c)));
    pairs.enumerate().map(|(at, (m, c))| (at, m, c))
}

/// Scenarios as clusters of as many lanes as there are headways.
fn clustered(counts: &ScenarioCounts, cell: usize, headways: usize, level: f64) -> Estimate {
    let failures = &counts.failures[cell];
    let squares = failures.iter().map(|k| k * k).sum();
    let draws = failures.len() as u64;
    from_clusters(draws, headways as u64, failures.iter().sum(), squares, level, StopReason::Samples)
}

/// The cells of S.
pub fn recorded_cells(
    plan: &LanePlan,
    counts: &ScenarioCounts,
    exposure: Option<&Exposure>,
    level: f64,
) -> Vec<RecordedCell> {
    let of = |(cell, model, criterion)| {
        let estimate = clustered(counts, cell, plan.headways.len(), level);
        let failing_scenarios = counts.cell(cell).failing();
        let risk = Risk::of(&estimate, exposure);
        RecordedCell { model, criterion, rate: RateRecord::of(&estimate), failing_scenarios, risk }
    };
    cells(plan).map(of).collect()
}

/// The cells of one parameterization: variant `variant` of a study's block, and the samples of its density.
///
/// # Errors
/// As [`ScenarioCounts::of_variant`]; [`Error::Internal`] for samples of other models.
pub fn compare_cells(
    plan: &LanePlan,
    partial: &Partial,
    block: usize,
    variant: usize,
    sampled: &SampledScenarios,
    enough: Enough,
    level: f64,
) -> Result<Vec<ComparedCell>> {
    let s = ScenarioCounts::of_variant(plan, partial, block, 0)?;
    let s_prime = ScenarioCounts::of_variant(plan, partial, block, variant)?;
    let mut labels = vec![Confusion::default(); s.failures.len()];
    for unit in units(plan, partial, block, variant)? {
        labels.iter_mut().zip(unit).for_each(|(total, cell)| total.add(cell));
    }
    let mut compared = Vec::new();
    for (cell, model, criterion) in cells(plan) {
        let row = sampled.rows.get(cell).filter(|row| (row.model, row.criterion) == (model, criterion));
        let Some(row) = row else {
            return Err(Error::Internal("samples of other models than the study's".to_owned()));
        };
        let replayed = ReplayedCell {
            rate: RateRecord::of(&clustered(&s_prime, cell, plan.headways.len(), level)),
            ratio: paired_ratio(s_prime.cell(cell), s.cell(cell), enough, level),
            labels: labels[cell],
        };
        let with_data = cluster_rate(sampled.counts.cell(cell), level).interval;
        let sampled = SampledCell {
            rate: RateRecord { low: row.draws[0], high: row.draws[1], ..RateRecord::of(&row.estimate) },
            with_data: [with_data.low, with_data.high],
            ratio: paired_ratio(sampled.counts.cell(cell), s.cell(cell), enough, level),
            risk: row.risk,
        };
        compared.push(ComparedCell { model, criterion, replayed, sampled });
    }
    Ok(compared)
}
