//! Flags of `lanesweep sample`: a density in, probabilities of failure out.

use std::path::PathBuf;

use clap::Args;

use super::ProfileFlags;
use super::backend_flags::BackendFlags;
use super::format::FormatFlag;
use super::lists;
use super::shard_flags::ShardFlags;
use super::source::PlausibilityFlag;
use crate::Result;
use crate::cli::settings::SampleSettings;
pub(super) use crate::cli::settings::{
    EstimatorKind as EstimatorFlag, IntervalKind as IntervalFlag, PointKind as PointsFlag,
};
use crate::engine::{Headway, OpenBackend};
use crate::interop::openscenario::Rename;
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::run::sampling::SampleHeadways;
use crate::stats::density::DensityModel;

/// How likely does a driver fail?
///
/// Draws concrete scenarios from a density (see `lanesweep fit`), runs each against the driver models and estimates
/// the probability of failure with its interval: by crude Monte Carlo, importance sampling, cross-entropy or subset
/// simulation. Each estimate has a verdict on whether to trust it. A table goes to stdout, files to --out.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
#[command(mut_args(|arg| match arg.get_id().as_str() {
    "density" | "distribution" | "category" | "rename" | "set" | "estimator" | "samples" | "models" | "criterion" | "thw" | "points" | "interval" | "level" | "half_width"
    | "time_limit" | "worst" | "map" | "given" | "proposal"
    | "seed" | "profile" | "dt" => arg.conflicts_with("plan"),
    "rows" => arg.conflicts_with("plan_only"),
    _ => arg,
}))]
#[command(
    after_help = "Examples (--help has more):\n  \
                  lanesweep sample lanesweep-densities/cut-in-2.json --samples 1e6\n  \
                  lanesweep sample cut-in-1.json --estimator subset --models FSM --thw 0.6\n  \
                  lanesweep sample cut-in-1.json --samples 1e8 --shard 0/2 --out big",
    after_long_help = "Examples (the repository has the .xosc file in docs/examples):\n  \
                  lanesweep sample lanesweep-densities/cut-in-2.json --samples 1e6\n  \
                  lanesweep sample cut-in-1.json --estimator subset --models FSM --thw 0.6\n  \
                  lanesweep sample cut-in-1.json --samples 1e8 --shard 0/2 --out big\n  \
                  lanesweep sample --distribution cut-in-stochastic.xosc --category cut-in \\\n      \
                  --rename Ego_Speed_kph=ego_speed_kmh --rename Other_Speed_kph=other_speed_kmh"
)]
pub struct Sample {
    /// Density file
    #[arg(value_name = "DENSITY", required_unless_present_any = ["plan", "distribution"])]
    pub(super) density: Option<PathBuf>,
    /// OpenSCENARIO file with stochastic distributions, not a density
    ///
    /// Its numberOfTestRuns and randomSeed are the defaults of --samples and --seed.
    #[arg(long, value_name = "FILE", requires = "category", conflicts_with_all = ["density", "plan", "given", "proposal", "map", "rows", "shard", "plan_only"])]
    pub(super) distribution: Option<PathBuf>,
    /// With --distribution: kind of scenario: cut-in, cut-out, lvd
    #[arg(long, value_name = "NAME", requires = "distribution")]
    pub(super) category: Option<String>,
    /// With --distribution: parameter of the file = our parameter, times a factor; repeatable
    #[arg(long, value_name = "THEIRS=OURS[*FACTOR]", requires = "distribution")]
    pub(super) rename: Vec<Rename>,
    /// With --distribution: value that is the same in every sample; repeatable
    #[arg(long, value_name = "NAME=VALUE", requires = "distribution", value_parser = given)]
    pub(super) set: Vec<(String, f64)>,
    /// Crude, importance, cross-entropy, subset
    ///
    /// Crude Monte Carlo, importance sampling, cross-entropy or subset simulation. Importance sampling draws around the worst points of a pilot.
    #[arg(long, value_name = "mc|is|ce|subset", value_enum, hide_possible_values = true)]
    pub(super) estimator: EstimatorFlag,
    /// Samples at most [default: 100000; subset: 2000 per level]
    ///
    /// With ce: of the final sample.
    #[arg(long, value_name = "N", value_parser = lists::whole::<u64>)]
    pub(super) samples: Option<u64>,
    #[command(flatten)]
    models: lists::ModelsFlag,
    #[command(flatten)]
    criterion: lists::CriterionFlag,
    /// Time headways [default: the density's, else paper]
    ///
    /// paper is 2.0, 1.8, … 0.2. observed (or sampled): the headway is drawn from the recorded ones, as a parameter of
    /// the density, which needs `fit --with-thw`. The adaptive estimators take one headway.
    #[arg(long, value_name = "s,s,…|paper|observed")]
    thw: Option<String>,
    #[arg(long, value_name = "random|sobol", value_enum, hide_possible_values = true)]
    pub(super) points: PointsFlag,
    #[arg(long, value_name = "wilson|clopper-pearson", value_enum, hide_possible_values = true)]
    pub(super) interval: IntervalFlag,
    #[arg(long, value_name = "FRACTION")]
    pub(super) level: f64,
    /// Stop when half-width over estimate is at most this
    ///
    /// The interval is checked after 4096·2^k samples.
    #[arg(long, value_name = "FRACTION")]
    pub(super) half_width: Option<f64>,
    /// Stop at the first check after this time: not reproducible
    #[arg(long, value_name = "s")]
    pub(super) time_limit: Option<f64>,
    #[arg(long, value_name = "N", value_parser = lists::whole::<usize>)]
    worst: usize,
    /// Failure map over two parameters, or `none` [default: the first two]
    #[arg(long, value_name = "X,Y|none")]
    pub(super) map: Option<String>,
    /// Also write one row per lane: .csv, .jsonl or .parquet
    #[arg(long, value_name = "FILE")]
    pub(super) rows: Option<PathBuf>,
    /// Draw given this value of a parameter (mc); repeatable
    #[arg(long, value_name = "NAME=VALUE", value_parser = given)]
    pub(super) given: Vec<(String, f64)>,
    /// Proposal file to sample, with --estimator is; repeatable
    ///
    /// Several are combined by the balance heuristic.
    #[arg(long, value_name = "FILE")]
    pub(super) proposal: Vec<PathBuf>,
    /// Seed of the draws [default: 157, or the --distribution's]
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Folder for estimate.json, tables and figures
    #[arg(long, value_name = "DIR", default_value = "lanesweep-sample")]
    pub(super) out: PathBuf,
    /// Print lanes, memory and estimated time; write nothing
    #[arg(long, conflicts_with_all = ["shard", "plan_only"])]
    pub(super) dry_run: bool,
    #[command(flatten)]
    pub(super) plausibility: PlausibilityFlag,
    #[command(flatten)]
    pub(super) format: FormatFlag,
    #[command(flatten)]
    pub(super) shards: ShardFlags,
    #[command(flatten)]
    pub(super) backend: BackendFlags,
    #[command(flatten)]
    profile: ProfileFlags,
}

