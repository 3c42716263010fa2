//! Result of a sampling run of any estimator.

use super::convergence::Checkpoint;
use super::estimate_rows::EstimateRow;
use lanesweep_engine::SampleTally;
use lanesweep_model::criterion::Criterion;
use lanesweep_stats::density::Mixture;
use lanesweep_stats::estimate::SearchRound;

/// Result of a sampling run.
#[derive(Debug, Clone, Default)]
pub struct SampleResult {
    /// The estimates.
    pub rows: Vec<EstimateRow>,
    /// Counts of crude Monte Carlo.
    pub crude: Option<SampleTally>,
    /// Estimates at the checkpoints.
    pub convergence: Vec<Checkpoint>,
    /// The rounds of the search.
    pub search: Vec<SearchRound>,
    /// The proposal found.
    pub proposal: Option<Mixture>,
    /// Number of merged parts; 0 for a run in one piece.
    pub parts: usize,
    /// Lanes that were rechecked.
    pub rechecked_lanes: u64,
}

impl SampleResult {
    /// Number of rows of a criterion whose interval of the draws is wider than asked, and of all its rows.
    pub fn wider_than(&self, half_width: f64, criterion: Criterion) -> (usize, usize) {
        let rows = || self.rows.iter().filter(|row| row.criterion == criterion && row.headway != "all");
        (rows().filter(|row| row.draws_half_width() > half_width).count(), rows().count())
    }
}
