//! `lanesweep tracks`: what is in a track file? Reads it, checks it against itself, draws and converts it.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use clap::Args;

use super::arguments::from_arguments;
use super::configured::Configured;
use super::format::FormatFlag;
use super::{Exit, Output};
use crate::report::tracks::{TrackReport, across, report_text, space_time};
use crate::scenario::{ScenarioFile, usable};
use crate::support::files::{check_folder, write_atomically};
use crate::support::plausibility::Implausible;
use crate::support::run_folder::{RunFolder, unfinished};
use crate::support::table::{Table, TableMetadata};
use crate::traffic::mining::{CategoryCount, counts, mine, noise_notes};
use crate::traffic::trajectory::highd::{self, HighdFiles, SYNTHETIC_MARKER};
use crate::traffic::trajectory::tracks::{LoadedTracks, Preset, SYNTHETIC, Understanding, draft, read_tracks};
use crate::traffic::trajectory::{InputFile, Inputs, NO_LANE, Recording, Track, VehicleClass};
use crate::{Error, Place, Result};

/// What is in a track file? Check it, draw it, convert it
///
/// Finds the format by the names of the columns, reads the tracks and says what was understood: rate, vehicles, road,
/// lanes, speeds, scenarios. Checks the file against itself: units, axes, reference point, lanes, jumps, overlaps. Verbs
/// that take recordings read the same files. A preset is a TOML file that says what the columns mean.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    lanesweep tracks fcd.csv\n  \
    lanesweep tracks own.csv --write-preset own.toml\n  \
    lanesweep tracks own.csv --preset own.toml --out figures --convert converted")]
pub(super) struct Tracks {
    /// Track files, or folders of them
    #[arg(value_name = "PATH", required = true, help_heading = "Data")]
    paths: Vec<PathBuf>,
    /// Format of the files: exid, sumo-fcd, … or a TOML file [default: detected]
    #[arg(long, value_name = "NAME|FILE", help_heading = "Data")]
    preset: Option<String>,
    /// Write a first preset for a file that no preset fits
    #[arg(long, value_name = "FILE", conflicts_with_all = ["preset", "out", "convert"], help_heading = "Output")]
    write_preset: Option<PathBuf>,
    /// Folder for tracks.json and figures: positions over time and across the road
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    out: Option<PathBuf>,
    /// Write the tracks in highD's format into this folder, or as one table: .csv, .parquet
    #[arg(long, value_name = "DIR|FILE", help_heading = "Output")]
    convert: Option<PathBuf>,
    #[command(flatten)]
    format: FormatFlag,
}

from_arguments!(Tracks { paths, preset, write_preset, out, convert } groups { format });

impl Tracks {
    pub(super) fn run(&self, configured: &Configured) -> Result<Output> {
        if let Some(path) = &self.write_preset {
            return self.write_draft(path);
        }
        if let Some(out) = &self.out {
            check_folder(out)?;
        }
        let mut reports: Vec<TrackReport> = Vec::new();
        let mut recordings: Vec<Recording> = Vec::new();
        let mut is_complete = true;
        for path in &self.paths {
            let inputs = Inputs::of(path, self.preset.as_deref())?;
            let (files, problems) = inputs.files();
            is_complete &= problems.is_empty();
            problems.iter().for_each(super::console::complain);
            for file in files {
                // A bad file does not hide what is in the others.
                match self.of_file(&file, configured) {
                    Ok(found) => {
                        for (report, recording) in found {
                            is_complete &= report.understanding.is_usable();
                            reports.push(report);
                            if self.out.is_some() || self.convert.is_some() {
                                recordings.push(recording);
                            }
                        }
                    }
                    Err(error) => {
                        is_complete = false;
                        super::console::complain(&error);
                    }
                }
            }
        }
        if reports.is_empty() {
            return Ok(Exit::BadInput.into());
        }
        if let Some(out) = &self.out {
            write_figures(out, &reports, &recordings)?;
        }
        if let Some(to) = &self.convert {
            convert(to, &reports, &recordings)?;
        }
        let json = || {
            serde_json::to_string_pretty(&reports).map_err(|error| Error::Internal(format!("tracks as JSON: {error}")))
        };
        let text = || report_text(&reports);
        self.format.output(if is_complete { Exit::Ok } else { Exit::Incomplete }, text, json)
    }

