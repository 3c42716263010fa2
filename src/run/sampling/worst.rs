//! The worst lanes of a crude run with their outcomes.

use super::{SampleTally, WorstSample};
use crate::engine::{LaneKey, LanePlan, LaneRunner, Outcome};
use crate::model::driver::ModelId;
use crate::{Error, Result};

/// One of the worst lanes.
pub struct WorstLane {
    /// Rank among the model's worst lanes, from 1.
    pub rank: usize,
    /// The lane and its limit state.
    pub lane: WorstSample,
    /// Its key.
    pub key: String,
    /// Its sample index.
    pub sample: u64,
    /// Driver model.
    pub model: ModelId,
    /// Headway, from the plan or the parameters.
    pub headway: String,
    /// Its point.
    pub point: Vec<f64>,
    /// Its outcome.
    pub outcome: Outcome<f64>,
}

impl WorstLane {
    /// Runs the worst lanes of a tally once more. `drawn` returns the point of a lane's sample, and its headway if
    /// sampled.
    ///
    /// # Errors
    /// Errors of `drawn`; [`Error::Internal`] for a tally of another plan.
    pub fn of_tally(
        plan: &LanePlan,
        tally: &SampleTally,
        drawn: impl Fn(&LaneKey) -> Result<(Vec<f64>, Option<String>)>,
    ) -> Result<Vec<WorstLane>> {
        let runner = LaneRunner::<f32>::new(plan);
        let of_models = plan.models.iter().zip(&tally.worst);
        let lanes = of_models.flat_map(|(model, lanes)| (1..).zip(lanes).map(|(rank, lane)| (*model, rank, *lane)));
        let run = |(model, rank, lane): (ModelId, usize, WorstSample)| {
            let missing = || Error::Internal(format!("lane {} is not in the plan", lane.lane));
            let key = plan.key(lane.lane).ok_or_else(missing)?;
            let (point, headway) = drawn(&key)?;
            Ok(WorstLane {
                rank,
                lane,
                key: plan.key_text(&key),
                sample: key.unit,
                model,
                headway: headway.unwrap_or_else(|| plan.headways[key.headway].to_string()),
                point,
                outcome: runner.run(&key).widen(),
            })
        };
        lanes.map(run).collect()
    }
}
