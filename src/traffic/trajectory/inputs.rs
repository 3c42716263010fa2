//! The recordings that a user names: a folder or a file, in highD's format or in that of a preset.

use std::path::{Path, PathBuf};

use super::highd::{self, HighdFiles};
use super::recording::Loaded;
use super::tracks::{self, HIGHD, Preset, TrackFile, Understanding};
use lanesweep_model::plausibility::Implausible;
use lanesweep_support::atomic_file::folder_of;
use lanesweep_support::files::{file_name, files_of};
use lanesweep_support::input_file::unpacked;
use lanesweep_support::{Error, Place, Result, option};

/// Recordings whose format is known: highD's, or that of a preset.
#[derive(Debug, Default)]
pub struct Inputs {
    pub(crate) files: Vec<InputFile>,
    /// What is wrong with recordings, or with other files that could be tracks.
    problems: Vec<Error>,
    /// `None` for highD's format.
    pub preset: Option<Preset>,
}

/// One file of recordings.
#[derive(Debug)]
pub enum InputFile {
    /// The three files of a highD recording.
    Highd(HighdFiles),
    /// A track file, with its preset.
    Tracks(TrackFile, Box<Preset>),
}

impl Inputs {
    /// The recordings of a folder or file. Without a preset, the names of the columns decide.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] if there is no recording, or if no preset fits; those of [`Preset::load`].
    pub fn of(path: &Path, preset: Option<&str>) -> Result<Inputs> {
        let with = |preset: Preset| {
            let of = |file| InputFile::Tracks(file, Box::new(preset.clone()));
            let files = tracks::track_files(path, &preset)?.into_iter().map(of).collect();
            Ok(Inputs { files, preset: Some(preset), ..Inputs::default() })
        };
        match preset {
            Some(HIGHD) => return highd_inputs(path),
            Some(name) => return with(Preset::load(name)?),
            None if !path.exists() => return highd_inputs(path),
            None => (),
        }
        if !path.is_dir() {
            let is_whole = |of: Inputs| of.files.iter().all(|file| file.paths().iter().all(|path| path.exists()));
            let has_meta = is_highd_name(path) && highd_inputs(path).is_ok_and(is_whole);
            return match tracks::detect(path)? {
                Some(preset) if preset.is_generic() && has_meta => highd_inputs(path),
                Some(preset) => with(preset),
                None if is_highd_name(path) => highd_inputs(path),
                None => Err(unknown(path)),
            };
        }
        let Some(first) = first_track_file(path)? else { return nothing_in(path) };
        let is_highd = is_highd_name(&first);
        let inputs = match tracks::detect(&first) {
            Ok(Some(preset)) if !(preset.is_generic() && is_highd) => with(preset),
            // Its reader says what is wrong.
            _ if is_highd => highd_inputs(path),
            found => Err(found.err().unwrap_or_else(|| unknown(&first))),
        };
        inputs?.with_others(path)
    }

    /// Leaves out files of a folder that are no tracks. Names those that could be tracks: files of another preset, compressed
    /// files, and files that do not fit or cannot be opened although they have the ending of those that are read.
    fn with_others(mut self, folder: &Path) -> Result<Inputs> {
        let own = self.preset.as_ref().map(|preset| preset.name.clone());
        let mut endings: Vec<String> = own.is_none().then(|| "csv".to_owned()).into_iter().collect();
        let mut foreign = Vec::new();
        for file in files_of(folder)? {
            let name = file_name(&file);
            if tracks::is_compressed(&file) {
                let help = "unpack it, or compress text with gzip (.gz), which is read";
                self.problems.push(Error::input(Place::file(&file), "it may hold tracks, and is compressed", help));
            }
            let is_highd = own.is_none() && is_of_highd(&file);
            if is_highd && file.to_str().is_none() {
                self.problems.push(Error::input(Place::file(&file), "its name is not UTF-8", "rename it"));
            }
            let is_meta = self.preset.as_ref().is_some_and(|preset| tracks::is_meta(&name, preset));
            if is_highd || is_meta || !tracks::may_hold_tracks(&file) {
                continue;
            }
            match tracks::detect(&file) {
                Ok(Some(found)) if Some(&found.name) == own.as_ref() => endings.extend(tracks::ending(&name)),
                found => foreign.push((file, found)),
            }
        }
        for (file, found) in foreign {
            self.files.retain(|of| *of.paths()[0] != file);
            let has_ending = tracks::ending(&file_name(&file)).is_some_and(|ending| endings.contains(&ending));
            match found {
                Ok(Some(other)) => {
                    let problem = format!("it fits preset {}, the other files here do not", other.name);
                    self.problems.push(Error::input(Place::file(&file), problem, "put it into a folder of its own"));
                }
                // A table with few columns is a list of something else.
                Ok(None) if has_ending && has_columns(&file) => self.problems.push(unknown(&file)),
                Err(error) if has_ending => self.problems.push(error),
                _ => {}
            }
        }
        Ok(self)
    }

