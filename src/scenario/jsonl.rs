//! The scenario file as JSON Lines: one [`Scenario`] a line, its fields as they are named there.
//!
//! Numbers are written with as many digits as they need and read to the same bits, so a study on a
//! written file gives the result of a study on the recordings. Unknown fields are ignored, so files of
//! other programs can be read; what a scenario cannot do without is checked line by line.

use std::collections::HashMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;

use serde_json::Value;

use super::schema::wrong_field;
use super::{Category, Other, Scenario};
use crate::atomic_file::AtomicFile;
use crate::error::{Error, Place, Result};
use crate::input_file;

/// Reads a scenario file. A byte-order mark, Windows line ends and empty lines are accepted.
pub(super) fn read(path: &Path) -> Result<Vec<Scenario>> {
    let file = input_file::open(path)?;
    let mut reader = BufReader::with_capacity(1 << 16, file);
    let mut scenarios = Vec::new();
    let mut line_of: HashMap<String, u64> = HashMap::new();
    let mut line = Vec::new();
    for row in 1.. {
        line.clear();
        let place = Place::file(path).row(row);
        let mut up_to_longest = reader.by_ref().take(LONGEST_LINE_BYTES);
        match up_to_longest.read_until(b'\n', &mut line).map_err(|e| Error::io(path, "read", e))? as u64 {
            0 => break,
            LONGEST_LINE_BYTES => {
                let problem = format!("the line is longer than {} MiB", LONGEST_LINE_BYTES >> 20);
                return Err(Error::input(place, problem, "expected one scenario a line"));
            }
            _ => (),
        }
        let text = std::str::from_utf8(&line)
            .map_err(|_| Error::input(place.clone(), "not UTF-8 text", "save the file as UTF-8"))?;
        let text = if row == 1 { text.trim_start_matches('\u{feff}') } else { text }.trim();
        if text.is_empty() {
            continue;
        }
        let mut scenario: Scenario = serde_json::from_str(text).map_err(|e| explain(&place, text, &e))?;
        check(&scenario).map_err(|p| p.at(place.clone().of(name(&scenario.id))))?;
        if let Some(first) = line_of.insert(scenario.id.clone(), row) {
            return Err(Error::input(
                place.column("id").of(name(&scenario.id)),
                format!("this id is that of line {first} too, but every scenario needs its own"),
                "remove one of the two lines or rename one scenario",
            ));
        }
        // They grew by doubling, and thousands stay.
        for other in std::iter::once(&mut scenario.target).chain(&mut scenario.lead) {
            other.v.shrink_to_fit();
            other.y.shrink_to_fit();
        }
        scenarios.push(scenario);
    }
    if scenarios.is_empty() {
        return Err(Error::input(
            Place::file(path),
            "holds no scenario",
            "expected one JSON object a line, as `lanesweep mine` writes them",
        ));
    }
    Ok(scenarios)
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

/// What could not be read again: JSON has no NaN, for instance, and it would be written as null. A recording may hold
/// speeds and accelerations that no scenario has.
pub(super) fn check_written(scenario: &Scenario) -> Result<()> {
    check(scenario).map_err(|p| {
        let place = Place::item(name(&scenario.id)).column(p.field);
        let problem = format!("{}: it cannot be written", p.problem);
        Error::input(place, problem, "correct the data that it was made of, or leave them out")
    })
}

/// How messages call a scenario.
pub(super) fn name(id: &str) -> String {
    format!("scenario {id}")
}

/// What is wrong with which field.
pub(super) struct Problem {
    pub field: String,
    pub problem: String,
    pub help: &'static str,
}

impl Problem {
    fn at(self, place: Place) -> Error {
        Error::input(place.column(self.field), self.problem, self.help)
    }
}

/// What no type says: lengths, signs and what a category needs.
pub(super) fn check(scenario: &Scenario) -> std::result::Result<(), Problem> {
    let s = scenario;
    expect((LEAST_RATE_HZ..=LARGEST).contains(&s.fps), "fps", s.fps, "a number of at least 0.1 and at most 1e6")?;
    above_zero("lane_width", s.lane_width)?;
    at_least_zero("ego.v0", s.ego.v0)?;
    above_zero("ego.length", s.ego.length)?;
    above_zero("ego.width", s.ego.width)?;
    let samples = s.target.v.len();
    if samples < 2 {
        return Err(Problem {
            field: "target.v".into(),
            problem: format!("{samples} samples, but a scenario has a duration: expected at least 2"),
            help: "remove the scenario or export its whole series",
        });
    }
    check_other("target", &s.target, samples)?;
    if let Some(lead) = &s.lead {
        check_other("lead", lead, samples)?;
    }
    for (field, value) in [("thw0", s.thw0), ("gap0", s.gap0), ("D", s.lead_gap), ("peak_decel", s.peak_decel)] {
        value.map_or(Ok(()), |value| finite(field, value))?;
    }
    if s.category == Category::CutOut && s.kept && (s.lead.is_none() || s.lead_gap.is_none()) {
        return Err(Problem {
            field: if s.lead.is_none() { "lead" } else { "D" }.into(),
            problem: "absent, but a kept cut-out uncovers a vehicle ahead".into(),
            help: "give the vehicle ahead (`lead`) and the gap to it (`D`), or set `kept` to false",
        });
    }
    Ok(())
}

/// What no reader of scenarios would accept, as a sentence.
pub(crate) fn problem_of(scenario: &Scenario) -> Option<String> {
    check(scenario).err().map(|p| format!("`{}` {}", p.field, p.problem))
}

fn check_other(role: &str, other: &Other, samples: usize) -> std::result::Result<(), Problem> {
    above_zero(&format!("{role}.length"), other.length)?;
    above_zero(&format!("{role}.width"), other.width)?;
    for (field, series) in [("v", &other.v), ("y", &other.y)] {
        if series.len() != samples {
            return Err(Problem {
                field: format!("{role}.{field}"),
                problem: format!("{} samples, but `target.v` has {samples}", series.len()),
                help: "all series of a scenario cover the same samples, frame0 to frame1",
            });
        }
    }
    for (k, &v) in other.v.iter().enumerate() {
        at_least_zero(&format!("{role}.v[{k}]"), v)?;
    }
    for (k, &y) in other.y.iter().enumerate() {
        finite(&format!("{role}.y[{k}]"), y)?;
    }
    Ok(())
}

/// Longest line: hours at 1000 samples a second fit.
const LONGEST_LINE_BYTES: u64 = 64 << 20;

/// Least sample rate, Hz. No motion can be told at a lower one; and two samples a day apart would be replayed in
/// millions of steps, so that a short file could demand any memory.
const LEAST_RATE_HZ: f64 = 0.1;

/// Beyond this no length, speed or rate is physical, and the squares of the lane arithmetic lose their meaning.
const LARGEST: f64 = 1e6;

fn finite(field: &str, value: f64) -> std::result::Result<(), Problem> {
    expect(value.abs() <= LARGEST, field, value, "a number between -1e6 and 1e6")
}

fn at_least_zero(field: &str, value: f64) -> std::result::Result<(), Problem> {
    expect((0.0..=LARGEST).contains(&value), field, value, "a number of at least 0 and at most 1e6")
}

fn above_zero(field: &str, value: f64) -> std::result::Result<(), Problem> {
    expect(value > 0.0 && value <= LARGEST, field, value, "a number above 0 and at most 1e6")
}

fn expect(holds: bool, field: &str, value: f64, what: &str) -> std::result::Result<(), Problem> {
    if holds {
        return Ok(());
    }
    Err(Problem {
        field: field.into(),
        problem: format!("is {value}; expected {what}"),
        help: "correct the value or remove the scenario",
    })
}

/// What a line was refused for, with the field where one can be named.
fn explain(place: &Place, text: &str, error: &serde_json::Error) -> Error {
    let Ok(value) = serde_json::from_str::<Value>(text) else {
        return Error::input(
            place.clone(),
            format!("not JSON: {} at character {}", reason(error), error.column()),
            "every line holds one whole scenario; NaN and Infinity are not JSON: remove such scenarios",
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
