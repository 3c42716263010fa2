//! How scores are made.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Result;
use crate::support::ranges;

/// How scores are made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ScoreOptions {
    /// Seed that chooses the lanes to check on the CPU. No score depends on it.
    pub seed: u64,
    /// Coverage of the intervals (0.95).
    #[schemars(extend("exclusiveMinimum" = 0.0, "exclusiveMaximum" = 1.0))]
    pub confidence: f64,
    /// Below so many failures in S F1 has no interval; below so many scenarios with one a claim is not judged (10).
    #[schemars(range(min = 0, max = 4_294_967_295_u32))]
    pub least_failures: u32,
}

impl Default for ScoreOptions {
    fn default() -> Self {
        ScoreOptions { seed: 157, confidence: 0.95, least_failures: 10 }
    }
}

impl ScoreOptions {
    /// Checks the ranges; the error names the option.
    pub fn validate(&self) -> Result<()> {
        ranges::check("score", self)
    }
}
