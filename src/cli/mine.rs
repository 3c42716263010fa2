//! `lanesweep mine`: mines scenarios from recordings.

use std::path::{Path, PathBuf};

use clap::Args;

use super::configured::Configured;
use super::source::{self, PlausibilityFlag, PresetFlag};
use super::{Exit, Output, console};
use lanesweep_model::scenario::{
    DataProvenance, check_scenario_file, scenario_table, write_scenarios, write_scenarios_to,
};
use lanesweep_support::Result;
use lanesweep_support::files::check_output;
use lanesweep_support::input_file;
use lanesweep_support::lock::FolderLock;
use lanesweep_support::readable::counted;
use lanesweep_traffic::Source;

/// Mine cut-ins, cut-outs and leader decelerations from recordings
///
/// Reads recordings in highD's format or another one (see `lanesweep tracks`) and writes one JSON line per scenario with its
/// series, or one row if FILE ends in .parquet; `study --scenarios FILE` reads it. The driven time and distance go to
/// FILE.exposure.json beside it, so that `fit --scenarios FILE` can compute events per hour.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  lanesweep mine recordings --out scenarios.jsonl")]
pub(super) struct Mine {
    /// Folder of recordings, or a track file
    #[arg(value_name = "DIR", help_heading = "Data")]
    recordings: PathBuf,
    #[command(flatten)]
    preset: PresetFlag,
    /// File to write, .jsonl or .parquet [default: standard output, JSON Lines]
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    out: Option<PathBuf>,
    /// Only scenarios that pass the paper's filters
    #[arg(long, help_heading = "Data")]
    kept: bool,
    #[command(flatten)]
    plausibility: PlausibilityFlag,
}

/// Prevents a second process from writing the same file and its provenance file.
fn lock_of(path: &Path) -> Result<FolderLock> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    FolderLock::acquire(&path.with_file_name(format!(".lanesweep-{name}.lock")))
}

impl Mine {
    pub(super) fn run(&self, configured: &Configured) -> Result<Output> {
        if let Some(path) = &self.out {
            check_scenario_file(path)?;
            check_output(path)?;
        }
        let _lock = self.out.as_deref().map(lock_of).transpose()?;
        let from = Source::Recordings { path: self.recordings.clone(), preset: self.preset.preset.clone() };
        let mut collection = source::load(&from, configured, self.plausibility.policy())?;
        if self.kept {
            collection.scenarios.retain(|s| s.kept);
        }
        match &self.out {
            Some(path) => {
                // The provenance file belongs to this scenario file: remove the old one first, write the new one last.
                DataProvenance::remove_beside(path)?;
                write_scenarios(path, &collection.scenarios)?;
                let (synthetic, driven) = (collection.synthetic, collection.driven());
                let (data, scenarios_sha256) = (from.describe(synthetic), input_file::sha256(path)?);
                let (settings, mined) = (configured.record(false), collection.record(&configured.settings.mining));
                let provenance = DataProvenance { data, synthetic, scenarios_sha256, driven };
                provenance.write_beside(path, serde_json::json!(settings), mined)?;
                tracing::info!("{} written to {}", counted(collection.scenarios.len(), "scenario"), path.display());
            }
            None => {
                let mut text = Vec::new();
                write_scenarios_to(&mut text, &collection.scenarios)?;
                console::print_json(&String::from_utf8_lossy(&text))?;
            }
        }
        let exit = if collection.problems.is_empty() { Exit::Ok } else { Exit::Incomplete };
        let mut output = Output::from(exit);
        if console::is_captured() {
            output.tables.push(("scenarios".to_owned(), scenario_table(&collection.scenarios)?));
        }
        Ok(output)
    }
}
