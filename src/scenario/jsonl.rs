//! The scenario file: JSON Lines, one [`Scenario`] a line, its fields as they are named there.
//!
//! Numbers are written with as many digits as they need and read to the same bits, so a study on a
//! written file gives the result of a study on the recordings. Unknown fields are ignored, so files of
//! other programs can be read; what a scenario cannot do without is checked line by line.

use std::collections::HashMap;
use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Write};
use std::path::Path;

use serde_json::Value;

use super::schema::wrong_field;
use super::{Category, Other, Scenario};
use crate::error::{Error, Place, Result};

/// Reads a scenario file. A byte-order mark, Windows line ends and empty lines are accepted.
///
/// # Errors
/// [`Error::Io`] if the file cannot be read; [`Error::Input`] naming the file, the line, the scenario
/// where its id can be read, and the field: not JSON, a missing field or one of a wrong type, series of
/// unequal length or of fewer than two samples, a negative speed, a size, lane width or sample rate that
/// is not above 0, a kept cut-out without the vehicle ahead or its gap, an id that came before, or a file
/// without scenarios.
pub fn read_scenarios(path: &Path) -> Result<Vec<Scenario>> {
    let file = File::open(path).map_err(|e| Error::io(path, "read", e))?;
    let mut reader = BufReader::with_capacity(1 << 16, file);
    let mut scenarios = Vec::new();
    let mut line_of: HashMap<String, u64> = HashMap::new();
    let mut line = Vec::new();
    for row in 1.. {
        line.clear();
        if reader.read_until(b'\n', &mut line).map_err(|e| Error::io(path, "read", e))? == 0 {
            break;
        }
        let place = Place::file(path).row(row);
        let text = std::str::from_utf8(&line)
            .map_err(|_| Error::input(place.clone(), "not UTF-8 text", "save the file as UTF-8"))?;
        let text = if row == 1 { text.trim_start_matches('\u{feff}') } else { text }.trim();
        if text.is_empty() {
            continue;
        }
        let scenario: Scenario = serde_json::from_str(text).map_err(|e| explain(&place, text, &e))?;
        check(&scenario).map_err(|p| p.at(place.clone().of(name(&scenario.id))))?;
        if let Some(first) = line_of.insert(scenario.id.clone(), row) {
            return Err(Error::input(
                place.column("id").of(name(&scenario.id)),
                format!("this id is that of line {first} too, but every scenario needs its own"),
                "remove one of the two lines or rename one scenario",
            ));
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

/// Writes a scenario file: whole or not at all. It is written beside its final place, synced and then
/// renamed, so a crash leaves the old file or the new one.
///
/// # Errors
/// [`Error::Io`] if the folder cannot be written to; [`Error::Internal`] for a scenario that
/// [`read_scenarios`] would refuse.
pub fn write_scenarios<'a>(path: &Path, scenarios: impl IntoIterator<Item = &'a Scenario>) -> Result<()> {
    let failed = |e| Error::io(path, "write", e);
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let file = temporary(folder).map_err(failed)?;
    let mut writer = BufWriter::with_capacity(1 << 16, file);
    write_lines(&mut writer, scenarios, path)?;
    let file = writer.into_inner().map_err(|e| failed(e.into_error()))?;
    file.as_file().sync_all().map_err(failed)?;
    file.persist(path).map_err(|e| failed(e.error))?;
    Ok(())
}

/// Writes scenarios to an open stream, one a line.
///
/// # Errors
/// As [`write_scenarios`]; the path in an [`Error::Io`] is `<output>`.
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
        // JSON has no NaN: it would be written as null and not be read again.
        check(scenario).map_err(|p| {
            Error::Internal(format!("scenario {} cannot be written: `{}` {}", scenario.id, p.field, p.problem))
        })?;
        let mut line = serde_json::to_vec(scenario)
            .map_err(|e| Error::Internal(format!("scenario {} cannot be written: {e}", scenario.id)))?;
        line.push(b'\n');
        writer.write_all(&line).map_err(|e| Error::io(path, "write", e))?;
    }
    Ok(())
}

/// A new file in `folder`, with the permissions that a new file has (temporary ones are private).
fn temporary(folder: &Path) -> std::io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".lanesweep-").suffix(".part");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666)); // less the umask
    }
    builder.tempfile_in(folder)
}

/// How messages call a scenario.
fn name(id: &str) -> String {
    format!("scenario {id}")
}

/// What is wrong with which field.
struct Problem {
    field: String,
    problem: String,
    help: &'static str,
}

impl Problem {
    fn at(self, place: Place) -> Error {
        Error::input(place.column(self.field), self.problem, self.help)
    }
}

