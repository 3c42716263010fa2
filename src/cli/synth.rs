//! `lanesweep synth`: the embedded default's recordings as highD files.

use std::path::PathBuf;

use clap::Args;

use super::Exit;
use super::configured::Configured;
use super::console::{self, Verbosity};
use super::source::Source;
use crate::report::files::{make_folder, write_atomically};
use crate::trajectory::generator::{GeneratorOptions, generate_one};
use crate::trajectory::highd::{self, HighdFiles, RecordingInfo, SYNTHETIC_MARKER};
use crate::{Error, Place, Result};

/// Flags of the generator.
#[derive(Debug, Clone, Args)]
pub struct GeneratorFlags {
    /// Seed of the generator
    #[arg(long, value_name = "N", default_value_t = GeneratorOptions::default().seed)]
    pub synth_seed: u64,
    /// Number of generated recordings
    #[arg(long, value_name = "N", default_value_t = GeneratorOptions::default().recordings)]
    pub synth_recordings: usize,
    /// Length of each generated recording, s
    #[arg(long, value_name = "SECONDS", default_value_t = GeneratorOptions::default().duration_s)]
    pub synth_duration: f64,
}

impl GeneratorFlags {
    /// The flags, over what is configured of the rest.
    pub fn options(&self, configured: &Configured) -> Result<GeneratorOptions> {
        let options = GeneratorOptions {
            seed: self.synth_seed,
            recordings: self.synth_recordings,
            duration_s: self.synth_duration,
            ..configured.settings.generator.clone()
        };
        options.validate()?;
        Ok(options)
    }
}

/// Write the synthetic recordings that `study` uses without data
///
/// The files are highD's; `study DIR` on them gives the same result as `study` alone.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  lanesweep synth recordings")]
pub struct Synth {
    /// Folder to write to; made where it does not exist
    #[arg(value_name = "DIR")]
    dir: PathBuf,
    #[command(flatten)]
    generator: GeneratorFlags,
}

impl Synth {
    pub fn run(&self, configured: &Configured, verbosity: Verbosity) -> Result<Exit> {
        let options = self.generator.options(configured)?;
        let taken = |id: &str| HighdFiles::named(&self.dir, id).tracks.exists();
        if let Some(id) = (1..=options.recordings).map(|k| format!("{k:02}")).find(|id| taken(id)) {
            return Err(Error::usage(
                Place::file(&self.dir),
                format!("it already holds a recording `{id}`, which would be overwritten"),
                "choose an empty folder",
            ));
        }
        make_folder(&self.dir)?;
        let sentence = Source::Generated(options.clone()).describe(true);
        let marker = format!("{sentence}\nNo number on these recordings is a statement about real traffic.\n");
        write_atomically(&self.dir.join(SYNTHETIC_MARKER), marker.as_bytes())?;
        let bar = console::progress(verbosity, options.recordings as u64, "writing recordings");
        let written = (0..options.recordings).try_for_each(|index| {
            let recording = generate_one(&options, index)?;
            highd::write(&self.dir, &recording, &RecordingInfo::default())?;
            bar.inc(1);
            Ok(())
        });
        bar.finish_and_clear();
        if let Err(error) = written {
            self.remove(options.recordings);
            return Err(error);
        }
        tracing::info!("{} synthetic recordings written to {}", options.recordings, self.dir.display());
        Ok(Exit::Ok)
    }

    /// Takes away what this run wrote: some of the recordings would be studied as if they were all, and the same
    /// command would refuse the folder.
    fn remove(&self, recordings: usize) {
        for id in (1..=recordings).map(|k| format!("{k:02}")) {
            let files = HighdFiles::named(&self.dir, &id);
            for file in [files.tracks, files.tracks_meta, files.recording_meta] {
                // One that was not written is not there.
                let _ = std::fs::remove_file(file);
            }
        }
    }
}
