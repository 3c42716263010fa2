//! Tracks in tables of other programs: a [`Preset`] says what the columns of a file mean, this module makes
//! [recordings](super::Recording) of them.
//!
//! The stages: rows of a file (`rows`, `times`), vehicles in SI units (`raw`, `samples`, `apart`), gapless pieces (`pieces`,
//! `boxes`), the lines of the road (`road`, `directions`), lanes (`lanes`), the recording (`assemble`), and what contradicts
//! itself (`understanding`, `findings`, `offsets`). highD files have their own reader. `lanesweep.tracks` in Python turns
//! other formats into a flat table.

mod apart;
mod assemble;
mod boxes;
mod directions;
mod findings;
mod lanes;
mod offsets;
mod pieces;
mod preset;
mod raw;
mod road;
mod roles;
mod rows;
mod samples;
mod smooth;
mod times;
mod understanding;

use std::path::{Path, PathBuf};

pub use preset::{Axes, Classes, HIGHD, HeadingOrigin, LaneBands, MetaFile, Preset, Reference, RoadSource, Side};
pub use roles::{ColumnName, Role};
pub use understanding::{Finding, Understanding};

pub(super) use road::{median, range};
pub(super) use smooth::central;

use raw::RawRecording;
use rows::{Columns, Rows};

use super::Loaded;
use super::highd::made_up;
use lanesweep_support::atomic_file::folder_of;
use lanesweep_support::files::{file_name, files_of};
use lanesweep_support::input_file::unpacked;
use lanesweep_support::{Error, Place, Result, option};

/// Names of recordings with this word are synthetic, because tables of tracks have no other place to say so.
pub const SYNTHETIC: &str = "SYNTHETIC";

/// A track file and the name of its recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TrackFile {
    /// The file.
    pub path: PathBuf,
    /// Name of the recording.
    pub id: String,
}

/// The ending of a file's name, before that of gzip, in small letters.
pub(super) fn ending(name: &str) -> Option<String> {
    Some(unpacked(name).rsplit_once('.')?.1.to_lowercase())
}

fn is_parquet(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("parquet"))
}

/// Whether the ending of a file's name is that of a format of tracks; texts may be compressed with gzip.
pub(super) fn may_hold_tracks(path: &Path) -> bool {
    is_parquet(path) || ending(&file_name(path)).is_some_and(|ending| ["csv", "txt", "tsv"].contains(&ending.as_str()))
}

/// Whether a file is one of a format of tracks that is compressed in a way that is not read.
pub(super) fn is_compressed(path: &Path) -> bool {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    let packed = ending.is_some_and(|ending| ["gz", "zip", "zst", "bz2", "xz", "lz4"].contains(&ending.as_str()));
    packed && !may_hold_tracks(path) && path.file_stem().is_some_and(|stem| may_hold_tracks(Path::new(stem)))
}

/// The shipped preset that fits a file; `None` if none fits.
///
/// # Errors
/// Those of the file; [`Error::Input`] if several presets fit equally well.
pub fn detect(path: &Path) -> Result<Option<Preset>> {
    if !may_hold_tracks(path) {
        return Ok(None);
    }
    let (name, rows) = (file_name(path), Rows::open(path)?);
    let usual = Preset::load("generic")?;
    let mut best: Vec<(usize, Preset)> = Vec::new();
    for preset in Preset::shipped()?.into_iter().filter(|preset| preset.recording_of(unpacked(&name)).is_some()) {
        let score = fitting(&preset, &usual, &rows.header);
        best.extend((score > 0).then_some((score, preset)));
    }
    best.sort_by_key(|(score, _)| std::cmp::Reverse(*score));
    if let [(first, a), (second, b), ..] = best.as_slice()
        && first == second
    {
        let problem = format!("it fits the presets {} and {}", a.name, b.name);
        return Err(Error::input(Place::file(path), problem, format!("choose one by {}", option("preset"))));
    }
    Ok(best.into_iter().next().map(|(_, preset)| preset))
}

