//! `lanesweep sample` with the estimators that look for failures, and with given proposals.

use std::path::PathBuf;

use super::Exit;
use super::dry_run::{DryRun, Part};
use super::sample::{EstimatorFlag, Run, one_headway};
use super::sample_checks::MAX_HELD;
use crate::Result;
use crate::model::driver::ModelId;
use crate::report::sampling::{EstimateFile, Levels};
use crate::run::sampling::{
    EstimateRow, LaneLimitState, SampleHeadways, plan_points, proposal_text, read_proposal, scenario_shares, truncated,
};
use crate::stats::density::{BandwidthRule, Kde, Mixture};
use crate::stats::estimate::{
    CrossEntropy, Defended, Density, Estimate, Importance, Pilot, PilotCheck, Subset, Technique, balance_heuristic,
    cross_entropy, defended, from_pilot_with_proposal, importance, pilot_proposal, subset,
};
use crate::support::run_dir::Results;

/// Draws that the valid share of each of several proposals is counted on.
const VALIDITY_DRAWS: u64 = 1_000_000;

impl Run<'_> {
    /// One model after the other, at one headway. The proposals that are found go to the results.
    pub(super) fn adaptive(&self, results: &mut Results) -> Result<EstimateFile> {
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
            let (estimate, level, proposal) = self.estimate(&nominal, model, samples, results)?;
            let of = |proposal| {
                scenario_shares(&self.limit_state(model), proposal, self.flags.defensive_weight, self.flags.seed())
            };
            let shares = proposal.as_ref().map(of).transpose()?.flatten();
            let exposure = self.density.exposure.as_ref();
            let row = EstimateRow::of_draws(model, self.criterion, headway.clone(), estimate, exposure);
            rows.push(row.with_data(shares.as_ref(), exposure));
            levels.extend(level);
        }
        let mut file = self.file(samples, rows)?;
        file.levels = levels;
        Ok(file)
    }

    /// What the run would be, at most: how many levels there are is seen on the way.
    pub(super) fn forecast_adaptive(&self) -> Result<Exit> {
        let flags = self.flags;
        let given = |usual: u64| flags.samples.unwrap_or(usual);
        let lanes = match flags.estimator {
            EstimatorFlag::Subset => {
                let options = Subset::new(flags.seed(), given(2000));
                options.samples_per_level.saturating_mul(options.levels as u64)
            }
            EstimatorFlag::Ce => {
                let samples = given(100_000);
                let options = CrossEntropy::new(flags.seed(), (samples / 10).max(2000), samples);
                samples.saturating_add(options.samples_per_level.saturating_mul(options.levels as u64))
            }
            EstimatorFlag::Mc | EstimatorFlag::Is if flags.proposal.is_empty() => {
                given(100_000).saturating_add(flags.pilot)
            }
            EstimatorFlag::Mc | EstimatorFlag::Is => given(100_000),
        };
        let part = |model: &ModelId| Part {
            of: model.name().to_owned(),
            what: format!("estimator {}", flags.estimator.key()),
            units: lanes,
            lanes,
        };
        DryRun {
            data: self.density.provenance.data.clone(),
            parts: self.models.iter().map(part).collect(),
            units: "samples",
            is_at_most: true,
            // The points of a level or pilot, with their limit states and the fit's responsibilities.
            more_bytes: lanes.min(MAX_HELD) * (self.density.space.parameters().len() as u64 + 8) * 8,
            more: "the points that are held at once",
            forecast: None,
            backend: self.opened.backend().describe(),
            before: None,
            besides: "",
        }
        .print(self.flags.format)?;
        Ok(Exit::Ok)
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

    /// The kernels of a pilot's worst points.
    fn fitted(&self, points: &[Vec<f64>]) -> Result<Mixture> {
        let names: Vec<&str> = self.density.space.parameters().iter().map(|p| p.name.as_str()).collect();
        Kde::fit(points.to_vec(), &names, BandwidthRule::Reduction)?.mixture()
    }

    /// The proposal of every driver model, with what its pilot counted.
    pub(super) fn pilots(&self, pilot: &Pilot) -> Result<(Vec<Mixture>, Vec<PilotCheck>)> {
        let nominal = truncated(&self.density)?;
        let fit = |points: &[Vec<f64>]| self.fitted(points);
        let search = |&model: &ModelId| {
            tracing::info!("pilot of {} on {}", model.name(), self.opened.backend().describe());
            pilot_proposal(&nominal, &self.limit_state(model), &fit, pilot, self.flags.seed())
        };
        let found: Vec<(Mixture, PilotCheck)> = self.models.iter().map(search).collect::<Result<_>>()?;
        Ok(found.into_iter().unzip())
    }

    /// The estimate of one model, its levels, and the proposal that was sampled.
    fn estimate(
        &self,
        nominal: &dyn Density,
        model: ModelId,
        samples: u64,
        results: &mut Results,
    ) -> Result<(Estimate, Option<Levels>, Option<Mixture>)> {
        let flags = self.flags;
        let lanes = self.limit_state(model);
        let importance_options =
            Importance { level: flags.level, stop: self.stop(samples), ..Importance::new(flags.seed(), samples) };
        let proposal_file = format!("proposal-{}.json", model.name());
        match flags.estimator {
            EstimatorFlag::Subset => {
                let options = Subset { level: flags.level, ..Subset::new(flags.seed(), samples) };
                let run = subset(nominal, &lanes, &options)?;
                Ok((run.estimate, Some(Levels::Subset(run.levels)), None))
            }
            EstimatorFlag::Ce => {
                let options = CrossEntropy {
                    level: flags.level,
                    defence: flags.defensive_weight,
                    stop: self.stop(samples),
                    ..CrossEntropy::new(flags.seed(), (samples / 10).max(2000), samples)
                };
                let run = cross_entropy(nominal, &lanes, &options)?;
                results.add(&proposal_file, proposal_text(&self.density, &run.proposal)?.as_bytes())?;
                Ok((run.estimate, Some(Levels::CrossEntropy(run.steps)), Some(run.proposal)))
            }
            EstimatorFlag::Mc | EstimatorFlag::Is if flags.proposal.is_empty() => {
                let (estimate, proposal) = from_pilot_with_proposal(
                    nominal,
                    &lanes,
                    &|points: &[Vec<f64>]| self.fitted(points),
                    &Pilot {
                        worst: flags.elite_fraction,
                        broad: flags.broad_weight,
                        defence: flags.defensive_weight,
                        ..Pilot::guarded(flags.pilot)
                    },
                    &importance_options,
                )?;
                results.add(&proposal_file, proposal_text(&self.density, &proposal)?.as_bytes())?;
                Ok((estimate, None, Some(proposal)))
            }
            EstimatorFlag::Mc | EstimatorFlag::Is => {
                let read = |path: &PathBuf| read_proposal(path, &self.density);
                let mixtures: Vec<Mixture> = flags.proposal.iter().map(read).collect::<Result<_>>()?;
                let is_one = mixtures.len() == 1;
                let equal: Vec<(f64, &Mixture)> = mixtures.iter().map(|m| (1.0 / mixtures.len() as f64, m)).collect();
                let all = Mixture::join(&equal)?;
                let prepared = |mixture| {
                    let proposal = defended(mixture, nominal, flags.defensive_weight)?;
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
                Ok((estimate, None, Some(all)))
            }
        }
    }
}
