//! A row as a line of JSON. JSON has neither NaN nor infinity: both become null.

use serde_json::Value;

use super::{Cell, Column, ColumnKind};

/// Appends a row to a text; fields are in the order of the columns.
pub(super) fn append(line: &mut String, columns: &[Column], row: &[Cell]) {
    let separator = |at: usize| if at == 0 { '{' } else { ',' };
    for (at, (column, cell)) in columns.iter().zip(row).enumerate() {
        line.push(separator(at));
        line.push_str(&Value::from(column.name.as_ref()).to_string());
        line.push(':');
        line.push_str(&value(column.kind, cell).to_string());
    }
    line.push_str("}\n");
}

/// A cell as JSON.
pub(super) fn value(kind: ColumnKind, cell: &Cell) -> Value {
    match cell {
        Cell::Null => Value::Null,
        Cell::Text(text) => Value::from(text.as_ref()),
        Cell::Flag(flag) => Value::from(*flag),
        Cell::Whole(number) => Value::from(*number),
        // The shortest text that reads back to the same binary32.
        Cell::Number(number) | Cell::Decimal(number) if kind == ColumnKind::Binary32 => {
            (*number as f32).to_string().parse::<f64>().map_or(Value::Null, Value::from)
        }
        Cell::Number(number) | Cell::Decimal(number) => Value::from(*number),
        Cell::Series(series) => Value::from(series.to_vec()),
        Cell::Wholes(numbers) => Value::from(numbers.to_vec()),
    }
}
