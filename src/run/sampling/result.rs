//! Result of a sampling run of any estimator.

use serde::Serialize;

use super::crude::CrudeRun;
use super::estimate_rows::EstimateRow;
use super::injuries::InjuryRow;
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::stats::density::Mixture;
use crate::stats::estimate::{Ratio, SearchRound};

/// Result of a sampling run.
#[derive(Debug, Clone, Default)]
pub struct SampleResult {
    /// The estimates.
    pub rows: Vec<EstimateRow>,
    /// Expected injuries, by crude Monte Carlo with curves.
    pub injuries: Vec<InjuryRow>,
    /// Ratios of the rates of two models by importance sampling.
    pub ratios: Vec<ModelRatio>,
    /// Ratios to the rates under another profile, if it was asked for.
    pub profiles: Option<ProfileRatios>,
    /// Counts and convergence of crude Monte Carlo.
    pub crude: Option<CrudeRun>,
    /// The rounds of the search.
    pub search: Vec<SearchRound>,
    /// The proposal found.
    pub proposal: Option<Mixture>,
    /// Number of merged parts; 0 for a run in one piece.
    pub parts: usize,
    /// Lanes that were rechecked.
    pub rechecked_lanes: u64,
}

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

/// The models of a run under its profile against the same models under another one.
#[derive(Debug, Clone)]
pub struct ProfileRatios {
    /// The profile of the denominators.
    pub other: String,
    /// Numerator and denominator are of one model.
    pub ratios: Vec<ModelRatio>,
}
