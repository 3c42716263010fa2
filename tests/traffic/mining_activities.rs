//! The detectors and the search against golden tables: other implementations of the published text.

use crate::common::{golden_json, numbers};

use lanesweep::traffic::mining::lateral::{LaneChangeKind, lane_changes};
use lanesweep::traffic::mining::longitudinal::{Longitudinal, longitudinal_events};
use lanesweep::traffic::mining::tags::Tags;
use lanesweep::traffic::mining::{LaneChangeEnd, LateralOptions, LongitudinalOptions, cut_in, lvd, tags};
use lanesweep::traffic::trajectory::Lane;
use serde_json::Value;

fn cases(name: &str) -> Vec<Value> {
    golden_json(name)["cases"].as_array().unwrap().clone()
}

/// `[[time, tag], …]` in samples.
fn events(value: &Value, fs: f64) -> Vec<(usize, String)> {
    let event = |e: &Value| ((e[0].as_f64().unwrap() * fs).round() as usize, e[1].as_str().unwrap().to_owned());
    value.as_array().unwrap().iter().map(event).collect()
}

#[test]
fn longitudinal_activities_are_those_of_the_published_formula() {
    let cases = cases("activity_longitudinal.json");
    assert_eq!(cases.len(), 16);
    for case in cases {
        let (fs, params) = (case["fs"].as_f64().unwrap(), &case["params"]);
        let options = LongitudinalOptions {
            window_s: params["time_horizon"].as_f64().unwrap(),
            cruise_acceleration_mps2: params["a_cruise"].as_f64().unwrap(),
            min_speed_change_mps: params["delta_v"].as_f64().unwrap(),
            min_cruise_s: params["min_cruising_time"].as_f64().unwrap(),
        };
        let found: Vec<(usize, String)> = longitudinal_events(&numbers(&case["speed"]), fs, &options)
            .into_iter()
            .map(|e| {
                let letter = match e.activity {
                    Longitudinal::Cruising => "c",
                    Longitudinal::Accelerating => "a",
                    Longitudinal::Decelerating => "d",
                };
                (e.start, letter.to_owned())
            })
            .collect();
        assert_eq!(found, events(&case["events_published_formula"], fs), "{}", case["name"]);
    }
}

/// The observed end comes when the window behind is calm, the published one when the window ahead is: the motion is over in
/// between.
#[test]
fn lane_changes_are_those_of_the_published_formula_and_their_observed_end_comes_later() {
    let cases = cases("activity_lateral_target.json");
    assert_eq!(cases.len(), 12);
    let mut compared = 0;
    for case in cases {
        let fs = case["fs"].as_f64().unwrap();
        let lane = Lane { left_m: case["line_left"].as_f64().unwrap(), right_m: case["line_right"].as_f64().unwrap() };
        let changes = |lc_end| {
            let options = LateralOptions { lc_end, ..LateralOptions::default() };
            lane_changes(&numbers(&case["target_dy"]), lane, fs, &options)
        };
        let mut found = vec![(0, "fl".to_owned())];
        let published = changes(LaneChangeEnd::Published);
        for (published, observed) in published.iter().zip(changes(LaneChangeEnd::Observed)) {
            assert!((published.end + 1..=published.end + fs as usize).contains(&observed.end), "{}", case["name"]);
            compared += 1;
        }
        for change in published {
            let name = match change.kind {
                LaneChangeKind::LeftIn => "li",
                LaneChangeKind::RightIn => "ri",
                LaneChangeKind::LeftOut => "lo",
                LaneChangeKind::RightOut => "ro",
            };
            found.push((change.start, name.to_owned()));
            found.push((change.end, "fl".to_owned()));
        }
        assert_eq!(found, events(&case["events_published_formula"], fs), "{}", case["name"]);
    }
    assert!(compared >= 10, "{compared}");
}

/// Rows `[time, tags…]` at a sample every half second: a value holds until the next row.
fn row_at(rows: &[Value], t: f64) -> &Value {
    rows.iter().rev().find(|r| r[0].as_f64().unwrap() <= t).unwrap()
}

#[test]
fn the_search_finds_the_golden_intervals() {
    const STEP_S: f64 = 0.5;
    let cases = cases("tag_search.json");
    assert_eq!(cases.len(), 8);
    for case in cases {
        let target = case["target_rows"].as_array().unwrap();
        let ego = case.get("ego_rows").and_then(Value::as_array);
        let ends = std::iter::once(target).chain(ego).map(|rows| rows.last().unwrap()[0].as_f64().unwrap());
        let last = (ends.fold(f64::INFINITY, f64::min) / STEP_S) as usize;
        let tags: Vec<Tags> = (0..=last)
            .map(|k| {
                let t = k as f64 * STEP_S;
                let row = row_at(target, t);
                Tags {
                    decelerates: row[1] == "d",
                    changes_in: row[2] == "li" || row[2] == "ri",
                    changes_out: row[2] == "lo" || row[2] == "ro",
                    leader: row[3] == "y",
                    ego_keeps_lane: ego.is_none_or(|rows| row_at(rows, t)[2] == "fl"),
                }
            })
            .collect();
        let (items, pause): (&[tags::Item<Tags>], usize) = match case["kind"].as_str().unwrap() {
            "cut-in" => (&cut_in::ITEMS, (5.0 / STEP_S) as usize),
            "LVD" => (&lvd::ITEMS, 0),
            other => panic!("{other}"),
        };
        let mut found = Vec::new();
        let mut from = 0;
        while let Some(m) = tags::find_match(&tags, items, from) {
            found.push(vec![m.start() as f64 * STEP_S, m.end as f64 * STEP_S]);
            from = m.end.max(m.last_item().end) + pause;
        }
        let expected: Vec<Vec<f64>> = case["found"].as_array().unwrap().iter().map(numbers).collect();
        assert_eq!(found, expected, "{} {}", case["kind"], case["name"]);
    }
}
