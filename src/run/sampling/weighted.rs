//! Importance sampling with given proposals or with those of a pilot. It draws, evaluates and weights the samples that
//! the ledger does not hold.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::limit_state::{LaneLimitState, scenario_shares, truncated};
use super::rows::EstimateRow;
use super::sample_options::SampleOptions;
use super::sample_run::SampleResult;
use super::{Proposals, Sample};
use crate::engine::{CpuBackend, Executor, lanes_within_seconds};
use crate::model::driver::ModelId;
use crate::run::parts::{Ledger, MergeableCounts};
use crate::stats::density::{BandwidthRule, Kde, Mixture};
use crate::stats::estimate::{
    BlockSums, Defended, Estimate, KernelShares, Pilot, PilotCheck, StopReason, WeightSums, defended, from_weight_sums,
    importance_sums, pilot_proposal,
};
use crate::support::cancel::Cancel;
use crate::{Error, Place, Result};

/// Maximum number of samples evaluated between two journal updates.
const CHUNK: u64 = 1 << 16;

/// Number of kernels in the density for which weighting `CHUNK` samples takes about one second. The time is
/// proportional to the number of kernels, so a density with more kernels has smaller chunks.
const KERNELS: u64 = 1 << 10;

/// Returns the number of samples between two updates of the journal and checks for cancellation.
///
/// It is small enough that a chunk takes seconds, however long the lanes last. It is a power of two, because the sums
/// follow a binary tree over the sample indices.
fn chunk_samples(step_cap: u32, models: u64, kernels: u64) -> u64 {
    let evaluated = lanes_within_seconds(step_cap) / models.max(1);
    let weighted = CHUNK / (kernels / KERNELS).max(1);
    1 << evaluated.min(weighted).clamp(1, CHUNK).ilog2()
}

impl Sample {
    /// Number of samples between two updates of the journal.
    pub(crate) fn chunk_samples(&self) -> u64 {
        let (models, kernels) = (self.options.models.len(), self.density.kde.points().len());
        chunk_samples(self.profile.step_cap(), models as u64, kernels as u64)
    }

    /// The lanes of a driver model as a limit state for estimators.
    pub(super) fn limit_state<'a>(&'a self, model: ModelId, executor: Executor<'a>) -> LaneLimitState<'a> {
        let (density, profile, options) = (&self.density, &self.profile, &self.options);
        let (criterion, headway) = (options.criterion, options.headways.clone());
        LaneLimitState { density, profile, model, criterion, headway, executor }
    }

    /// The kernels over a pilot's worst points.
    pub(super) fn kernels_over(&self, points: &[Vec<f64>]) -> Result<Mixture> {
        let names: Vec<&str> = self.density.space.parameters().iter().map(|p| p.name.as_str()).collect();
        Kde::fit(points.to_vec(), &names, BandwidthRule::Reduction)?.mixture()
    }

    /// The proposal of every driver model, with the counts of its pilot.
    pub(super) fn pilots(&self, pilot: &Pilot, executor: &Executor) -> Result<Proposals> {
        let (nominal, fit) = (truncated(&self.density)?, |points: &[Vec<f64>]| self.kernels_over(points));
        let search = |&model: &ModelId| {
            tracing::info!("pilot of {} on {}", model.name(), executor.backend.describe());
            pilot_proposal(&nominal, &self.limit_state(model, executor.clone()), &fit, pilot, self.options.seed)
        };
        let found: Vec<(Mixture, PilotCheck)> = self.options.models.iter().map(search).collect::<Result<_>>()?;
        let (mixtures, pilots) = found.into_iter().unzip();
        Ok(Proposals { mixtures, pilots })
    }

