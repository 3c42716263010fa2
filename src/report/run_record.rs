//! What was run, on what, with what, so that a number can be made again: `run.json` of a study.

use serde::Serialize;

use crate::model::profile::Profile;
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

/// The device that computed the lanes, where one did.
#[derive(Debug, Clone, Serialize)]
pub struct DeviceRecord {
    /// Name.
    pub name: String,
    /// Interface: Vulkan, Metal, DX12, GL.
    pub api: &'static str,
    /// Driver and its version.
    pub driver: String,
    /// Place on the PCI bus, where it is known.
    pub pci_bus_id: Option<String>,
    /// Float operations reached the driver as written.
    pub exact_path: bool,
}

impl DeviceRecord {
    /// In one line, as pages show it.
    pub(super) fn line(&self) -> String {
        let path = if self.exact_path { "exact path" } else { "plain path" };
        let at = self.pci_bus_id.as_ref().map_or(String::new(), |id| format!(", PCI {id}"));
        format!("{} ({}, {}{at}, {path})", self.name, self.api, self.driver)
    }
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