    fn write_draft(&self, path: &Path) -> Result<Output> {
        let [file] = &self.paths[..] else {
            let problem = "one file is needed for a preset";
            return Err(Error::usage(Place::item("--write-preset"), problem, "name one track file"));
        };
        if path.exists() {
            let problem = "the file exists; it may hold your changes";
            return Err(Error::usage(Place::file(path), problem, "choose another name, or remove it"));
        }
        let text = draft(file)?;
        write_atomically(path, text.as_bytes())?;
        tracing::info!(
            "{} written: check each line, then run `tracks` with --preset {}",
            path.display(),
            path.display()
        );
        Ok(Exit::Ok.into())
    }

    fn of_file(&self, file: &InputFile, configured: &Configured) -> Result<Vec<(TrackReport, Recording)>> {
        // Found and kept scenarios, what noise may do to them, and those that runs leave out.
        let mined_of = |recording: &Recording| -> (Vec<CategoryCount>, Vec<String>) {
            let options = &configured.settings.mining;
            let ScenarioFile { scenarios, problems, .. } =
                usable(mine(recording, options).scenarios, Implausible::Refused);
            let mut notes = noise_notes(recording, &scenarios, options);
            if let Some(first) = problems.first() {
                notes.push(format!("{} more scenarios are left out, the first: {first}", problems.len()));
            }
            (counts(&scenarios).to_vec(), notes)
        };
        let is_detected = self.preset.is_none();
        match file {
            InputFile::Highd(files) => {
                let loaded = highd::read(files)?;
                let (mut understanding, recording) = Understanding::of_recording(loaded.recording, loaded.notes);
                let (mined, notes) = mined_of(&recording);
                understanding.note(notes);
                let file = files.tracks.display().to_string();
                let preset = "highd".to_owned();
                let report =
                    TrackReport { file, preset, is_detected, understanding, mined, mined_without_smoothing: None };
                Ok(vec![(report, recording)])
            }
            InputFile::Tracks(file, preset) => {
                let without = preset.smoothing_s.map(|_| Preset { smoothing_s: None, ..(**preset).clone() });
                // Before the recordings are read that are kept.
                let rough = |preset| -> Result<Vec<_>> {
                    Ok(read_tracks(file, &preset)?.iter().map(|rough| mined_of(&rough.loaded.recording).0).collect())
                };
                let mut rough = without.map(rough).transpose()?.map(Vec::into_iter);
                let found = read_tracks(file, preset)?.into_iter().map(|LoadedTracks { loaded, mut understanding }| {
                    let rough = rough.as_mut().and_then(Iterator::next);
                    let (mined, notes) = mined_of(&loaded.recording);
                    understanding.note(notes);
                    let report = TrackReport {
                        file: file.path.display().to_string(),
                        preset: preset.name.clone(),
                        is_detected,
                        understanding,
                        mined,
                        mined_without_smoothing: rough,
                    };
                    (report, loaded.recording)
                });
                Ok(found.collect())
            }
        }
    }
}

fn write_figures(out: &Path, reports: &[TrackReport], recordings: &[Recording]) -> Result<()> {
    let folder = RunFolder::open(out, "tracks.json")?;
    let mut results = folder.results()?;
    for recording in recordings {
        results.add(&format!("{}-time.svg", recording.id), space_time(recording).svg().as_bytes())?;
        results.add(&format!("{}-lanes.svg", recording.id), across(recording).svg().as_bytes())?;
    }
    let record =
        serde_json::to_vec_pretty(reports).map_err(|error| Error::Internal(format!("tracks.json: {error}")))?;
    results.publish(&record)?;
    tracing::info!("figures written to {}", out.display());
    Ok(())
}

