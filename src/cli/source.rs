//! Where a verb's scenarios come from: a folder of recordings, a scenario file, or the generator.

use std::path::{Path, PathBuf};

use super::console::{self, Verbosity};
use crate::mining::{Collection, MiningOptions, count, mine_folder, mine_generated};
use crate::scenario::{Category, Scenario, read_scenarios};
use crate::trajectory::generator::GeneratorOptions;
use crate::trajectory::highd;
use crate::{Error, Result};

/// What the scenarios of a run are.
#[derive(Debug, Clone, PartialEq)]
pub enum Source {
    /// A folder of highD-format recordings.
    Folder(PathBuf),
    /// A scenario file.
    Scenarios(PathBuf),
    /// Recordings that the program generates.
    Generated(GeneratorOptions),
}

impl Source {
    /// Where the scenarios are from, in one line.
    pub fn describe(&self) -> String {
        match self {
            Source::Folder(dir) => format!("recordings in {}", dir.display()),
            Source::Scenarios(path) => format!("scenarios of {}", path.display()),
            Source::Generated(options) => format!(
                "SYNTHETIC DATA: {} generated recordings of {} s, seed {}, event rates {} times those of highD",
                options.recordings, options.duration_s, options.seed, options.event_rate_factor
            ),
        }
    }

    /// Made by the program: no statement about real traffic.
    pub fn is_synthetic(&self) -> bool {
        matches!(self, Source::Generated(_))
    }

    /// Reads or generates, and mines.
    pub fn load(&self, mining: &MiningOptions, verbosity: Verbosity) -> Result<Collection> {
        let collection = match self {
            Source::Scenarios(path) => Collection { scenarios: read_scenarios(path)?, ..Collection::default() },
            Source::Folder(dir) => {
                let length = highd::inventory(dir).map_or(0, |i| i.recordings.len() as u64);
                let bar = console::progress(verbosity, length, "reading and mining");
                let collection = mine_folder(dir, mining, || bar.inc(1))?;
                bar.finish_and_clear();
                collection
            }
            Source::Generated(options) => {
                let bar = console::progress(verbosity, options.recordings as u64, "generating and mining");
                let collection = mine_generated(options, mining, || bar.inc(1))?;
                bar.finish_and_clear();
                collection
            }
        };
        for problem in &collection.problems {
            console::complain(problem);
        }
        for note in &collection.notes {
            tracing::info!("{note}");
        }
        Ok(collection)
    }
}

/// Found and kept, per category, in one line.
pub fn counts(scenarios: &[Scenario]) -> String {
    let part = |category: Category| {
        let count = count(scenarios, category);
        format!("{} {} found, {} kept", category.label(), count.found, count.kept)
    };
    Category::ALL.map(part).join("; ")
}

/// Mining options from a TOML file, or the paper's.
pub fn mining_options(path: Option<&Path>) -> Result<MiningOptions> {
    let Some(path) = path else { return Ok(MiningOptions::default()) };
    let options: MiningOptions = read_toml(path)?;
    options.validate()?;
    Ok(options)
}

/// A TOML file as options; errors name the line.
pub fn read_toml<T: serde::de::DeserializeOwned>(path: &Path) -> Result<T> {
    let text = std::fs::read_to_string(path).map_err(|e| Error::io(path, "read", e))?;
    toml::from_str(&text).map_err(|e| {
        let mut place = crate::Place::file(path);
        place.row = e.span().map(|span| 1 + text[..span.start].matches('\n').count() as u64);
        Error::usage(place, e.message().to_owned(), "the keys and their defaults are in the folder `configs`")
    })
}
