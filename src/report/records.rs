//! The tables of a run as JSON: what `--format json` prints. The same rows and columns as the CSV files.

use serde_json::{Map, Value};

use crate::engine::{NO_STEP, Outcome};
use crate::model::criterion::Criterion;
use crate::support::table::text_of_cell;
use crate::{Error, Result};

/// Columns whose fields are texts even where they look like numbers (a parameterization's key is `1`). Every other
/// column holds numbers.
const TEXTS: &[&str] = &[
    "category",
    "claim",
    "criterion",
    "data",
    "lane",
    "mark",
    "model",
    "parameterization",
    "statement",
    "variant",
    "verdict",
];

/// A table as a list of objects, one per row, in the table's order. An empty field is null; a number that JSON does
/// not have (infinite) is null as well. The column `data` is left out: a document says once what it is about.
///
/// # Errors
/// [`Error::Internal`] where the bytes are not a table with a header.
pub(super) fn records(csv: &[u8]) -> Result<Value> {
    let broken = |e: csv::Error| Error::Internal(format!("a table cannot be read again: {e}"));
    let mut reader = csv::Reader::from_reader(csv);
    let names: Vec<String> = reader.headers().map_err(broken)?.iter().map(str::to_owned).collect();
    let mut rows = Vec::new();
    for row in reader.records() {
        let row = row.map_err(broken)?;
        let fields = names.iter().zip(&row).filter(|(name, _)| *name != "data");
        rows.push(Value::Object(
            fields.map(|(name, field)| (name.clone(), value(name, text_of_cell(field)))).collect::<Map<_, _>>(),
        ));
    }
    Ok(Value::Array(rows))
}

fn value(name: &str, field: &str) -> Value {
    if field.is_empty() {
        return Value::Null;
    }
    if TEXTS.contains(&name) {
        return Value::from(field);
    }
    match (field.parse::<u64>(), field.parse::<f64>()) {
        (Ok(whole), _) => Value::from(whole),
        // Null where it is not finite.
        (_, Ok(number)) => Value::from(number),
        _ => Value::from(field),
    }
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
    fn numbers_are_numbers_and_keys_are_texts() {
        let csv = b"parameterization,f1,fn,headway,mark,data\n1,0.5,3,1.2s,,synthetic\ni,,0,all,contact,synthetic\n";
        let rows = records(csv).unwrap();
        assert_eq!(
            rows,
            serde_json::json!([
                {"parameterization": "1", "f1": 0.5, "fn": 3, "headway": "1.2s", "mark": null},
                {"parameterization": "i", "f1": null, "fn": 0, "headway": "all", "mark": "contact"},
            ])
        );
        assert_eq!(records(b"ttc_s\ninf\n").unwrap(), serde_json::json!([{"ttc_s": null}]));
        assert_eq!(records(b"f1\n").unwrap(), serde_json::json!([]));
    }
}