/// What no type says: lengths, signs and what a category needs.
fn check(scenario: &Scenario) -> std::result::Result<(), Problem> {
    let s = scenario;
    above_zero("fps", s.fps)?;
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

fn finite(field: &str, value: f64) -> std::result::Result<(), Problem> {
    expect(value.is_finite(), field, value, "a finite number")
}

fn at_least_zero(field: &str, value: f64) -> std::result::Result<(), Problem> {
    expect(value.is_finite() && value >= 0.0, field, value, "a finite number of at least 0")
}

fn above_zero(field: &str, value: f64) -> std::result::Result<(), Problem> {
    expect(value.is_finite() && value > 0.0, field, value, "a finite number above 0")
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::schema::field_names;
    use crate::scenario::{Ego, Side};

    fn cut_out() -> Scenario {
        let series = |from: f64| (0..4).map(|k| from + f64::from(k) / 3.0).collect::<Vec<_>>();
        let other = |y: f64| Other { length: 4.53, width: 1.9, v: series(22.0), y: series(y) };
        Scenario {
            id: "01_cut_out_5_4_77".into(),
            category: Category::CutOut,
            recording: "01".into(),
            ego_id: 5,
            target_id: 4,
            lead_id: Some(3),
            frame0: 77,
            frame1: 80,
            fps: 25.0,
            kept: true,
            reason: "lead slower than ego".into(),
            ego: Ego { v0: 0.1 + 0.2, length: 4.8, width: 1.93 },
            lane_width: 3.75,
            side: Side::Right,
            target: other(0.0),
            lead: Some(other(-0.1)),
            thw0: Some(1.0 / 3.0),
            gap0: Some(31.2),
            lead_gap: Some(35.68),
            peak_decel: Some(-0.96),
            truncated_start: Some(false),
            end_cause: Some("lc_end".into()),
            frame_switch: Some(79),
            tag_frames: Some([77, 81]),
        }
    }

    fn file(text: impl AsRef<[u8]>) -> tempfile::NamedTempFile {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        file
    }

    fn line(change: impl FnOnce(&mut Value)) -> String {
        let mut value = serde_json::to_value(cut_out()).unwrap();
        change(&mut value);
        value.to_string()
    }

    /// The message of the refusal, which must offer help.
    fn refused(text: impl AsRef<[u8]>) -> String {
        let error = read_scenarios(file(text).path()).unwrap_err();
        assert!(error.help().is_some_and(|h| !h.is_empty()), "{error}");
        error.to_string()
    }

    fn refused_change(change: impl FnOnce(&mut Value)) -> String {
        let message = refused(line(change));
        assert!(message.contains("line 1"), "{message}");
        assert!(message.contains("scenario 01_cut_out_5_4_77"), "{message}");
        message
    }

    #[test]
    fn a_scenario_survives_the_file_to_the_last_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("s.jsonl");
        let mut lvd = cut_out();
        (lvd.id, lvd.category, lvd.kept) = ("2".into(), Category::Lvd, false);
        (lvd.lead, lvd.lead_id, lvd.lead_gap, lvd.thw0, lvd.end_cause) = (None, None, None, None, None);
        lvd.target.y[1] = -0.0;
        let all = [cut_out(), lvd];
        write_scenarios(&path, &all).unwrap();
        let read = read_scenarios(&path).unwrap();
        assert_eq!(read, all);
        assert!(read[1].target.y[1].is_sign_negative());
        let mut bytes = Vec::new();
        write_scenarios_to(&mut bytes, &read).unwrap();
        assert_eq!(bytes, std::fs::read(&path).unwrap());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file stays");
    }

    #[test]
    fn every_written_field_is_known_to_the_explanation() {
        let Value::Object(written) = serde_json::to_value(cut_out()).unwrap() else { panic!() };
        let mut written: Vec<&str> = written.keys().map(String::as_str).collect();
        let mut known = field_names();
        written.sort_unstable();
        known.sort_unstable();
        assert_eq!(written, known);
    }

    #[test]
    fn a_byte_order_mark_windows_line_ends_and_empty_lines_are_accepted() {
        let second = line(|v| v["id"] = "b".into());
        let text = format!("\u{feff}{}\r\n\r\n{second}\r\n", line(|_| ()));
        let read = read_scenarios(file(text).path()).unwrap();
        assert_eq!(read.iter().map(|s| s.id.as_str()).collect::<Vec<_>>(), ["01_cut_out_5_4_77", "b"]);
        assert_eq!(read[0], cut_out());
    }

    #[test]
    fn unknown_fields_are_ignored_and_optional_ones_may_be_absent() {
        let text = line(|v| {
            v["note"] = "mine".into();
            for field in ["recording", "ego_id", "frame0", "kept", "lane_width", "thw0", "end_cause"] {
                v.as_object_mut().unwrap().remove(field);
            }
        });
        let read = &read_scenarios(file(text).path()).unwrap()[0];
        assert!(read.kept && read.lane_width == 3.5 && read.thw0.is_none());
    }

    #[test]
    fn what_is_not_json_is_refused_with_its_line() {
        let good = line(|_| ());
        let message = refused(format!("{good}\n{}", &good[..good.len() / 2]));
        assert!(message.contains("line 2") && message.contains("not JSON"), "{message}");
        let nan = good.replacen("25.0", "NaN", 1);
        assert!(refused(nan).contains("not JSON"));
        assert!(refused(good.replacen("25.0", "1e999", 1)).contains("number out of range"));
        assert!(refused("[1, 2]").contains("not a scenario"));
        assert!(refused(b"\xff\xfe{}").contains("UTF-8"));
    }

    #[test]
    fn a_missing_or_mistyped_field_is_named() {
        for field in ["category", "fps", "ego", "side", "target"] {
            let message = refused_change(|v| drop(v.as_object_mut().unwrap().remove(field)));
            assert!(message.contains(&format!("`{field}`")) && message.contains("missing"), "{message}");
        }
        let message = refused_change(|v| drop(v["target"].as_object_mut().unwrap().remove("v")));
        assert!(message.contains("`target.v`") && message.contains("missing"), "{message}");
        let message = refused_change(|v| v["category"] = "overtake".into());
        assert!(message.contains("`category`") && message.contains("\"cut_in\""), "{message}");
        let message = refused_change(|v| v["lead"]["y"][2] = Value::Null);
        assert!(message.contains("`lead.y[2]`"), "{message}");
        let message = refused_change(|v| v["ego_id"] = (-3).into());
        assert!(message.contains("`ego_id`"), "{message}");
        assert!(refused(line(|v| drop(v.as_object_mut().unwrap().remove("id")))).contains("`id`"));
    }

    #[test]
    fn numbers_that_cannot_be_are_refused_by_field() {
        let cases: [(&str, fn(&mut Value)); 8] = [
            ("`fps`", |v| v["fps"] = 0.0.into()),
            ("`fps`", |v| v["fps"] = (-25.0).into()),
            ("`ego.v0`", |v| v["ego"]["v0"] = (-1.0).into()),
            ("`ego.length`", |v| v["ego"]["length"] = 0.0.into()),
            ("`target.width`", |v| v["target"]["width"] = (-2.0).into()),
            ("`target.v[1]`", |v| v["target"]["v"][1] = (-0.5).into()),
            ("`lead.length`", |v| v["lead"]["length"] = (-4.0).into()),
            ("`lane_width`", |v| v["lane_width"] = 0.0.into()),
        ];
        for (field, change) in cases {
            let message = refused_change(change);
            assert!(message.contains(field) && message.contains("expected"), "{message}");
        }
    }

    #[test]
    fn series_must_be_there_and_of_one_length() {
        let message = refused_change(|v| v["target"]["y"] = vec![1.0].into());
        assert!(message.contains("`target.y`") && message.contains("1 samples"), "{message}");
        let message = refused_change(|v| v["lead"]["v"] = vec![1.0; 5].into());
        assert!(message.contains("`lead.v`"), "{message}");
        for empty in [vec![], vec![20.0]] {
            let message = refused_change(|v| {
                v["target"]["v"] = empty.clone().into();
                v["target"]["y"] = empty.into();
            });
            assert!(message.contains("at least 2"), "{message}");
        }
    }

    #[test]
    fn a_kept_cut_out_needs_the_vehicle_ahead() {
        assert!(refused_change(|v| v["lead"] = Value::Null).contains("`lead`"));
        assert!(refused_change(|v| v["D"] = Value::Null).contains("`D`"));
        let text = line(|v| {
            v["lead"] = Value::Null;
            v["D"] = Value::Null;
            v["kept"] = false.into();
        });
        assert!(read_scenarios(file(text).path()).unwrap()[0].lead.is_none());
    }

    #[test]
    fn an_id_that_came_before_is_refused_with_both_lines() {
        let text = format!("{}\n\n{}\n", line(|_| ()), line(|_| ()));
        let message = refused(text);
        assert!(message.contains("line 3") && message.contains("line 1") && message.contains("`id`"), "{message}");
    }

    #[test]
    fn a_file_without_scenarios_and_a_missing_file_are_refused() {
        for empty in ["", "\n\n", "\u{feff}\r\n"] {
            assert!(refused(empty).contains("holds no scenario"));
        }
        let missing = Path::new("no/such/file.jsonl");
        assert!(matches!(read_scenarios(missing), Err(Error::Io { .. })));
        assert!(matches!(write_scenarios(missing, &[cut_out()]), Err(Error::Io { .. })));
    }

    #[test]
    fn nan_is_never_written_and_a_failed_write_leaves_the_old_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("s.jsonl");
        std::fs::write(&path, "old").unwrap();
        let mut broken = cut_out();
        broken.target.y[2] = f64::NAN;
        let error = write_scenarios(&path, &[cut_out(), broken]).unwrap_err().to_string();
        assert!(error.contains("target.y[2]") && error.contains("01_cut_out_5_4_77"), "{error}");
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file stays");
    }

    #[cfg(unix)]
    #[test]
    fn a_written_file_has_the_permissions_of_a_new_file() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode();
        write_scenarios(&folder.path().join("a"), &[cut_out()]).unwrap();
        std::fs::write(folder.path().join("b"), "").unwrap();
        assert_eq!(mode(&folder.path().join("a")), mode(&folder.path().join("b")));
    }
}
