//! The time and distance driven to record scenarios, and the origin of a scenario file.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::file::reason;

use lanesweep_support::files::{remove_file, write_atomically};
use lanesweep_support::{Error, Place, Result, input_file, option};

/// Driven time and distance of the recordings that were searched for scenarios.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Driven {
    /// Hours, > 0.
    pub hours: Option<f64>,
    /// Kilometres, > 0.
    pub kilometres: Option<f64>,
}

impl Driven {
    /// `None` if neither is known.
    pub fn known(self) -> Option<Driven> {
        (self.hours.is_some() || self.kilometres.is_some()).then_some(self)
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the option of a number that is not above 0 and finite.
    pub fn validate(&self) -> Result<()> {
        for (option, value) in [("hours", self.hours), ("km", self.kilometres)] {
            if let Some(value) = value.filter(|v| !(*v > 0.0 && v.is_finite())) {
                let problem = format!("{value} cannot be driven");
                return Err(Error::usage(Place::option(option), problem, "give a number above 0"));
            }
        }
        Ok(())
    }
}

/// Provenance of scenarios. A scenario file holds one scenario per line and cannot store it, so `mine` writes it to a
/// second file.
#[derive(Debug, Clone, PartialEq)]
pub struct DataProvenance {
    /// The data in one line; synthetic data say so.
    pub data: String,
    /// True if the data are synthetic: no statement about real traffic.
    pub synthetic: bool,
    /// SHA-256 of the scenario file, in hexadecimal.
    pub scenarios_sha256: String,
    /// Time and distance of all ego data sets, if known.
    pub driven: Option<Driven>,
}

const VERSION: u64 = 1;
/// A recording takes half a kilobyte.
const MAX_BYTES: u64 = 64 << 20;

/// The provenance file of a scenario file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ProvenanceFile {
    lanesweep_exposure: u64,
    scenarios_sha256: String,
    data: String,
    synthetic: bool,
    driven: Driven,
    /// Options of the command that mined the scenarios, for readers; files of earlier versions have none.
    #[serde(default, skip_serializing_if = "Value::is_null")]
    settings: Value,
    /// What `mine` knew of the recordings; files of earlier versions have none.
    #[serde(default, skip_serializing_if = "Value::is_null")]
    mined: Value,
}

impl DataProvenance {
    /// Path of the provenance file: `scenarios.jsonl` → `scenarios.exposure.json`. Other formats keep their ending, so
    /// that the same scenarios in two formats have one file each: `scenarios.parquet` →
    /// `scenarios.parquet.exposure.json`.
    pub(crate) fn path_of(scenarios: &Path) -> PathBuf {
        match scenarios.extension().and_then(|ending| ending.to_str()) {
            Some(ending @ ("parquet" | "csv")) => scenarios.with_extension(format!("{ending}.exposure.json")),
            _ => scenarios.with_extension("exposure.json"),
        }
    }

    /// Removes the provenance file of a scenario file that will be replaced.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn remove_beside(scenarios: &Path) -> Result<()> {
        remove_file(&Self::path_of(scenarios))
    }

    /// Writes the provenance file of a scenario file atomically, with the options of the command and what it knew of the
    /// recordings; nothing if time and distance are unknown.
    ///
    /// # Errors
    /// [`Error::Io`] if the folder cannot be written to.
    pub fn write_beside(&self, scenarios: &Path, settings: Value, mined: Value) -> Result<()> {
        let Some(driven) = self.driven else { return Ok(()) };
        let file = ProvenanceFile {
            lanesweep_exposure: VERSION,
            scenarios_sha256: self.scenarios_sha256.clone(),
            data: self.data.clone(),
            synthetic: self.synthetic,
            driven,
            settings,
            mined,
        };
        let text = serde_json::to_string_pretty(&file);
        let text = text.map_err(|e| Error::Internal(format!("cannot be written as JSON: {e}")))?;
        write_atomically(&Self::path_of(scenarios), format!("{text}\n").as_bytes())
    }

    /// Reads the provenance file of a scenario file, and what `mine` knew of the recordings; `None` if there is none.
    ///
    /// # Errors
    /// [`Error::Io`] if it exists and cannot be read; [`Error::Input`] if it is damaged, of another version, or belongs
    /// to scenarios with another checksum than `scenarios_sha256`.
    pub fn read_beside(scenarios: &Path, scenarios_sha256: &str) -> Result<Option<(DataProvenance, Value)>> {
        let path = Self::path_of(scenarios);
        let text = match input_file::read(&path, MAX_BYTES) {
            Err(Error::Io { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            read => read?,
        };
        let wrong = |place: Place, problem: String| {
            let help = format!(
                "mine the recordings again, or remove this file and give {} and {}",
                option("hours"),
                option("km")
            );
            Err(Error::input(place, problem, help))
        };
        let content: ProvenanceFile = match serde_json::from_slice(&text) {
            Ok(content) => content,
            Err(e) => {
                let problem = format!("no exposure file: {}", reason(&e));
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
        let ProvenanceFile { scenarios_sha256, data, synthetic, driven, mined, .. } = content;
        Ok(Some((DataProvenance { scenarios_sha256, data, synthetic, driven: Some(driven) }, mined)))
    }
}
