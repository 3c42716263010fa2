//! The file beside a mined scenario file that says how long and how far was driven for it. A scenario file holds
//! one scenario a line and has no place for it.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::exposure::Driven;
use super::json_rows::to_readable_json;
use crate::support::atomic_file::AtomicFile;
use crate::support::input_file;
use crate::{Error, Place, Result};

const VERSION: u64 = 1;

/// What was driven for one scenario file.
#[derive(Debug, Clone, PartialEq)]
pub struct ExposureFile {
    /// SHA-256 of the scenario file, in hexadecimal: the numbers are those of this file and no other.
    pub scenarios_sha256: String,
    /// Where the scenarios are from, in one line; synthetic data say so.
    pub data: String,
    /// Nothing was measured on real traffic.
    pub synthetic: bool,
    /// Time and distance of all ego data sets.
    pub driven: Driven,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Content {
    lanesweep_exposure: u64,
    scenarios_sha256: String,
    data: String,
    synthetic: bool,
    driven: Driven,
}

impl ExposureFile {
    /// Where it stands: `scenarios.jsonl` → `scenarios.exposure.json`; of another format with its ending, so that the
    /// same scenarios in two formats have one each: `scenarios.parquet` → `scenarios.parquet.exposure.json`.
    pub fn path_of(scenarios: &Path) -> PathBuf {
        match scenarios.extension().and_then(|ending| ending.to_str()) {
            Some(ending @ ("parquet" | "csv")) => scenarios.with_extension(format!("{ending}.exposure.json")),
            _ => scenarios.with_extension("exposure.json"),
        }
    }

    /// Takes away the one beside a scenario file that is about to be replaced.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn remove_beside(scenarios: &Path) -> Result<()> {
        let path = Self::path_of(scenarios);
        match std::fs::remove_file(&path) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::io(&path, "remove", e)),
            _ => Ok(()),
        }
    }

    /// Writes it beside a scenario file: whole or not at all.
    ///
    /// # Errors
    /// [`Error::Io`] if the folder cannot be written to.
    pub fn write_beside(&self, scenarios: &Path) -> Result<()> {
        let text = to_readable_json(&Content {
            lanesweep_exposure: VERSION,
            scenarios_sha256: self.scenarios_sha256.clone(),
            data: self.data.clone(),
            synthetic: self.synthetic,
            driven: self.driven,
        })?;
        let mut file = AtomicFile::create(&Self::path_of(scenarios))?;
        file.append(&text)?;
        file.stage()?.publish()
    }

    /// Reads the one beside a scenario file; `None` where there is none.
    ///
    /// # Errors
    /// [`Error::Io`] if it is there and cannot be read; [`Error::Input`] if it is broken, of another version, or
    /// belongs to other scenarios than those with `scenarios_sha256`.
    pub fn read_beside(scenarios: &Path, scenarios_sha256: &str) -> Result<Option<ExposureFile>> {
        let path = Self::path_of(scenarios);
        let text = match input_file::read(&path, input_file::MAX_SETTINGS_BYTES) {
            Err(Error::Io { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            read => read?,
        };
        let wrong = |place: Place, problem: String| {
            let help = "mine the recordings again, or remove this file and give option `hours` and option `km`";
            Err(Error::input(place, problem, help))
        };
        let content: Content = match serde_json::from_slice(&text) {
            Ok(content) => content,
            Err(e) => {
                let message = e.to_string();
                let reason = message.split(" at line ").next().unwrap_or(&message);
                let problem = format!("no exposure file: {reason}");
                return wrong(Place::file(&path).row(e.line() as u64), problem);
            }
        };
        if content.lanesweep_exposure != VERSION {
            let problem = format!("version {}, but this program reads {VERSION}", content.lanesweep_exposure);
            return wrong(Place::file(&path), problem);
        }
        if content.scenarios_sha256 != scenarios_sha256 {
            let problem = format!("belongs to other scenarios than {} holds now", scenarios.display());
            return wrong(Place::file(&path).column("scenarios_sha256"), problem);
        }
        if content.driven.validate().is_err() {
            return wrong(Place::file(&path).column("driven"), "hours and kilometres are not above 0".to_owned());
        }
        let Content { scenarios_sha256, data, synthetic, driven, .. } = content;
        Ok(Some(ExposureFile { scenarios_sha256, data, synthetic, driven }))
    }
}
