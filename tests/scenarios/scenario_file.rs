//! The scenario file: what is written is read to the last bit, and what cannot be a scenario is refused
//! with the line, the scenario and the field.

use std::path::Path;

use lanesweep::scenario::{Category, Ego, Other, Scenario, Side, read_scenarios, write_scenarios, write_scenarios_to};
use lanesweep::support::error::Error;
use serde_json::Value;

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
        synthetic: false,
        replays: Vec::new(),
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
    type Change = fn(&mut Value);
    let cases: [(&str, Change); 8] = [
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
