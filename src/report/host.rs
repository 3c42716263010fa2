//! The machine and the command of a run, which are not part of its result.

use std::time::Instant;

use serde::Serialize;

use crate::engine::{DeviceRecord, OpenBackend, SweepSummary};
use crate::support::readable::counted;

/// Facts about the machine.
#[derive(Debug, Clone, Serialize)]
pub struct Host {
    /// Backend.
    pub backend: String,
    /// The device, if one computed.
    pub device: Option<DeviceRecord>,
    /// Lanes that the CPU recomputed with every step, all equal.
    pub rechecked_lanes: u64,
    /// Wall clock, s.
    pub seconds: f64,
    /// Threads.
    pub threads: usize,
    /// Options of the command; records have them as `settings`. A merge has none, because its parts had their own.
    #[serde(skip)]
    pub settings: Vec<SettingRecord>,
}

impl Host {
    /// For a run that started at `started`.
    pub fn of(opened: &OpenBackend, rechecked_lanes: u64, started: Instant, settings: Vec<SettingRecord>) -> Host {
        Host {
            backend: opened.backend().describe(),
            device: opened.device().cloned(),
            rechecked_lanes,
            seconds: started.elapsed().as_secs_f64(),
            threads: rayon::current_num_threads(),
            settings,
        }
    }

    /// For the merged parts of a run, which had their own machines and commands.
    pub fn of_parts(parts: usize, rechecked_lanes: u64) -> Host {
        Host {
            backend: format!("{} merged", counted(parts, "part")),
            device: None,
            rechecked_lanes,
            seconds: 0.0,
            threads: rayon::current_num_threads(),
            settings: Vec::new(),
        }
    }

    /// What computed, for a page.
    pub(super) fn computed_by(&self) -> (&'static str, String) {
        ("computed by", self.backend.clone())
    }

    /// The time that it took, for a page.
    pub(super) fn wall_clock(&self) -> (&'static str, String) {
        ("seconds", format!("{:.2} on {} threads", self.seconds, self.threads))
    }

    /// What computed, with the device.
    pub(super) fn facts(&self) -> Vec<(&'static str, String)> {
        std::iter::once(self.computed_by()).chain(self.device.iter().map(|device| ("device", device.line()))).collect()
    }
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

/// Statistics of a sweep.
#[derive(Debug, Clone, Serialize)]
pub struct SweepRecord {
    /// Lanes that the CPU recomputed with every step, all equal.
    rechecked_lanes: u64,
    /// Seed of the random selection of these lanes.
    recheck_seed: u64,
    /// Lanes that the CPU computed because the device could not.
    redone_lanes: u64,
    /// Computing time of the device, s, if it reports it.
    device_s: Option<f64>,
}

impl SweepRecord {
    /// From a summary, and the seed of the random selection of recomputed lanes.
    pub fn of(swept: &SweepSummary, recheck_seed: u64) -> SweepRecord {
        let SweepSummary { rechecked_lanes, redone_lanes, device_s, .. } = *swept;
        SweepRecord { rechecked_lanes, recheck_seed, redone_lanes, device_s }
    }
}

/// Durations of the parts of a study, s; they differ between runs.
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