    /// Draws, evaluates and weights the samples that the ledger does not hold.
    pub(crate) fn sample_weighted(
        &self,
        proposals: &Proposals,
        ledger: &mut Ledger<WeightedTally>,
        executor: &Executor,
        mut progress: impl FnMut(u64),
    ) -> Result<()> {
        let SampleOptions { estimator, models, seed, .. } = &self.options;
        let nominal = truncated(&self.density)?;
        let prepared = |proposal: &Mixture| defended(proposal.clone(), &nominal, estimator.defence());
        let proposals: Vec<Defended> = proposals.mixtures.iter().map(prepared).collect::<Result<_>>()?;
        let (units, chunk) = (ledger.units(), self.chunk_samples());
        // The samples of a chunk are drawn, evaluated and weighted together, so a chunk cannot be cancelled.
        let whole = executor.clone().with_cancel(Cancel::default());
        for missing in ledger.missing(units.clone())? {
            let mut at = missing.start;
            while at < missing.end {
                let next = (at / chunk + 1).saturating_mul(chunk).min(missing.end);
                // One proposal serves all models, or each has its own.
                let sums_of = |(&model, proposal): (&ModelId, &Defended)| {
                    let lanes = self.limit_state(model, whole.clone());
                    Ok((model, importance_sums(&nominal, proposal, &lanes, *seed, at..next)?))
                };
                let pairs = models.iter().zip(proposals.iter().cycle());
                ledger.add(WeightedTally { sums: pairs.map(sums_of).collect::<Result<_>>()? }, [0; 2])?;
                progress(next - at);
                at = next;
                ledger.kept(executor.check_cancelled(at - units.start, units.end - units.start))?;
            }
        }
        Ok(())
    }

    /// The estimates from the sums over all samples.
    ///
    /// # Errors
    /// [`Error::Input`] at `place` if a sample or a driver model is missing.
    pub(super) fn weighted_result(
        &self,
        proposals: &Proposals,
        tally: Option<WeightedTally>,
        place: Place,
    ) -> Result<SampleResult> {
        let SampleOptions { estimator, models, seed, level, .. } = &self.options;
        let tally = tally.filter(|tally| {
            tally.covered().as_slice() == std::slice::from_ref(&(0..self.samples())) && self.check_sums(tally).is_ok()
        });
        let Some(tally) = tally else {
            let problem = "the parts do not hold every sample of every driver model";
            return Err(Error::input(place, problem, "make them again"));
        };
        let cpu = CpuBackend::lane_arithmetic();
        let row = |(at, (model, sums)): (usize, &(ModelId, BlockSums<WeightSums>))| {
            let total = sums.total().unwrap_or_default();
            let mut estimate = from_weight_sums(&total, false, *level, StopReason::Samples);
            proposals.pilots.get(at).into_iter().for_each(|pilot| pilot.add_to(&mut estimate));
            // Some more lanes, on the CPU: a merge has no other backend, and all backends give the same bits.
            let lanes = self.limit_state(*model, Executor::new(&cpu));
            let proposal = &proposals.mixtures[at % proposals.mixtures.len()];
            let shares = scenario_shares(&lanes, proposal, estimator.defence(), *seed)?;
            Ok(self.row(*model, estimate, shares.as_ref()))
        };
        let rows = tally.sums.iter().enumerate().map(row).collect::<Result<_>>()?;
        let found = models.iter().copied().zip(proposals.mixtures.iter().cloned());
        let proposals = found.filter(|_| !proposals.pilots.is_empty()).collect();
        Ok(SampleResult { rows, proposals, ..SampleResult::default() })
    }

    /// A row of a weighting estimator.
    pub(super) fn row(&self, model: ModelId, estimate: Estimate, shares: Option<&KernelShares>) -> EstimateRow {
        let (exposure, options) = (self.exposure(), &self.options);
        let row = EstimateRow::of_draws(model, options.criterion, options.headway_name(), estimate, exposure);
        row.with_data(shares, exposure)
    }
}

/// Sums over a set of samples of one run; all models use the same samples. Tallies of disjoint sets can be merged in
/// any order to the same bits, because the sums follow a binary tree over the indices.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WeightedTally {
    /// Model by model.
    pub sums: Vec<(ModelId, BlockSums<WeightSums>)>,
}

