//! Exported scenarios: read again, vertex by vertex, they are the lanes that `simulate` prints, to the bit.

use std::collections::HashMap;
use std::path::Path;

use lanesweep::scenario::write_scenarios;

use crate::common::mined::{scenarios_of, write_cut_in_density};
use crate::common::program::{done, names, ran, refused, table};
use crate::common::text_of;

struct Found {
    path: String,
    attributes: HashMap<String, String>,
}

impl Found {
    fn number(&self, name: &str) -> f64 {
        self.attributes[name].parse().unwrap()
    }
}

fn named<'f>(all: &'f [Found], name: &str) -> Option<&'f Found> {
    all.iter().find(|found| found.attributes.get("name").is_some_and(|own| own == name))
}

/// Every element in order; the document must be well-formed, and no text stands outside of attributes.
fn elements(text: &str) -> Vec<Found> {
    let (mut above, mut found): (Vec<&str>, Vec<Found>) = (Vec::new(), Vec::new());
    let declared = text.strip_prefix("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n").expect("a declaration");
    for part in declared.split('<').skip(1) {
        let (tag, outside) = part.split_once('>').expect("a tag ends");
        assert!(outside.trim().is_empty(), "{outside}");
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(above.pop(), Some(name));
            continue;
        }
        let (name, mut rest) = tag.trim_end_matches('/').split_once(' ').unwrap_or((tag.trim_end_matches('/'), ""));
        let mut attributes = HashMap::new();
        while !rest.trim().is_empty() {
            let (key, after) = rest.trim_start().split_once("=\"").expect("an attribute");
            let (value, after) = after.split_once('"').expect("its end");
            assert!(!key.contains(char::is_whitespace) && !value.contains(char::is_control), "{tag}");
            assert!(attributes.insert(key.to_owned(), unescaped(value)).is_none(), "{key} twice");
            rest = after;
        }
        found.push(Found { path: format!("{}/{name}", above.join("/")), attributes });
        if !tag.ends_with('/') {
            above.push(name);
        }
    }
    assert!(above.is_empty());
    found
}

fn unescaped(value: &str) -> String {
    let mut parts = value.split('&');
    let mut text = parts.next().unwrap().to_owned();
    for part in parts {
        let (entity, rest) = part.split_once(';').expect("an entity ends");
        let number = |text: &str| text.strip_prefix('x').map_or(text.parse(), |hex| u32::from_str_radix(hex, 16));
        text.push(match (entity, entity.strip_prefix('#')) {
            ("lt", _) => '<',
            ("gt", _) => '>',
            ("amp", _) => '&',
            ("quot", _) => '"',
            ("apos", _) => '\'',
            (_, code) => char::from_u32(number(code.expect("an entity of XML")).unwrap()).unwrap(),
        });
        text += rest;
    }
    text
}

#[derive(Default)]
struct Played {
    start: (f64, f64),
    centre_m: f64,
    length_m: f64,
    width_m: f64,
    /// Time, place of the box's centre.
    path: Vec<(f64, f64, f64)>,
    written: Vec<(f64, f64)>,
}

/// The vehicles of a scenario by name, and its other elements.
fn played(text: &str) -> (HashMap<String, Played>, Vec<Found>) {
    let all = elements(text);
    let mut vehicles: HashMap<String, Played> = HashMap::new();
    let (mut name, mut time) = (String::new(), 0.0);
    for found in &all {
        match found.path.rsplit('/').next().unwrap() {
            "ScenarioObject" => name = found.attributes["name"].clone(),
            "Private" | "EntityRef" => name = found.attributes["entityRef"].clone(),
            "Center" => vehicles.entry(name.clone()).or_default().centre_m = found.number("x"),
            "Dimensions" => {
                let vehicle = vehicles.entry(name.clone()).or_default();
                (vehicle.length_m, vehicle.width_m) = (found.number("length"), found.number("width"));
            }
            "Vertex" => time = found.number("time"),
            "WorldPosition" => {
                let (x, y) = (found.number("x"), found.number("y"));
                assert_eq!(found.number("h"), 0.0);
                let vehicle = vehicles.get_mut(&name).unwrap();
                if found.path.contains("Init") {
                    vehicle.start = (x, y);
                } else {
                    vehicle.path.push((time, x + vehicle.centre_m, y));
                    vehicle.written.push((x, y));
                }
            }
            _ => {}
        }
    }
    (vehicles, all)
}

