//! Compares the rates of a density's samples with those of the scenarios that it was fitted on, as recorded (S) and
//! replayed under the parameterization (S'). The interval of P includes the uncertainty of draws and data. The error of
//! the parameterization itself is visible only in this comparison.

use rayon::prelude::*;

use super::Sample;
use super::estimate_rows::{EstimateRow, NoTraffic, RecordedRatios};
use super::plan::{plan_draws, plan_points};
use super::result::SampleResult;
use super::sample_options::SampleHeadways;
use crate::study::{StudyOptions, plan_study};
use lanesweep_engine::{CpuBackend, Executor, Headway, KernelCounts, LanePlan, Verdicts, Wanted, cell_of};
use lanesweep_model::driver::ModelId;
use lanesweep_model::scenario::Category;
use lanesweep_random::Stream;
use lanesweep_stats::estimate::{Clusters, Ratio, RatioVerdict, Warning, paired_ratio};
use lanesweep_support::{Error, Result};

/// The lanes of S and of S' under the density's parameterization, with scenarios as kernels. `None` if the density
/// cannot be replayed.
fn replay(sample: &Sample, headways: &[Headway]) -> Result<Option<[KernelCounts; 2]>> {
    let (density, models) = (&sample.density, &sample.options.models);
    let id = density.space.id();
    let options = StudyOptions {
        categories: vec![id.category],
        models: models.clone(),
        headways: headways.to_vec(),
        parameterization: density.space.options().clone(),
        ..StudyOptions::default()
    };
    let plan = match plan_study(&density.scenarios, &sample.profile, &options) {
        Ok(plan) => plan,
        // A failed comparison does not invalidate the samples.
        Err(Error::Input { .. } | Error::Usage { .. }) => return Ok(None),
        Err(error) => return Err(error),
    };
    let Some(block) = plan.blocks.first() else { return Ok(None) };
    let Some(variant) = block.variants.iter().position(|name| *name == id.key) else { return Ok(None) };
    let verdicts = verdicts(&plan)?;
    let (variants, lanes) = (block.variants.len(), headways.len() * models.len());
    let units = block.units.len() as usize;
    let counted = |variant: usize| {
        let mut counts = KernelCounts::zero(units, lanes);
        for unit in 0..units {
            counts.count_sample(unit as u32, &verdicts[(unit * variants + variant) * lanes..][..lanes]);
        }
        counts
    };
    Ok(Some([counted(0), counted(variant)]))
}

/// The verdicts of all lanes, by the CPU: it gives the same bits as any device, and they are few beside those of the samples.
fn verdicts(plan: &LanePlan) -> Result<Vec<Verdicts>> {
    let (backend, mut verdicts) = (CpuBackend::lane_arithmetic(), Vec::new());
    Executor::new(&backend).sweep(plan, 0..plan.unit_count(), Wanted::Verdicts, |chunk| {
        verdicts.extend(chunk.verdicts.iter().copied());
        Ok(())
    })?;
    Ok(verdicts)
}

/// Number of further draws of a cut-out that are examined.
pub const TRAFFIC_DRAWS: u64 = 20_000;
const PURPOSE: u32 = 0x7261_6666;

impl Sample {
    /// Adds the rates of the recorded scenarios to the result, P at other bandwidths, and what draws without possible traffic
    /// are of it. Adds a warning if the rates differ, if there are too few failures, or if the density does not contain its scenarios.
    ///
    /// # Errors
    /// Those of the lanes of S and S'.
    pub(super) fn against_recorded(&self, mut result: SampleResult) -> Result<SampleResult> {
        let (density, options) = (&self.density, &self.options);
        // If the density draws the headway, S starts from the recorded gaps.
        let headways = match &options.headways {
            SampleHeadways::Each(headways) => headways.clone(),
            SampleHeadways::Sampled => vec![Headway::Observed],
        };
        self.count_no_traffic(&mut result.rows, &headways)?;
        result = self.at_bandwidths(result)?;
        for carrier in result.rows.iter_mut().flat_map(|row| &mut row.carriers) {
            carrier.scenario = density.scenarios.get(carrier.of.kernel).map(|scenario| scenario.id.clone());
        }
        let is_comparable = !density.scenarios.is_empty();
        let replayed = is_comparable.then(|| replay(self, &headways));
        let Some([recorded, replayed]) = replayed.transpose()?.flatten() else {
            result.rows.iter_mut().for_each(|row| row.estimate.trust.warn_if(true, Warning::NotCompared));
            return Ok(result);
        };
        let sampled = result.crude.as_ref().and_then(|tally| tally.by_kernel.as_ref());
        for row in &mut result.rows {
            let cells = cells_of(row, &options.models, &headways);
            let (runs, failures) = recorded.over(&cells);
            let ratio = |of: &KernelCounts| {
                let (their_runs, their_failures) = of.over(&cells);
                let theirs = Clusters { runs: &their_runs, failures: &their_failures };
                paired_ratio(theirs, Clusters { runs: &runs, failures: &failures }, options.level)
            };
            let ratios = RecordedRatios { replayed: ratio(&replayed), sampled: sampled.map(ratio) };
            warn(row, &ratios);
            row.recorded = Some(ratios);
        }
        Ok(result)
    }

