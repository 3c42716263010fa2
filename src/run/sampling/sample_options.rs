//! Options of a sampling run, as set by flags and settings, stored in its plan file and written to its record.

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
    /// Importance sampling with a proposal that a pilot finds for each driver model.
    Pilot(Pilot),
    /// Importance sampling with given proposals; several are combined by the balance heuristic.
    Given {
        /// One for all driver models, or several. A plan file stores them separately.
        #[serde(skip)]
        proposals: Vec<Mixture>,
        /// Defensive mixture weight: the weight of the density in each proposal.
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

    /// Name in files: `mc`, `is`, `ce`, `subset`.
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

    /// Defensive mixture weight: the weight of the density in each proposal.
    pub fn defence(&self) -> f64 {
        match self {
            Estimator::Crude { .. } | Estimator::Subset => 0.0,
            Estimator::Pilot(Pilot { defence, .. })
            | Estimator::Given { defence, .. }
            | Estimator::CrossEntropy { defence } => *defence,
        }
    }
}

/// Options of a sampling run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SampleOptions {
    /// Estimator.
    pub estimator: Estimator,
    /// When to end. A run with a rule in addition to the number of samples cannot be split.
    pub stop: StopRule,
    /// Kind of points (crude).
    pub source: SampleSource,
    /// Models, in order.
    pub models: Vec<ModelId>,
    /// Headways: only crude Monte Carlo accepts several.
    pub headways: SampleHeadways,
    /// Criterion of the estimators other than crude Monte Carlo, of the worst lanes, of the map and of the stop rules.
    pub criterion: Criterion,
    /// Seed of the draws.
    pub seed: u64,
    /// Level of the intervals.
    pub level: f64,
    /// Given parameters with their values (crude).
    pub given: Vec<(String, f64)>,
    /// Number of worst lanes listed per model (crude); with 0, only verdicts are computed.
    pub worst: usize,
    /// Axes of the failure map (crude).
    pub map: Option<MapAxes>,
}

impl SampleOptions {
    /// Independent points, all models, collision criterion, seed 157, level 0.95, and these headways.
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

    /// Refuses several headways for a weighting estimator.
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

    /// Headways; empty if the density draws them.
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