/// Writes recordings in highD's format, or as one table.
fn convert(to: &Path, reports: &[TrackReport], recordings: &[Recording]) -> Result<()> {
    if to.extension().is_none() {
        return convert_to_highd(to, reports, recordings);
    }
    if to.exists() {
        return Err(Error::usage(
            Place::file(to),
            "it exists, and would be replaced",
            "choose another name, or remove it",
        ));
    }
    // In one plane: x along the forward carriageway, y to its left.
    let way = |recording: &Recording, track: &Track| {
        if recording.carriageways[track.carriageway].name == "1" { -1.0 } else { 1.0 }
    };
    let synthetic = recordings.iter().any(|recording| recording.synthetic);
    let samples = recordings.iter().flat_map(|recording| {
        recording.tracks.iter().flat_map(move |track| (0..track.len()).map(move |k| (recording, track, k)))
    });
    Table::of(samples)
        .column("recording", |(recording, ..)| match recording.synthetic {
            true => format!("{SYNTHETIC}-{}", recording.id),
            false => recording.id.clone(),
        })
        .column("vehicle", |(_, track, _)| u64::from(track.id))
        .column("time", |(recording, track, k)| (track.first_frame + k as i64) as f64 / recording.frame_rate_hz)
        .column("x", |(recording, track, k)| way(recording, track) * track.s_m[k])
        .column("y", |(recording, track, k)| way(recording, track) * track.d_m[k])
        .column("vx", |(recording, track, k)| way(recording, track) * track.v_s_mps[k])
        .column("vy", |(recording, track, k)| way(recording, track) * track.v_d_mps[k])
        .column("acceleration", |(_, track, k)| track.a_s_mps2[k])
        .column("length", |(_, track, _)| track.length_m)
        .column("width", |(_, track, _)| track.width_m)
        .column("class", |(_, track, _)| match track.class {
            VehicleClass::Car => "car",
            VehicleClass::Truck => "truck",
        })
        .column("lane", |(recording, track, k)| {
            let carriageway = &recording.carriageways[track.carriageway].name;
            (track.lane[k] != NO_LANE).then(|| format!("{carriageway}.{}", track.lane[k]))
        })
        .build()
        .save(to, &TableMetadata { table: "tracks", profile: None, plan_sha256: None, synthetic })?;
    tracing::info!("table written to {}", to.display());
    Ok(())
}

/// Record of a conversion: which recording became which.
const CONVERTED: &str = "converted.json";

/// Writes recordings in highD's format: all of them, or none.
fn convert_to_highd(to: &Path, reports: &[TrackReport], recordings: &[Recording]) -> Result<()> {
    let folder = RunFolder::open(to, CONVERTED)?;
    let unfinished = unfinished(to).unwrap_or_default();
    let names = names(recordings);
    let is_foreign = |file: &PathBuf| file.exists() && !unfinished.iter().any(|name| file.ends_with(name));
    let files = names.iter().flat_map(|id| InputFile::Highd(HighdFiles::named(to, id)).paths());
    if let Some(file) = files.into_iter().find(is_foreign) {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        let problem = format!("it already holds `{name}`, which would be overwritten");
        return Err(Error::usage(Place::file(to), problem, "choose an empty folder"));
    }
    let mut results = folder.results()?;
    for (recording, id) in recordings.iter().zip(&names) {
        let staged = highd::stage(to, &Recording { id: id.clone(), ..recording.clone() })?;
        staged.into_iter().for_each(|file| results.join(file.closed()));
    }
    if recordings.iter().any(|recording| recording.synthetic) {
        results.add(SYNTHETIC_MARKER, b"SYNTHETIC DATA: converted from generated recordings\n")?;
    }
    let converted = recordings.iter().zip(&names).zip(reports).map(|((recording, id), report)| {
        serde_json::json!({"recording": id, "of": recording.id, "file": report.file, "vehicle_names": report.understanding.vehicle_names})
    });
    let record = serde_json::json!({
        "program": format!("lanesweep {}", env!("CARGO_PKG_VERSION")),
        "files": results.names(),
        "recordings": converted.collect::<Vec<_>>(),
    });
    let record =
        serde_json::to_vec_pretty(&record).map_err(|error| Error::Internal(format!("{CONVERTED}: {error}")))?;
    results.publish(&record)?;
    tracing::info!("{} recordings written to {}; {CONVERTED} has their former names", recordings.len(), to.display());
    Ok(())
}

/// Numbers as highD's recordings have them: those that recordings have already, once each, and free ones for the others.
fn names(recordings: &[Recording]) -> Vec<String> {
    let number = |recording: &Recording| recording.id.parse::<u32>().ok();
    let mut taken = BTreeSet::new();
    let is_own: Vec<bool> = recordings.iter().map(|of| number(of).is_some_and(|number| taken.insert(number))).collect();
    let mut free = (1..).filter(|number| !taken.contains(number));
    let named = recordings.iter().zip(is_own).map(|(recording, is_own)| match is_own {
        true => recording.id.clone(),
        false => format!("{:02}", free.next().unwrap_or_default()),
    });
    named.collect()
}
