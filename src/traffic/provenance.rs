//! The source of scenarios, and the time and distance driven to record them.

use std::io::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::mining::{Collection, MiningOptions, mine_generated, mine_inputs};
use super::trajectory::Inputs;
use super::trajectory::generator::GeneratorOptions;
use super::trajectory::highd::made_up;
use crate::scenario::{ScenarioFile, read_scenario_file, write_scenarios_to};
use crate::support::files::write_atomically;
use crate::support::input_file;
use crate::support::plain_text::hex;
use crate::support::plausibility::Implausible;
use crate::{Error, Place, Result};

/// Source of scenarios.
#[derive(Debug, Clone, PartialEq)]
pub enum Source {
    /// A folder, or a file, of recordings.
    Recordings {
        /// The folder or file.
        path: PathBuf,
        /// Name or file of the preset; without it, the format is detected.
        preset: Option<String>,
    },
    /// A scenario file.
    Scenarios(PathBuf),
    /// Recordings that the program generates.
    Generated(GeneratorOptions),
}

impl Source {
    /// Description in one line; it says so if the data are synthetic.
    pub fn describe(&self, synthetic: bool) -> String {
        let text = match self {
            Source::Recordings { path, .. } => {
                made_up(path).unwrap_or_else(|| format!("recordings in {}", path.display()))
            }
            Source::Scenarios(path) => format!("scenarios of {}", path.display()),
            Source::Generated(options) => format!(
                "SYNTHETIC DATA: {} generated recordings of {} s, seed {}, event rates multiplied by {}",
                options.recordings, options.duration_s, options.seed, options.event_rate_factor
            ),
        };
        if synthetic && !text.starts_with("SYNTHETIC DATA") { format!("SYNTHETIC DATA: {text}") } else { text }
    }

    /// Number of recordings to be mined.
    pub fn recordings(&self) -> u64 {
        match self {
            Source::Scenarios(_) => 0,
            Source::Recordings { path, preset } => {
                Inputs::of(path, preset.as_deref()).map_or(0, |inputs| inputs.count() as u64)
            }
            Source::Generated(options) => options.recordings as u64,
        }
    }

    /// Reads or generates recordings, and mines them. `done` is called after each recording, from any thread; its error
    /// ends the work.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] if nothing can be read; [`Error::Usage`] for options out of range; that of `done`.
    pub fn load(
        &self,
        mining: &MiningOptions,
        implausible: Implausible,
        done: impl Fn() -> Result<()> + Sync,
    ) -> Result<Collection> {
        match self {
            Source::Scenarios(path) => {
                let ScenarioFile { scenarios, problems, notes } = read_scenario_file(path, implausible)?;
                let synthetic = scenarios.iter().any(|scenario| scenario.synthetic);
                Ok(Collection { scenarios, problems, notes, synthetic, ..Collection::default() })
            }
            Source::Recordings { path, preset } => {
                mine_inputs(Inputs::of(path, preset.as_deref())?, mining, implausible, done)
            }
            Source::Generated(options) => mine_generated(options, mining, done),
        }
    }
}

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
    /// Sum over all ego data sets of the recordings used; `None` for scenarios without recordings.
    pub fn of(collection: &Collection) -> Option<Driven> {
        let hours = collection.recordings.iter().map(|r| r.driven_s).sum::<f64>() / 3600.0;
        let kilometres = collection.recordings.iter().map(|r| r.driven_m).sum::<f64>() / 1000.0;
        let positive = |v: f64| (v > 0.0).then_some(v);
        Driven { hours: positive(hours), kilometres: positive(kilometres) }.known()
    }

    /// `None` if neither is known.
    fn known(self) -> Option<Driven> {
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

/// The provenance file of a scenario file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ProvenanceFile {
    lanesweep_exposure: u64,
    scenarios_sha256: String,
    data: String,
    synthetic: bool,
    driven: Driven,
}

