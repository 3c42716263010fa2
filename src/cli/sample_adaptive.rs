//! `lanesweep sample` with the estimators that look for failures, and with given proposals.

use std::path::PathBuf;

use super::sample::{EstimatorFlag, Run, one_headway};
use crate::Result;
use crate::density::{BandwidthRule, Kde, Mixture};
use crate::driver::ModelId;
use crate::estimate::{
    CrossEntropy, Defended, Density, Estimate, Importance, Pilot, Subset, Technique, balance_heuristic, cross_entropy,
    defended, from_pilot_with_proposal, importance, subset,
};
use crate::report::sampling::{EstimateFile, Levels};
use crate::sampling::{
    EstimateRow, LaneLimitState, Risk, SampleHeadways, plan_points, read_proposal, truncated, write_proposal,
};

/// Draws that the valid share of each of several proposals is counted on.
const VALIDITY_DRAWS: u64 = 1_000_000;

impl Run<'_> {
    /// One model after the other, at one headway.
    pub(super) fn adaptive(&self) -> Result<EstimateFile> {
        let headway = match &self.headways {
            SampleHeadways::Sampled => "sampled".to_owned(),
            SampleHeadways::Each(list) => one_headway(list, self.flags.estimator)?.to_string(),
        };
        // The same complaint for every model: make it before any work.
        let first = self.density.kde.points()[0].clone();
        plan_points(&self.density, &[first], &self.profile, &self.models, &self.headways)?;
        let nominal = truncated(&self.density)?;
        let samples = self.flags.samples.unwrap_or(match self.flags.estimator {
            EstimatorFlag::Subset => 2000,
            _ => 100_000,
        });
        let (mut rows, mut levels) = (Vec::new(), Vec::new());
        for &model in &self.models {
            tracing::info!("{} on {}", model.name(), self.opened.backend().describe());
            let (estimate, level) = self.estimate(&nominal, model, samples)?;
            let risk = Risk::of(&estimate, self.density.exposure.as_ref());
            rows.push(EstimateRow { model, criterion: self.criterion, headway: headway.clone(), estimate, risk });
            levels.extend(level);
        }
        let mut file = self.file(samples, rows)?;
        file.levels = levels;
        Ok(file)
    }

    /// The limit state of one model.
    fn limit_state(&self, model: ModelId) -> LaneLimitState<'_> {
        LaneLimitState {
            density: &self.density,
            profile: &self.profile,
            model,
            criterion: self.criterion,
            headway: self.headways.clone(),
            backend: self.opened.backend(),
            fallback: self.opened.fallback(),
        }
    }

    fn estimate(&self, nominal: &dyn Density, model: ModelId, samples: u64) -> Result<(Estimate, Option<Levels>)> {
        let flags = self.flags;
        let lanes = self.limit_state(model);
        let importance_options =
            Importance { level: flags.level, stop: self.stop(samples), ..Importance::new(flags.seed(), samples) };
        let proposal_file = flags.out.join(format!("proposal-{}.json", model.name()));
        match flags.estimator {
            EstimatorFlag::Subset => {
                let options = Subset { level: flags.level, ..Subset::new(flags.seed(), samples) };
                let run = subset(nominal, &lanes, &options)?;
                Ok((run.estimate, Some(Levels::Subset(run.levels))))
            }
            EstimatorFlag::Ce => {
                let options = CrossEntropy {
                    level: flags.level,
                    defence: flags.defence,
                    stop: self.stop(samples),
                    ..CrossEntropy::new(flags.seed(), (samples / 10).max(2000), samples)
                };
                let run = cross_entropy(nominal, &lanes, &options)?;
                write_proposal(&proposal_file, &self.density, &run.proposal)?;
                Ok((run.estimate, Some(Levels::CrossEntropy(run.steps))))
            }
            EstimatorFlag::Mc | EstimatorFlag::Is if flags.proposal.is_empty() => {
                let names: Vec<&str> = self.density.space.parameters().iter().map(|p| p.name.as_str()).collect();
                let fit = |points: &[Vec<f64>]| Kde::fit(points.to_vec(), &names, BandwidthRule::Reduction)?.mixture();
                let (estimate, proposal) = from_pilot_with_proposal(
                    nominal,
                    &lanes,
                    &fit,
                    &Pilot {
                        worst: flags.worst_share,
                        broad: flags.broad,
                        defence: flags.defence,
                        ..Pilot::guarded(flags.pilot)
                    },
                    &importance_options,
                )?;
                write_proposal(&proposal_file, &self.density, &proposal)?;
                Ok((estimate, None))
            }
            EstimatorFlag::Mc | EstimatorFlag::Is => {
                let read = |path: &PathBuf| read_proposal(path, &self.density);
                let mixtures: Vec<Mixture> = flags.proposal.iter().map(read).collect::<Result<_>>()?;
                let is_one = mixtures.len() == 1;
                let prepared = |mixture| {
                    let proposal = defended(mixture, nominal, flags.defence)?;
                    // One proposal's valid share comes out of its own draws.
                    Ok(if is_one { proposal } else { proposal.with_counted_validity(flags.seed(), VALIDITY_DRAWS) })
                };
                let proposals: Vec<Defended> = mixtures.into_iter().map(prepared).collect::<Result<_>>()?;
                let estimate = match &proposals[..] {
                    [one] => importance(nominal, one, &lanes, &importance_options)?,
                    several => {
                        let draws = samples / several.len() as u64;
                        let techniques: Vec<Technique> =
                            several.iter().map(|proposal| Technique { proposal, draws }).collect();
                        balance_heuristic(nominal, &techniques, &lanes, flags.seed(), flags.level)?
                    }
                };
                Ok((estimate, None))
            }
        }
    }
}
