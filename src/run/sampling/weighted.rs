//! Importance sampling over given proposals, or those of a pilot: draws, judges and weighs what a ledger does not hold.

use super::lanes::{LaneLimitState, scenario_shares, truncated};
use super::rows::EstimateRow;
use super::weighted_plan::WeightedPlan;
use super::weighted_tally::WeightedTally;
use crate::engine::{CpuBackend, Executor, lanes_within_seconds};
use crate::model::driver::ModelId;
use crate::run::parts::{Countable, Ledger};
use crate::stats::density::{BandwidthRule, DensityModel, Kde, Mixture};
use crate::stats::estimate::{
    BlockSums, Defended, Pilot, PilotCheck, StopReason, WeightSums, defended, from_weight_sums, importance_sums,
    pilot_proposal,
};
use crate::support::cancel::Cancel;
use crate::{Error, Place, Result};

/// Samples that are judged between two looks at the journal, at most.
const CHUNK: u64 = 1 << 16;

/// Kernels up to which weighing so many samples takes about a second.
const KERNELS: u64 = 1 << 10;

/// Samples between two looks at the journal and at a signal: so few that they take seconds, whatever a lane costs. A
/// power of two, as the sums' tree has it.
fn chunk_samples(step_cap: u32, models: u64, kernels: u64) -> u64 {
    let judged = lanes_within_seconds(step_cap) / models.max(1);
    let weighed = CHUNK / (kernels / KERNELS).max(1);
    1 << judged.min(weighed).clamp(1, CHUNK).ilog2()
}

/// The kernels of a pilot's worst points.
pub(super) fn fitted(density: &DensityModel, points: &[Vec<f64>]) -> Result<Mixture> {
    let names: Vec<&str> = density.space.parameters().iter().map(|p| p.name.as_str()).collect();
    Kde::fit(points.to_vec(), &names, BandwidthRule::Reduction)?.mixture()
}

impl WeightedPlan {
    /// Samples between two looks at the journal.
    pub(crate) fn chunk_samples(&self) -> u64 {
        let facts = &self.facts;
        let kernels = self.density.kde.points().len();
        chunk_samples(facts.profile.step_cap(), facts.models.len() as u64, kernels as u64)
    }

    fn limit_state<'a>(&'a self, model: ModelId, executor: Executor<'a>) -> LaneLimitState<'a> {
        LaneLimitState {
            density: &self.density,
            profile: &self.facts.profile,
            model,
            criterion: self.facts.criterion,
            headway: self.headways(),
            executor,
        }
    }

    /// The proposal of every driver model, with what its pilot counted.
    pub(super) fn pilots(&self, pilot: &Pilot, executor: &Executor) -> Result<(Vec<Mixture>, Vec<PilotCheck>)> {
        let nominal = truncated(&self.density)?;
        let fit = |points: &[Vec<f64>]| fitted(&self.density, points);
        let search = |&model: &ModelId| {
            tracing::info!("pilot of {} on {}", model.name(), executor.backend.describe());
            pilot_proposal(&nominal, &self.limit_state(model, executor.clone()), &fit, pilot, self.facts.seed)
        };
        let found: Vec<(Mixture, PilotCheck)> = self.facts.models.iter().map(search).collect::<Result<_>>()?;
        Ok(found.into_iter().unzip())
    }

    /// Draws, judges and weighs what the ledger does not hold yet.
    pub(crate) fn sample(
        &self,
        ledger: &mut Ledger<WeightedTally>,
        executor: &Executor,
        mut progress: impl FnMut(u64),
    ) -> Result<()> {
        let facts = &self.facts;
        let nominal = truncated(&self.density)?;
        let prepared = |proposal: &Mixture| defended(proposal.clone(), &nominal, facts.defence);
        let proposals: Vec<Defended> = self.proposals.iter().map(prepared).collect::<Result<_>>()?;
        let (units, chunk) = (ledger.units(), self.chunk_samples());
        // The samples of a chunk are drawn, judged and weighed together or not at all.
        let whole = executor.clone().with_cancel(Cancel::default());
        for missing in ledger.missing(units.clone())? {
            let mut at = missing.start;
            while at < missing.end {
                let next = (at / chunk + 1).saturating_mul(chunk).min(missing.end);
                // One proposal serves all models, or each has its own.
                let sums_of = |(&model, proposal): (&ModelId, &Defended)| {
                    let lanes = self.limit_state(model, whole.clone());
                    Ok((model, importance_sums(&nominal, proposal, &lanes, facts.seed, at..next)?))
                };
                let pairs = facts.models.iter().zip(proposals.iter().cycle());
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
    /// [`Error::Input`] at `place` where a sample or a driver model is missing.
    pub(super) fn rows(&self, tally: Option<WeightedTally>, place: Place) -> Result<Vec<EstimateRow>> {
        let (facts, density) = (&self.facts, &self.density);
        let tally = tally.filter(|tally| {
            let models: Vec<ModelId> = tally.sums.iter().map(|(model, _)| *model).collect();
            tally.covered().as_slice() == std::slice::from_ref(&(0..facts.samples)) && models == facts.models
        });
        let Some(tally) = tally else {
            let problem = "the parts do not hold every sample of every driver model";
            return Err(Error::input(place, problem, "make them again"));
        };
        let (cpu, exposure) = (CpuBackend::lane_arithmetic(), density.exposure.as_ref());
        let row = |(at, (model, sums)): (usize, &(ModelId, BlockSums<WeightSums>))| {
            let total = sums.total().unwrap_or_default();
            let mut estimate = from_weight_sums(&total, false, facts.level, StopReason::Samples);
            facts.pilots.get(at).into_iter().for_each(|pilot| pilot.add_to(&mut estimate));
            let row = EstimateRow::of_draws(*model, facts.criterion, self.headway_name(), estimate, exposure);
            // A few lanes more, on the CPU: a merge has no other backend, and all have the same bits.
            let lanes = self.limit_state(*model, Executor::new(&cpu));
            let proposal = &self.proposals[at % self.proposals.len()];
            let shares = scenario_shares(&lanes, proposal, facts.defence, facts.seed)?;
            Ok(row.with_data(shares.as_ref(), exposure))
        };
        tally.sums.iter().enumerate().map(row).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A look at the signal comes after a bounded number of lane-steps and of weighed kernels, whatever the time step.
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
}