    /// The files, and what is wrong with others.
    pub fn files(self) -> (Vec<InputFile>, Vec<Error>) {
        (self.files, self.problems)
    }
}

impl InputFile {
    /// Reads the recordings. Contradictions are in their findings.
    ///
    /// # Errors
    /// As [`highd::read_checked`] and [`tracks::read_tracks`].
    pub fn understand(&self, implausible: Implausible) -> Result<Vec<Loaded>> {
        match self {
            InputFile::Highd(files) => {
                let loaded = highd::read_checked(files, implausible)?;
                Ok(vec![Understanding::of_highd(loaded, &Place::file(&files.tracks))?])
            }
            InputFile::Tracks(file, preset) => tracks::read_tracks(file, preset),
        }
    }

    /// Reads the recordings for runs that use them: minor findings become notes.
    ///
    /// # Errors
    /// As [`InputFile::understand`]; [`Error::Input`] for a grave finding, unless implausible input is accepted.
    pub fn read(&self, implausible: Implausible) -> Result<Vec<Loaded>> {
        let mut usable = self.understand(implausible)?;
        for loaded in &mut usable {
            let findings = std::mem::take(&mut loaded.understanding.findings);
            if let Some(grave) = findings.iter().find(|finding| finding.is_grave)
                && implausible == Implausible::Refused
            {
                let place = Place::file(self.paths()[0]).of(format!("recording {}", loaded.recording.id));
                let format = if matches!(self, InputFile::Highd(_)) { HIGHD_HELP } else { "" };
                let accept = option("accept_implausible");
                let help = format!("`lanesweep tracks` shows all; {accept} uses the tracks as they are{format}");
                return Err(Error::input(place, grave.text.clone(), help));
            }
            loaded.notes.extend(findings.into_iter().map(|finding| finding.text));
        }
        Ok(usable)
    }

    /// The files that are read.
    pub(crate) fn paths(&self) -> Vec<&PathBuf> {
        match self {
            InputFile::Highd(files) => files.paths().to_vec(),
            InputFile::Tracks(file, _) => vec![&file.path],
        }
    }
}

/// A table with fewer columns holds no tracks: vehicle, time, x and y.
const MIN_COLUMNS: usize = 4;
/// What to look at in highD's format, which has no preset.
const HIGHD_HELP: &str = "; look at y (it points down; x and y are the left and upper edge of the box in the image), at the lane \
                          markings, `laneId` and the sizes";
/// Ending of the tracks in highD's format.
const HIGHD_ENDING: &str = highd::SUFFIXES[0];
/// Files that a message lists.
const MAX_TRIED: usize = 5;

fn is_highd_name(path: &Path) -> bool {
    path.file_name().is_some_and(|name| unpacked(&name.to_string_lossy()).ends_with(HIGHD_ENDING))
}

fn highd_inputs(path: &Path) -> Result<Inputs> {
    if path.is_dir() || !is_highd_name(path) {
        let highd::Inventory { recordings, problems } = highd::inventory(path)?;
        let files = recordings.into_iter().map(InputFile::Highd).collect();
        return Ok(Inputs { files, problems, ..Inputs::default() });
    }
    let name = file_name(path);
    let id = unpacked(&name).strip_suffix(HIGHD_ENDING).unwrap_or(&name);
    Ok(Inputs { files: vec![InputFile::Highd(HighdFiles::found(folder_of(path), id))], ..Inputs::default() })
}

