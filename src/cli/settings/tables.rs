//! The tables of a configuration.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::help::{MODELS, RUN};
use lanesweep_engine::BackendChoice;
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::Bound;
use lanesweep_model::profile::Profile;
use lanesweep_model::scenario::parameterization::{ParameterizationOptions, SvdLateral};
use lanesweep_run::score::ScoreOptions;
use lanesweep_stats::density::{BandwidthRule, FitOptions};
use lanesweep_support::config_tables;
use lanesweep_traffic::mining::MiningOptions;
use lanesweep_traffic::trajectory::generator::GeneratorOptions;

/// Verbs that choose a device.
const ON_DEVICES: [&str; 6] = ["study", "sample", "map", "verify", "show", "check"];
/// Verbs that simulate under one profile.
const SIMULATING: [&str; 6] = ["study", "sample", "map", "verify", "show", "simulate"];

/// Everything that may be set. A key with `x-flag` has that flag too, in the verbs `x-verbs`: see [`super::keys::KeyFlag`].
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(title = "lanesweep configuration")]
pub(crate) struct Settings {
    /// Options of every verb: threads, backend, profile.
    pub run: RunSettings,
    /// The synthetic recordings that verbs run on without data.
    pub generator: GeneratorOptions,
    /// Mining: what counts as a cut-in, a cut-out, a leader deceleration, and which are kept.
    pub mining: MiningOptions,
    /// Options of the parameterizations.
    pub parameterization: ParameterizationOptions,
    /// Scores of a study and its claims.
    pub score: ScoreOptions,
    /// `lanesweep study`.
    pub study: StudySettings,
    /// `lanesweep fit`.
    pub fit: FitSettings,
    /// `lanesweep sample`.
    pub sample: SampleSettings,
    /// `lanesweep map`.
    pub map: MapSettings,
    /// `lanesweep verify`.
    pub verify: VerifySettings,
}

fn profile_help() -> String {
    let names = Profile::names().collect::<Vec<_>>().join(", ");
    format!(
        "Name of a profile, or a TOML file of your own. Profiles: {names}. `map --preset jrc` takes jrc-2021 unless it is set."
    )
}

