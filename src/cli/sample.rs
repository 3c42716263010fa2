//! Flags of `lanesweep sample`: estimates failure probabilities over a density.

use std::path::PathBuf;

use clap::Args;

use super::format::FormatFlag;
use super::lists;
use super::shard_flags::ShardFlags;
use super::source::PlausibilityFlag;
use crate::settings::{EstimatorKind, SampleSettings};
use lanesweep_engine::Headway;
use lanesweep_model::driver::ModelId;
use lanesweep_run::sampling::SampleHeadways;
use lanesweep_stats::density::DensityModel;
use lanesweep_support::Result;

/// How likely does a driver fail?
///
/// Draws concrete scenarios from a density (see `lanesweep fit`), runs each against the driver models and estimates
/// the probability of failure with its interval, by crude Monte Carlo or importance sampling. With --half-width it
/// takes the cheaper one for each question. Each estimate has a verdict on whether to trust it. A table goes to
/// stdout, files to --out.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
#[command(mut_args(|arg| match arg.get_id().as_str() {
    "density" | "models" | "thw" | "proposal" => arg.conflicts_with("plan"),
    "rows" => arg.conflicts_with("plan_only"),
    "failures" => arg.conflicts_with_all(["shard", "plan_only"]),
    _ => arg,
}))]
#[command(after_help = "Examples:\n  \
                  lanesweep sample lanesweep-densities/cut-in-2.json --samples 1e6\n  \
                  lanesweep sample cut-in-1.json --models FSM --thw 2 --half-width 0.1\n  \
                  lanesweep sample cut-in-1.json --samples 1e8 --shard 0/2 --out big")]
pub(crate) struct Sample {
    /// Density file
    #[arg(value_name = "DENSITY", required_unless_present = "plan", help_heading = "Data")]
    pub density: Option<PathBuf>,
    #[command(flatten)]
    models: lists::ModelsFlag,
    /// Time headways, s [default: the density's, else paper]
    ///
    /// paper is 2.0, 1.8, … 0.2. observed (or sampled): the headway is drawn from the recorded ones, as a parameter of
    /// the density, which needs `fit --with-thw`.
    #[arg(long, value_name = "LIST", value_delimiter = ',', help_heading = "Scenario")]
    thw: Vec<String>,
    /// Also write one row per lane: .csv, .jsonl or .parquet
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub(super) rows: Option<PathBuf>,
    /// Also write the first failing lanes of each model and criterion: .csv, .jsonl or .parquet
    ///
    /// The first 1000, or sample.failures_limit; with the columns of --rows. For a run in parts: `merge --failures`.
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    pub(super) failures: Option<PathBuf>,
    /// Proposal file to sample, with --estimator is
    #[arg(long, value_name = "FILE", help_heading = "Data")]
    pub(super) proposal: Option<PathBuf>,
    /// Folder for estimate.json, tables and figures
    #[arg(long, value_name = "DIR", default_value = "lanesweep-sample", help_heading = "Output")]
    pub(super) out: PathBuf,
    #[command(flatten)]
    pub(super) plausibility: PlausibilityFlag,
    #[command(flatten)]
    pub(super) format: FormatFlag,
    #[command(flatten)]
    pub(super) shards: ShardFlags,
    /// The values of the flags that set keys.
    #[arg(skip)]
    pub(super) settings: SampleSettings,
}

impl Sample {
    pub(super) fn is_crude(&self) -> bool {
        self.settings.estimator != EstimatorKind::Is && self.proposal.is_none()
    }

    /// Whether importance sampling answers what crude Monte Carlo would answer at a higher cost.
    pub(super) fn is_refined(&self) -> bool {
        let needs_crude = self.rows.is_some()
            || self.settings.time_limit_s.is_some()
            || self.shards.is_split()
            || self.shards.plan.is_some();
        self.settings.estimator == EstimatorKind::Auto && self.settings.half_width.is_some() && !needs_crude
    }

    pub(super) fn models(&self) -> Result<Vec<ModelId>> {
        self.models.list()
    }

    pub(super) fn headways(&self, density: &DensityModel) -> Result<SampleHeadways> {
        match &self.thw.iter().map(|text| text.trim()).collect::<Vec<_>>()[..] {
            ["sampled" | "observed"] => Ok(SampleHeadways::Sampled),
            [] if density.space.has_thw() => Ok(SampleHeadways::Sampled),
            [] => Ok(SampleHeadways::Each(Headway::paper())),
            _ => Ok(SampleHeadways::Each(lists::headways(&self.thw)?)),
        }
    }
}
