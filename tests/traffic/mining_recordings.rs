//! Mining of whole recordings against an independent implementation of the same definitions, and of
//! recordings turned by 180°.

use crate::common;

use std::collections::BTreeMap;
use std::path::Path;

use lanesweep::scenario::{Category, Scenario, read_scenarios, write_scenarios};
use lanesweep::traffic::mining::{Mined, MiningOptions, count, mine};
use lanesweep::traffic::trajectory::highd::{HighdFiles, read};

fn mined(dir: &Path, id: &str) -> Mined {
    mine(&read(&HighdFiles::named(dir, id)).unwrap().recording, &MiningOptions::default())
}

/// Scenarios of some recordings by id.
fn by_id(dir: &Path, recordings: &[&str]) -> BTreeMap<String, Scenario> {
    let all = recordings.iter().flat_map(|id| mined(dir, id).scenarios);
    let by_id: BTreeMap<String, Scenario> = all.map(|s| (s.id.clone(), s)).collect();
    by_id
}

/// `found` rounds to the golden value, to as many decimals as that has but at most four.
fn same_rounded(found: Option<f64>, golden: &str) -> bool {
    match found {
        None => golden.is_empty(),
        Some(found) => golden.parse::<f64>().is_ok_and(|golden| (found - golden).abs() <= 0.5e-4 + 1e-9),
    }
}

#[test]
fn sumo_recordings_hold_the_scenarios_that_a_second_implementation_finds() {
    let Some(dir) = common::sumo_recordings() else { return };
    let mut ours = by_id(&dir, &["01", "02"]);
    let mut golden = csv::Reader::from_path(common::golden("mining_sumo_01_02.csv")).unwrap();
    let mut compared = 0;
    for row in golden.deserialize::<BTreeMap<String, String>>() {
        let row = row.unwrap();
        let id = format!(
            "{}_{}_{}_{}_{}",
            row["recording"], row["category"], row["ego_id"], row["target_id"], row["frame0"]
        );
        let s = ours.remove(&id).unwrap_or_else(|| panic!("{id} not found"));
        assert_eq!(s.frame1.to_string(), row["frame1"], "{id}");
        assert_eq!(s.lead_id.map_or(String::new(), |l| l.to_string()), row["lead_id"], "{id}");
        assert_eq!(format!("{:?}", s.side).to_lowercase(), row["side"], "{id}");
        assert_eq!(u8::from(s.truncated_start == Some(true)).to_string(), row["truncated_start"], "{id}");
        assert_eq!(u8::from(s.kept).to_string(), row["kept"], "{id}");
        for (name, found) in [("thw0", s.thw0), ("gap0", s.gap0), ("D", s.lead_gap), ("peak_decel", s.peak_decel)] {
            assert!(same_rounded(found, &row[name]), "{id}: {name} {found:?}, golden {}", row[name]);
        }
        compared += 1;
    }
    assert_eq!(compared, 72);
    assert!(ours.is_empty(), "found besides: {:?}", ours.keys());
}

/// The series too, and everything else that the golden file says of a scenario.
#[test]
fn sumo_scenarios_equal_those_of_a_second_implementation_field_by_field() {
    let Some(dir) = common::sumo_recordings() else { return };
    let Some(golden) = common::shared("golden/paper_sumo_01_02_scenarios.jsonl") else { return };
    let golden = read_scenarios(&golden).unwrap();
    assert_eq!(golden.len(), 19);
    let ours = by_id(&dir, &["01", "02"]);
    for expected in golden {
        let mut found = ours[&expected.id].clone();
        let thw = found.thw0.unwrap();
        assert!((thw - expected.thw0.unwrap()).abs() <= 0.5e-4 + 1e-9, "{}", found.id);
        found.thw0 = expected.thw0; // the golden one is rounded to four decimals
        if expected.category == Category::Lvd {
            assert!(found.end_cause.is_none() && found.frame_switch.is_none());
        }
        assert_eq!(found, expected);
    }
}

/// Counts that the second implementation gives for all four recordings.
#[test]
fn sumo_counts_equal_those_of_a_second_implementation() {
    let Some(dir) = common::sumo_recordings() else { return };
    let all: Vec<Mined> = ["01", "02", "03", "04"].iter().map(|id| mined(&dir, id)).collect();
    let found_and_kept = |category| {
        let counts = all.iter().map(|m| count(&m.scenarios, category));
        counts.fold((0, 0), |sum, c| (sum.0 + c.found, sum.1 + c.kept))
    };
    assert_eq!(found_and_kept(Category::CutIn), (26, 3));
    assert_eq!(found_and_kept(Category::CutOut), (34, 9));
    assert_eq!(found_and_kept(Category::Lvd), (249, 43));
}

