//! What a sampling run gives.

use serde::Serialize;

use super::crude::CrudeRun;
use super::rows::EstimateRow;
use crate::model::driver::ModelId;
use crate::stats::density::Mixture;
use crate::stats::estimate::{CrossEntropyStep, SubsetLevel};

/// How an adaptive estimator went.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Levels {
    /// Cross-entropy.
    CrossEntropy(Vec<CrossEntropyStep>),
    /// Subset simulation.
    Subset(Vec<SubsetLevel>),
}

/// What a sampling run gave.
#[derive(Debug, Clone, Default)]
pub struct SampleResult {
    /// The estimates.
    pub rows: Vec<EstimateRow>,
    /// Counts and convergence of crude Monte Carlo.
    pub crude: Option<CrudeRun>,
    /// How an adaptive estimator went, model by model.
    pub levels: Vec<Levels>,
    /// The proposals that were found, model by model.
    pub proposals: Vec<(ModelId, Mixture)>,
    /// Parts that were merged; 0 of a run in one piece.
    pub parts: usize,
    /// Lanes that were computed again as a check.
    pub rechecked_lanes: u64,
}

impl SampleResult {
    pub(super) fn of_crude(mut run: CrudeRun) -> SampleResult {
        let (rows, rechecked_lanes) = (std::mem::take(&mut run.rows), run.summary.rechecked_lanes);
        SampleResult { rows, rechecked_lanes, crude: Some(run), ..SampleResult::default() }
    }
}
