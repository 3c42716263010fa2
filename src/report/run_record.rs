//! `run.json` of a study: data, program and settings, so that its numbers can be reproduced.

use serde::Serialize;

use super::records::{PROGRAM, document};
use crate::Result;
use crate::engine::{Block, DeviceRecord, ENGINE_VERSION, SweepSummary};
use crate::model::profile::Profile;
use crate::run::score::{ScoreOptions, ScoreTable, f1};
use crate::run::study::{CategoryProvenance, Study, StudyResult};
use crate::scenario::parameterization::ParameterizationOptions;
use crate::support::readable::counted;
use crate::traffic::mining::{MiningOptions, RecordingSummary};

/// Found and kept scenarios of a category, and counts of their lanes.
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
    /// Cumulative explained variance of the decomposition's first coefficients, if there is one.
    pub svd_explained: Vec<f64>,
    /// Number of folds, with cross-validation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub folds: Option<usize>,
}

/// Durations of the parts of a run, s.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Timings {
    /// Reading or generating, and mining, s.
    pub mine_s: f64,
    /// Planning: parameterizations and tables, s.
    pub plan_s: f64,
    /// Lanes, s.
    pub sweep_s: f64,
    /// Scores and claims, s.
    pub score_s: f64,
}

/// Statistics of the sweep.
#[derive(Debug, Clone, Serialize)]
pub struct SweepRecord {
    /// Lanes that the CPU recomputed with every step, all equal.
    pub rechecked_lanes: u64,
    /// Seed of the random selection of these lanes.
    pub recheck_seed: u64,
    /// Lanes that the CPU computed because the device could not.
    pub redone_lanes: u64,
    /// Computing time of the device, s, if it reports it.
    pub device_s: Option<f64>,
}

/// An option.
#[derive(Debug, Clone, Serialize)]
pub struct SettingRecord {
    /// Key, as shown by `lanesweep config show`.
    pub key: String,
    /// Value.
    pub value: serde_json::Value,
    /// Source: line of a file, flag, or `default`.
    pub source: String,
}

/// The whole record.
#[derive(Debug, Clone, Serialize)]
pub struct RunRecord {
    /// Program and version.
    pub program: String,
    /// [`ENGINE_VERSION`] of the program, which identifies the bits of its lanes.
    pub engine: u64,
    /// The swept data, in one line.
    pub data: String,
    /// True if the data are synthetic: no statement about real traffic.
    pub synthetic: bool,
    /// Backend of the lanes.
    pub backend: String,
    /// The device, if one computed.
    pub device: Option<DeviceRecord>,
    /// Statistics of the sweep.
    pub sweep: SweepRecord,
    /// SHA-256 of the plan, which determines all outcomes.
    pub plan_sha256: String,
    /// SHA-256 of the scenario file, if one was read.
    pub scenario_file_sha256: Option<String>,
    /// Recordings with the SHA-256 of their files.
    pub recordings: Vec<RecordingSummary>,
    /// Skipped recordings and parts, with reasons.
    pub left_out: Vec<String>,
    /// Open questions about the data and suspicious values.
    pub notes: Vec<String>,
    /// Per category.
    pub categories: Vec<CategoryRecord>,
    /// Total number of lanes.
    pub lanes: u64,
    /// Profile with every constant.
    pub profile: Profile,
    /// Thresholds and filters of the mining.
    pub mining: MiningOptions,
    /// Options of the parameterizations.
    pub parameterization: ParameterizationOptions,
    /// Options of the scoring.
    pub score: ScoreOptions,
    /// Options of this command, with their sources. Like the backend's, they belong to the command and not to the result:
    /// a merge has none, because its parts had their own.
    pub settings: Vec<SettingRecord>,
    /// Files beside this one.
    pub files: Vec<String>,
    /// Durations, s; they differ between runs.
    pub timings: Timings,
}

/// Facts about the machine and the command, which are not part of a study's result.
pub struct StudyHost {
    /// Backend of the lanes.
    pub backend: String,
    /// The device, if one computed.
    pub device: Option<DeviceRecord>,
    /// Statistics of the sweep.
    pub swept: SweepSummary,
    /// Durations of the parts of the run.
    pub timings: Timings,
    /// Options of the command.
    pub settings: Vec<SettingRecord>,
}

impl StudyHost {
    /// For merged parts, which had their own machines and commands.
    pub fn of_parts(result: &StudyResult) -> StudyHost {
        StudyHost {
            backend: format!("{} merged", counted(result.parts, "part")),
            device: None,
            swept: result.summary,
            timings: Timings::default(),
            settings: Vec::new(),
        }
    }
}

impl RunRecord {
    /// From a study and its scores.
    pub fn of(study: &Study, scores: &ScoreTable, host: StudyHost) -> RunRecord {
        let (plan, facts) = (study.plan(), study.facts().clone());
        RunRecord {
            program: PROGRAM.to_owned(),
            engine: ENGINE_VERSION,
            data: facts.data,
            synthetic: facts.synthetic,
            backend: host.backend,
            device: host.device,
            sweep: SweepRecord {
                rechecked_lanes: host.swept.rechecked_lanes,
                recheck_seed: facts.score.seed,
                redone_lanes: host.swept.redone_lanes,
                device_s: host.swept.device_s,
            },
            plan_sha256: plan.hash().to_owned(),
            scenario_file_sha256: facts.scenario_file_sha256,
            left_out: facts.left_out,
            notes: facts.notes,
            recordings: facts.recordings,
            categories: category_records(study, scores),
            lanes: plan.lane_count(),
            profile: plan.profile.clone(),
            mining: facts.mining,
            parameterization: facts.parameterization,
            score: facts.score,
            settings: host.settings,
            files: Vec::new(),
            timings: host.timings,
        }
    }

    /// As JSON.
    pub fn json(&self) -> Result<String> {
        document(self)
    }
}

fn category_records(study: &Study, scores: &ScoreTable) -> Vec<CategoryRecord> {
    let plan = study.plan();
    let record = |(block, of): (&Block, &CategoryProvenance)| {
        let scored = scores.categories.iter().find(|c| c.category == block.category);
        let cells = || scored.iter().flat_map(|c| &c.cells).filter(|c| c.variant > 0);
        CategoryRecord {
            category: block.category.key(),
            found: of.found,
            kept: of.kept,
            variants: block.variants.clone(),
            lanes: plan.lanes_per_unit(block) * block.units.len(),
            capped_lanes: scored.map_or(0, |c| c.capped.iter().sum()),
            undefined_f1: cells().filter(|c| f1(&c.counts).is_none()).count() as u64,
            svd_explained: of.svd_explained.clone(),
            folds: of.folds.iter().map(|(_, fold)| fold + 1).max(),
        }
    };
    plan.blocks.iter().zip(&study.facts().categories).map(record).collect()
}
