//! Compares failure rates of recorded scenarios, of their parameterized replays and of densities fitted on them. A
//! parameterization may label most scenarios correctly and still give a wrong risk, and vice versa.
//!
//! All three depend on the same scenarios, so their rates are correlated: if the sample contains many hard scenarios,
//! the rates of S and of the density are both high. Each draw of a kernel density comes from one kernel, which is one
//! scenario. So every scenario is a cluster with three measurements: its recorded lanes, its replayed lanes and the
//! lanes drawn around it. The ratio's interval is that of [`paired_ratio`], which cancels the common variation and
//! includes the noise of the draws.
//!
//! The interval is conditional on the density's scale, bandwidth and mean sizes, and on the basis of a decomposition.
//! It does not include differences caused by the data alone: S and the density see the same data. Agreement therefore
//! means that the parameterization and the density represent *these* scenarios, not that these are enough.

use serde::Serialize;

use super::crude::sample_crude;
use super::estimate_rows::{EstimateRow, Risk};
use super::sample_options::{Estimator, SampleHeadways, SampleOptions};
use super::tally::SampleTally;
use super::uncertainty::Uncertainty;
use crate::engine::{Chunk, Confusion, Executor, LanePlan, Partial, SweepSummary};
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::run::close_following::CloseFollowing;
use crate::scenario::{Category, Scenario};
use crate::stats::density::{DensityKind, DensityModel, Exposure, Representativeness, normal_quantile};
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
    /// Counts of zero.
    pub(crate) fn empty(scenarios: usize, cells: usize) -> ScenarioCounts {
        ScenarioCounts { lanes: vec![0; scenarios], failures: vec![vec![0; scenarios]; cells] }
    }

    /// The counts of a variant of a study (0 is S).
    ///
    /// # Errors
    /// [`Error::Internal`] for a partial that does not cover the whole plan, or a variant that does not exist.
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

    /// Adds the lanes of a chunk of samples. `scenarios` maps kernels to scenarios.
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

/// The cells of one variant per scenario.
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

/// The index of each kernel of a density among the category's kept scenarios.
///
/// # Errors
/// [`Error::Internal`] if the density was fitted on other scenarios.
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

/// Failures of a density's samples, in total and per scenario.
pub struct SampledScenarios {
    /// Counts per kept scenario of the category.
    pub counts: ScenarioCounts,
    /// Estimates over all headways: model × criterion.
    pub rows: Vec<EstimateRow>,
    /// Counts of the draws.
    pub tally: SampleTally,
    /// Summary of the sweep.
    pub summary: SweepSummary,
}

/// Crude Monte Carlo over a whole plan, with failures counted per scenario. `kernels` is the result of
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
    let mut add = |plan: &LanePlan, chunk: &Chunk| counts.add(plan, chunk, kernels);
    let run = sample_crude(plan, 0..plan.unit_count(), executor, &options, exposure, Some(&mut add))?;
    let rows = run.rows.iter().filter(|row| row.is_overall(&run.rows)).cloned().collect();
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
    /// The rate; its interval treats scenarios as clusters.
    pub rate: RateRecord,
    /// Scenarios with a failure.
    pub failing_scenarios: u64,
    /// Failures per hour and per 1,000 km, where the exposure is known.
    pub risk: Risk,
}

/// Failures of parameterized replays (S') in one cell.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ReplayedCell {
    /// The rate; its interval counts scenarios as clusters.
    pub rate: RateRecord,
    /// S'/S.
    pub ratio: Ratio,
    /// Its labels compared with those of S, lane by lane.
    pub labels: Confusion,
}

/// Failures of a density's samples in one cell.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SampledCell {
    /// The rate; its interval covers Monte Carlo noise only, for this density.
    pub rate: RateRecord,
    /// Ends of the interval that treats scenarios as clusters; it covers the uncertainty of the data too.
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
    /// Name of the parameterization in the paper.
    pub key: String,
    /// Number of its parameters.
    pub parameters: usize,
    /// SHA-256 of its density.
    pub density_sha256: String,
    /// Kernels of the density: kept scenarios that are points of its space.
    pub kernels: usize,
    /// SHA-256 of the plan of its samples.
    pub plan_sha256: String,
    /// Samples without a valid point; no rate counts them.
    pub voids: u64,
    /// Model × criterion.
    pub cells: Vec<ComparedCell>,
    /// How well the density represents unseen scenarios; `None` unless other forms are compared.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub goodness: Option<Representativeness>,
    /// Densities of other forms over the same scenarios; empty unless asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub forms: Vec<ComparedForm>,
}

/// A density of another form.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ComparedForm {
    /// The form.
    pub form: DensityKind,
    /// SHA-256 of the density.
    pub density_sha256: String,
    /// Components of its mixture.
    pub components: usize,
    /// How well it represents unseen scenarios.
    pub goodness: Option<Representativeness>,
    /// Model × criterion, as in the comparison's cells; intervals of the draws alone.
    pub rates: Vec<RateRecord>,
}

