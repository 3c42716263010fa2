//! `lanesweep synth`: the embedded default's recordings as highD files.

use std::path::PathBuf;

use clap::Args;

use super::Exit;
use super::console::{self, Verbosity};
use crate::Result;
use crate::trajectory::generator::{GeneratorOptions, generate_one};
use crate::trajectory::highd::{self, RecordingInfo};

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
    pub fn options(&self) -> GeneratorOptions {
        GeneratorOptions {
            seed: self.synth_seed,
            recordings: self.synth_recordings,
            duration_s: self.synth_duration,
            ..GeneratorOptions::default()
        }
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
    pub fn run(&self, verbosity: Verbosity) -> Result<Exit> {
        let options = self.generator.options();
        options.validate()?;
        let bar = console::progress(verbosity, options.recordings as u64, "writing recordings");
        for index in 0..options.recordings {
            let recording = generate_one(&options, index)?;
            highd::write(&self.dir, &recording, &RecordingInfo::default())?;
            bar.inc(1);
        }
        bar.finish_and_clear();
        tracing::info!("{} synthetic recordings written to {}", options.recordings, self.dir.display());
        Ok(Exit::Ok)
    }
}
