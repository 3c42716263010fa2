//! The source of a verb's scenarios: a folder of recordings, a scenario file, or the generator.

use std::path::{Path, PathBuf};

use clap::Args;
use indicatif::ProgressBar;

use super::configured::Configured;
use super::console;
use super::signals::CANCEL;
use lanesweep_model::plausibility::Implausible;
use lanesweep_model::scenario::{DataProvenance, Driven, Scenario, ScenarioFile, read_scenario_file};
use lanesweep_report::lanes::table_format;
use lanesweep_support::files::check_output;
use lanesweep_support::input_file::canonical;
use lanesweep_support::{Error, Place, Result, option};
use lanesweep_traffic::Source;
use lanesweep_traffic::mining::{Collection, counts, counts_text};

/// Reads or generates recordings and mines them, with a progress bar; reports skipped input and the number of
/// scenarios.
///
/// # Errors
/// As [`Source::load`].
pub(super) fn load(source: &Source, configured: &Configured, implausible: Implausible) -> Result<Collection> {
    let what = if matches!(source, Source::Generated(_)) { "generating and mining" } else { "reading and mining" };
    let collection = configured.with_bar(source.recordings(), what, |bar| {
        source.load(&configured.settings.mining, implausible, || advance(bar))
    })?;
    complain_of(&collection.problems, &collection.notes);
    let data = source.describe(collection.synthetic);
    if data != source.describe(false) {
        tracing::info!("{data}");
    }
    if let Some(preset) = collection.recordings.first().and_then(|recording| recording.preset.as_deref()) {
        let name = preset.split(' ').next().unwrap_or(preset);
        let assumed =
            if name == "generic" { ", which takes positions for centres and numbers for SI units" } else { "" };
        tracing::info!("read by preset {name}{assumed}; `lanesweep tracks` says how");
    }
    let kept = if matches!(source, Source::Scenarios { filter: false, .. }) { "kept as given" } else { "kept" };
    tracing::info!("{}", counts_text(&counts(&collection.scenarios)).replacen("kept", kept, 1));
    Ok(collection)
}

/// Advances a bar over recordings, unless the owner of the process has asked for the end of the work.
pub(super) fn advance(bar: &ProgressBar) -> Result<()> {
    bar.inc(1);
    CANCEL.check()
}

/// Maximum number of skipped items listed individually.
const MAX_LISTED: usize = 20;

/// Reports skipped input and doubts.
pub(super) fn complain_of(problems: &[Error], notes: &[String]) {
    problems.iter().take(MAX_LISTED).for_each(console::complain);
    if problems.len() > MAX_LISTED {
        tracing::error!("{} more are left out", problems.len() - MAX_LISTED);
    }
    notes.iter().for_each(|note| tracing::warn!("{note}"));
}

/// Policy for implausible input.
#[derive(Debug, Clone, Copy, Args)]
pub(super) struct PlausibilityFlag {
    /// Use physically impossible values (a speed of 108 m/s) with a warning
    #[arg(long, help_heading = "Data")]
    accept_implausible: bool,
}

impl PlausibilityFlag {
    /// The policy for readers.
    pub(super) fn policy(self) -> Implausible {
        if self.accept_implausible { Implausible::Accepted } else { Implausible::Refused }
    }
}

/// Format of recordings.
#[derive(Debug, Clone, Args)]
pub(super) struct PresetFlag {
    /// Format of the recordings: exid, sumo-fcd, … or a TOML file [default: detected]
    #[arg(long, value_name = "NAME|FILE", requires = "recordings", help_heading = "Data")]
    pub preset: Option<String>,
}

/// Where a verb's data come from.
#[derive(Debug, Clone, Args)]
pub(super) struct SourceFlags {
    /// Folder of recordings, or a track file [default: synthetic recordings]
    ///
    /// highD's format, or that of a preset, which the names of the columns tell; see `lanesweep tracks`.
    #[arg(value_name = "DIR", conflicts_with = "scenarios", help_heading = "Data")]
    pub recordings: Option<PathBuf>,
    #[command(flatten)]
    pub preset: PresetFlag,
    /// Scenario file (.jsonl, .parquet, .csv) instead of recordings
    #[arg(long, value_name = "FILE", help_heading = "Data")]
    pub scenarios: Option<PathBuf>,
    /// Keep only scenarios of the file that pass the filters of mining [default: kept as given]
    #[arg(long, requires = "scenarios", help_heading = "Data")]
    filter: bool,
    #[command(flatten)]
    pub plausibility: PlausibilityFlag,
}