/// The first file of a folder that may hold tracks; those with highD's names come first.
fn first_track_file(folder: &Path) -> Result<Option<PathBuf>> {
    let files = files_of(folder)?;
    if let Some(first) = files.iter().find(|path| is_highd_name(path)) {
        return Ok(Some(first.clone()));
    }
    let fits = |path: &&PathBuf| tracks::detect(path).is_ok_and(|preset| preset.is_some());
    // Meta files and settings fit no preset.
    Ok(files.iter().find(fits).or_else(|| files.iter().find(|path| has_columns(path))).cloned())
}

fn has_columns(path: &Path) -> bool {
    tracks::columns_of(path).is_ok_and(|columns| columns.len() >= MIN_COLUMNS)
}

/// Whether a file has a name of highD's format.
fn is_of_highd(path: &Path) -> bool {
    let name = path.to_string_lossy();
    highd::SUFFIXES.iter().any(|ending| unpacked(&name).ends_with(ending))
}

/// The error about a folder without a file that fits: it says what was tried.
fn nothing_in(folder: &Path) -> Result<Inputs> {
    let files = files_of(folder)?;
    if files.is_empty() || files.iter().any(|path| is_of_highd(path)) {
        return highd_inputs(folder);
    }
    let tried = |path: &PathBuf| {
        let name = file_name(path);
        let why = match tracks::columns_of(path) {
            _ if tracks::is_compressed(path) => "compressed".to_owned(),
            Ok(_) => "no preset fits".to_owned(),
            Err(Error::Input { problem, help, .. }) => format!("{problem}; {help}"),
            Err(error) => error.to_string(),
        };
        format!("{name}: {why}")
    };
    let more = if files.len() > MAX_TRIED { format!("; and {} more", files.len() - MAX_TRIED) } else { String::new() };
    let tried: Vec<String> = files.iter().take(MAX_TRIED).map(tried).collect();
    Err(Error::input(
        Place::file(folder),
        format!("no file here is a recording ({}{more})", tried.join("; ")),
        "recordings are .csv, .txt, .tsv (also .gz) or .parquet; XML and JSON become tables in Python (`lanesweep.tracks`)",
    ))
}

fn unknown(path: &Path) -> Error {
    if path.extension().is_some_and(|ending| ending == "xosc") {
        let help =
            "give recordings; a scenario file is a .jsonl file, and OpenSCENARIO is written by `simulate`, not read";
        return Error::input(Place::file(path), "an OpenSCENARIO file is no recording", help);
    }
    let columns: Vec<String> = match tracks::columns_of(path) {
        Ok(columns) => columns.iter().map(|name| format!("`{name}`")).collect(),
        Err(error) => return error,
    };
    let geographic: Vec<&str> = columns.iter().map(String::as_str).filter(|name| is_geographic(name)).collect();
    let (problem, help) = if geographic.len() >= 2 {
        let help = "project the positions to metres (UTM, for instance) and name the columns x and y".to_owned();
        (format!("positions are longitudes and latitudes ({})", geographic.join(", ")), help)
    } else {
        let names = columns[..columns.len().min(30)].join(", ");
        let help = format!("name a preset by {}, or rename the columns as in the preset `generic`", option("preset"));
        (format!("no preset fits this file; its columns are {names}"), help)
    };
    Error::input(Place::file(path), problem, help)
}

/// Whether a name is that of a column of longitudes or latitudes.
fn is_geographic(name: &str) -> bool {
    let bare = name.split(['(', '[']).next().unwrap_or(name);
    let letters: String = bare.chars().filter(|c| c.is_alphabetic()).flat_map(char::to_lowercase).collect();
    let letters = letters.trim_start_matches("gps").trim_end_matches("deg");
    ["lon", "lng", "long", "longitude", "lat", "latitude"].contains(&letters)
}
