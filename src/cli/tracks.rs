//! `lanesweep tracks`: what is in a track file? Reads it, checks it against itself, draws and converts it. Also writes
//! the synthetic recordings.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use super::configured::Configured;
use super::format::FormatFlag;
use super::{Exit, Output, source};
use lanesweep_model::plausibility::Implausible;
use lanesweep_report::tracks::{TrackReport, across};
use lanesweep_support::files::check_output;
use lanesweep_support::run_folder::RunFolder;
use lanesweep_support::table::{Table, TableMetadata};
use lanesweep_support::{Error, Place, Result, option};
use lanesweep_traffic::Source;
use lanesweep_traffic::mining::{counts, mine_loaded};
use lanesweep_traffic::trajectory::generator::generate_one;
use lanesweep_traffic::trajectory::highd::{self, SYNTHETIC_MARKER};
use lanesweep_traffic::trajectory::tracks::SYNTHETIC;
use lanesweep_traffic::trajectory::{InputFile, Inputs, Loaded, NO_LANE, Recording, Track, VehicleClass};

/// What is in a track file? Check it, draw it, convert it
///
/// Finds the format by the names of the columns, reads the tracks and says what was understood: rate, vehicles, road,
/// lanes, speeds, scenarios. Checks the file against itself: units, axes, reference point, lanes, jumps, overlaps. Verbs
/// that take recordings read the same files. A preset is a TOML file that says what the columns mean. Without a path,
/// --convert DIR writes the synthetic recordings that `study` uses without data.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    lanesweep tracks own.csv\n  \
    lanesweep tracks own.csv --preset own.toml --out figures --convert converted\n  \
    lanesweep tracks --convert recordings")]
pub(super) struct Tracks {
    /// Track files, or folders of them
    #[arg(value_name = "PATH", help_heading = "Data")]
    paths: Vec<PathBuf>,
    /// Format of the files: exid, sumo-fcd, … or a TOML file [default: detected]
    #[arg(long, value_name = "NAME|FILE", requires = "paths", help_heading = "Data")]
    preset: Option<String>,
    /// Folder for tracks.json and a figure of each recording: positions across the road
    #[arg(long, value_name = "DIR", requires = "paths", help_heading = "Output")]
    out: Option<PathBuf>,
    /// Write the tracks in highD's format into this folder, or as one table: .csv, .parquet
    #[arg(long, value_name = "DIR|FILE", help_heading = "Output")]
    convert: Option<PathBuf>,
    #[command(flatten)]
    format: FormatFlag,
}

impl Tracks {
    pub(super) fn run(&self, configured: &Configured) -> Result<Output> {
        if self.paths.is_empty() {
            return self.generate(configured);
        }
        // Before the work, so that what cannot be written is told at once.
        let open = |to: &PathBuf, record| RunFolder::open(to, record);
        let figures = self.out.as_ref().map(|out| open(out, "tracks.json")).transpose()?;
        if let (Some(figures), Some(to)) = (&figures, &self.convert)
            && to.canonicalize().is_ok_and(|to| figures.dir().canonicalize().is_ok_and(|out| out == to))
        {
            let problem = format!("{} is the folder of {} too", to.display(), option("out"));
            return Err(Error::usage(Place::option("convert"), problem, "give each a folder of its own"));
        }
        let (table, highd) = match &self.convert {
            Some(to) if to.extension().is_none() => (None, Some(open(to, CONVERTED)?)),
            to => (to.as_ref(), None),
        };
        if let Some(to) = table.filter(|to| to.exists()) {
            let problem = "it exists, and would be replaced";
            return Err(Error::usage(Place::file(to), problem, "choose another name, or remove it"));
        }
        table.map_or(Ok(()), |to| check_output(to))?;
        let (mut reports, mut recordings, mut is_complete) = (Vec::new(), Vec::new(), true);
        let mut ids = BTreeSet::new();
        let is_kept = self.out.is_some() || self.convert.is_some();
        for path in &self.paths {
            let (files, problems) = Inputs::of(path, self.preset.as_deref())?.files();
            is_complete &= problems.is_empty();
            problems.iter().for_each(super::console::complain);
            for file in files {
                // A bad file does not hide what is in the others.
                let found = self.of_file(&file, configured).inspect_err(super::console::complain);
                is_complete &= found.is_ok();
                for (mut report, mut recording) in found.into_iter().flatten() {
                    let own = recording.id.clone();
                    let mut number = 1;
                    while !ids.insert(recording.id.clone()) {
                        number += 1;
                        recording.id = format!("{own}-{number}");
                    }
                    if number > 1 {
                        let about = &mut report.understanding;
                        about.warn(format!("another file has a recording {own} too: this one is {}", recording.id));
                        about.recording.clone_from(&recording.id);
                    }
                    is_complete &= report.understanding.is_usable();
                    reports.push(report);
                    recordings.extend(is_kept.then_some(recording));
                }
            }
        }
        if reports.is_empty() {
            return Ok(Exit::BadInput.into());
        }
        figures.map_or(Ok(()), |folder| write_figures(&folder, &reports, &recordings))?;
        table.map_or(Ok(()), |to| convert(to, &recordings))?;
        highd.map_or(Ok(()), |folder| convert_to_highd(&folder, &reports, &recordings))?;
        let json = || json(&reports);
        let text = || reports.iter().map(TrackReport::text).collect::<Vec<_>>().join("\n");
        self.format.output(if is_complete { Exit::Ok } else { Exit::Incomplete }, text, json)
    }

