//! What a sampling run is asked for: as flags and settings give it, as its plan file holds it and as its record tells it.

use serde::{Deserialize, Serialize};

use super::generator::SampleSource;
use super::map::MapAxes;
use super::plan::SampleHeadways;
use crate::engine::Headway;
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::stats::density::Mixture;
use crate::stats::estimate::{BinomialInterval, Pilot, StopRule};
use crate::{Error, Place, Result};

/// How probabilities are estimated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Estimator {
    /// Crude Monte Carlo.
    Crude {
        /// Kind of interval.
        interval: BinomialInterval,
    },
    /// Importance sampling of what a pilot finds for each driver model.
    Pilot(Pilot),
    /// Importance sampling of given proposals; several are combined by the balance heuristic.
    Given {
        /// One for all driver models, or several. A plan file holds them beside.
        #[serde(skip)]
        proposals: Vec<Mixture>,
        /// Defensive mixture weight: the density's share in each proposal.
        defence: f64,
    },
    /// Cross-entropy.
    CrossEntropy {
        /// Defensive mixture weight.
        defence: f64,
    },
    /// Subset simulation.
    Subset,
}

impl Estimator {
    /// Crude Monte Carlo with Wilson's interval.
    pub const CRUDE: Estimator = Estimator::Crude { interval: BinomialInterval::Wilson };

    /// As files name it: `mc`, `is`, `ce`, `subset`.
    pub fn key(&self) -> &'static str {
        match self {
            Estimator::Crude { .. } => "mc",
            Estimator::Pilot(_) | Estimator::Given { .. } => "is",
            Estimator::CrossEntropy { .. } => "ce",
            Estimator::Subset => "subset",
        }
    }

    /// Kind of interval of crude Monte Carlo.
    pub(super) fn interval(&self) -> BinomialInterval {
        match self {
            Estimator::Crude { interval } => *interval,
            _ => BinomialInterval::Wilson,
        }
    }

    /// Defensive mixture weight: the density's share in each proposal.
    pub fn defence(&self) -> f64 {
        match self {
            Estimator::Crude { .. } | Estimator::Subset => 0.0,
            Estimator::Pilot(Pilot { defence, .. })
            | Estimator::Given { defence, .. }
            | Estimator::CrossEntropy { defence } => *defence,
        }
    }
}

/// What a sampling run is asked for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SampleOptions {
    /// Estimator.
    pub estimator: Estimator,
    /// When to end. A rule beside the number of samples makes a run that cannot be split.
    pub stop: StopRule,
    /// Kind of points (crude).
    pub source: SampleSource,
    /// Models, in order.
    pub models: Vec<ModelId>,
    /// Headways: only crude Monte Carlo takes several.
    pub headways: SampleHeadways,
    /// Criterion of the estimators other than crude Monte Carlo, of the worst lanes, the map and the stop rules.
    pub criterion: Criterion,
    /// Seed of the draws.
    pub seed: u64,
    /// Level of the intervals.
    pub level: f64,
    /// Parameters that are given, with their values (crude).
    pub given: Vec<(String, f64)>,
    /// Worst lanes to list per model (crude); 0 needs verdicts only.
    pub worst: usize,
    /// Axes of the failure map (crude).
    pub map: Option<MapAxes>,
}

impl SampleOptions {
    /// Independent points, all models from these headways, collisions, seed 157, level 0.95.
    pub fn new(estimator: Estimator, samples: u64, headways: SampleHeadways) -> SampleOptions {
        SampleOptions {
            estimator,
            stop: StopRule::samples(samples),
            source: SampleSource::Random,
            models: ModelId::ALL.to_vec(),
            headways,
            criterion: Criterion::Collision,
            seed: 157,
            level: 0.95,
            given: Vec::new(),
            worst: 0,
            map: None,
        }
    }

    /// Refuses several headways where the estimator weighs.
    pub(super) fn check_headways(&self) -> Result<()> {
        match &self.headways {
            SampleHeadways::Each(list) if list.len() != 1 => Err(Error::usage(
                Place::item("headways"),
                format!("estimator {} follows one headway at a time", self.estimator.key()),
                "give one, or a density that draws the headway",
            )),
            _ => Ok(()),
        }
    }

    /// Headways; none where the density draws them.
    pub fn headways(&self) -> &[Headway] {
        match &self.headways {
            SampleHeadways::Each(list) => list,
            SampleHeadways::Sampled => &[],
        }
    }

    /// The one headway's name in tables.
    pub(crate) fn headway_name(&self) -> String {
        self.headways().first().map_or_else(|| "sampled".to_owned(), Headway::to_string)
    }
}
