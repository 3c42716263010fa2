//! Tracks in any format: a [`Preset`] says what the columns of a file mean, this module makes [recordings](super::Recording) of them.
//!
//! The stages: rows of a file (`rows`, `markup`), vehicles in SI units (`raw`, `samples`, `apart`, `sumo`, `commonroad`), gapless pieces (`pieces`,
//! `boxes`), the lines of the road (`road`, `directions`), lanes (`lanes`), the recording (`assemble`), and what contradicts
//! itself (`understanding`, `findings`). highD files have their own reader.

mod apart;
mod assemble;
mod boxes;
mod commonroad;
mod directions;
mod draft;
mod findings;
mod lanes;
mod markup;
mod pieces;
mod preset;
mod raw;
mod road;
mod roles;
mod rows;
mod samples;
mod smooth;
mod sumo;
mod understanding;

use std::collections::HashMap;
use std::path::{Path, PathBuf};

pub use draft::draft;
pub use preset::{
    Axes, Classes, FileFormat, HIGHD, HeadingOrigin, LaneBands, MetaFile, Preset, Reference, RoadSource, Side,
};
pub use roles::{ColumnName, OneOrMany, Role};
pub use understanding::{Finding, Understanding, UnderstoodCarriageway};

pub(super) use raw::{PROJECT, is_geographic};

use rows::{Columns, Rows};

use super::Loaded;
use super::highd::made_up;
use crate::support::atomic_file::folder_of;
use crate::support::files::file_name;
use crate::support::input_file::{open_text, unpacked};
use crate::support::plausibility::Implausible;
use crate::{Error, Place, Result};

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

/// Endings of files that may hold tracks, with their formats.
const ENDINGS: [(&str, FileFormat); 7] = [
    ("csv", FileFormat::Csv),
    ("txt", FileFormat::Csv),
    ("tsv", FileFormat::Csv),
    ("parquet", FileFormat::Parquet),
    ("xml", FileFormat::Xml),
    ("json", FileFormat::Json),
    ("jsonl", FileFormat::Json),
];

/// The format of a file by the ending of its name; texts may be compressed with gzip.
fn format_of(path: &Path) -> Option<FileFormat> {
    let name = path.file_name()?.to_str()?;
    let bare = unpacked(name);
    let ending = bare.rsplit_once('.')?.1.to_lowercase();
    let format = ENDINGS.iter().find(|(known, _)| *known == ending).map(|(_, format)| *format)?;
    (bare == name || format != FileFormat::Parquet).then_some(format)
}

/// Whether the ending of a file's name is that of a format of tracks.
pub(super) fn may_hold_tracks(path: &Path) -> bool {
    format_of(path).is_some()
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
    let Some(format) = format_of(path) else { return Ok(None) };
    let name = file_name(path);
    let mut best: Vec<(usize, Preset)> = Vec::new();
    // By what opens the file: the element or list of rows, the delimiter.
    type HowOpened = (Option<String>, Option<char>);
    let mut headers: Vec<(HowOpened, Result<Vec<String>>)> = Vec::new();
    let (usual, shipped): (Vec<Preset>, Vec<Preset>) = Preset::shipped()?.into_iter().partition(Preset::is_generic);
    for preset in shipped.into_iter().filter(|preset| preset.recording_of(unpacked(&name)).is_some()) {
        let score = if preset.format == FileFormat::Commonroad {
            usize::from(format == FileFormat::Xml && is_commonroad(path)?) * 100
        } else if preset.format == format {
            // Presets that open the file in the same way share its header.
            let how = (preset.rows.clone(), preset.delimiter);
            let known = headers.iter().position(|(opened, _)| *opened == how);
            let at = known.unwrap_or_else(|| {
                headers.push((how, Rows::of_preset(path, &preset).map(|rows| rows.header().to_vec())));
                headers.len() - 1
            });
            let is_whole =
                |header: &&Vec<String>| usual.iter().all(|usual| reads_sizes_and_class(&preset, usual, header));
            headers[at].1.as_ref().ok().filter(is_whole).map_or(0, |header| fitting(&preset, header))
        } else {
            0
        };
        if score > 0 {
            best.push((score, preset));
        }
    }
    best.sort_by_key(|(score, _)| std::cmp::Reverse(*score));
    match best.as_slice() {
        [(first, a), (second, b), ..] if first == second => {
            let problem = format!("it fits the presets {} and {}", a.name, b.name);
            Err(Error::input(Place::file(path), problem, "choose one by option `preset`"))
        }
        [] => generic(path, format),
        _ => Ok(best.into_iter().next().map(|(_, preset)| preset)),
    }
}