    /// Writes the synthetic recordings, which no path names.
    fn generate(&self, configured: &Configured) -> Result<Output> {
        let Some(to) = self.convert.as_ref().filter(|to| to.extension().is_none()) else {
            let help = format!(
                "give track files, or only {} (a name without an ending), which writes the synthetic recordings",
                option("convert = DIR")
            );
            return Err(Error::usage(Place::item("lanesweep tracks"), "there is nothing to read", help));
        };
        let options = &configured.settings.generator;
        let folder = RunFolder::open(to, SYNTHETIC_MARKER)?;
        let mut results = folder.results()?;
        configured.with_bar(options.recordings as u64, "writing recordings", |bar| {
            (0..options.recordings).try_for_each(|index| {
                let staged = highd::stage(to, &generate_one(options, index)?)?;
                staged.into_iter().for_each(|file| results.add_staged(file));
                source::advance(bar)
            })
        })?;
        let sentence = Source::Generated(options.clone()).describe(true);
        let marker = format!("{sentence}\nNo number on these recordings is a statement about real traffic.\n");
        // A part of the recordings could be mistaken for all of them, or for real data. All are therefore renamed
        // together, the marker file last.
        results.publish(marker.as_bytes())?;
        tracing::info!("{} synthetic recordings written to {}", options.recordings, to.display());
        self.format.output(Exit::Ok, String::new, || json(&[(); 0]))
    }

    fn of_file(&self, file: &InputFile, configured: &Configured) -> Result<Vec<(TrackReport, Recording)>> {
        let (name, preset) = match file {
            InputFile::Highd(files) => (&files.tracks, "highd"),
            InputFile::Tracks(file, preset) => (&file.path, preset.name.as_str()),
        };
        let read = file.understand(Implausible::Accepted)?;
        let report = |loaded: Loaded| {
            // As in runs: what is noted of the scenarios, and those that are left out.
            let (_, mined) = mine_loaded(&loaded, &configured.settings.mining, Implausible::Refused);
            let Loaded { recording, vehicle_names, mut understanding, .. } = loaded;
            if understanding.is_usable() {
                mined.notes.into_iter().for_each(|note| understanding.warn(note));
                if let Some(first) = mined.problems.first() {
                    let number = mined.problems.len();
                    understanding.warn(format!("{number} more scenarios are left out, the first: {first}"));
                }
            }
            let (file, preset, is_detected) = (name.display().to_string(), preset.to_owned(), self.preset.is_none());
            let mined = counts(&mined.scenarios).to_vec();
            (TrackReport { file, preset, is_detected, understanding, vehicle_names, mined }, recording)
        };
        Ok(read.into_iter().map(report).collect())
    }
}

fn json(record: &impl Serialize) -> Result<String> {
    serde_json::to_string_pretty(record).map_err(|error| Error::Internal(format!("tracks as JSON: {error}")))
}

fn write_figures(folder: &RunFolder, reports: &[TrackReport], recordings: &[Recording]) -> Result<()> {
    let mut results = folder.results()?;
    for recording in recordings {
        results.add(&format!("{}-lanes.svg", recording.id), across(recording).svg().as_bytes())?;
    }
    results.publish(json(&reports)?.as_bytes())?;
    tracing::info!("figures written to {}", folder.dir().display());
    Ok(())
}

/// Writes recordings as one table.
fn convert(to: &Path, recordings: &[Recording]) -> Result<()> {
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
fn convert_to_highd(folder: &RunFolder, reports: &[TrackReport], recordings: &[Recording]) -> Result<()> {
    let (to, names) = (folder.dir(), names(recordings));
    let mut results = folder.results()?;
    for (recording, id) in recordings.iter().zip(&names) {
        let staged = highd::stage(to, &Recording { id: id.clone(), ..recording.clone() })?;
        staged.into_iter().for_each(|file| results.add_staged(file));
    }
    if recordings.iter().any(|recording| recording.synthetic) {
        results.add(SYNTHETIC_MARKER, b"SYNTHETIC DATA: converted from generated recordings\n")?;
    }
    let converted = recordings.iter().zip(&names).zip(reports).map(|((recording, id), report)| {
        serde_json::json!({"recording": id, "of": recording.id, "file": report.file, "vehicle_names": report.vehicle_names})
    });
    let record = serde_json::json!({
        "program": format!("lanesweep {}", env!("CARGO_PKG_VERSION")),
        "files": results.names(),
        "recordings": converted.collect::<Vec<_>>(),
    });
    results.publish(json(&record)?.as_bytes())?;
    tracing::info!("{} recordings written to {}; {CONVERTED} has their former names", recordings.len(), to.display());
    Ok(())
}

/// Numbers as highD's recordings have them: their own, if each has one, else new ones.
fn names(recordings: &[Recording]) -> Vec<String> {
    let own: BTreeSet<u32> = recordings.iter().filter_map(|of| of.id.parse().ok()).collect();
    match own.len() == recordings.len() {
        true => recordings.iter().map(|of| of.id.clone()).collect(),
        false => (1..=recordings.len()).map(|number| format!("{number:02}")).collect(),
    }
}
