//! Scenario files, in the format given by the file name's ending.
//!
//! JSON Lines have one [`Scenario`] per line, with the same field names.
//!
//! Numbers are written with as many digits as needed to read back to the same bits. A study on a written file therefore
//! gives the result of a study on the recordings. Unknown fields are ignored, so that files of other programs can be
//! read; required fields are checked line by line.

use std::borrow::Cow;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;

use serde_json::Value;

use super::check::{check_written, name};
use super::columns::{Leaf, leaves};
use super::found::{ScenarioFile, ScenariosRead};
use super::schema::wrong_field;
use super::{Scenario, table_reader};
use crate::plausibility::Implausible;
use lanesweep_support::atomic_file::AtomicFile;
use lanesweep_support::table::{Cell, Column, ColumnKind, Table, TableFormat, TableMetadata, TableWriter};
use lanesweep_support::{Error, Place, Result, input_file};

/// Formats for writing; the first is the default for names without an ending.
const WRITTEN: [TableFormat; 2] = [TableFormat::JsonLines, TableFormat::Parquet];
/// Formats for reading.
const READ: [TableFormat; 3] = [TableFormat::JsonLines, TableFormat::Parquet, TableFormat::Csv];

/// Reads a file of scenarios: JSON Lines or Parquet as `lanesweep mine` writes them, or a user's table with one row per
/// scenario, per instant of a scenario, or per concrete case. At most one scenario in ten may be unusable.
///
/// # Errors
/// [`Error::Io`] if the file cannot be read; [`Error::Usage`] for another ending. [`Error::Input`] names the file, the
/// line or row, the scenario if its id can be read, and the field or column. Its causes are: a missing field, a wrong
/// type or unit, series of unequal length or with fewer than two samples, a speed of -0.5 m/s or below, a size, lane
/// width or sample rate that is not above 0, a value outside the physical range unless accepted, a kept cut-out without
/// the vehicle ahead or its gap, a repeated id, a file without scenarios, or a damaged file.
pub fn read_scenario_file(path: &Path, implausible: Implausible) -> Result<ScenarioFile> {
    match TableFormat::of(&input_file::plain_name(path), &READ, "the scenario file")? {
        TableFormat::JsonLines => read_json_lines(path, implausible),
        format => table_reader::read(path, format, implausible),
    }
}

/// Like [`read_scenario_file`], but every scenario must be usable, and implausible values are accepted.
///
/// # Errors
/// Those of [`read_scenario_file`], for the first unusable scenario.
pub fn read_scenarios(path: &Path) -> Result<Vec<Scenario>> {
    let mut file = read_scenario_file(path, Implausible::Accepted)?;
    if file.problems.is_empty() { Ok(file.scenarios) } else { Err(file.problems.swap_remove(0)) }
}

/// Writes a file of scenarios atomically.
///
/// # Errors
/// [`Error::Io`] if the folder cannot be written to; [`Error::Usage`] for a name that ends in neither `.jsonl` nor
/// `.parquet`; [`Error::Input`] for a scenario that [`read_scenarios`] would refuse.
pub fn write_scenarios<'a>(path: &Path, scenarios: impl IntoIterator<Item = &'a Scenario>) -> Result<()> {
    match check_scenario_file(path)? {
        TableFormat::JsonLines => write_json_lines(path, scenarios),
        format => {
            let scenarios: Vec<&Scenario> = scenarios.into_iter().collect();
            scenarios.iter().try_for_each(|scenario| check_written(scenario))?;
            let synthetic = scenarios.iter().any(|scenario| scenario.synthetic);
            let facts = TableMetadata { table: "scenarios", synthetic, ..TableMetadata::default() };
            let (leaves, columns) = columns();
            let mut table = TableWriter::create(path, format, columns.clone(), &facts)?;
            scenarios.iter().try_for_each(|scenario| table.row(&row(scenario, &leaves, &columns)?))?;
            table.finish()
        }
    }
}

/// Returns the format of a scenario file to be written; called before the work starts.
///
/// # Errors
/// [`Error::Usage`] as [`write_scenarios`].
pub fn check_scenario_file(path: &Path) -> Result<TableFormat> {
    TableFormat::of(path, &WRITTEN, "the scenario file")
}

/// Scenarios as a table: one row per scenario, series as lists.
///
/// # Errors
/// None for a scenario that can be written.
pub fn scenario_table(scenarios: &[Scenario]) -> Result<Table> {
    let (leaves, columns) = columns();
    let rows = scenarios.iter().map(|scenario| row(scenario, &leaves, &columns)).collect::<Result<_>>()?;
    Ok(Table { columns, rows, ..Table::default() })
}