impl WeightedTally {
    fn models(&self) -> Vec<ModelId> {
        self.sums.iter().map(|(model, _)| *model).collect()
    }
}

impl MergeableCounts for WeightedTally {
    fn covered(&self) -> Vec<Range<u64>> {
        self.sums.first().map_or_else(Vec::new, |(_, sums)| sums.ranges())
    }

    fn join(mut self, other: Self) -> Result<Self> {
        if self.models() != other.models() {
            let help = "join only counts of one run: same density, proposal, flags and seed";
            return Err(Error::input(Place::item("weighted sums"), "they are of other driver models", help));
        }
        for ((_, ours), (_, theirs)) in self.sums.iter_mut().zip(other.sums) {
            ours.merge(theirs)?;
        }
        Ok(self)
    }

    fn check(&self) -> std::result::Result<(), String> {
        for (model, sums) in &self.sums {
            sums.check()?;
            if sums.ranges() != self.covered() {
                return Err(format!("{} holds other samples than the first model", model.name()));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::estimate::WeightedDraw;

    /// Cancellation is checked after a bounded number of lane-steps and of weighted kernels, for every time step.
    #[test]
    fn a_chunk_is_bounded_by_its_work() {
        for step_cap in [1, 349, 3000, 120_000, 1_200_000, 4_000_000] {
            for (models, kernels) in [(1, 10), (4, 300), (4, 1_000_000)] {
                let samples = chunk_samples(step_cap, models, kernels);
                let lanes = lanes_within_seconds(step_cap);
                assert!(samples.is_power_of_two() && (samples * models <= lanes || samples == 1), "{samples}");
                assert!(samples * kernels <= CHUNK * 2 * KERNELS, "{samples}");
            }
        }
    }

    fn tally(models: &[ModelId], range: Range<u64>) -> WeightedTally {
        let leaf = |i: u64| {
            let response = f64::from(u8::from(i.is_multiple_of(3)));
            let weight = libm::exp(((i * 2_654_435_761) % 97) as f64 / 9.0 - 5.0);
            WeightSums::from(WeightedDraw { weight, response, tries: 1, is_void: false, is_thin: false })
        };
        let sums = || BlockSums::of_leaves(range.start, &range.clone().map(leaf).collect::<Vec<_>>());
        WeightedTally { sums: models.iter().map(|model| (*model, sums())).collect() }
    }

    #[test]
    fn parts_join_in_any_order_to_the_bits_of_the_whole() {
        let models = [ModelId::Rss, ModelId::Fsm];
        let whole = tally(&models, 0..1000);
        for cuts in [[0, 1, 512, 1000], [0, 333, 666, 1000], [0, 511, 513, 1000]] {
            let parts: Vec<WeightedTally> = cuts.windows(2).map(|w| tally(&models, w[0]..w[1])).collect();
            let [a, b, c] = [parts[0].clone(), parts[1].clone(), parts[2].clone()];
            assert_eq!(a.clone().join(b.clone()).unwrap().join(c.clone()).unwrap(), whole);
            assert_eq!(c.join(a).unwrap().join(b).unwrap(), whole);
        }
        assert_eq!(whole.covered().as_slice(), std::slice::from_ref(&(0..1000)));
    }

    #[test]
    fn samples_in_both_other_models_and_uneven_models_are_refused() {
        let models = [ModelId::Rss, ModelId::Fsm];
        assert!(tally(&models, 0..10).join(tally(&models, 9..12)).is_err());
        assert!(tally(&models, 0..10).join(tally(&models[..1], 10..12)).is_err());
        let mut uneven = tally(&models, 0..10);
        assert_eq!(uneven.check(), Ok(()));
        uneven.sums[1].1 = tally(&models, 0..9).sums[1].1.clone();
        assert!(uneven.check().unwrap_err().contains("FSM"));
    }
}
