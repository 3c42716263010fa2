//! Driver models against each other, on the same samples.

use serde::Serialize;

use super::Sample;
use super::rows::headway_name;
use super::sample_run::SampleResult;
use super::tally::SampleTally;
use crate::engine::LanePlan;
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::stats::estimate::{Clusters, Enough, Ratio, paired_ratio};

/// The rate of one model over that of another. Both met the same samples (common random numbers), so what the samples
/// and their scenarios have in common cancels. The interval covers the draws and the data; by importance sampling the
/// draws alone.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ModelRatio {
    /// Numerator.
    pub model: ModelId,
    /// Denominator.
    pub other: ModelId,
    /// Criterion.
    pub criterion: Criterion,
    /// Headway, or `all`.
    pub headway: String,
    /// The ratio.
    pub ratio: Ratio,
}

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

/// Every pair of models, criterion by criterion and headway by headway; empty if samples do not identify their
/// scenarios.
fn model_ratios(plan: &LanePlan, tally: &SampleTally, is_sampled: bool, level: f64) -> Vec<ModelRatio> {
    let Some(counts) = &tally.by_kernel else { return Vec::new() };
    let (models, headways) = (&plan.models, plan.headways.len());
    let all = (headways > 1).then(|| ("all".to_owned(), (0..headways).collect::<Vec<_>>()));
    let each = (0..headways).map(|headway| (headway_name(plan, headway, is_sampled), vec![headway]));
    let groups: Vec<(String, Vec<usize>)> = all.into_iter().chain(each).collect();
    let mut ratios = Vec::new();
    for criterion in Criterion::ALL {
        for (a, &model) in models.iter().enumerate() {
            for (b, &other) in models.iter().enumerate().skip(a + 1) {
                for (headway, of) in &groups {
                    let over = |model: usize| {
                        let cell = |at: &usize| (at * models.len() + model) * Criterion::ALL.len() + criterion.index();
                        counts.over(&of.iter().map(cell).collect::<Vec<_>>())
                    };
                    let ((runs, failures), (other_runs, other_failures)) = (over(a), over(b));
                    let ratio = paired_ratio(
                        Clusters { runs: &runs, failures: &failures },
                        Clusters { runs: &other_runs, failures: &other_failures },
                        Enough::default(),
                        level,
                    );
                    ratios.push(ModelRatio { model, other, criterion, headway: headway.clone(), ratio });
                }
            }
        }
    }
    ratios
}
