//! From counts to estimates: one row per model, criterion and headway, and one over all headways.

use serde::Serialize;

use super::risk::Risk;
use super::tally::SampleTally;
use crate::criterion::Criterion;
use crate::density::Exposure;
use crate::driver::ModelId;
use crate::estimate::{BinomialInterval, Counts, Estimate, StopReason, from_clusters, from_counts};
use crate::sweep::LanePlan;

/// An estimate and what it is of.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EstimateRow {
    /// Driver model.
    pub model: ModelId,
    /// Criterion.
    pub criterion: Criterion,
    /// Headway: `1.4s`, `sampled`, or `all` for the mean over those of the plan.
    pub headway: String,
    /// The probability that a sampled lane fails.
    pub estimate: Estimate,
    /// Failures per hour and per 1,000 km, where the exposure is known.
    pub risk: Risk,
}

/// Name of a plan's headway in tables.
pub fn headway_name(plan: &LanePlan, headway: usize, is_sampled: bool) -> String {
    if is_sampled { "sampled".to_owned() } else { plan.headways[headway].to_string() }
}

/// All rows of crude Monte Carlo. Headways share their samples, so the mean over them counts samples as clusters.
pub fn crude_rows(
    plan: &LanePlan,
    tally: &SampleTally,
    exposure: Option<&Exposure>,
    is_sampled: bool,
    interval: BinomialInterval,
    level: f64,
    stopped: StopReason,
) -> Vec<EstimateRow> {
    let (headways, models, criteria) = (plan.headways.len(), plan.models.len(), Criterion::ALL.len());
    let runs = tally.valid();
    let mut rows = Vec::new();
    for (model, &id) in plan.models.iter().enumerate() {
        for criterion in Criterion::ALL {
            let failed = |headway: usize| tally.failures[(headway * models + model) * criteria + criterion.index()];
            let mut push = |headway: String, estimate: Estimate| {
                let risk = Risk::of(&estimate, exposure);
                rows.push(EstimateRow { model: id, criterion, headway, estimate, risk });
            };
            if headways > 1 {
                let sum = (0..headways).map(failed).sum();
                let squares = tally.squares[model * criteria + criterion.index()];
                let mut all = from_clusters(runs, headways as u64, sum, squares, level, stopped);
                all.voids = tally.voids;
                push("all".to_owned(), all);
            }
            for headway in 0..headways {
                let counts = Counts { runs, failures: failed(headway), voids: tally.voids, tries: tally.tries };
                push(headway_name(plan, headway, is_sampled), from_counts(&counts, interval, level, stopped));
            }
        }
    }
    rows
}
