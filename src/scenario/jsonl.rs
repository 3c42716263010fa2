//! The scenario file as JSON Lines: one [`Scenario`] a line, its fields as they are named there.
//!
//! Numbers are written with as many digits as they need and read to the same bits, so a study on a
//! written file gives the result of a study on the recordings. Unknown fields are ignored, so files of
//! other programs can be read; what a scenario cannot do without is checked line by line.

use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;

use serde_json::Value;

use super::Scenario;
use super::check::{check_written, name};
use super::found::{ScenarioFile, ScenariosRead};
use super::schema::wrong_field;
use crate::support::atomic_file::AtomicFile;
use crate::support::error::{Error, Place, Result};
use crate::support::input_file;
use crate::support::plausibility::Implausible;

/// Reads a scenario file. A byte-order mark, Windows line ends and empty lines are accepted.
pub(super) fn read(path: &Path, implausible: Implausible) -> Result<ScenarioFile> {
    let file = input_file::open(path)?;
    let mut reader = BufReader::with_capacity(1 << 16, file);
    let mut found = ScenariosRead::new(implausible, "remove one of the two lines, or rename one scenario");
    let mut line = Vec::new();
    for row in 1.. {
        line.clear();
        let place = Place::file(path).row(row);
        let mut up_to_longest = reader.by_ref().take(MAX_LINE_BYTES);
        match up_to_longest.read_until(b'\n', &mut line).map_err(|e| Error::io(path, "read", e))? as u64 {
            0 => break,
            MAX_LINE_BYTES => {
                let problem = format!("the line is longer than {} MiB", MAX_LINE_BYTES >> 20);
                return Err(Error::input(place, problem, "expected one scenario per line"));
            }
            _ => (),
        }
        let Ok(text) = std::str::from_utf8(&line) else {
            found.refuse(Error::input(place, "not UTF-8 text", "save the file as UTF-8"));
            continue;
        };
        let text = if row == 1 { text.trim_start_matches('\u{feff}') } else { text }.trim();
        if text.is_empty() {
            continue;
        }
        match serde_json::from_str::<Scenario>(text) {
            Ok(scenario) => {
                let place = place.of(name(&scenario.id));
                found.take(scenario, row, "line", |field| place.clone().column(field));
            }
            Err(error) => found.refuse(explain(&place, text, &error)),
        }
    }
    found.finish(Place::file(path), "expected one JSON object per line, as `lanesweep mine` writes them")
}

/// Writes a scenario file: whole or not at all.
pub(super) fn write<'a>(path: &Path, scenarios: impl IntoIterator<Item = &'a Scenario>) -> Result<()> {
    let mut file = AtomicFile::create(path)?;
    write_lines(&mut file, scenarios, path)?;
    file.stage()?.publish()
}

/// Writes scenarios to an open stream, one a line.
///
/// # Errors
/// As [`super::write_scenarios`]; the path in an [`Error::Io`] is `<output>`.
pub fn write_scenarios_to<'a>(mut writer: impl Write, scenarios: impl IntoIterator<Item = &'a Scenario>) -> Result<()> {
    let output = Path::new("<output>");
    write_lines(&mut writer, scenarios, output)?;
    writer.flush().map_err(|e| Error::io(output, "write", e))
}

fn write_lines<'a>(
    writer: &mut impl Write,
    scenarios: impl IntoIterator<Item = &'a Scenario>,
    path: &Path,
) -> Result<()> {
    for scenario in scenarios {
        check_written(scenario)?;
        let mut line = serde_json::to_vec(scenario)
            .map_err(|e| Error::Internal(format!("scenario {} cannot be written: {e}", scenario.id)))?;
        line.push(b'\n');
        writer.write_all(&line).map_err(|e| Error::io(path, "write", e))?;
    }
    Ok(())
}

/// Longest line: hours at 1000 samples a second fit.
const MAX_LINE_BYTES: u64 = 64 << 20;

/// What a line was refused for, with the field where one can be named.
fn explain(place: &Place, text: &str, error: &serde_json::Error) -> Error {
    let Ok(value) = serde_json::from_str::<Value>(text) else {
        return Error::input(
            place.clone(),
            format!("not JSON: {} at character {}", reason(error), error.column()),
            "every line holds one complete scenario; NaN and Infinity are not JSON: remove such scenarios",
        );
    };
    let id = value.get("id").and_then(Value::as_str);
    let place = id.map_or_else(|| place.clone(), |id| place.clone().of(name(id)));
    match wrong_field(&value) {
        Some((field, problem)) => {
            Error::input(place.column(field), problem, "expected the fields that `lanesweep mine` writes")
        }
        None => Error::input(
            place,
            format!("not a scenario: {}", reason(error)),
            "expected the fields that `lanesweep mine` writes",
        ),
    }
}

/// The message without its position, which counts lines inside the one line.
fn reason(error: &serde_json::Error) -> String {
    let text = error.to_string();
    text.split(" at line ").next().unwrap_or(&text).to_owned()
}
