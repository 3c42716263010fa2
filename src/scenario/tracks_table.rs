//! Recognises a table of tracks where scenarios are expected: recordings must be mined first.

use std::io::Read;
use std::path::Path;

use crate::support::error::{Error, Place, Result};
use crate::support::input_file;

/// Column names of recordings, in lower case without punctuation: vehicle, instant, place along and across.
const VEHICLE: &[&str] = &["id", "trackid", "vehicleid", "carid", "objectid", "idx"];
const INSTANT: &[&str] = &[
    "frame",
    "frameid",
    "framenum",
    "frameindex",
    "time",
    "times",
    "timesteptime",
    "timestep",
    "totalnanos",
    "timestamp",
];
const ALONG: &[&str] = &["x", "xm", "xcenter", "vehiclex", "localx", "posx", "xloc", "xlockf", "carcenterx"];
const ACROSS: &[&str] = &["y", "ym", "ycenter", "vehicley", "localy", "posy", "yloc", "ylockf", "carcentery"];
/// What a table of scenarios has and a recording has not.
const SCENARIO: &[&str] = &["category", "targetv", "targetvmps", "targety", "targetym"];

const HELP: &str = "scenarios are mined from recordings: give the folder of the recording as data, or mine it first (`mine`) and \
                    give the scenarios that it writes. Recordings are read in highD's three files; convert others to these";

/// Bytes of a file in which its header must end.
const HEADER_BYTES: u64 = 1 << 16;

/// Refuses the columns of a recording.
///
/// # Errors
/// [`Error::Input`] at `header`, naming the columns that give it away.
pub(super) fn refuse(columns: &[String], header: Place) -> Result<()> {
    let plain = |name: &str| name.chars().filter(char::is_ascii_alphanumeric).collect::<String>().to_ascii_lowercase();
    let find = |known: &[&str]| columns.iter().find(|column| known.contains(&plain(column).as_str()));
    let (Some(vehicle), Some(instant), Some(along), Some(across), None) =
        (find(VEHICLE), find(INSTANT), find(ALONG), find(ACROSS), find(SCENARIO))
    else {
        return Ok(());
    };
    let problem = format!(
        "this is a table of tracks, not of scenarios: it has a vehicle (`{vehicle}`), its instants (`{instant}`) and its places \
         (`{along}`, `{across}`)"
    );
    Err(Error::input(header, problem, HELP))
}

/// The error of a table that cannot be read: that it holds tracks, where its first line says so. Some simulators part their
/// columns by semicolons.
pub(super) fn of_unreadable(path: &Path, error: Error) -> Error {
    let mut head = Vec::new();
    let is_read = input_file::open(path).is_ok_and(|file| file.take(HEADER_BYTES).read_to_end(&mut head).is_ok());
    let text = String::from_utf8_lossy(&head);
    let line = text.lines().next().unwrap_or_default().trim_start_matches('\u{feff}');
    let columns: Vec<String> = line.split([';', '\t', ',']).map(|name| name.trim().to_owned()).collect();
    match refuse(&columns, Place::file(path).row(1)) {
        Err(tracks) if is_read => tracks,
        _ => error,
    }
}
