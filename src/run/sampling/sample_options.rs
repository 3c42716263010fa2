//! What a sampling run is asked for.

use super::generator::SampleSource;
use super::map::MapAxes;
use super::plan::SampleHeadways;
use crate::engine::Headway;
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::stats::density::Mixture;
use crate::stats::estimate::{BinomialInterval, Pilot, StopRule};
use crate::{Error, Place, Result};

/// Points that an adaptive estimator holds at once, at most.
pub(crate) const MAX_HELD: u64 = 10_000_000;

/// How probabilities are estimated.
#[derive(Debug, Clone, PartialEq)]
pub enum Estimator {
    /// Crude Monte Carlo.
    Crude {
        /// Kind of points.
        points: SampleSource,
        /// Kind of interval.
        interval: BinomialInterval,
    },
    /// Importance sampling of what a pilot finds for each driver model.
    Pilot(Pilot),
    /// Importance sampling of given proposals; several are combined by the balance heuristic.
    Given {
        /// One for all driver models, or several.
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
    /// Crude Monte Carlo with independent points and Wilson's interval.
    pub const CRUDE: Estimator = Estimator::Crude { points: SampleSource::Random, interval: BinomialInterval::Wilson };

    /// As files name it: `mc`, `is`, `ce`, `subset`.
    pub fn key(&self) -> &'static str {
        match self {
            Estimator::Crude { .. } => "mc",
            Estimator::Pilot(_) | Estimator::Given { .. } => "is",
            Estimator::CrossEntropy { .. } => "ce",
            Estimator::Subset => "subset",
        }
    }
}

/// What a sampling run is asked for.
#[derive(Debug, Clone)]
pub struct SampleOptions {
    /// Estimator.
    pub estimator: Estimator,
    /// When to end. A rule beside the number of samples makes a run that cannot be split.
    pub stop: StopRule,
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
    /// Worst lanes to list per model (crude).
    pub worst: usize,
    /// Axes of the failure map (crude).
    pub map: Option<MapAxes>,
}

impl SampleOptions {
    /// All models from these headways, collisions, seed 157, level 0.95.
    pub fn new(estimator: Estimator, samples: u64, headways: SampleHeadways) -> SampleOptions {
        SampleOptions {
            estimator,
            stop: StopRule::samples(samples),
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
}

/// The one headway of an estimator that weighs; `None` where the density draws it.
pub(super) fn one_headway(options: &SampleOptions) -> Result<Option<Headway>> {
    match &options.headways {
        SampleHeadways::Sampled => Ok(None),
        SampleHeadways::Each(list) => match list[..] {
            [one] => Ok(Some(one)),
            _ => Err(Error::usage(
                Place::item("headways"),
                format!("estimator {} follows one headway at a time", options.estimator.key()),
                "give one, or a density that draws the headway",
            )),
        },
    }
}
