//! Compares the rates of a density's samples with those of the scenarios that it was fitted on, as recorded (S) and
//! replayed under the parameterization (S'). The interval of P includes the uncertainty of draws and data. The error of
//! the parameterization itself is visible only in this comparison.

use super::Sample;
use super::estimate_rows::{EstimateRow, RecordedRatios};
use super::result::SampleResult;
use super::sample_options::SampleHeadways;
use crate::engine::{CpuBackend, Executor, Headway, KernelCounts, Wanted, cell_of};
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::run::study::{StudyOptions, plan_study};
use crate::stats::density::DensityModel;
use crate::stats::estimate::{Clusters, Ratio, RatioVerdict, Warning, paired_ratio};
use crate::{Error, Result};

/// The lanes of S and of S' under the density's parameterization, with scenarios as kernels. `None` if the density
/// cannot be replayed.
fn replay(
    density: &DensityModel,
    profile: &Profile,
    models: &[ModelId],
    headways: &[Headway],
) -> Result<Option<[KernelCounts; 2]>> {
    let id = density.space.id();
    let options = StudyOptions {
        categories: vec![id.category],
        models: models.to_vec(),
        headways: headways.to_vec(),
        parameterization: density.space.options().clone(),
        ..StudyOptions::default()
    };
    let plan = match plan_study(&density.scenarios, profile, &options) {
        Ok(plan) => plan,
        // A failed comparison does not invalidate the samples.
        Err(Error::Input { .. } | Error::Usage { .. }) => return Ok(None),
        Err(error) => return Err(error),
    };
    let Some(block) = plan.blocks.first() else { return Ok(None) };
    let Some(variant) = block.variants.iter().position(|name| *name == id.key) else { return Ok(None) };
    // The CPU gives the same bits as any device, and there are few lanes compared with those of the samples.
    let backend = CpuBackend::lane_arithmetic();
    let executor = Executor::new(&backend);
    let mut verdicts = Vec::new();
    executor.sweep(&plan, 0..plan.unit_count(), Wanted::Verdicts, |chunk| {
        verdicts.extend(chunk.verdicts.iter().copied());
        Ok(())
    })?;
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

impl Sample {
    /// Adds the rates of the recorded scenarios to the result, and what draws without possible traffic are of it. Adds a warning if the rates differ, if there are too few
    /// failures, or if the density does not contain its scenarios.
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
        let is_comparable = !density.scenarios.is_empty();
        let replayed = is_comparable.then(|| replay(density, &self.profile, &options.models, &headways));
        let Some([recorded, replayed]) = replayed.transpose()?.flatten() else {
            result.rows.iter_mut().for_each(|row| row.estimate.trust.warn_if(true, Warning::NotCompared));
            return Ok(result);
        };
        let sampled = result.crude.as_ref().and_then(|crude| crude.tally.by_kernel.as_ref());
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
}

/// The cells of a row: one headway, or all.
pub(super) fn cells_of(row: &EstimateRow, models: &[ModelId], headways: &[Headway]) -> Vec<usize> {
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
