//! Estimators that choose the next samples during the run: they run in one piece.

use super::Sample;
use super::limit_state::{LaneLimitState, scenario_shares, truncated};
use super::sample_options::{Estimator, SampleOptions};
use super::sample_run::{Levels, SampleResult};
use crate::Result;
use crate::engine::Executor;
use crate::stats::density::Mixture;
use crate::stats::estimate::{
    CrossEntropy, Defended, Density, Estimate, Importance, Subset, Technique, balance_heuristic, cross_entropy,
    defended, from_pilot, importance, subset,
};

/// Draws for counting the valid fraction of each of several proposals.
const VALIDITY_DRAWS: u64 = 1_000_000;

impl Sample {
    /// Runs one model after the other.
    pub(super) fn run_sequential(&self, executor: &Executor) -> Result<SampleResult> {
        let options = &self.options;
        let nominal = truncated(&self.density)?;
        let mut result = SampleResult::default();
        for &model in &options.models {
            tracing::info!("{} on {}", model.name(), executor.backend.describe());
            let lanes = self.limit_state(model, executor.clone());
            let (estimate, level, proposal) = self.estimate(&nominal, &lanes)?;
            let of = |proposal| scenario_shares(&lanes, proposal, options.estimator.defence(), options.seed);
            let shares = proposal.as_ref().map(of).transpose()?.flatten();
            result.rows.push(self.row(model, estimate, shares.as_ref()));
            result.levels.extend(level);
            let found = proposal.filter(|_| !matches!(options.estimator, Estimator::Given { .. }));
            result.proposals.extend(found.map(|proposal| (model, proposal)));
        }
        Ok(result)
    }

    /// The estimate of one model, its levels, and the sampled proposal.
    fn estimate(
        &self,
        nominal: &dyn Density,
        lanes: &LaneLimitState,
    ) -> Result<(Estimate, Option<Levels>, Option<Mixture>)> {
        let SampleOptions { seed, level, stop, .. } = self.options;
        let samples = stop.samples;
        let importance_options = Importance { level, stop, ..Importance::new(seed, samples) };
        match &self.options.estimator {
            Estimator::Subset => {
                let run = subset(nominal, lanes, &Subset { level, ..Subset::new(seed, samples) })?;
                Ok((run.estimate, Some(Levels::Subset(run.levels)), None))
            }
            Estimator::CrossEntropy { defence } => {
                let options = CrossEntropy {
                    level,
                    defence: *defence,
                    stop,
                    ..CrossEntropy::new(seed, (samples / 10).max(2000), samples)
                };
                let run = cross_entropy(nominal, lanes, &options)?;
                Ok((run.estimate, Some(Levels::CrossEntropy(run.steps)), Some(run.proposal)))
            }
            Estimator::Pilot(pilot) => {
                let fit = |points: &[Vec<f64>]| self.kernels_over(points);
                let (estimate, proposal) = from_pilot(nominal, lanes, &fit, pilot, &importance_options)?;
                Ok((estimate, None, Some(proposal)))
            }
            Estimator::Given { proposals, defence } => {
                let share = 1.0 / proposals.len() as f64;
                let equal: Vec<(f64, &Mixture)> = proposals.iter().map(|m| (share, m)).collect();
                let all = Mixture::join(&equal)?;
                let prepared = |mixture: &Mixture| {
                    let proposal = defended(mixture.clone(), nominal, *defence)?;
                    // The valid fraction of a single proposal follows from its own draws.
                    let is_one = proposals.len() == 1;
                    Ok(if is_one { proposal } else { proposal.with_counted_validity(seed, VALIDITY_DRAWS) })
                };
                let proposals: Vec<Defended> = proposals.iter().map(prepared).collect::<Result<_>>()?;
                let estimate = match &proposals[..] {
                    [one] => importance(nominal, one, lanes, &importance_options)?,
                    several => {
                        let draws = samples / several.len() as u64;
                        let techniques: Vec<Technique> =
                            several.iter().map(|proposal| Technique { proposal, draws }).collect();
                        balance_heuristic(nominal, &techniques, lanes, seed, level)?
                    }
                };
                Ok((estimate, None, Some(all)))
            }
            Estimator::Crude { .. } => Err(crate::Error::Internal("crude Monte Carlo has no sequence".to_owned())),
        }
    }
}
