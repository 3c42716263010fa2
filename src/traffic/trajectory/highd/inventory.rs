//! Recordings of a folder: three files with the same prefix are one recording.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::trajectory::tracks::may_hold_tracks;
use lanesweep_support::files::files_of;
use lanesweep_support::{Error, Place, Result, input_file};

/// The three files of one recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HighdFiles {
    /// The prefix before `_tracks.csv`, for instance `01`: the recording's name.
    pub id: String,
    /// `NN_tracks.csv`: one line per vehicle and frame.
    pub tracks: PathBuf,
    /// `NN_tracksMeta.csv`: one line per vehicle.
    pub tracks_meta: PathBuf,
    /// `NN_recordingMeta.csv`: one line.
    pub recording_meta: PathBuf,
}

impl HighdFiles {
    /// The names the three files of recording `id` have in `dir`.
    pub fn named(dir: &Path, id: &str) -> Self {
        HighdFiles::each(dir, id, |path| path)
    }

    /// The same; files that only gzip's ending tells from these names take their places.
    pub(in crate::trajectory) fn found(dir: &Path, id: &str) -> Self {
        HighdFiles::each(dir, id, input_file::packed_or_not)
    }

    fn each(dir: &Path, id: &str, path: fn(PathBuf) -> PathBuf) -> Self {
        let [tracks, tracks_meta, recording_meta] = SUFFIXES.map(|suffix| path(dir.join(format!("{id}{suffix}"))));
        HighdFiles { id: id.to_owned(), tracks, tracks_meta, recording_meta }
    }

    /// All three.
    pub(in crate::trajectory) fn paths(&self) -> [&PathBuf; 3] {
        [&self.tracks, &self.tracks_meta, &self.recording_meta]
    }
}

/// The recordings of a folder.
#[derive(Debug)]
pub struct Inventory {
    /// Complete recordings, ascending by [`HighdFiles::id`].
    pub recordings: Vec<HighdFiles>,
    /// One error per incomplete recording; the complete ones can be used.
    pub problems: Vec<Error>,
}

/// File names after the prefix, in the order of the fields of [`HighdFiles`].
pub(in crate::trajectory) const SUFFIXES: [&str; 3] = ["_tracks.csv", "_tracksMeta.csv", "_recordingMeta.csv"];

/// Finds the recordings of a folder (not of its subfolders).
///
/// # Errors
/// If it is not a folder, cannot be listed, or holds no complete recording.
pub fn inventory(dir: &Path) -> Result<Inventory> {
    let found = prefixes(dir)?;
    let unfinished = lanesweep_support::run_folder::unfinished(dir).unwrap_or_default();
    if unfinished.iter().any(|name| name.ends_with(SUFFIXES[0])) {
        let problem = "`tracks` did not finish writing here, so recordings are missing";
        let help = "repeat that command, which completes the folder, or remove the folder";
        return Err(Error::input(Place::file(dir), problem, help));
    }
    let mut inventory = Inventory { recordings: Vec::new(), problems: Vec::new() };
    for (id, present) in found {
        let names = SUFFIXES.map(|suffix| format!("{id}{suffix}"));
        let missing: Vec<&str> =
            names.iter().zip(present).filter(|(_, is)| !is).map(|(name, _)| name.as_str()).collect();
        if missing.is_empty() {
            inventory.recordings.push(HighdFiles::found(dir, &id));
            continue;
        }
        let (missing, are) = (missing.join(" and "), if missing.len() == 1 { "is" } else { "are" });
        let problem = format!("{missing} {are} missing; a recording consists of {}", names.join(", "));
        let help = "add what is missing, or remove the other files of this recording";
        inventory.problems.push(Error::input(Place::file(dir).of(format!("recording `{id}`")), problem, help));
    }
    if inventory.recordings.is_empty() {
        return Err(nothing_complete(dir, inventory.problems));
    }
    Ok(inventory)
}

/// File that `lanesweep tracks` writes beside synthetic recordings, for readers and for folders of versions without marks in
/// the recordings.
pub const SYNTHETIC_MARKER: &str = "SYNTHETIC.txt";

/// The text of a folder's marker in one line; `None` without a marker.
pub(crate) fn made_up(dir: &Path) -> Option<String> {
    let text = input_file::read_text(&dir.join(SYNTHETIC_MARKER), input_file::MAX_SETTINGS_BYTES).ok()?;
    text.lines().next().filter(|line| line.starts_with("SYNTHETIC DATA")).map(str::to_owned)
}

/// Every prefix with the presence of its three files, sorted.
fn prefixes(dir: &Path) -> Result<BTreeMap<String, [bool; 3]>> {
    let facts = fs::metadata(dir).map_err(|source| Error::io(dir, "read the folder", source))?;
    if !facts.is_dir() {
        let help = "name the folder that holds the files NN_tracks.csv, NN_tracksMeta.csv, NN_recordingMeta.csv";
        return Err(Error::input(Place::file(dir), "this is a file; expected a folder with recordings", help));
    }
    let mut found: BTreeMap<String, [bool; 3]> = BTreeMap::new();
    for path in files_of(dir)?.iter().filter(|path| !path.is_symlink() || path.exists()) {
        // A name that is not UTF-8 cannot be part of a scenario's key.
        let Some(name) = path.file_name().and_then(|name| name.to_str()) else { continue };
        for (file, suffix) in SUFFIXES.iter().enumerate() {
            if let Some(prefix) = input_file::unpacked(name).strip_suffix(suffix)
                && !prefix.is_empty()
            {
                found.entry(prefix.to_owned()).or_default()[file] = true;
            }
        }
    }
    Ok(found)
}

fn nothing_complete(dir: &Path, mut problems: Vec<Error>) -> Error {
    match problems.len() {
        0 => {
            // The highD archive unpacks into `data/`, and simulations have a folder for each run.
            let has_tracks =
                |folder: &PathBuf| files_of(folder).is_ok_and(|all| all.iter().any(|of| may_hold_tracks(of)));
            let listed = fs::read_dir(dir).into_iter().flatten().flatten().map(|entry| entry.path());
            let inner = listed.filter(|folder| folder.is_dir()).filter(has_tracks);
            let mut inner: Vec<String> = inner.map(|of| of.display().to_string()).collect();
            inner.sort();
            let help = match &inner[..] {
                [] => "name a folder with highD-format recordings".to_owned(),
                [inner] => format!("the folder {inner} has recordings: name that one"),
                several => format!("these folders have recordings, name one of them: {}", several.join(", ")),
            };
            let expected = SUFFIXES.map(|suffix| format!("NN{suffix}")).join(", ");
            Error::input(Place::file(dir), format!("the folder has no recording; expected files {expected}"), help)
        }
        1 => problems.remove(0),
        count => Error::input(
            Place::file(dir),
            format!("none of the {count} recordings is complete. First: {}", problems[0]),
            "every recording needs NN_tracks.csv, NN_tracksMeta.csv and NN_recordingMeta.csv",
        ),
    }
}
