//! The scenario file: what is written is read to the last bit, and what cannot be a scenario is refused
//! with the line, the scenario and the field.

use std::path::Path;

use lanesweep::model::plausibility::Implausible;
use lanesweep::scenario::{
    Category, Ego, Other, Scenario, Side, read_scenario_file, read_scenarios, write_scenarios, write_scenarios_to,
};
use lanesweep::support::error::Error;
use serde_json::Value;

use crate::common;

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
        fold: None,
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
fn what_a_scenario_says_twice_and_differently_is_named() {
    let mined = common::mined::scenarios_of(2);
    let notes = |list: &[Scenario], category, change: &dyn Fn(&mut Scenario)| {
        let mut list = list.to_vec();
        list.iter_mut().filter(|s| s.category == category).for_each(change);
        let written = tempfile::NamedTempFile::new().unwrap();
        write_scenarios(written.path(), &list).unwrap();
        read_scenario_file(written.path(), Implausible::Refused).unwrap().notes.join("\n")
    };
    assert_eq!(notes(mined, Category::CutIn, &|_| ()), "");
    let slower = |s: &mut Scenario| s.target.v.iter_mut().for_each(|v| *v /= 3.6 * 3.6);
    let thinner = |s: &mut Scenario| {
        s.target.v = s.target.v.iter().copied().step_by(2).collect();
        s.target.y = s.target.y.iter().copied().step_by(2).collect();
    };
    type Change<'a> = &'a dyn Fn(&mut Scenario);
    // A digit of 0.1 m at 25 Hz is 2.5 m/s.
    let rounded = |s: &mut Scenario| s.target.y.iter_mut().for_each(|y| *y = (*y * 10.0).round() / 10.0);
    let lane_off = |s: &mut Scenario| s.target.y.iter_mut().for_each(|y| *y += s.lane_width);
    let standing = |s: &mut Scenario| s.target.v.fill(0.0);
    const AWAY: &str = "are never in the ego's lane";
    let cases: [(Category, Change, &str); 11] = [
        (Category::CutIn, &lane_off, AWAY),
        (Category::CutOut, &lane_off, AWAY),
        (Category::Lvd, &lane_off, AWAY),
        (Category::CutIn, &rounded, "have a position or a speed that stands still between steps"),
        (Category::CutOut, &standing, "have a vehicle that moves farther to the side than along the road"),
        (Category::Lvd, &slower, "have a `peak_decel` that the changes of `target.v` contradict"),
        (Category::Lvd, &|s| s.fps = 10.0, "have a `peak_decel` that the changes of `target.v` contradict"),
        (Category::Lvd, &thinner, "have not one sample per frame from `frame0` to `frame1`"),
        (Category::CutIn, &|s| s.ego.v0 /= 3.6, "have a `gap0` that is not `thw0` times `ego.v0`"),
        (Category::CutIn, &|s| s.gap0 = s.gap0.map(|gap| gap / 2.0), "have a `gap0` that is not `thw0` times `ego.v0`"),
        (Category::CutIn, &|s| s.target.y.iter_mut().for_each(|y| *y += 1.75), "are never in the ego's lane"),
    ];
    for (category, change, expected) in cases {
        let said = notes(mined, category, change);
        assert!(said.contains(expected), "{expected}: {said}");
    }
    // One scenario is enough where no other reading is possible.
    for category in Category::ALL {
        let one = common::mined::kept(mined, category)[0].clone();
        let said = notes(&[one], category, &lane_off);
        assert!(said.contains(AWAY), "{said}");
    }
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
fn what_cannot_be_a_scenario_is_refused_by_field() {
    for field in ["category", "fps", "ego", "side", "target"] {
        let message = refused_change(|v| drop(v.as_object_mut().unwrap().remove(field)));
        assert!(message.contains(&format!("`{field}`")) && message.contains("missing"), "{message}");
    }
    type Change = fn(&mut Value);
    let cases: [([&str; 2], Change); 17] = [
        (["`target.v`", "missing"], |v| drop(v["target"].as_object_mut().unwrap().remove("v"))),
        (["`category`", "\"cut_in\""], |v| v["category"] = "overtake".into()),
        (["`lead.y[2]`", ""], |v| v["lead"]["y"][2] = Value::Null),
        (["`ego_id`", ""], |v| v["ego_id"] = (-3).into()),
        (["`fps`", "expected"], |v| v["fps"] = 0.0.into()),
        (["`fps`", "expected"], |v| v["fps"] = (-25.0).into()),
        (["`ego.v0`", "expected"], |v| v["ego"]["v0"] = (-1.0).into()),
        (["`ego.length`", "expected"], |v| v["ego"]["length"] = 0.0.into()),
        (["`target.width`", "expected"], |v| v["target"]["width"] = (-2.0).into()),
        (["`target.v[1]`", "expected"], |v| v["target"]["v"][1] = (-0.5).into()),
        (["`lead.length`", "expected"], |v| v["lead"]["length"] = (-4.0).into()),
        (["`lane_width`", "expected"], |v| v["lane_width"] = 0.0.into()),
        (["`target.y`", "1 samples"], |v| v["target"]["y"] = vec![1.0].into()),
        (["`lead.v`", ""], |v| v["lead"]["v"] = vec![1.0; 5].into()),
        (["at least 2", ""], |v| ["v", "y"].iter().for_each(|of| v["target"][*of] = vec![20.0].into())),
        (["at least 2", ""], |v| ["v", "y"].iter().for_each(|of| v["target"][*of] = Vec::<f64>::new().into())),
        // A kept cut-out needs the vehicle ahead.
        (["`lead`", ""], |v| v["lead"] = Value::Null),
    ];
    for (says, change) in cases {
        let message = refused_change(change);
        assert!(says.iter().all(|said| message.contains(said)), "{says:?}: {message}");
    }
    assert!(refused_change(|v| v["D"] = Value::Null).contains("`D`"));
    assert!(refused(line(|v| drop(v.as_object_mut().unwrap().remove("id")))).contains("`id`"));
    let text = line(|v| {
        v["lead"] = Value::Null;
        v["D"] = Value::Null;
        v["kept"] = false.into();
    });
    assert!(read_scenarios(file(text).path()).unwrap()[0].lead.is_none());
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