/// How well a preset fits a header: 0 without a needed column, 1 of the usual names, else the number of its columns.
fn fitting(preset: &Preset, usual: &Preset, header: &[String]) -> usize {
    let columns = Columns::of(&preset.columns, header, &[]);
    let has = |role: Role| columns.has(role);
    let is_needed = has(Role::Vehicle) && has(Role::X) && has(Role::Y) && (has(Role::Frame) || has(Role::Time));
    if !is_needed || preset.name == usual.name {
        return usize::from(is_needed);
    }
    // Another program wrote sizes and classes that the preset does not read.
    let usual = Columns::of(&usual.columns, header, &[]);
    let is_whole = [Role::Length, Role::Width, Role::Class].into_iter().all(|role| has(role) || !usual.has(role));
    // Two thirds of the columns at least, so that two formats that share the names of positions are told apart; sizes may come
    // from elsewhere.
    let found = preset.columns.keys().filter(|role| has(**role)).count();
    let all = preset.columns.len() - if preset.sizes_from.is_some() { 2 } else { 0 };
    if is_whole && 3 * found >= 2 * all { found } else { 0 }
}

/// The track files of a folder, or the one file, for a preset; sorted by name.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] if there is none.
pub(super) fn track_files(path: &Path, preset: &Preset) -> Result<Vec<TrackFile>> {
    let name = file_name(path);
    if !path.is_dir() {
        let name = unpacked(&name);
        let stem = name.rsplit_once('.').map_or(name, |(stem, _)| stem);
        let id = preset.recording_of(name).unwrap_or(stem).to_owned();
        return Ok(vec![TrackFile { path: path.to_path_buf(), id }]);
    }
    let of = |path: PathBuf| {
        let name = file_name(&path);
        let id = preset.recording_of(unpacked(&name))?.to_owned();
        let is_ours = may_hold_tracks(&path) && !is_meta(&name, preset);
        is_ours.then_some(TrackFile { path, id })
    };
    let files: Vec<TrackFile> = files_of(path)?.into_iter().filter_map(of).collect();
    if files.is_empty() {
        let problem = format!("no file here is named {} as preset {} expects", preset.files, preset.name);
        return Err(Error::input(Place::file(path), problem, "give another folder, or another preset"));
    }
    Ok(files)
}

/// Whether a file name is that of a preset's other files.
pub(super) fn is_meta(name: &str, preset: &Preset) -> bool {
    let name = unpacked(name);
    let fits = |meta: &MetaFile| {
        let (before, after) = meta.file.split_once('*').unwrap_or((&meta.file, ""));
        name.starts_with(before) && name.ends_with(after)
    };
    preset.vehicles.iter().chain(&preset.recording).any(fits)
}

/// Reads a track file; returns its recordings. Contradictions are in their findings.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] for a value that is none, with file, row and column, or for a file without vehicles.
pub fn read_tracks(file: &TrackFile, preset: &Preset) -> Result<Vec<Loaded>> {
    let recordings = raw::read_table(file, preset)?;
    let place = Place::file(&file.path);
    if recordings.iter().all(|recording| recording.vehicles.is_empty()) {
        return Err(Error::input(place, "there is no vehicle", "check that this is the file with the tracks"));
    }
    let synthetic = made_up(folder_of(&file.path)).is_some();
    let read = |mut recording: RawRecording| {
        recording.synthetic = synthetic || recording.id.contains(SYNTHETIC);
        let place = place.clone().of(format!("recording {}", recording.id));
        assemble::assemble(recording, preset, &place)
    };
    recordings.into_iter().map(read).collect()
}

/// The names of a file's columns.
///
/// # Errors
/// Those of the file; [`Error::Input`] for a file whose format is unknown.
pub(super) fn columns_of(path: &Path) -> Result<Vec<String>> {
    if may_hold_tracks(path) {
        return Ok(Rows::open(path)?.header);
    }
    let (problem, help) = match ending(&file_name(path)).as_deref() {
        Some("xml") => ("XML is not read", "make a table in Python: `lanesweep.tracks.sumo`, or `commonroad`"),
        Some("json" | "jsonl") => {
            ("JSON is not read", "make a table in Python: `lanesweep.tracks.automatum`, `i24`, or `lists`")
        }
        _ => ("no format of tracks", "if it is a table, name it .csv, .txt, .tsv or .parquet"),
    };
    Err(Error::input(Place::file(path), problem, help))
}