/// The preset for tables of unknown programs, if the names of the columns say enough.
fn generic(path: &Path, format: FileFormat) -> Result<Option<Preset>> {
    let preset = Preset { format, ..Preset::load("generic")? };
    // A file that cannot be opened in this format fits nothing; its reader says why.
    let rows = Rows::of_preset(path, &preset)?;
    Ok((fitting(&preset, rows.header()) > 0).then_some(preset))
}

/// Number of columns of a preset that a header has; 0 if a needed one is missing.
fn fitting(preset: &Preset, header: &[String]) -> usize {
    let columns = Columns::of(&preset.columns, header, &[]);
    let has = |role: Role| columns.has(role);
    let is_needed = has(Role::Vehicle) && has(Role::X) && has(Role::Y) && (has(Role::Frame) || has(Role::Time));
    // Two thirds of the columns at least, so that two formats that share the names of positions are told apart.
    let found = preset.columns.keys().filter(|role| has(**role)).count();
    if is_needed && (preset.is_generic() || 3 * found >= 2 * preset.columns.len()) { found } else { 0 }
}

/// Whether a preset reads the sizes and the class that a table has under their usual names. If not, another program wrote the
/// table.
fn reads_sizes_and_class(preset: &Preset, usual: &Preset, header: &[String]) -> bool {
    let (own, usual) = (Columns::of(&preset.columns, header, &[]), Columns::of(&usual.columns, header, &[]));
    [Role::Length, Role::Width, Role::Class].into_iter().all(|role| own.has(role) || !usual.has(role))
}

fn is_commonroad(path: &Path) -> Result<bool> {
    use std::io::Read;
    let mut start = Vec::new();
    let file = open_text(path)?;
    file.take(4096).read_to_end(&mut start).map_err(|e| Error::io(path, "read", e))?;
    Ok(start.windows(11).any(|window| window == b"<commonRoad"))
}

/// The track files of a folder, or the one file, for a preset; sorted by name.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] if there is none.
pub(super) fn track_files(path: &Path, preset: &Preset) -> Result<Vec<TrackFile>> {
    let of = |path: PathBuf| {
        let name = unpacked(path.file_name()?.to_str()?);
        let stem = || Path::new(name).file_stem().map(|stem| stem.to_string_lossy().into_owned());
        let id = preset.recording_of(name).map(str::to_owned).or_else(|| if path.is_dir() { None } else { stem() })?;
        Some(TrackFile { id, path })
    };
    if !path.is_dir() {
        return of(path.to_path_buf()).map(|file| vec![file]).ok_or_else(|| {
            Error::input(Place::file(path), "the file has no name", "give the path of a file or folder")
        });
    }
    let listed = std::fs::read_dir(path).map_err(|e| Error::io(path, "list", e))?;
    let format = if preset.format == FileFormat::Commonroad { FileFormat::Xml } else { preset.format };
    let mut files: Vec<TrackFile> = Vec::new();
    for entry in listed {
        let file = entry.map_err(|e| Error::io(path, "list", e))?.path();
        let name = file_name(&file);
        let is_ours = preset.recording_of(unpacked(&name)).is_some() && format_of(&file) == Some(format);
        if file.is_file() && is_ours && !name.starts_with('.') && !is_meta(&name, preset) && !is_second(&file) {
            files.extend(of(file));
        }
    }
    files.sort_by(|a, b| a.path.cmp(&b.path));
    if files.is_empty() {
        let problem = format!("no file here is named {} as preset {} expects", preset.files, preset.name);
        return Err(Error::input(Place::file(path), problem, "give another folder, or another preset"));
    }
    Ok(files)
}

/// Whether the file that gzip compressed lies beside this one.
pub(super) fn is_second(path: &Path) -> bool {
    let name = file_name(path);
    unpacked(&name) != name && path.with_file_name(unpacked(&name)).exists()
}

