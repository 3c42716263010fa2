//! The source of scenarios, and their provenance.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use super::mining::{
    Collection, MiningOptions, RecordingSummary, filter_given, leave_out_copies, mine_generated, mine_inputs,
};
use super::trajectory::Inputs;
use super::trajectory::generator::GeneratorOptions;
use super::trajectory::highd::made_up;
use lanesweep_model::plausibility::Implausible;
use lanesweep_model::scenario::{DataProvenance, Driven, ScenarioFile, read_scenario_file, write_scenarios_to};
use lanesweep_support::plain_text::hex;
use lanesweep_support::{Result, input_file};

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
    Scenarios {
        /// The file.
        path: PathBuf,
        /// The filters of mining decide which scenarios are kept; else they are kept as given.
        filter: bool,
    },
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
            Source::Scenarios { path, filter } => {
                format!("scenarios of {}{}", path.display(), if *filter { ", filtered" } else { "" })
            }
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
            Source::Scenarios { .. } => 0,
            Source::Recordings { path, preset } => {
                Inputs::of(path, preset.as_deref()).map_or(0, |inputs| inputs.files.len() as u64)
            }
            Source::Generated(options) => options.recordings as u64,
        }
    }

    /// Reads or generates recordings, and mines them. `done` is called after each recording, from any thread; its error
    /// ends the work.
    ///
    /// # Errors
    /// [`Error::Io`](lanesweep_support::error::Error::Io); [`Error::Input`](lanesweep_support::error::Error::Input) if nothing can be read; [`Error::Usage`](lanesweep_support::error::Error::Usage) for options out of range; that of `done`.
    pub fn load(
        &self,
        mining: &MiningOptions,
        implausible: Implausible,
        done: impl Fn() -> Result<()> + Sync,
    ) -> Result<Collection> {
        let mut collection = match self {
            Source::Scenarios { path, filter } => {
                let ScenarioFile { mut scenarios, problems, mut notes } = read_scenario_file(path, implausible)?;
                notes.extend(filter_given(&mut scenarios, mining, *filter));
                let synthetic = scenarios.iter().any(|scenario| scenario.synthetic);
                let read = Collection { scenarios, problems, notes, synthetic, ..Collection::default() };
                read.with_record_of(path)?
            }
            Source::Recordings { path, preset } => {
                mine_inputs(Inputs::of(path, preset.as_deref())?, mining, implausible, done)?
            }
            Source::Generated(options) => mine_generated(options, mining, done)?,
        };
        collection.notes.extend(leave_out_copies(&mut collection.scenarios));
        Ok(collection)
    }

    /// The provenance of the scenarios loaded from here.
    ///
    /// # Errors
    /// [`Error::Io`](lanesweep_support::error::Error::Io); as [`DataProvenance::read_beside`].
    pub fn provenance(&self, collection: &Collection) -> Result<DataProvenance> {
        // That of their file, or of the file that `mine` would write: the same scenarios have the same checksum.
        let scenarios_sha256 = match self {
            Source::Scenarios { path, .. } => input_file::sha256(path)?,
            _ => {
                let mut hash = Sha256::new();
                for scenario in &collection.scenarios {
                    let mut line = Vec::new();
                    write_scenarios_to(&mut line, [scenario])?;
                    hash.update(&line);
                }
                hex(&hash.finalize())
            }
        };
        let mut provenance = DataProvenance {
            data: self.describe(collection.synthetic),
            synthetic: collection.synthetic,
            scenarios_sha256,
            driven: collection.driven(),
        };
        if let Source::Scenarios { path, .. } = self
            && let Some((beside, _)) = DataProvenance::read_beside(path, &provenance.scenarios_sha256)?
        {
            provenance.driven = beside.driven;
            if beside.synthetic {
                (provenance.synthetic, provenance.data) = (true, beside.data);
            }
        }
        Ok(provenance)
    }
}

/// What `mine` knows of its recordings. It stands beside the scenario file, and in the records of a study of that file.
#[derive(Serialize, Deserialize)]
struct MinedRecord {
    recordings: Vec<RecordingSummary>,
    notes: Vec<String>,
    left_out: Vec<String>,
    mining: MiningOptions,
}

impl Collection {
    /// What these recordings were, for the file beside the scenarios.
    pub fn record(&self, mining: &MiningOptions) -> Value {
        let left_out = self.problems.iter().map(ToString::to_string).collect();
        let (recordings, notes) = (self.recordings.clone(), self.notes.clone());
        json!(MinedRecord { recordings, notes, left_out, mining: mining.clone() })
    }

    /// Adds what `mine` wrote beside a scenario file. A record of other scenarios is a note.
    fn with_record_of(mut self, path: &Path) -> Result<Collection> {
        match DataProvenance::read_beside(path, &input_file::sha256(path)?) {
            Ok(Some((beside, mined))) => {
                self.synthetic |= beside.synthetic;
                if let Ok(MinedRecord { recordings, notes, left_out, mining }) = serde_json::from_value(mined) {
                    let left_out = left_out.into_iter().map(|text| format!("left out by `mine`: {text}"));
                    self.notes.extend(notes.into_iter().chain(left_out));
                    (self.recordings, self.mining) = (recordings, Some(mining));
                }
            }
            Ok(None) => {}
            Err(error) => self.notes.push(format!("the recordings of these scenarios are unknown: {error}")),
        }
        Ok(self)
    }

    /// Sum over all ego data sets of the recordings used; `None` for scenarios without recordings.
    pub fn driven(&self) -> Option<Driven> {
        let hours = self.recordings.iter().map(|r| r.driven_s).sum::<f64>() / 3600.0;
        let kilometres = self.recordings.iter().map(|r| r.driven_m).sum::<f64>() / 1000.0;
        let positive = |v: f64| (v > 0.0).then_some(v);
        Driven { hours: positive(hours), kilometres: positive(kilometres) }.known()
    }
}