fn columns() -> (Vec<Leaf>, Vec<Column>) {
    let leaves = leaves();
    let columns = leaves.iter().map(Leaf::column).collect();
    (leaves, columns)
}

fn row(scenario: &Scenario, leaves: &[Leaf], columns: &[Column]) -> Result<Vec<Cell<'static>>> {
    let cannot = |e: &dyn std::fmt::Display| Error::Internal(format!("scenario {}: {e}", scenario.id));
    let value = serde_json::to_value(scenario).map_err(|e| cannot(&e))?;
    let cells: Option<_> =
        leaves.iter().zip(columns).map(|(leaf, column)| cell(leaf.of(&value), column.kind)).collect();
    cells.ok_or_else(|| cannot(&"a field is of another type than its column"))
}

/// Converts a JSON value to a cell; `None` if the value does not match the column's kind.
fn cell(value: &Value, kind: ColumnKind) -> Option<Cell<'static>> {
    let numbers = || value.as_array();
    Some(match (value, kind) {
        (Value::Null, _) => Cell::Null,
        (_, ColumnKind::Text | ColumnKind::Name) => Cell::text(value.as_str()?.to_owned()),
        (_, ColumnKind::Flag) => Cell::Flag(value.as_bool()?),
        (_, ColumnKind::Whole) => Cell::Whole(value.as_i64()?),
        (_, ColumnKind::Binary32 | ColumnKind::Binary64) => Cell::Number(value.as_f64()?),
        (_, ColumnKind::Series) => {
            Cell::Series(Cow::Owned(numbers()?.iter().map(Value::as_f64).collect::<Option<_>>()?))
        }
        (_, ColumnKind::Wholes) => {
            Cell::Wholes(Cow::Owned(numbers()?.iter().map(Value::as_i64).collect::<Option<_>>()?))
        }
    })
}

/// Reads a scenario file. A byte-order mark, Windows line ends and empty lines are accepted.
fn read_json_lines(path: &Path, implausible: Implausible) -> Result<ScenarioFile> {
    let file = input_file::open_text(path)?;
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
        match serde_json::from_str::<Scenario>(text).or_else(|error| of_flat(text).ok_or(error)) {
            Ok(scenario) => {
                let place = place.of(name(&scenario.id));
                found.take(scenario, None, row, "line", |field| place.clone().column(field));
            }
            Err(error) => found.refuse(explain(&place, text, &error)),
        }
    }
    found.finish(Place::file(path), ONE_OBJECT)
}

/// A scenario whose fields have the names of the table, as programs write a table as JSON Lines.
fn of_flat(text: &str) -> Option<Scenario> {
    let flat: Value = serde_json::from_str(text).ok()?;
    let mut scenario = serde_json::Map::new();
    for leaf in leaves() {
        leaf.put(&mut scenario, flat.get(&leaf.flat).cloned().unwrap_or_default());
    }
    serde_json::from_value(Value::Object(scenario)).ok()
}

/// Writes a scenario file atomically.
fn write_json_lines<'a>(path: &Path, scenarios: impl IntoIterator<Item = &'a Scenario>) -> Result<()> {
    let mut file = AtomicFile::create(path)?;
    write_lines(&mut file, scenarios, path)?;
    file.stage()?.publish()
}

/// Writes scenarios to an open stream, one per line.
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

/// Help for a file of something else.
const ONE_OBJECT: &str = "expected one JSON object per line, as `lanesweep mine` writes them";

/// Maximum line length, bytes: enough for hours at 1000 samples per second.
const MAX_LINE_BYTES: u64 = 64 << 20;

/// Explains why a line was refused, with the field if it can be named.
fn explain(place: &Place, text: &str, error: &serde_json::Error) -> Error {
    let Ok(value) = serde_json::from_str::<Value>(text) else {
        return Error::input(
            place.clone(),
            format!("not JSON: {} at character {}", reason(error), error.column()),
            "every line holds one complete scenario: is the file cut off? NaN and Infinity are not JSON",
        );
    };
    if !value.is_object() {
        return Error::input(place.clone(), "not a scenario: the line is no JSON object", ONE_OBJECT);
    }
    let id = value.get("id").and_then(Value::as_str);
    let place = id.map_or_else(|| place.clone(), |id| place.clone().of(name(id)));
    let (place, problem) = match wrong_field(&value) {
        Some((field, problem)) => (place.column(field), problem),
        None => (place, format!("not a scenario: {}", reason(error))),
    };
    Error::input(place, problem, "expected the fields that `lanesweep mine` writes")
}

/// The message without its position, which refers to characters within the one line.
pub(super) fn reason(error: &serde_json::Error) -> String {
    let text = error.to_string();
    text.split(" at line ").next().unwrap_or(&text).to_owned()
}