fn series(text: &str) -> Vec<HashMap<String, String>> {
    csv::Reader::from_reader(text.as_bytes()).deserialize().map(Result::unwrap).collect()
}

/// Every vertex against the series: time and place across the road to the bit, place along it to the bit of the
/// difference that is written, and the gap between the boxes to 1e-6 m (a lane in binary32 rounds half the sum of two
/// lengths).
fn compare(scenario: &str, csv: &str) -> usize {
    let (vehicles, _) = played(scenario);
    let rows = series(csv);
    let number = |row: &HashMap<String, String>, column: &str| row[column].parse::<f64>().unwrap();
    let ego = &vehicles["Ego"];
    for (name, prefix) in [("Other", "other"), ("Ahead", "ahead")] {
        let Some(other) = vehicles.get(name) else { continue };
        assert!(other.path.len() >= rows.len().max(2) && ego.path.len() >= rows.len().max(2));
        for (at, row) in rows.iter().enumerate() {
            let (t, x, y) = other.path[at];
            assert_eq!(t, number(row, "t_s"), "{name} {at}");
            assert_eq!(y, number(row, &format!("{prefix}_y_m")), "{name} {at}");
            assert_eq!(other.written[at].0, number(row, &format!("{prefix}_x_m")) - other.centre_m, "{name} {at}");
            assert_eq!(ego.path[at].0, t);
            assert_eq!(ego.written[at], (number(row, "x_ego_m") - ego.centre_m, 0.0));
            let gap = (x - other.length_m / 2.0) - (ego.path[at].1 + ego.length_m / 2.0);
            assert!((gap - number(row, &format!("{prefix}_gap_m"))).abs() < 1e-6, "{name} {at}: {gap}");
            let lateral = y.abs() - (other.width_m + ego.width_m) / 2.0;
            assert!((lateral - number(row, &format!("{prefix}_lateral_gap_m"))).abs() < 1e-6, "{name} {at}");
        }
        assert_eq!(other.start, other.written[0]);
    }
    rows.len()
}

const CUT_IN: &str = "--category cut-in --models FSM --ego-speed 30m/s --speed 20m/s --thw 1.2 --lateral-speed 1";
const CUT_OUT: &str = "--category cut-out --models RSS --ego-speed 27.3m/s --gap 31 --lateral-speed 1.1 --ahead-gap 42 --ahead-speed 26m/s";

/// The only file of this ending in the folder `x`.
fn only(dir: &Path, ending: &str) -> String {
    let all = std::fs::read_dir(dir.join("x")).unwrap().map(|entry| entry.unwrap().path());
    let found: Vec<_> = all.filter(|path| path.extension().is_some_and(|own| own == ending)).collect();
    assert_eq!(found.len(), 1, "{found:?}");
    std::fs::read_to_string(&found[0]).unwrap()
}

/// The only scenario that these flags export.
fn exported(dir: &Path, flags: &str) -> String {
    ran(dir, &format!("simulate --xosc x {flags}"));
    only(dir, "xosc")
}

#[test]
fn every_vertex_of_a_case_of_flags_is_that_of_its_series() {
    let dir = tempfile::tempdir().unwrap();
    for flags in [CUT_IN, CUT_OUT, "--category lvd --models CCHDM --ego-speed 25m/s --gap 20 --acceleration -6.5"] {
        for more in ["", "--profile jrc-2021", "--dt 0.007", "--length 11.3 --width 2.3"] {
            let case = format!("{flags} {more}");
            let csv = ran(dir.path(), &format!("simulate {case}"));
            assert!(compare(&exported(dir.path(), &case), &csv) > 20, "{case}");
        }
    }
}