config_tables! {
    /// Options of every verb.
    pub(crate) struct RunSettings {
        /// Threads; results do not depend on it. Without it: all cores.
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schemars(range(min = 1, max = 4096))]
        #[schemars(extend("x-flag" = "threads", "x-verbs" = ["lanesweep"], "x-heading" = RUN))]
        pub threads: Option<usize> = None,
        /// Backend; auto: a GPU if there is one.
        #[schemars(extend("x-flag" = "backend", "x-verbs" = ON_DEVICES, "x-heading" = RUN))]
        pub backend: BackendChoice = BackendChoice::Auto,
        /// Device, by part of its name, PCI bus id or index. `lanesweep devices` lists the devices. The default
        /// is the first GPU.
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schemars(extend("x-flag" = "device", "x-verbs" = ON_DEVICES, "x-heading" = RUN))]
        #[schemars(extend("x-value" = "NAME|pci:BUS|INDEX"))]
        pub device: Option<String> = None,
        #[schemars(description = profile_help())]
        #[schemars(extend("x-flag" = "profile", "x-verbs" = SIMULATING, "x-heading" = MODELS, "x-value" = "NAME|FILE"))]
        pub profile: String = "paper".to_owned(),
        /// Time step, s. Without it: the profile's.
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schemars(extend("minimum" = Bound::TIME_STEP.smallest, "maximum" = Bound::TIME_STEP.largest))]
        #[schemars(extend("x-flag" = "dt", "x-verbs" = SIMULATING, "x-heading" = MODELS))]
        pub dt_s: Option<f64> = None,
        /// After this time, finish the current chunk and stop, as after Ctrl-C; the same command resumes, s. Without it:
        /// no limit.
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0.0, "exclusiveMaximum" = 1e9))]
        pub stop_after_s: Option<f64> = None,
    }

    /// `lanesweep study`.
    pub(crate) struct StudySettings {
        /// Compute in binary64 on the CPU, not in the f32 lane arithmetic.
        pub reference: bool = false,
        /// Run both arithmetics and list every verdict that differs (tables/reference.csv).
        pub compare_reference: bool = false,
        /// Keep the plan, run-plan.json, for `simulate --from`.
        pub keep_plan: KeepPlan = KeepPlan::Auto,
        /// Folds of the cross-validation; 1: none.
        #[schemars(range(min = 1, max = 100))]
        pub folds: usize = 5,
    }

    /// `lanesweep fit`.
    pub(crate) struct FitSettings {
        /// Search interval of the bandwidth.
        pub bandwidth_rule: BandwidthRule = FitOptions::default().rule,
        /// Sign of the lateral series of densities and of the replays that are compared with them.
        pub svd_lateral: SvdLateral = FitOptions::default().parameterization.svd_lateral,
        /// Seed of P_valid.
        #[schemars(extend("x-flag" = "seed", "x-verbs" = ["fit"], "x-heading" = RUN))]
        pub seed: u64 = FitOptions::default().seed,
        /// Number of draws for P_valid; with 10^9 its relative standard error is 0.01 % if it is 0.1.
        #[schemars(range(min = 1, max = 1_000_000_000))]
        pub valid_draws: u64 = FitOptions::default().valid_draws,
    }

    /// `lanesweep sample`.
    pub(crate) struct SampleSettings {
        /// Crude, importance, or the cheaper one. Importance sampling searches the failures, then draws
        /// around them; `auto` chooses for each model and headway, and is `mc` without a half-width.
        #[schemars(extend("x-flag" = "estimator", "x-verbs" = ["sample"], "x-heading" = MODELS))]
        pub estimator: EstimatorKind = EstimatorKind::Auto,
        /// Number of samples. With a half-width: the maximum. Without it: 100000, or as needed.
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schemars(range(min = 1, max = 281_474_976_710_655_u64))]
        #[schemars(extend("x-flag" = "samples", "x-verbs" = ["sample"], "x-heading" = MODELS))]
        pub samples: Option<u64> = None,
        /// Criterion of importance sampling and of a half-width.
        #[schemars(extend("x-flag" = "criterion", "x-verbs" = ["sample"], "x-heading" = MODELS))]
        pub criterion: Criterion = Criterion::Collision,
        /// Level of the intervals.
        #[schemars(extend("minimum" = 0.5, "exclusiveMaximum" = 1.0))]
        #[schemars(extend("x-flag" = "level", "x-verbs" = ["sample"], "x-heading" = MODELS))]
        pub level: f64 = 0.95,
        /// Reach this half-width over estimate. It is that of the draws' interval; mc checks it after 4096·2^k
        /// samples. The default of is is 0.1 unless the number of samples is given; else none.
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0.0))]
        #[schemars(extend("x-flag" = "half_width", "x-verbs" = ["sample"], "x-heading" = MODELS))]
        pub half_width: Option<f64> = None,
        /// Stop at the first check after this time (not reproducible), s. Without it: no limit.
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0.0, "exclusiveMaximum" = 1e9))]
        #[schemars(extend("x-flag" = "time_limit", "x-verbs" = ["sample"], "x-heading" = MODELS))]
        pub time_limit_s: Option<f64> = None,
        /// What importance sampling rests on. `draws` of the density bound what its search missed; the `search` alone costs
        /// 20,000 to 65,000 lanes a question as a rule, for drivers that take a millisecond a lane, and bounds nothing.
        #[schemars(extend("x-flag" = "assurance", "x-verbs" = ["sample"], "x-heading" = MODELS))]
        pub assurance: Assurance = Assurance::Draws,
        /// Lanes of each model and criterion in the table of failures, at most.
        #[schemars(range(min = 1))]
        pub failures_limit: u64 = 1000,
        /// Maximum number of lanes of the density itself, in the search of `is` and of the rare rows of `auto` and
        /// again beside its final draws. They meet the failures that the proposal misses, or bound them.
        #[schemars(range(min = 1))]
        pub crude_lanes: u64 = 100_000_000,
        /// Seed of the draws.
        #[schemars(extend("x-flag" = "seed", "x-verbs" = ["sample"], "x-heading" = RUN))]
        pub seed: u64 = 157,
    }

    /// `lanesweep map`.
    pub(crate) struct MapSettings {
        /// Compute in binary64 on the CPU, not in the f32 lane arithmetic.
        pub reference: bool = false,
        /// Only panels in which the ego is faster than the other vehicle; not of presets.
        pub closing: bool = false,
        /// Start each model at its following distance in the JRC's simulator, not gap_m or thw_s; not of presets.
        pub native_gap: bool = false,
    }

    /// `lanesweep verify`.
    pub(crate) struct VerifySettings {
        /// Units of 12 lanes per model, threshold and category.
        #[schemars(range(min = 1, max = 100_000))]
        pub threshold_units: u64 = 64,
    }
}

/// When a run in one piece leaves its plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum KeepPlan {
    /// Up to 256 MiB, about 135,000 scenarios.
    Auto,
    /// However large.
    Always,
    /// Never.
    Never,
}

/// What importance sampling rests on.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Assurance {
    #[default]
    Draws,
    Search,
}

/// Estimator of a probability of failure.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum EstimatorKind {
    #[default]
    Auto,
    Mc,
    Is,
}
