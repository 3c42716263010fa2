//! Driver models, and profiles, against each other on the same samples.

use super::crude::sample_crude;
use super::estimate_rows::headway_name;
use super::kernel_counts::{KernelCounts, cell_of};
use super::plan::{mixture_of, plan_samples};
use super::result::{ModelRatio, ProfileRatios, SampleResult};
use super::tally::SampleTally;
use super::{Sample, SampleOptions};
use crate::engine::{Executor, LanePlan};
use crate::model::criterion::Criterion;
use crate::model::profile::Profile;
use crate::stats::estimate::StopRule;
use crate::{Error, Place, Result};

impl Sample {
    /// Every pair of models of a result. Where importance sampling answered, its ratio takes the place of the crude one.
    pub fn model_ratios(&self, result: &SampleResult) -> Vec<ModelRatio> {
        let level = result.rows.first().map_or(self.options.level, |row| row.estimate.interval.level);
        let is_sampled = self.density.space.has_thw();
        let crude = result.crude.as_ref().zip(self.lane_plan());
        let crude = crude.map(|(crude, plan)| model_ratios(plan, &crude.tally, is_sampled, level));
        let is_same = |a: &ModelRatio, b: &ModelRatio| {
            (a.model, a.other, a.criterion, &a.headway) == (b.model, b.other, b.criterion, &b.headway)
        };
        let mut all = crude.unwrap_or_default();
        for ratio in &result.ratios {
            match all.iter_mut().find(|old| is_same(old, ratio)) {
                Some(old) => *old = ratio.clone(),
                None => all.push(ratio.clone()),
            }
        }
        all
    }
}

impl Sample {
    /// The rates of a result over those that the same samples have under another profile.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] if the samples are not those of crude Monte Carlo, and as [`Sample::plan`] and
    /// [`Sample::run`] under the other profile.
    pub fn profile_ratios(&self, result: &SampleResult, other: &Profile, executor: &Executor) -> Result<ProfileRatios> {
        let Some((crude, plan)) = result.crude.as_ref().zip(self.lane_plan()) else {
            return Err(Error::usage(
                Place::item(format!("profile {}", other.name)),
                "two profiles are compared on the samples of crude Monte Carlo",
                "estimate by crude Monte Carlo",
            ));
        };
        let stop = StopRule::samples(crude.tally.covered().iter().map(|range| range.end).max().unwrap_or_default());
        let options = SampleOptions { stop, worst: 0, map: None, injury: None, ..self.options.clone() };
        let theirs = plan_samples(&self.density, &mixture_of(&self.density, &options.given)?, other, &options)?;
        let run = sample_crude(&theirs, 0..theirs.unit_count(), executor, &options, None, None)?;
        let level = result.rows.first().map_or(options.level, |row| row.estimate.interval.level);
        let ratios = match (&crude.tally.by_kernel, &run.tally.by_kernel) {
            (Some(ours), Some(theirs)) => {
                let pairs: Vec<[usize; 2]> = (0..plan.models.len()).map(|model| [model; 2]).collect();
                ratios_of(plan, [ours, theirs], &pairs, self.density.space.has_thw(), level)
            }
            _ => Vec::new(),
        };
        Ok(ProfileRatios { other: other.name.clone(), ratios })
    }
}

/// Every pair of models; empty if samples do not identify their scenarios.
fn model_ratios(plan: &LanePlan, tally: &SampleTally, is_sampled: bool, level: f64) -> Vec<ModelRatio> {
    let Some(counts) = &tally.by_kernel else { return Vec::new() };
    let models = plan.models.len();
    let pairs: Vec<[usize; 2]> = (0..models).flat_map(|a| (a + 1..models).map(move |b| [a, b])).collect();
    ratios_of(plan, [counts; 2], &pairs, is_sampled, level)
}

/// The ratios of pairs of models, the first one in the first counts; criterion by criterion and headway by headway.
fn ratios_of(
    plan: &LanePlan,
    counts: [&KernelCounts; 2],
    pairs: &[[usize; 2]],
    is_sampled: bool,
    level: f64,
) -> Vec<ModelRatio> {
    let (models, headways) = (&plan.models, plan.headways.len());
    let all = (headways > 1).then(|| ("all".to_owned(), (0..headways).collect::<Vec<_>>()));
    let each = (0..headways).map(|headway| (headway_name(plan, headway, is_sampled), vec![headway]));
    let groups: Vec<(String, Vec<usize>)> = all.into_iter().chain(each).collect();
    let mut ratios = Vec::new();
    for criterion in Criterion::ALL {
        for pair in pairs {
            for (headway, of) in &groups {
                let [ours, theirs] = pair.map(|model| -> Vec<usize> {
                    of.iter().map(|headway| cell_of(models.len(), *headway, model, criterion)).collect()
                });
                let ratio = counts[0].ratio(&ours, (counts[1], &theirs), level);
                let [model, other] = pair.map(|at| models[at]);
                ratios.push(ModelRatio { model, other, criterion, headway: headway.clone(), ratio });
            }
        }
    }
    ratios
}