/// A lane goes on where the vehicle that cuts out drives through the one ahead; another simulator reports a collision.
#[test]
fn a_cut_out_whose_other_vehicles_overlap_says_so_in_its_file() {
    let dir = tempfile::tempdir().unwrap();
    let case =
        "--category cut-out --models FSM --ego-speed 20m/s --gap 40 --ahead-speed 0 --lateral-speed 0.8 --ahead-gap";
    // By hand: 1.9 m across at 0.8 m/s take 2.375 s; at 20 m/s the bumpers meet after 30 m in 1.5 s. After 100 m in 5 s
    // the vehicles are apart.
    for (ahead_gap, first_s) in [("30", Some(1.5)), ("100", None)] {
        let (vehicles, all) = played(&exported(dir.path(), &format!("{case} {ahead_gap}")));
        let (other, ahead) = (&vehicles["Other"], &vehicles["Ahead"]);
        let overlap = other.path.iter().zip(&ahead.path).find(|(a, b)| {
            (a.1 - b.1).abs() < (other.length_m + ahead.length_m) / 2.0
                && (a.2 - b.2).abs() < (other.width_m + ahead.width_m) / 2.0
        });
        let time_s = overlap.map(|(at, _)| at.0);
        let of_property = named(&all, "lanesweep.others_overlap_s");
        assert_eq!(of_property.map(|e| e.number("value")), time_s);
        assert_eq!(time_s.is_some(), first_s.is_some());
        let description = &all.iter().find(|e| e.path.ends_with("/FileHeader")).unwrap().attributes["description"];
        match (time_s, first_s) {
            (Some(time_s), Some(first_s)) => {
                assert!((time_s - first_s).abs() <= 0.041, "{time_s}");
                let says =
                    format!("; Other drives through Ahead from {time_s} s on: a player that checks all vehicles");
                assert!(description.contains(&says), "{description}");
            }
            _ => assert!(!description.contains("drives through"), "{description}"),
        }
    }
}

#[test]
fn lanes_of_a_study_and_of_a_sampling_run_are_those_of_simulate_in_binary32() {
    let root = &*crate::common::folder();
    write_scenarios(&root.join("s.jsonl"), scenarios_of(1)).unwrap();
    ran(root, "study --scenarios s.jsonl --backend cpu --out study --rows lanes.csv");
    // The first lanes that collide, by their keys.
    let rows = table(&root.join("lanes.csv"));
    let colliding = rows.iter().filter(|row| row["collision"] == "1").take(6);
    let lanes: Vec<String> = colliding
        .map(|row| format!("--lane {}/{}/{}/{}", row["id"], row["variant"], row["headway"], row["model"]))
        .collect();
    let check = |flags: &str, from: &str| {
        let printed = series(&ran(root, &format!("simulate --xosc x --from {from} {flags}")));
        let index = table(&root.join("x/index.csv"));
        let mut lanes: Vec<_> = printed.iter().filter_map(|row| row.get("lane")).collect();
        lanes.dedup();
        assert!(index.len() == 1 || lanes == index.iter().map(|row| &row["lane"]).collect::<Vec<_>>(), "{lanes:?}");
        for row in &index {
            let (file, lane) = (&row["file"], row["lane"].as_str());
            let csv = ran(root, &format!("simulate --from {from} --lane {lane}"));
            let text = std::fs::read_to_string(root.join("x").join(file)).unwrap();
            compare(&text, &csv);
            let (_, all) = played(&text);
            assert_eq!(named(&all, "lanesweep.lane").unwrap().attributes["value"], lane);
            let road = std::fs::read_to_string(root.join("x").join(file.replace(".xosc", ".xodr"))).unwrap();
            assert!(elements(&road).iter().any(|e| e.path.ends_with("/line")));
        }
        index.len()
    };
    // Lengths by their sums, then by the scenarios; both keep every gap.
    assert_eq!(check(&format!("--side left {}", lanes.join(" ")), "study"), 6);
    assert_eq!(check(&format!("--scenarios s.jsonl --side left {}", lanes[0]), "study"), 1);
    // What an earlier export left does not stand beside the new files.
    assert_eq!(std::fs::read_dir(root.join("x")).unwrap().count(), 4);

    write_cut_in_density(&root.join("d.json"));
    ran(root, "sample d.json --samples 500 --backend cpu --thw 0.6 --out run");
    assert_eq!(check("--lane #0/2/0.6s/FSM --lane #7/2/0.6s/RSS", "run"), 2);
    let says = "there is no lane `no/S/1.2s/RSS`: no scenario `no` in this run";
    refused(root, "simulate --xosc x --from study --lane no/S/1.2s/RSS", 2, says);
}

