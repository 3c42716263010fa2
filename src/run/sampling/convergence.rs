//! Estimates after growing numbers of samples, by either estimator, from counts that are kept apart there.

use serde::Serialize;

use super::estimate_rows::{EstimateRow, crude_rows};
use super::sample_run::SampleCounts;
use super::{Sample, SampleKind};
use crate::parts::{Job, MergeableCounts};
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_stats::estimate::StopReason;
use lanesweep_support::Result;

/// Estimates after a number of samples.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Checkpoint {
    /// Number of samples, including void ones; with importance sampling, of draws of the proposal.
    pub samples: u64,
    /// One per model and criterion, over all headways if there are several; of importance sampling one per question.
    pub rows: Vec<CheckpointRow>,
}

/// One estimate at a checkpoint.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CheckpointRow {
    /// Driver model.
    pub model: ModelId,
    /// Criterion.
    pub criterion: Criterion,
    /// Headway, as of [`EstimateRow`].
    pub headway: String,
    /// Estimate.
    pub probability: f64,
    /// Ends of the interval of the draws alone; more samples narrow it.
    pub interval: [f64; 2],
    /// Ends of the interval that includes the uncertainty of the data, and the effective number of failing scenarios.
    /// `None` with importance sampling, or if draws do not come from scenarios.
    pub with_data: Option<([f64; 2], f64)>,
}

impl Sample {
    /// The counts of all segments, and the estimates at the cuts.
    ///
    /// # Errors
    /// If segments contain the same samples.
    pub(super) fn converged(&self, mut segments: Vec<SampleCounts>) -> Result<(Option<SampleCounts>, Vec<Checkpoint>)> {
        segments.sort_by_key(|segment| segment.covered().first().map_or(0, |range| range.start));
        let (looks, mut all, mut convergence) = (self.cuts(), None::<SampleCounts>, Vec::new());
        for segment in segments {
            let counts = match all {
                Some(before) => before.join(segment)?,
                None => segment,
            };
            // Checkpoints are evaluated only on samples from the first one on without a gap.
            if let [covered] = &counts.covered()[..]
                && covered.start == 0
                && looks.contains(&covered.end)
            {
                let rows = match (&self.kind, &counts) {
                    (SampleKind::Crude(plan), SampleCounts::Crude(tally)) => {
                        crude_rows(self, plan, tally, StopReason::Samples)
                    }
                    (_, SampleCounts::Weighted(tally)) => self.weighted_rows(tally),
                    _ => Vec::new(),
                };
                convergence.push(Checkpoint { samples: covered.end, rows: overall(&rows) });
            }
            all = Some(counts);
        }
        Ok((all, convergence))
    }
}

/// The rows over all headways.
fn overall(rows: &[EstimateRow]) -> Vec<CheckpointRow> {
    let of = |row: &EstimateRow| CheckpointRow {
        model: row.model,
        criterion: row.criterion,
        headway: row.headway.clone(),
        probability: row.estimate.probability,
        interval: row.draws,
        with_data: row.failing_scenarios.map(|n| ([row.estimate.interval.low, row.estimate.interval.high], n)),
    };
    rows.iter().filter(|row| row.is_overall(rows)).map(of).collect()
}