impl Sample {
    /// The seed of the draws.
    pub(super) fn seed(&self) -> u64 {
        self.seed.unwrap_or(SampleSettings::default().seed)
    }

    /// The seed as it was typed.
    pub(super) fn given_seed(&self) -> Option<u64> {
        self.seed
    }

    pub(super) fn open(&self) -> Result<OpenBackend> {
        self.backend.open()
    }

    pub(super) fn load_profile(&self) -> Result<Profile> {
        self.profile.load()
    }

    /// The headways of `--thw` where nothing draws them.
    pub(super) fn listed_headways(&self) -> Result<Option<Vec<Headway>>> {
        match self.thw.as_deref().map(str::trim) {
            None => Ok(None),
            Some("paper") => Ok(Some(Headway::paper())),
            Some(list) => lists::headways(list, "or `paper`").map(Some),
        }
    }

    pub(super) fn worst(&self) -> usize {
        self.worst
    }

    pub(super) fn is_crude(&self) -> bool {
        self.estimator == EstimatorFlag::Mc && self.proposal.is_empty()
    }

    /// Importance sampling of one given proposal: its samples are independent, so the run can be split and continued.
    pub(super) fn is_weighted(&self) -> bool {
        self.estimator == EstimatorFlag::Is && self.proposal.len() == 1
    }

    pub(super) fn models(&self) -> Result<Vec<ModelId>> {
        self.models.list()
    }

    pub(super) fn criterion(&self) -> Result<Criterion> {
        self.criterion.get()
    }

    pub(super) fn headways(&self, density: &DensityModel) -> Result<SampleHeadways> {
        match self.thw.as_deref().map(str::trim) {
            Some("sampled" | "observed") => Ok(SampleHeadways::Sampled),
            None if density.space.has_thw() => Ok(SampleHeadways::Sampled),
            None | Some("paper") => Ok(SampleHeadways::Each(Headway::paper())),
            Some(list) => Ok(SampleHeadways::Each(lists::headways(list, "`paper` or `observed`")?)),
        }
    }
}

/// `NAME=VALUE`.
fn given(text: &str) -> std::result::Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or("write NAME=VALUE, such as v_ego_mps=30")?;
    let value: f64 = value.trim().parse().map_err(|_| format!("`{value}` is not a number"))?;
    if value.is_finite() { Ok((name.trim().to_owned(), value)) } else { Err("the value is not finite".to_owned()) }
}
