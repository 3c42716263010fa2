//! The file of scenarios, in the format that its name ends in.

use std::borrow::Cow;
use std::path::Path;

use serde_json::Value;

use super::check::check_written;
use super::columns::{Leaf, leaves};
use super::found::ScenarioFile;
use super::{Scenario, jsonl, table_reader};
use crate::support::plausibility::Implausible;
use crate::support::table::{Cell, Column, ColumnKind, TableFormat, TableMetadata, TableWriter};
use crate::{Error, Result};

/// Formats that scenarios are written in, the one for names without an ending first.
const WRITTEN: [TableFormat; 2] = [TableFormat::JsonLines, TableFormat::Parquet];
/// Formats that they are read from.
const READ: [TableFormat; 3] = [TableFormat::JsonLines, TableFormat::Parquet, TableFormat::Csv];

/// Reads a file of scenarios: JSON Lines or Parquet as `lanesweep mine` writes them, or a table that a user made, with
/// a row per scenario, per instant of one, or per concrete case. One scenario in ten may be unusable.
///
/// # Errors
/// [`Error::Io`] if the file cannot be read; [`Error::Usage`] for a name with another ending;
/// [`Error::Input`] naming the file, the line or row, the scenario where its id can be read, and the field or
/// column: a missing one, one of a wrong type or unit, series of unequal length or of fewer than two samples, a
/// speed of -0.5 m/s or below, a size, lane width or sample rate that is not above 0, a value beyond the physical range
/// unless accepted, a kept cut-out without the vehicle ahead or its gap, an id that came before, a file without
/// scenarios, or a damaged one.
pub fn read_scenario_file(path: &Path, implausible: Implausible) -> Result<ScenarioFile> {
    match TableFormat::of(path, &READ, "the scenario file")? {
        TableFormat::JsonLines => jsonl::read(path, implausible),
        format => table_reader::read(path, format, implausible),
    }
}

/// As [`read_scenario_file`], where every scenario is needed and implausible ones are accepted.
///
/// # Errors
/// As [`read_scenario_file`], for the first scenario that cannot be used.
pub fn read_scenarios(path: &Path) -> Result<Vec<Scenario>> {
    let mut file = read_scenario_file(path, Implausible::Accepted)?;
    if file.problems.is_empty() { Ok(file.scenarios) } else { Err(file.problems.swap_remove(0)) }
}

/// Writes a file of scenarios: whole or not at all.
///
/// # Errors
/// [`Error::Io`] if the folder cannot be written to; [`Error::Usage`] for a name that ends neither in
/// `.jsonl` nor in `.parquet`; [`Error::Input`] for a scenario that [`read_scenarios`] would refuse.
pub fn write_scenarios<'a>(path: &Path, scenarios: impl IntoIterator<Item = &'a Scenario>) -> Result<()> {
    match check_scenario_file(path)? {
        TableFormat::JsonLines => jsonl::write(path, scenarios),
        format => {
            let scenarios: Vec<&Scenario> = scenarios.into_iter().collect();
            scenarios.iter().try_for_each(|scenario| check_written(scenario))?;
            write_table(path, format, &scenarios)
        }
    }
}

/// The format of a file of scenarios that is to be written, checked before the work starts.
///
/// # Errors
/// [`Error::Usage`] as [`write_scenarios`].
pub fn check_scenario_file(path: &Path) -> Result<TableFormat> {
    TableFormat::of(path, &WRITTEN, "the scenario file")
}

/// The columns of a table of scenarios.
pub fn scenario_columns() -> Vec<Column> {
    leaves().iter().map(Leaf::column).collect()
}

/// A table with one row per scenario and series as lists. The caller has checked that the scenarios can be read again.
fn write_table(path: &Path, format: TableFormat, scenarios: &[&Scenario]) -> Result<()> {
    let synthetic = scenarios.iter().any(|scenario| scenario.synthetic);
    let facts = TableMetadata { table: "scenarios", synthetic, ..TableMetadata::default() };
    let (leaves, columns) = (leaves(), scenario_columns());
    let mut table = TableWriter::create(path, format, columns.clone(), &facts)?;
    for scenario in scenarios {
        let cannot = |e: &dyn std::fmt::Display| Error::Internal(format!("scenario {}: {e}", scenario.id));
        let value = serde_json::to_value(scenario).map_err(|e| cannot(&e))?;
        let cell = |(leaf, column): (&Leaf, &Column)| cell(leaf.of(&value), column.kind);
        let row: Option<Vec<Cell>> = leaves.iter().zip(&columns).map(cell).collect();
        table.row(&row.ok_or_else(|| cannot(&"a field is of another type than its column"))?)?;
    }
    table.finish()
}

/// `None` where the value is not of the column's kind.
fn cell(value: &Value, kind: ColumnKind) -> Option<Cell<'_>> {
    let numbers = || value.as_array();
    Some(match (value, kind) {
        (Value::Null, _) => Cell::Null,
        (_, ColumnKind::Text | ColumnKind::Name) => Cell::text(value.as_str()?),
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
