//! What was run, on what, with what, so that a number can be made again: `run.json` of a study, the facts of a
//! sampling run.

use serde::Serialize;

use crate::engine::{DeviceRecord, Headway};
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::run::sampling::{Sample, SampleHeadways, SampleKind};
use crate::run::score::ScoreOptions;
use crate::scenario::parameterization::ParameterizationOptions;
use crate::traffic::mining::{MiningOptions, RecordingSummary};
use crate::{Error, Result};

/// Found and kept scenarios of a category, and what became of their lanes.
#[derive(Debug, Clone, Serialize)]
pub struct CategoryRecord {
    /// Kind of scenario.
    pub category: &'static str,
    /// Scenarios mined or read.
    pub found: u64,
    /// Those that passed the filters and were simulated.
    pub kept: u64,
    /// Variants simulated, S first.
    pub variants: Vec<String>,
    /// Lanes.
    pub lanes: u64,
    /// Lanes that ended at the time cap.
    pub capped_lanes: u64,
    /// Cells of the score table whose F1 is 0/0.
    pub undefined_f1: u64,
    /// Explained variance of the decomposition by its first coefficients, where there is one.
    pub svd_explained: Vec<f64>,
}

/// Seconds of the parts of a run.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Timings {
    /// Reading or generating, and mining.
    pub mine_s: f64,
    /// Planning: parameterizations and tables.
    pub plan_s: f64,
    /// Lanes.
    pub sweep_s: f64,
    /// Scores and claims.
    pub score_s: f64,
}

/// How the sweep went.
#[derive(Debug, Clone, Serialize)]
pub struct SweepRecord {
    /// Lanes that the CPU computed again with every step made, all equal.
    pub rechecked_lanes: u64,
    /// Seed of their choice.
    pub recheck_seed: u64,
    /// Lanes that the CPU computed because the device could not.
    pub redone_lanes: u64,
    /// Time that the device itself computed, s, where it can tell.
    pub device_s: Option<f64>,
}

/// An option that somebody set.
#[derive(Debug, Clone, Serialize)]
pub struct SettingRecord {
    /// Key, as `lanesweep config show` has it.
    pub key: String,
    /// Value.
    pub value: serde_json::Value,
    /// Line of a file, variable or flag.
    pub source: String,
}

/// The whole record.
#[derive(Debug, Clone, Serialize)]
pub struct RunRecord {
    /// Program and version.
    pub program: String,
    /// [`ENGINE_VERSION`](crate::engine::ENGINE_VERSION) of the program: what the bits of its lanes are.
    pub engine: u64,
    /// What was swept, in one line.
    pub data: String,
    /// Nothing here was measured on real traffic.
    pub synthetic: bool,
    /// What computed the lanes.
    pub backend: String,
    /// The device, where one did.
    pub device: Option<DeviceRecord>,
    /// How the sweep went.
    pub sweep: SweepRecord,
    /// SHA-256 of the plan: everything that decides the outcomes.
    pub plan_sha256: String,
    /// SHA-256 of the scenario file, where one was read.
    pub scenario_file_sha256: Option<String>,
    /// Recordings with the SHA-256 of their files.
    pub recordings: Vec<RecordingSummary>,
    /// Recordings and parts that were left out, and why.
    pub left_out: Vec<String>,
    /// What the data leave open or what looks wrong in them.
    pub notes: Vec<String>,
    /// Per category.
    pub categories: Vec<CategoryRecord>,
    /// Lanes in all.
    pub lanes: u64,
    /// Profile with every constant.
    pub profile: Profile,
    /// Thresholds and filters of the mining.
    pub mining: MiningOptions,
    /// Options of the parameterizations.
    pub parameterization: ParameterizationOptions,
    /// How it was scored.
    pub score: ScoreOptions,
    /// Options that were set for this command, and by what. As the backend's, they are of the command and not of the
    /// result: a merge has none, its parts had their own.
    pub settings: Vec<SettingRecord>,
    /// Files beside this one.
    pub files: Vec<String>,
    /// Seconds; they differ from run to run.
    pub timings: Timings,
}

impl RunRecord {
    /// As JSON.
    pub fn to_json(&self) -> Result<Vec<u8>> {
        let mut text =
            serde_json::to_vec_pretty(self).map_err(|e| Error::Internal(format!("run.json cannot be written: {e}")))?;
        text.push(b'\n');
        Ok(text)
    }
}

/// What a run was asked for.
#[derive(Debug, Clone)]
pub struct RunFacts {
    /// Estimator: `mc`, `is`, `ce`, `subset`.
    pub estimator: &'static str,
    /// Profile, with its time step.
    pub profile: Profile,
    /// Models.
    pub models: Vec<ModelId>,
    /// Headways of the plan; none where the density draws them.
    pub headways: Vec<Headway>,
    /// Kind of points: `random`, `sobol`.
    pub points: &'static str,
    /// Samples asked for.
    pub samples: u64,
    /// Seed.
    pub seed: u64,
    /// Parameters that were given, with their values.
    pub given: Vec<(String, f64)>,
}

impl RunFacts {
    /// Of a run.
    pub fn of(sample: &Sample) -> RunFacts {
        let random = |estimator, profile: &Profile, models: &[ModelId], headways| RunFacts {
            estimator,
            profile: profile.clone(),
            models: models.to_vec(),
            headways,
            points: "random",
            samples: sample.samples(),
            seed: sample.seed(),
            given: Vec::new(),
        };
        match &sample.0 {
            SampleKind::Crude(plan, _) => {
                let facts = &plan.facts;
                let headways = facts.headways.clone().unwrap_or_default();
                RunFacts {
                    points: if facts.sobol { "sobol" } else { "random" },
                    given: facts.given.clone(),
                    ..random("mc", &facts.profile, &facts.models, headways)
                }
            }
            SampleKind::Weighted(plan) | SampleKind::Pilot(plan, _) => {
                let facts = &plan.facts;
                random("is", &facts.profile, &facts.models, facts.headway.into_iter().collect())
            }
            SampleKind::Sequential(run) => {
                let headways = match &run.options.headways {
                    SampleHeadways::Each(list) => list.clone(),
                    SampleHeadways::Sampled => Vec::new(),
                };
                random(run.options.estimator.key(), &run.profile, &run.options.models, headways)
            }
        }
    }
}