impl ComparedForm {
    /// From the rows of a sample.
    ///
    /// # Errors
    /// As [`DensityModel::content_sha256`].
    pub(crate) fn of(density: &DensityModel, rows: &[EstimateRow]) -> Result<ComparedForm> {
        let overall = rows.iter().filter(|row| row.is_overall(rows));
        Ok(ComparedForm {
            form: density.kind(),
            density_sha256: density.content_sha256()?,
            components: density.components(),
            goodness: density.representativeness,
            rates: overall.map(|row| RateRecord::of(&row.estimate)).collect(),
        })
    }
}

/// One category.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CategoryComparison {
    /// Kind of scenario.
    pub category: Category,
    /// Kept scenarios.
    pub scenarios: u64,
    /// Events per hour and kilometre; `None` if unknown.
    pub exposure: Option<Exposure>,
    /// S: model × criterion.
    pub recorded: Vec<RecordedCell>,
    /// Failures of S from headways below 0.5 s; `None` if the headways are gaps in metres.
    pub close_following: Option<CloseFollowing>,
    /// Parameterizations, in the registry's order.
    pub parameterizations: Vec<ComparedParameterization>,
    /// What the risk is uncertain by: model × criterion.
    pub uncertainty: Vec<Option<Uncertainty>>,
}

impl Uncertainty {
    /// The uncertainty of the risk of a category under any of its parameterizations and forms: model × criterion. `None`
    /// where no density has a failure. A rate without failures counts as its upper bound, so what it differs by is a
    /// minimum.
    pub(crate) fn of_category(category: &CategoryComparison, level: f64) -> Vec<Option<Uncertainty>> {
        let z = normal_quantile(0.5 + 0.5 * level);
        let variance = |low: f64, high: f64| (libm::log(high / low) / (2.0 * z)).powi(2);
        let of_rate = |rate: &RateRecord| if rate.failures > 0 { variance(rate.low, rate.high) } else { 0.0 };
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        // Variance of ln rate over the choices, less that of the draws; `None` for a single choice.
        let between = |rates: &[&RateRecord]| {
            let log = |rate: &&RateRecord| libm::log(if rate.failures > 0 { rate.rate } else { rate.high });
            let logs: Vec<f64> = rates.iter().map(log).collect();
            let of_draws: Vec<f64> = rates.iter().map(|rate| of_rate(rate)).collect();
            let middle = mean(&logs);
            let squares: f64 = logs.iter().map(|log| (log - middle).powi(2)).sum();
            (logs.len() > 1).then(|| (squares / (logs.len() - 1) as f64 - mean(&of_draws)).max(0.0))
        };
        let all = &category.parameterizations;
        let cell = |at: usize| {
            let sampled = all.iter().map(|of| &of.cells[at].sampled);
            let failing: Vec<_> = sampled.clone().filter(|of| of.rate.failures > 0).collect();
            if failing.is_empty() {
                return None;
            }
            let of_draws: Vec<f64> = failing.iter().map(|of| of_rate(&of.rate)).collect();
            let with_data: Vec<f64> = failing.iter().map(|of| variance(of.with_data[0], of.with_data[1])).collect();
            let forms = all.iter().filter(|of| !of.forms.is_empty()).filter_map(|of| {
                let others = of.forms.iter().map(|form| &form.rates[at]);
                between(&std::iter::once(&of.cells[at].sampled.rate).chain(others).collect::<Vec<_>>())
            });
            let forms: Vec<f64> = forms.collect();
            let exposure = category.exposure.map_or(0.0, |of| 1.0 / of.events.max(1) as f64);
            let draws = mean(&of_draws);
            let parts = [draws, (mean(&with_data) - draws).max(0.0), exposure];
            let rates: Vec<&RateRecord> = sampled.map(|of| &of.rate).collect();
            Uncertainty::new(parts, (!forms.is_empty()).then(|| mean(&forms)), between(&rates))
        };
        (0..category.recorded.len()).map(cell).collect()
    }
}

/// Model and criterion of every cell, in order.
fn cells(plan: &LanePlan) -> impl Iterator<Item = (usize, ModelId, Criterion)> + '_ {
    let pairs = plan.models.iter().flat_map(|&m| Criterion::ALL.into_iter().map(move |c| (m, c)));
    pairs.enumerate().map(|(at, (m, c))| (at, m, c))
}

/// The rate over scenarios as clusters, with one lane per headway each.
fn clustered(counts: &ScenarioCounts, cell: usize, headways: usize, level: f64) -> Estimate {
    let failures = &counts.failures[cell];
    let squares = failures.iter().map(|k| k * k).sum();
    let draws = failures.len() as u64;
    from_clusters(draws, headways as u64, failures.iter().sum(), squares, level, StopReason::Samples)
}

/// The cells of S.
pub(crate) fn recorded_cells(
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
pub(crate) fn compare_cells(
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