impl DataProvenance {
    /// From scenarios and their source. If the user gives hours or kilometres (`given`), they replace all known
    /// values: hours of one data set must not mix with kilometres of another.
    ///
    /// # Errors
    /// [`Error::Io`]; as [`DataProvenance::read_beside`].
    pub fn of(source: &Source, collection: &Collection, given: Driven) -> Result<DataProvenance> {
        let mut provenance = DataProvenance {
            data: source.describe(collection.synthetic),
            synthetic: collection.synthetic,
            scenarios_sha256: String::new(),
            driven: Driven::of(collection),
        };
        match source {
            Source::Scenarios(path) => {
                provenance.scenarios_sha256 = input_file::sha256(path)?;
                if let Some(beside) = DataProvenance::read_beside(path, &provenance.scenarios_sha256)? {
                    provenance.driven = beside.driven;
                    if beside.synthetic {
                        (provenance.synthetic, provenance.data) = (true, beside.data);
                    }
                }
            }
            Source::Recordings { .. } | Source::Generated(_) => {
                // The checksum of the file that `mine` would write: the same scenarios have the same checksum.
                let mut hash = Hashing(Sha256::new());
                write_scenarios_to(&mut hash, &collection.scenarios)?;
                provenance.scenarios_sha256 = hex(&hash.0.finalize());
            }
        }
        provenance.driven = given.known().or(provenance.driven);
        Ok(provenance)
    }

    /// Path of the provenance file: `scenarios.jsonl` → `scenarios.exposure.json`. Other formats keep their ending, so
    /// that the same scenarios in two formats have one file each: `scenarios.parquet` →
    /// `scenarios.parquet.exposure.json`.
    pub fn path_of(scenarios: &Path) -> PathBuf {
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
        let path = Self::path_of(scenarios);
        match std::fs::remove_file(&path) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::io(&path, "remove", e)),
            _ => Ok(()),
        }
    }

    /// Writes the provenance file of a scenario file atomically; nothing if time and distance are unknown.
    ///
    /// # Errors
    /// [`Error::Io`] if the folder cannot be written to.
    pub fn write_beside(&self, scenarios: &Path) -> Result<()> {
        let Some(driven) = self.driven else { return Ok(()) };
        let file = ProvenanceFile {
            lanesweep_exposure: VERSION,
            scenarios_sha256: self.scenarios_sha256.clone(),
            data: self.data.clone(),
            synthetic: self.synthetic,
            driven,
        };
        let text = serde_json::to_string_pretty(&file);
        let text = text.map_err(|e| Error::Internal(format!("cannot be written as JSON: {e}")))?;
        write_atomically(&Self::path_of(scenarios), format!("{text}\n").as_bytes())
    }

    /// Reads the provenance file of a scenario file; `None` if there is none.
    ///
    /// # Errors
    /// [`Error::Io`] if it exists and cannot be read; [`Error::Input`] if it is damaged, of another version, or belongs
    /// to scenarios with another checksum than `scenarios_sha256`.
    pub fn read_beside(scenarios: &Path, scenarios_sha256: &str) -> Result<Option<DataProvenance>> {
        let path = Self::path_of(scenarios);
        let text = match input_file::read(&path, input_file::MAX_SETTINGS_BYTES) {
            Err(Error::Io { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            read => read?,
        };
        let wrong = |place: Place, problem: String| {
            let help = "mine the recordings again, or remove this file and give option `hours` and option `km`";
            Err(Error::input(place, problem, help))
        };
        let content: ProvenanceFile = match serde_json::from_slice(&text) {
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
        let ProvenanceFile { scenarios_sha256, data, synthetic, driven, .. } = content;
        Ok(Some(DataProvenance { scenarios_sha256, data, synthetic, driven: Some(driven) }))
    }
}

/// A writer that computes only a checksum.
struct Hashing(Sha256);

impl Write for Hashing {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.update(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}