impl SourceFlags {
    /// The named source; the generator if none is named.
    pub(super) fn source(&self, configured: &Configured) -> Source {
        match (&self.recordings, &self.scenarios) {
            (Some(dir), _) => Source::Recordings { path: dir.clone(), preset: self.preset.preset.clone() },
            (None, Some(path)) => Source::Scenarios { path: path.clone(), filter: self.filter },
            (None, None) => Source::Generated(configured.settings.generator.clone()),
        }
    }

    /// Like [`load`].
    pub(super) fn load(&self, configured: &Configured) -> Result<Collection> {
        load(&self.source(configured), configured, self.plausibility.policy())
    }

    /// Like [`load`], but first reports the source of the data, and with the provenance. The flags of the exposure
    /// (`given`) replace all known values: hours of one data set must not mix with kilometres of another.
    pub(super) fn load_with_exposure(
        &self,
        configured: &Configured,
        given: Driven,
    ) -> Result<(Collection, DataProvenance)> {
        let source = self.source(configured);
        tracing::info!("{}", source.describe(false));
        let collection = self.load(configured)?;
        let mut provenance = source.provenance(&collection)?;
        let recorded = provenance.driven.unwrap_or(given);
        let pairs = [("hours", given.hours.zip(recorded.hours)), ("km", given.kilometres.zip(recorded.kilometres))];
        let is_other = |(given, recorded): &(f64, f64)| !(0.99..=1.01).contains(&(given / recorded));
        for (flag, pair) in pairs {
            let Some((given, recorded)) = pair.filter(is_other) else { continue };
            let recorded = lanesweep_support::readable::value(recorded);
            let given = option(&format!("{flag} = {given}"));
            tracing::warn!("{given} is used, but the recordings of these scenarios have {recorded}");
        }
        provenance.driven = given.known().or(provenance.driven);
        let Some(driven) = provenance.driven else {
            let [hours, km] = ["hours", "km"].map(option);
            tracing::warn!(
                "exposure is unknown, because the scenarios have no driven time and distance; give {hours} and {km}"
            );
            return Ok((collection, provenance));
        };
        let mean_mps = driven.hours.zip(driven.kilometres).map(|(hours, kilometres)| kilometres / hours / 3.6);
        if let Some(mean_mps) = mean_mps.filter(|mean_mps| !(1.0..=70.0).contains(mean_mps)) {
            tracing::warn!("hours and kilometres driven: a mean speed of {mean_mps:.3} m/s is not plausible");
        }
        Ok((collection, provenance))
    }
}

/// The scenarios of a file for selecting one, and whether some were skipped; reports what was wrong.
pub(super) fn scenarios_of(path: &Path, implausible: Implausible) -> Result<(Vec<Scenario>, bool)> {
    let ScenarioFile { scenarios, problems, notes } = read_scenario_file(path, implausible)?;
    complain_of(&problems, &notes);
    Ok((scenarios, !problems.is_empty()))
}

/// Checks a table of lanes: its format, its place, and that it replaces none of these files of the run.
pub(super) fn check_lane_table(table: &Path, flag: &'static str, results: &[PathBuf]) -> Result<()> {
    if let Some(other) = results.iter().find(|other| canonical(other) == canonical(table)) {
        let problem = format!("{} would be overwritten: this run writes it", other.display());
        return Err(Error::usage(Place::option(flag), problem, "choose another path"));
    }
    table_format(table, flag)?;
    check_output(table)
}

/// Checks that a file to write has this ending, and its place.
pub(super) fn check_ending(path: &Path, ending: &str, flag: &'static str) -> Result<()> {
    if path.extension().is_none_or(|found| !found.eq_ignore_ascii_case(ending)) {
        let problem = format!("{} does not end in .{ending}", path.display());
        return Err(Error::usage(Place::option(flag), problem, format!("give a name that ends in .{ending}")));
    }
    check_output(path)
}