#[test]
fn an_ego_of_the_users_own_has_a_start_and_no_path_and_the_others_go_on() {
    let dir = tempfile::tempdir().unwrap();
    let rows = series(&ran(dir.path(), &format!("simulate {CUT_IN}")));
    let end: f64 = rows.last().unwrap()["t_s"].parse().unwrap();
    for (flags, min_s) in [("", end + 9.9), ("--duration 30", 30.0)] {
        let text = exported(dir.path(), &format!("--ego external {CUT_IN} {flags}"));
        let (vehicles, all) = played(&text);
        assert!(vehicles["Ego"].path.is_empty());
        let path = &vehicles["Other"].path;
        assert!(path.last().unwrap().0 >= min_s, "{:?}", path.last());
        for (at, row) in rows.iter().enumerate() {
            assert_eq!(path[at].2, row["other_y_m"].parse::<f64>().unwrap());
        }
        // 20 m/s in the middle of the lane, for ever.
        let (a, b) = (path[path.len() - 2], path[path.len() - 1]);
        assert!(((b.1 - a.1) / (b.0 - a.0) - 20.0).abs() < 1e-6 && b.2 == 0.0);
        let stop = all.iter().rev().find(|e| e.path.ends_with("SimulationTimeCondition")).unwrap();
        assert_eq!(stop.number("value"), b.0);
        assert_eq!(named(&all, "ego_speed_mps").unwrap().number("value"), 30.0);
        assert!(text.contains("<AbsoluteTargetSpeed value=\"$ego_speed_mps\"/>"));
    }
    refused(dir.path(), &format!("simulate --xosc x --duration 5 {CUT_IN}"), 2, "add --ego external");
    // The declared speed is the case's to the bit: ten digits of 20 km/h gave another first gap and another braking.
    for kmh in [7.0, 20.0, 33.3, 50.0, 108.0] {
        let case = "--ego external --category cut-in --models FSM --speed 1m/s --gap 9 --lateral-speed 1";
        let (_, all) = played(&exported(dir.path(), &format!("{case} --ego-speed {kmh}km/h")));
        let declared = named(&all, "ego_speed_mps").unwrap();
        assert_eq!(declared.number("value") * 0.04, kmh / 3.6 * 0.04, "{kmh} km/h");
    }
}

#[test]
fn a_right_hand_cutter_is_mirrored_and_the_road_holds_everybody() {
    let dir = tempfile::tempdir().unwrap();
    let read = |side: &str| {
        let text = exported(dir.path(), &format!("{CUT_IN} --lane-width 3 --side {side}"));
        (played(&text).0, elements(&only(dir.path(), "xodr")))
    };
    let ((left, _), (right, road)) = (read("left"), read("right"));
    for (a, b) in left["Other"].path.iter().zip(&right["Other"].path) {
        assert_eq!((a.0, a.1, a.2), (b.0, b.1, -b.2));
    }
    let geometry = road.iter().find(|e| e.path.ends_with("/geometry")).unwrap();
    let lanes = road.iter().filter(|e| e.path.ends_with("/right/lane")).count() as f64;
    let (top, from) = (geometry.number("y"), geometry.number("x"));
    assert_eq!(top, 4.5, "the reference line is the left edge: one lane and a half left of the ego's middle");
    for vehicle in right.values() {
        for (_, x, y) in &vehicle.path {
            assert!(*x > from && x - from < geometry.number("length"));
            assert!(*y < top && *y > top - 3.0 * lanes);
        }
    }
}

#[test]
fn odd_names_are_escaped_and_read_back_and_make_plain_file_names() {
    let dir = tempfile::tempdir().unwrap();
    let text = text_of("tests/golden/paper_sumo_01_02_scenarios.jsonl");
    let line = text.lines().find(|l| l.contains("\"cut_in\"")).unwrap();
    let mut scenario: serde_json::Value = serde_json::from_str(line).unwrap();
    for (id, read) in [
        ("a\"b<c>&'d\u{e9} \t\n/../e", "a\"b<c>&'d\u{e9} \t\n/../e"),
        ("]]>--&lt;&#0;", "]]>--&lt;&#0;"),
        ("\u{1}bell\u{7}", "\u{fffd}bell\u{fffd}"),
        ("$dollar", " $dollar"),
        ("..", ".."),
    ] {
        scenario["id"] = id.into();
        std::fs::write(dir.path().join("s.jsonl"), scenario.to_string() + "\n").unwrap();
        let lane = format!("{id}/S/1.2s/FSM");
        done(dir.path(), &["simulate", "--xosc", "x", "--scenarios", "s.jsonl", "--lane", &lane]);
        let (_, all) = played(&only(dir.path(), "xosc"));
        let property = named(&all, "lanesweep.lane").unwrap();
        assert_eq!(property.attributes["value"], format!("{read}/S/1.2s/FSM"));
        for name in names(&dir.path().join("x")) {
            assert!(name.bytes().all(|b| b.is_ascii_alphanumeric() || b"._-".contains(&b)), "{name}");
        }
        assert_eq!(table(&dir.path().join("x/index.csv"))[0]["lane"], lane);
    }
}
