//! `lanesweep synth`: writes the default synthetic recordings as highD files.

use std::path::{Path, PathBuf};

use clap::Args;

use super::arguments::from_arguments;
use super::configured::Configured;
use super::console::Total;
use super::source;
use super::{Exit, Output};
use crate::support::files::check_folder;
use crate::support::run_folder::{RunFolder, unfinished};
use crate::traffic::Source;
use crate::traffic::trajectory::generator::generate_one;
use crate::traffic::trajectory::highd::{self, HighdFiles, SYNTHETIC_MARKER};
use crate::{Error, Place, Result};

/// Write the synthetic recordings that `study` uses without data
///
/// The files have the format of highD; `study DIR` on them gives the same result as `study` without data.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  lanesweep synth recordings")]
pub(super) struct Synth {
    /// Folder for the recordings; created if it does not exist
    #[arg(value_name = "DIR", help_heading = "Data")]
    folder: PathBuf,
}

from_arguments!(Synth { folder });

impl Synth {
    pub(super) fn run(&self, configured: &Configured) -> Result<Output> {
        let options = &configured.settings.generator;
        check_folder(&self.folder)?;
        let folder = RunFolder::open(&self.folder, SYNTHETIC_MARKER)?;
        // Files that a killed run was renaming are written anew.
        let unfinished = unfinished(&self.folder).unwrap_or_default();
        let is_unfinished = |tracks: &Path| unfinished.iter().any(|name| tracks.ends_with(name));
        let taken = |id: &str| {
            let tracks = HighdFiles::named(&self.folder, id).tracks;
            tracks.exists() && !is_unfinished(&tracks)
        };
        if let Some(id) = (1..=options.recordings).map(|k| format!("{k:02}")).find(|id| taken(id)) {
            return Err(Error::usage(
                Place::file(&self.folder),
                format!("it already holds a recording `{id}`, which would be overwritten"),
                "choose an empty folder",
            ));
        }
        let sentence = Source::Generated(options.clone()).describe(true);
        let marker = format!("{sentence}\nNo number on these recordings is a statement about real traffic.\n");
        let mut results = folder.results()?;
        configured.with_bar(Total::Exact(options.recordings as u64), "writing recordings", |bar| {
            (0..options.recordings).try_for_each(|index| {
                let recording = generate_one(options, index)?;
                let staged = highd::stage(&self.folder, &recording)?;
                staged.into_iter().for_each(|file| results.join(file.closed()));
                source::advance(bar)
            })
        })?;
        // A part of the recordings could be mistaken for all of them, or for real data. All are therefore renamed
        // together, the marker file last.
        results.publish(marker.as_bytes())?;
        tracing::info!("{} synthetic recordings written to {}", options.recordings, self.folder.display());
        Ok(Exit::Ok.into())
    }
}
