//! Options of a sampling run, as set by flags and settings, stored in its plan file and written to its record.

use serde::{Deserialize, Serialize};

use lanesweep_engine::Headway;
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_stats::density::Mixture;
use lanesweep_stats::estimate::{Goal, Search, StopRule};

/// How probabilities are estimated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Estimator {
    /// Crude Monte Carlo.
    Crude,
    /// Importance sampling with a proposal that a search finds, one for all questions.
    Search(Search),
    /// Importance sampling with a given proposal.
    Given {
        /// The proposal. A plan file stores it separately.
        #[serde(skip)]
        proposal: Option<Mixture>,
        /// Draws of the density for each draw of the proposal.
        crude_per_draw: u64,
    },
}

impl Estimator {
    /// Name in files: `mc`, `is`.
    pub fn key(&self) -> &'static str {
        match self {
            Estimator::Crude => "mc",
            Estimator::Search(_) | Estimator::Given { .. } => "is",
        }
    }
}

/// Initial headways of sampled lanes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SampleHeadways {
    /// Every sample starts from each of these.
    Each(Vec<Headway>),
    /// The parameter `thw_s` of the density.
    Sampled,
}

/// What is asked of a sample: does this driver model fail under this criterion from this headway?
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Question {
    /// Driver model.
    pub model: ModelId,
    /// Criterion.
    pub criterion: Criterion,
    /// Index into the headways of the run; 0 if the density draws the headway.
    pub headway: usize,
}

/// Options of a sampling run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SampleOptions {
    /// Estimator.
    pub estimator: Estimator,
    /// When to end. Crude Monte Carlo with a rule in addition to the number of samples cannot be split.
    pub stop: StopRule,
    /// Models, in order.
    pub models: Vec<ModelId>,
    /// Headways.
    pub headways: SampleHeadways,
    /// Criterion of importance sampling and of the stop rules.
    pub criterion: Criterion,
    /// What importance sampling is asked; empty: every model from every headway under the criterion.
    pub questions: Vec<Question>,
    /// Seed of the draws.
    pub seed: u64,
    /// Level of the intervals.
    pub level: f64,
}

impl SampleOptions {
    /// Independent points, all models, collision criterion, seed 157, level 0.95, and these headways.
    pub fn new(estimator: Estimator, samples: u64, headways: SampleHeadways) -> SampleOptions {
        SampleOptions {
            estimator,
            stop: StopRule::samples(samples),
            models: ModelId::ALL.to_vec(),
            headways,
            criterion: Criterion::Collision,
            questions: Vec::new(),
            seed: 157,
            level: 0.95,
        }
    }

    /// What importance sampling is asked.
    pub fn asked(&self) -> Vec<Question> {
        if !self.questions.is_empty() {
            return self.questions.clone();
        }
        let of = |(headway, model): (usize, &ModelId)| Question { model: *model, criterion: self.criterion, headway };
        let headways = 0..self.headways().len().max(1);
        self.models.iter().flat_map(|model| headways.clone().map(move |headway| (headway, model))).map(of).collect()
    }

    /// The accuracy that importance sampling aims at after a search with at most `max_crude` draws of the density.
    pub(super) fn goal(&self, max_crude: u64) -> Goal {
        let half_width = self.stop.relative_half_width.unwrap_or(Goal::HALF_WIDTH);
        Goal { half_width, max_draws: self.stop.samples, max_crude }
    }

    /// Headways; empty if the density draws them.
    pub fn headways(&self) -> &[Headway] {
        match &self.headways {
            SampleHeadways::Each(list) => list,
            SampleHeadways::Sampled => &[],
        }
    }

    /// A headway's name in tables.
    pub fn headway_name(&self, headway: usize) -> String {
        self.headways().get(headway).map_or_else(|| "sampled".to_owned(), Headway::to_string)
    }
}