    /// Adds to rows of cut-outs what draws without possible traffic are of them.
    ///
    /// # Errors
    /// Those of the lanes.
    fn count_no_traffic(&self, rows: &mut [EstimateRow], headways: &[Headway]) -> Result<()> {
        let (density, profile, options) = (&self.density, &self.profile, &self.options);
        if density.category() != Category::CutOut {
            return Ok(());
        }
        let stream = Stream { seed: options.seed, purpose: PURPOSE };
        let plan = plan_draws(density, stream, profile, TRAFFIC_DRAWS, &options.models, &options.headways)?;
        let Some(generator) = plan.generator() else { return Ok(()) };
        let is_possible = |index| {
            let point = generator.point(index)?;
            let case = density.space.case(&point, &density.sizes, profile.frame.dt_s).ok()?;
            Some((case.drives_through_s(profile).is_none(), point))
        };
        let drawn: Vec<(bool, Vec<f64>)> = (0..TRAFFIC_DRAWS).into_par_iter().filter_map(is_possible).collect();
        let draws = drawn.len() as f64;
        let points: Vec<Vec<f64>> =
            drawn.into_iter().filter_map(|(is_possible, of)| (!is_possible).then_some(of)).collect();
        if points.is_empty() {
            return Ok(());
        }
        let plan = plan_points(density, &points, profile, &options.models, &options.headways)?;
        let lanes = plan.headways.len() * options.models.len();
        let mut counts = KernelCounts::zero(1, lanes);
        verdicts(&plan)?.chunks(lanes).for_each(|of_sample| counts.count_sample(0, of_sample));
        let fraction = points.len() as f64 / draws;
        for row in rows {
            let cells = cells_of(row, &options.models, headways);
            let failing = counts.over(&cells).1[0] as f64 / (draws * cells.len() as f64);
            let possible_probability = ((row.estimate.probability - failing) / (1.0 - fraction)).max(0.0);
            row.no_traffic = Some(NoTraffic { fraction, possible_probability });
        }
        Ok(())
    }
}

/// The cells of a row: one headway, or all.
fn cells_of(row: &EstimateRow, models: &[ModelId], headways: &[Headway]) -> Vec<usize> {
    let model = models.iter().position(|model| *model == row.model).unwrap_or_default();
    // A density with its own headway has a single headway, independent of its name.
    let is_of = |at: &usize| headways.len() == 1 || row.headway == "all" || headways[*at].to_string() == row.headway;
    (0..headways.len()).filter(is_of).map(|at| cell_of(models.len(), at, model, row.criterion)).collect()
}

/// Decided differences come first, then S': if the replays of the same scenarios differ, the samples differ too.
fn warn(row: &mut EstimateRow, ratios: &RecordedRatios) {
    let named = [("S'/S", Some(ratios.replayed)), ("P/S", ratios.sampled)];
    let differing = || named.into_iter().filter_map(|(name, ratio)| Some((name, ratio?))).filter(|(_, r)| !r.agrees());
    let decided = differing().find(|(_, ratio)| ratio.verdict != RatioVerdict::Undecided);
    let Some((name, ratio)) = decided.or_else(|| differing().next()) else { return };
    let is_decided = ratio.verdict != RatioVerdict::Undecided;
    let name = name.to_owned();
    let Ratio { ratio, low, high, .. } = ratio;
    row.estimate.trust.warn_if(true, Warning::AgainstRecorded { name, ratio, low, high, is_decided });
}
