//! Where a verb's scenarios come from: a folder of recordings, a scenario file, or the generator.

use std::path::{Path, PathBuf};

use super::console::{self, Verbosity};
use crate::mining::{Collection, MiningOptions, count, mine_folder, mine_generated};
use crate::readable;
use crate::scenario::{Category, Scenario, read_scenarios};
use crate::trajectory::generator::GeneratorOptions;
use crate::trajectory::highd;
use crate::{Error, Place, Result, input_file};

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
            Source::Folder(dir) => match synthetic_marker(dir) {
                Some(sentence) => sentence,
                None => format!("recordings in {}", dir.display()),
            },
            Source::Scenarios(path) => format!("scenarios of {}", path.display()),
            Source::Generated(options) => format!(
                "SYNTHETIC DATA: {} generated recordings of {} s, seed {}, event rates {} times those of highD",
                options.recordings, options.duration_s, options.seed, options.event_rate_factor
            ),
        }
    }

    /// Made by the program: no statement about real traffic.
    pub fn is_synthetic(&self) -> bool {
        match self {
            Source::Generated(_) => true,
            Source::Folder(dir) => synthetic_marker(dir).is_some(),
            Source::Scenarios(_) => false,
        }
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
        format!("{} {} found, {} kept", category.label(), readable::count(count.found), readable::count(count.kept))
    };
    Category::ALL.map(part).join("; ")
}

/// The categories of a flag, in the order of every table; all where none is given.
pub fn categories(list: &[String], flag: &str) -> Result<Vec<Category>> {
    if list.is_empty() {
        return Ok(Category::ALL.to_vec());
    }
    let parse = |text: &String| {
        Category::parse(text.trim()).ok_or_else(|| {
            let problem = format!("there is no category `{text}`");
            Error::usage(Place::item(flag), problem, "use cut-in, cut-out, lvd")
        })
    };
    let mut list = list.iter().map(parse).collect::<Result<Vec<_>>>()?;
    list.sort();
    list.dedup();
    Ok(list)
}

/// File that `synth` leaves beside its recordings, so that a study on them says what they are.
pub const SYNTHETIC_MARKER: &str = "SYNTHETIC.txt";

fn synthetic_marker(dir: &Path) -> Option<String> {
    let text = input_file::read_text(&dir.join(SYNTHETIC_MARKER), input_file::LARGEST_SETTINGS_BYTES).ok()?;
    text.lines().next().filter(|line| line.starts_with("SYNTHETIC DATA")).map(str::to_owned)
}

/// An output must not be one of these files.
pub fn refuse_overwriting(output: &Path, others: &[PathBuf], flag: &str) -> Result<()> {
    // Where a file does not exist yet, its folder still tells.
    let place_of = |path: &Path| {
        path.canonicalize().ok().or_else(|| {
            let parent = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
            Some(parent.canonicalize().ok()?.join(path.file_name()?))
        })
    };
    let place_of = |path: &Path| place_of(path).unwrap_or_else(|| path.to_path_buf());
    match others.iter().find(|other| place_of(other) == place_of(output)) {
        Some(other) => Err(Error::usage(
            Place::item(flag),
            format!("{} would be overwritten: this run reads or writes it", other.display()),
            "choose another path",
        )),
        None => Ok(()),
    }
}

/// An output must not be one of a folder's recordings.
pub fn refuse_recording(output: &Path, dir: &Path, flag: &str) -> Result<()> {
    // A folder that cannot be listed is the reader's complaint.
    let Ok(inventory) = highd::inventory(dir) else { return Ok(()) };
    let files: Vec<PathBuf> =
        inventory.recordings.into_iter().flat_map(|r| [r.tracks, r.tracks_meta, r.recording_meta]).collect();
    refuse_overwriting(output, &files, flag)
}
