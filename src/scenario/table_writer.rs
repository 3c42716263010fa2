//! Scenarios as a table: one row each, series as lists.

use std::borrow::Cow;
use std::path::Path;

use serde_json::Value;

use super::Scenario;
use super::leaves::{Leaf, leaves};
use crate::support::table::{Cell, Column, Kind, TableFacts, TableFormat, TableWriter};
use crate::{Error, Result};

/// The columns of a table of scenarios.
pub fn scenario_columns() -> Vec<Column> {
    leaves().iter().map(Leaf::column).collect()
}

/// The caller has checked that the scenarios can be read again.
pub(super) fn write(path: &Path, format: TableFormat, scenarios: &[&Scenario]) -> Result<()> {
    let synthetic = scenarios.iter().any(|scenario| scenario.synthetic);
    let facts = TableFacts { table: "scenarios", synthetic, ..TableFacts::default() };
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
fn cell(value: &Value, kind: Kind) -> Option<Cell<'_>> {
    let numbers = || value.as_array();
    Some(match (value, kind) {
        (Value::Null, _) => Cell::Null,
        (_, Kind::Text | Kind::Name) => Cell::text(value.as_str()?),
        (_, Kind::Flag) => Cell::Flag(value.as_bool()?),
        (_, Kind::Whole) => Cell::Whole(value.as_i64()?),
        (_, Kind::Binary32 | Kind::Binary64) => Cell::Number(value.as_f64()?),
        (_, Kind::Series) => Cell::Series(Cow::Owned(numbers()?.iter().map(Value::as_f64).collect::<Option<_>>()?)),
        (_, Kind::Wholes) => Cell::Wholes(Cow::Owned(numbers()?.iter().map(Value::as_i64).collect::<Option<_>>()?)),
    })
}
