//! The tables of a run: as CSV, and as JSON for `--format json`. Each field has a type of its own; none is guessed from text.

use std::fmt::Write;

use serde_json::{Map, Value};

use crate::engine::{NO_STEP, Outcome};
use crate::model::criterion::Criterion;
use crate::support::table::{Cell, csv_field};
use crate::{Error, Result};

/// A table with a header.
pub struct Table {
    columns: Vec<String>,
    rows: Vec<Vec<Cell<'static>>>,
}

impl Table {
    /// A table without rows.
    pub fn new(columns: &[&str]) -> Table {
        Table { columns: columns.iter().map(|name| (*name).to_owned()).collect(), rows: Vec::new() }
    }

    /// Adds a row: a field per column.
    pub fn push(&mut self, row: Vec<Cell<'static>>) {
        debug_assert_eq!(row.len(), self.columns.len());
        self.rows.push(row);
    }

    /// The table as CSV: numbers in full precision, nothing for null.
    pub fn csv(&self) -> String {
        let mut text = self.columns.join(",") + "\n";
        for row in &self.rows {
            for (at, cell) in row.iter().enumerate() {
                text.push_str(if at > 0 { "," } else { "" });
                // Writing to a string does not fail.
                let _ = match cell {
                    Cell::Text(words) => write!(text, "{}", csv_field(words)),
                    Cell::Whole(number) => write!(text, "{number}"),
                    Cell::Number(number) => write!(text, "{number}"),
                    _ => Ok(()),
                };
            }
            text.push('\n');
        }
        text
    }

    /// The rows as a list of objects. A number that JSON does not have (infinite) is null. The column `data` is left
    /// out: a document says once what it is about.
    pub fn records(&self) -> Value {
        let value = |cell: &Cell| match cell {
            Cell::Text(words) => Value::from(words.as_ref()),
            Cell::Whole(number) => Value::from(*number),
            Cell::Number(number) => Value::from(*number),
            _ => Value::Null,
        };
        let record = |row: &Vec<Cell>| {
            let fields = self.columns.iter().zip(row).filter(|(name, _)| *name != "data");
            Value::Object(fields.map(|(name, cell)| (name.clone(), value(cell))).collect::<Map<_, _>>())
        };
        Value::Array(self.rows.iter().map(record).collect())
    }
}

/// A text; an empty one is null.
pub fn words(text: impl Into<String>) -> Cell<'static> {
    let text: String = text.into();
    if text.is_empty() { Cell::Null } else { Cell::text(text) }
}

/// A count.
pub fn whole(count: impl TryInto<i64>) -> Cell<'static> {
    count.try_into().map_or(Cell::Null, Cell::Whole)
}

/// How a lane ended. Times in seconds, null for what did not happen and for what is infinite.
pub fn outcome(outcome: &Outcome<f64>, dt_s: f64) -> Value {
    let time = |step: u32| (step != NO_STEP).then(|| (f64::from(step) * dt_s * 1e9).round() / 1e9);
    let failed = |c: Criterion| outcome.verdicts.failed(c);
    let is_contact = outcome.contact_step != NO_STEP;
    serde_json::json!({
        "collision": failed(Criterion::Collision),
        "ttc": failed(Criterion::Ttc),
        "btn": failed(Criterion::Btn),
        "capped": outcome.verdicts.capped(),
        "min_ttc_s": outcome.min_ttc,
        "max_btn": outcome.max_btn,
        "min_gap_m": outcome.min_gap,
        "crash_type": outcome.contact.code(),
        "t_react_s": time(outcome.reaction_step),
        "t_crash_s": time(outcome.contact_step),
        "impact_speed_mps": is_contact.then_some(outcome.impact_speed),
        "impact_closing_speed_mps": is_contact.then_some(outcome.impact_closing_speed),
        "t_end_s": time(outcome.end_step),
    })
}

/// A document as text, with a line's end.
///
/// # Errors
/// None for what this program made.
pub fn document(value: &Value) -> Result<String> {
    let text = serde_json::to_string_pretty(value);
    text.map(|text| text + "\n").map_err(|e| Error::Internal(format!("a document cannot be written: {e}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_has_its_type_whatever_it_looks_like() {
        let mut table = Table::new(&["parameterization", "f1", "fn", "headway", "data"]);
        table.push(vec![words("1"), Cell::Number(1.0), whole(3_u64), words("1.2"), words("synthetic")]);
        table.push(vec![words("-i"), Cell::number(None), whole(0_u64), words(""), words("synthetic")]);
        table.push(vec![words("a,b"), Cell::Number(f64::INFINITY), whole(u64::MAX), words("inf"), words("")]);
        // `is_f64`: 1 as a number is 1.0 in every row, 3 as a count is 3.
        let rows = table.records();
        assert!(rows[0]["f1"].is_f64() && rows[0]["fn"].is_i64() && rows[0]["parameterization"].is_string());
        assert_eq!(
            rows,
            serde_json::json!([
                {"parameterization": "1", "f1": 1.0, "fn": 3, "headway": "1.2"},
                {"parameterization": "-i", "f1": null, "fn": 0, "headway": null},
                {"parameterization": "a,b", "f1": null, "fn": null, "headway": "inf"},
            ])
        );
        let csv = "parameterization,f1,fn,headway,data\n1,1,3,1.2,synthetic\n'-i,,0,,synthetic\n\"a,b\",inf,,inf,\n";
        assert_eq!(table.csv(), csv);
        assert_eq!(Table::new(&["f1"]).records(), serde_json::json!([]));
    }
}
