//! Where a verb's scenarios come from: a folder of recordings, a scenario file, or the generator.

use std::path::{Path, PathBuf};

use clap::Args;

use super::configured::Configured;
use super::console::{self, Verbosity};
use crate::scenario::{Category, Scenario, ScenarioFile, read_scenario_file};
use crate::support::plausibility::Implausible;
use crate::support::repeats::refuse_repeats;
use crate::traffic::mining::{Collection, MiningOptions, counts_text, mine_folder, mine_generated};
use crate::traffic::trajectory::generator::GeneratorOptions;
use crate::traffic::trajectory::highd::{self, made_up};
use crate::{Error, Place, Result};

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
    /// Where the scenarios are from, in one line, which says so where they are made up.
    pub fn describe(&self, synthetic: bool) -> String {
        let text = match self {
            Source::Folder(dir) => made_up(dir).unwrap_or_else(|| format!("recordings in {}", dir.display())),
            Source::Scenarios(path) => format!("scenarios of {}", path.display()),
            Source::Generated(options) => format!(
                "SYNTHETIC DATA: {} generated recordings of {} s, seed {}, event rates multiplied by {}",
                options.recordings, options.duration_s, options.seed, options.event_rate_factor
            ),
        };
        labelled(text, synthetic)
    }

    /// Checks that the data can be read: all of a scenario file, the names of a folder's recordings.
    ///
    /// # Errors
    /// As [`Source::load`].
    pub fn check(&self, implausible: Implausible) -> Result<()> {
        match self {
            Source::Scenarios(path) => read_scenario_file(path, implausible).map(drop),
            Source::Folder(dir) => highd::inventory(dir).map(drop),
            Source::Generated(options) => options.validate(),
        }
    }

    /// Reads or generates, and mines.
    pub fn load(&self, mining: &MiningOptions, implausible: Implausible, verbosity: Verbosity) -> Result<Collection> {
        let collection = match self {
            Source::Scenarios(path) => {
                let ScenarioFile { scenarios, problems, notes } = read_scenario_file(path, implausible)?;
                let synthetic = scenarios.iter().any(|scenario| scenario.synthetic);
                Collection { scenarios, problems, notes, synthetic, ..Collection::default() }
            }
            Source::Folder(dir) => {
                let length = highd::inventory(dir).map_or(0, |i| i.recordings.len() as u64);
                let bar = console::progress(verbosity, length, "reading and mining");
                let collection = mine_folder(dir, mining, implausible, || bar.inc(1))?;
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
        complain_of(&collection.problems, &collection.notes);
        let data = self.describe(collection.synthetic);
        if data != self.describe(false) {
            tracing::info!("{data}");
        }
        Ok(collection)
    }
}

/// What is told one by one of what was left out.
const TOLD: usize = 20;

/// Tells what was left out and what is doubtful.
pub fn complain_of(problems: &[Error], notes: &[String]) {
    problems.iter().take(TOLD).for_each(console::complain);
    if problems.len() > TOLD {
        tracing::error!("{} more are left out", problems.len() - TOLD);
    }
    notes.iter().for_each(|note| tracing::warn!("{note}"));
}

/// What is done about input that no road has.
#[derive(Debug, Clone, Copy, Args)]
pub struct PlausibilityFlag {
    /// Use physically impossible values (a speed of 108 m/s) with a warning
    #[arg(long, help_heading = "Data", hide_short_help = true)]
    accept_implausible: bool,
}

impl PlausibilityFlag {
    /// As readers take it.
    pub fn policy(self) -> Implausible {
        if self.accept_implausible { Implausible::Accepted } else { Implausible::Refused }
    }
}

/// Where a verb's data come from.
#[derive(Debug, Clone, Args)]
pub struct SourceFlags {
    /// Folder of highD-format recordings [default: synthetic recordings]
    #[arg(value_name = "DIR", conflicts_with = "scenarios", help_heading = "Data")]
    pub dir: Option<PathBuf>,
    /// Scenario file (.jsonl, .parquet, .csv) instead of recordings
    #[arg(long, value_name = "FILE", help_heading = "Data")]
    pub scenarios: Option<PathBuf>,
    #[command(flatten)]
    plausibility: PlausibilityFlag,
}

impl SourceFlags {
    /// What they name; the generator where they name nothing.
    pub fn source(&self, configured: &Configured) -> Source {
        match (&self.dir, &self.scenarios) {
            (Some(dir), _) => Source::Folder(dir.clone()),
            (None, Some(path)) => Source::Scenarios(path.clone()),
            (None, None) => Source::Generated(configured.settings.generator.clone()),
        }
    }

    /// As [`Source::check`].
    pub fn check(&self, configured: &Configured) -> Result<()> {
        self.source(configured).check(self.plausibility.policy())
    }

    /// As [`Source::load`].
    pub fn load(&self, configured: &Configured, verbosity: Verbosity) -> Result<Collection> {
        self.source(configured).load(&configured.settings.mining, self.plausibility.policy(), verbosity)
    }

    /// The same, with what it is of and what is found told.
    pub fn load_told(&self, configured: &Configured, verbosity: Verbosity) -> Result<Collection> {
        tracing::info!("{}", self.source(configured).describe(false));
        let collection = self.load(configured, verbosity)?;
        tracing::info!("{}", counts_text(&collection.scenarios));
        Ok(collection)
    }

    /// No result may replace an input of the run.
    pub fn refuse_overwriting(&self, output: &Path, configured: &Configured, flag: &str) -> Result<()> {
        let inputs: Vec<PathBuf> = self.scenarios.iter().chain(configured.files()).cloned().collect();
        refuse_overwriting(output, &inputs, flag)
    }
}

/// The scenarios of a file of which one is asked for, and whether some were left out; what was wrong is told.
pub fn scenarios_of(path: &Path, implausible: Implausible) -> Result<(Vec<Scenario>, bool)> {
    let ScenarioFile { scenarios, problems, notes } = read_scenario_file(path, implausible)?;
    complain_of(&problems, &notes);
    Ok((scenarios, !problems.is_empty()))
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
    let mut found = list.iter().map(parse).collect::<Result<Vec<_>>>()?;
    refuse_repeats(|| Place::item(flag), found.iter().zip(list.iter().map(|text| text.trim())))?;
    found.sort();
    Ok(found)
}

/// What data are, in words that say so where they are made up.
pub fn labelled(data: String, synthetic: bool) -> String {
    if synthetic && !data.starts_with("SYNTHETIC DATA") { format!("SYNTHETIC DATA: {data}") } else { data }
}

/// The file that a path stands for, however it is written.
pub fn file_of(path: &Path) -> PathBuf {
    // Where a file does not exist yet, its folder still tells.
    let of_folder = || {
        let parent = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        Some(parent.canonicalize().ok()?.join(path.file_name()?))
    };
    path.canonicalize().ok().or_else(of_folder).unwrap_or_else(|| path.to_path_buf())
}

/// An output must not be one of these files.
pub fn refuse_overwriting(output: &Path, others: &[PathBuf], flag: &str) -> Result<()> {
    match others.iter().find(|other| file_of(other) == file_of(output)) {
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
