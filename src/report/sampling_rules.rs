//! How the estimates of a sampling run are to be read, in words that its table and its page share.

use super::sampling::EstimateFile;
use crate::run::sampling::EstimateRow;

impl EstimateFile {
    /// The headway of a row, or of how many P is the mean.
    pub(super) fn headway_cell(&self, row: &EstimateRow) -> String {
        if row.headway == "all" { format!("all {}", self.headways.len()) } else { row.headway.clone() }
    }

    /// What P over all headways is a mean of; `None` where there is one headway.
    pub(super) fn mean_rule(&self) -> Option<String> {
        let is_mean = self.estimates.iter().any(|row| row.headway == "all");
        is_mean.then(|| {
            format!(
                "THW all {}: P is the mean over {}; every sample runs from each of them, and each counts the same; every \
                 headway of its own is in estimates.csv",
                self.headways.len(),
                self.headways.join(", ")
            )
        })
    }

    /// What a rate per hour assumes; `None` where no risk is known or the density draws the headway.
    pub(super) fn exposure_rule(&self) -> Option<String> {
        let is_known = self.estimates.iter().any(|row| row.risk.per_hour.is_some() || row.risk.per_1000_km.is_some());
        (is_known && !self.plan_headways.is_empty()).then(|| {
            "Per hour and per 1000 km: scenarios occur as often as observed, but begin at these headways, which are \
             imposed, not observed; a density fitted with --with-thw draws them"
                .to_owned()
        })
    }

    /// What the intervals hold besides the draws.
    pub(super) fn interval_rule(&self) -> &'static str {
        if self.density.kernels == 0 {
            ""
        } else if self.estimates.iter().all(|row| row.failing_scenarios.is_some()) {
            " hold what other scenarios would change (bandwidth and scale held)"
        } else {
            " are of the draws alone: what other scenarios would change is not in them"
        }
    }
}
