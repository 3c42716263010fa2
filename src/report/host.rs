//! The machine and the command of a run, which are not part of its result.

use std::time::Instant;

use serde::Serialize;

use super::case_evidence::program;
use super::html::Section;
use lanesweep_engine::{DeviceRecord, OpenBackend, SweepSummary};
use lanesweep_model::profile::Profile;
use lanesweep_support::readable::{count, counted};

/// Facts about the machine.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Host {
    /// Commit of the program; empty if unknown. Records have it beside the program's version.
    #[serde(skip)]
    pub commit: &'static str,
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
    pub fn of(
        commit: &'static str,
        opened: &OpenBackend,
        rechecked_lanes: u64,
        started: Instant,
        settings: Vec<SettingRecord>,
    ) -> Host {
        Host {
            commit,
            backend: opened.backend().describe(),
            device: opened.device().cloned(),
            rechecked_lanes,
            seconds: started.elapsed().as_secs_f64(),
            threads: rayon::current_num_threads(),
            settings,
        }
    }

    /// For the merged parts of a run, which had their own machines and commands.
    pub fn of_parts(commit: &'static str, parts: usize, rechecked_lanes: u64) -> Host {
        let (backend, threads) = (format!("{} merged", counted(parts, "part")), rayon::current_num_threads());
        Host { commit, backend, rechecked_lanes, threads, ..Host::default() }
    }

    /// The chapter on what repeats a run: what computed, whether a device computed as the CPU does, and the options that are not
    /// the default.
    pub(super) fn section(&self, profile: &Profile) -> Section {
        let equal = match &self.device {
            None => "no device computed a lane".to_owned(),
            Some(device) if device.exact_path => format!("{}: operations reach the driver unchanged", device.line()),
            Some(device) => format!("{}: the self-check before the run found no difference", device.line()),
        };
        let again = match self.rechecked_lanes {
            0 => "no lane was computed again".to_owned(),
            lanes => format!("{} lanes computed again on the CPU with every step made, all equal", count(lanes)),
        };
        let set = self.settings.iter().filter(|setting| setting.source != "default");
        let set: Vec<String> =
            set.map(|setting| format!("{} = {} ({})", setting.key, setting.value, setting.source)).collect();
        let set = (!set.is_empty()).then(|| ("options that are set", set.join("\n")));
        Section::new("reproduction", "Reproduction")
            .intro(
                "The same input, profile, options and program give the same numbers on any machine. The record beside this page \
                 holds them, with checksums.",
            )
            .fact("program", program(self.commit, 40))
            .fact("profile", &profile.name)
            .host([("computed by", self.backend.clone()), ("GPU = CPU", equal), ("checked", again)])
            .host(set)
            .parts([Section::options("Profile", profile)])
    }

    /// The commit for records; null if unknown.
    pub(super) fn commit(&self) -> Option<&'static str> {
        Some(self.commit).filter(|commit| !commit.is_empty())
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