#[test]
fn mined_scenarios_survive_the_scenario_file() {
    let Some(dir) = common::sumo_recordings() else { return };
    let folder = tempfile::tempdir().unwrap();
    for id in ["01", "04"] {
        let found = mined(&dir, id).scenarios;
        let path = folder.path().join(id);
        write_scenarios(&path, &found).unwrap();
        assert_eq!(read_scenarios(&path).unwrap(), found);
    }
}

/// Turns the three files of a recording by 180° about some point, as a camera held the other way round
/// would have recorded them, in the two decimals of the format.
fn turn(from: &Path, into: &Path, id: &str) {
    const WIDTH: f64 = 421.37;
    const HEIGHT: f64 = 57.93;
    let files = |name: &str| (from.join(format!("{id}_{name}.csv")), into.join(format!("{id}_{name}.csv")));
    let fixed = |x: f64| format!("{:.2}", if x == 0.0 { 0.0 } else { x });
    let number = |text: &str| text.parse::<f64>().unwrap();

    let markings = |text: &str| text.split(';').map(number).collect::<Vec<f64>>();
    let turned = |lines: &[f64]| lines.iter().rev().map(|y| fixed(HEIGHT - y)).collect::<Vec<_>>().join(";");
    let mut lines = 0;
    let (path, target) = files("recordingMeta");
    each_row(&path, &target, |row| {
        let (upper, lower) = (markings(&row["upperLaneMarkings"]), markings(&row["lowerLaneMarkings"]));
        lines = upper.len() + lower.len();
        row.insert("upperLaneMarkings".into(), turned(&lower));
        row.insert("lowerLaneMarkings".into(), turned(&upper));
    });
    let (path, target) = files("tracksMeta");
    each_row(&path, &target, |row| {
        let direction = 3 - row["drivingDirection"].parse::<u8>().unwrap();
        row.insert("drivingDirection".into(), direction.to_string());
    });
    let (path, target) = files("tracks");
    each_row(&path, &target, |row| {
        for (at, size, extent) in [("x", "width", WIDTH), ("y", "height", HEIGHT)] {
            let value = extent - number(&row[at]) - number(&row[size]);
            row.insert(at.into(), fixed(value));
        }
        for name in ["xVelocity", "yVelocity", "xAcceleration", "yAcceleration", "precedingXVelocity"] {
            let value = fixed(-number(&row[name]));
            row.insert(name.into(), value);
        }
        let lane = lines + 2 - row["laneId"].parse::<usize>().unwrap();
        row.insert("laneId".into(), lane.to_string());
    });
}

/// Copies a table with its rows changed; columns keep their order.
fn each_row(from: &Path, into: &Path, mut change: impl FnMut(&mut BTreeMap<String, String>)) {
    let mut reader = csv::Reader::from_path(from).unwrap();
    let header = reader.headers().unwrap().clone();
    let mut writer = csv::Writer::from_path(into).unwrap();
    writer.write_record(&header).unwrap();
    for record in reader.records() {
        let record = record.unwrap();
        let mut row: BTreeMap<String, String> =
            header.iter().zip(&record).map(|(h, v)| (h.to_owned(), v.to_owned())).collect();
        change(&mut row);
        writer.write_record(header.iter().map(|h| &row[h])).unwrap();
    }
    writer.flush().unwrap();
}

/// Recording 04 has an on-ramp, so its carriageways have unequal lane counts.
#[test]
fn a_recording_turned_by_180_degrees_gives_the_same_scenarios() {
    let Some(dir) = common::sumo_recordings() else { return };
    let folder = tempfile::tempdir().unwrap();
    for id in ["01", "02", "03", "04"] {
        turn(&dir, folder.path(), id);
        let (original, turned) = (mined(&dir, id), mined(folder.path(), id));
        assert!(!original.scenarios.is_empty());
        assert_eq!(original.data_sets, turned.data_sets, "recording {id}");
        for (a, b) in original.scenarios.iter().zip(&turned.scenarios) {
            assert_eq!(a, b);
        }
        assert_eq!(original.scenarios.len(), turned.scenarios.len(), "recording {id}");
    }
}