/// Names recordings of files that differ in their ending only with it: `a.csv` and `a.txt`.
pub(super) fn keep_apart(files: &mut [TrackFile]) {
    let mut counts: HashMap<String, usize> = HashMap::new();
    files.iter().for_each(|file| *counts.entry(file.id.clone()).or_default() += 1);
    for file in files.iter_mut().filter(|file| counts[&file.id] > 1) {
        file.id = file_name(&file.path);
    }
}

/// Whether a file name is that of a preset's other files.
pub(super) fn is_meta(name: &str, preset: &Preset) -> bool {
    let name = unpacked(name);
    let fits = |pattern: &str| {
        let (before, after) = pattern.split_once('*').unwrap_or((pattern, ""));
        name.starts_with(before) && name.ends_with(after) && (pattern.contains('*') || name == pattern)
    };
    let metas = preset.vehicles.iter().chain(&preset.recording).map(|meta| meta.file.as_str());
    let types = preset.types_file.iter().flat_map(OneOrMany::names).map(String::as_str);
    metas.chain(types).any(fits)
}

/// A recording of a track file, and what was understood.
#[derive(Debug)]
pub struct LoadedTracks {
    /// The recording with the facts about its file.
    pub loaded: Loaded,
    /// What was understood.
    pub understanding: Understanding,
}

/// Reads a track file; returns its recordings. Contradictions are in their findings.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] for a value that is none, with file, row and column, or for a file without vehicles.
pub fn read_tracks(file: &TrackFile, preset: &Preset) -> Result<Vec<LoadedTracks>> {
    let raw = match preset.format {
        FileFormat::Commonroad => commonroad::read(&file.path, &file.id)?,
        _ => raw::read_table(file, preset)?,
    };
    let place = Place::file(&file.path);
    if raw.recordings.iter().all(|recording| recording.vehicles.is_empty()) {
        return Err(Error::input(place, "there is no vehicle", "check that this is the file with the tracks"));
    }
    let synthetic = made_up(folder_of(&file.path)).is_some();
    let bytes = raw.checksums.iter().map(|file| file.bytes).sum();
    let mut all = Vec::new();
    for mut recording in raw.recordings {
        recording.synthetic = synthetic || recording.id.contains(SYNTHETIC);
        let place = place.clone().of(format!("recording {}", recording.id));
        let (recording, understanding) = assemble::assemble(recording, preset, (&raw.roles, &raw.unused), &place)?;
        let loaded = Loaded {
            recording,
            checksum_sha256: raw.checksums.clone(),
            rows: raw.rows,
            bytes,
            notes: Vec::new(),
            vehicle_names: understanding.vehicle_names.clone(),
            file_frames: understanding.file_frames,
        };
        all.push(LoadedTracks { loaded, understanding });
    }
    Ok(all)
}

/// Like [`read_tracks`], for runs that use the recordings: minor findings become notes.
///
/// # Errors
/// As [`read_tracks`]; [`Error::Input`] for a grave finding, unless implausible input is accepted.
pub fn read_usable(file: &TrackFile, preset: &Preset, implausible: Implausible) -> Result<Vec<Loaded>> {
    let mut usable = Vec::new();
    for LoadedTracks { mut loaded, understanding } in read_tracks(file, preset)? {
        if let Some(grave) = understanding.findings.iter().find(|finding| finding.is_grave)
            && implausible == Implausible::Refused
        {
            let more = understanding.findings.iter().filter(|finding| finding.is_grave).count() - 1;
            let more = if more > 0 { format!(" ({more} more findings of this kind)") } else { String::new() };
            return Err(Error::input(
                Place::file(&file.path).of(format!("recording {}", loaded.recording.id)),
                format!("{}{more}", grave.text),
                "`lanesweep tracks` shows all; option `accept_implausible` uses the tracks as they are",
            ));
        }
        loaded.notes.extend(understanding.findings.into_iter().map(|finding| finding.text));
        usable.push(loaded);
    }
    Ok(usable)
}

/// The names of a file's columns, and its format.
///
/// # Errors
/// Those of the file; [`Error::Input`] for a file whose format is unknown.
pub(super) fn columns_of(path: &Path) -> Result<(Vec<String>, FileFormat)> {
    let format = format_of(path).ok_or_else(|| {
        Error::input(Place::file(path), "the format is unknown", "name it .csv, .txt, .parquet, .xml or .json")
    })?;
    Ok((Rows::open(path, format, None, None)?.header().to_vec(), format))
}
