//! Units of a case in every way to give one, and tables of cases that `lanesweep check` judges whole.

use std::path::Path;

use lanesweep::scenario::read_scenario_file;
use serde_json::Value;

use crate::common::program::{lanesweep, ran, refused, said, unbroken, words};

/// Runs in a folder: exit status, stdout, and stderr in one line.
fn run(dir: &Path, line: &str) -> (i32, String, String) {
    let (code, out, error) = lanesweep(dir, &words(line));
    (code, out, unbroken(error.as_bytes()))
}

fn document(dir: &Path, line: &str) -> Value {
    let (code, out, error) = run(dir, &format!("{line} --format json"));
    assert!([0, 1, 4, 8, 9, 10].contains(&code), "{code} {error}");
    serde_json::from_str(&out).unwrap()
}

fn file(dir: &Path, name: &str, content: &str) {
    std::fs::write(dir.join(name), content).unwrap();
}

/// 60 km/h, 40 km/h, 15 m and 1 m/s in all spellings are one case.
#[test]
fn the_unit_may_stand_in_the_name_or_in_the_value() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let flags = "check --category cut-in --ego-speed 60km/h --speed 40km/h --gap 15 --lateral-speed 1 --profiles paper";
    let by_flags = document(dir, flags);
    let keys = [
        "ego_speed_kmh = 60\nspeed_kmh = 40.0\ngap = 15\nlateral_speed = 1",
        "ego_speed = \"60km/h\"\nspeed = \"40 KM/H\"\ngap_m = 15\nlateral_speed = \"1m/s\"",
        "ego_speed_kmh = \"60\"\nspeed_kmh = \"40kph\"\ngap = \"15m\"\nlateral_speed_mps = \"1\"",
    ];
    for keys in keys {
        file(dir, "case.toml", &format!("category = \"cut-in\"\n{keys}\n"));
        let by_toml = document(dir, "check case.toml --profiles paper");
        assert_eq!(by_toml["profiles"], by_flags["profiles"], "{keys}");
        let simulate = "--models RSS --profile paper";
        let lane = flags.replace("check", "simulate").replace("--profiles paper", simulate);
        assert_eq!(ran(dir, &format!("simulate --case-file case.toml {simulate}")), ran(dir, &lane), "{keys}");
        let pairs: Vec<(&str, &str)> = keys.lines().map(|line| line.split_once(" = ").unwrap()).collect();
        let names: Vec<&str> = pairs.iter().map(|(name, _)| *name).collect();
        let values: Vec<&str> = pairs.iter().map(|(_, value)| value.trim_matches('"')).collect();
        let table = format!("category,{}\ncut-in,{}\n", names.join(","), values.join(","));
        file(dir, "case.csv", &table);
        let by_row = document(dir, "check case.csv --row 1 --profiles paper");
        assert_eq!(by_row["profiles"], by_flags["profiles"], "{table}");
    }
}

const HEADER: &str = "id,category,ego_speed_kmh,speed_kmh,gap,lateral_speed\n";
/// A row and its answer.
const ROWS: [(&str, &str, i32); 4] = [
    ("slow,cut-in,108,36,20,2", "not preventable", 1),
    ("mild,cut-in,108,72,36,1", "preventable", 0),
    ("away,cut-in,60,70,12,1", "no conflict", 9),
    ("other,cut-in,60,60,12,1", "no conflict", 9),
];

#[test]
fn a_table_is_judged_whole_and_its_status_is_that_of_the_worst_row() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let table = |rows: &[usize]| {
        let rows: String = rows.iter().map(|&at| format!("{}\n", ROWS[at].0)).collect();
        file(dir, "cases.csv", &format!("{HEADER}{rows}"));
    };
    for (rows, status, verdict) in
        [(&[0, 1, 2, 3][..], 1, "not preventable"), (&[1, 2], 0, "preventable"), (&[2, 3], 9, "no conflict")]
    {
        table(rows);
        let (code, out, error) = run(dir, "check cases.csv");
        assert_eq!(code, status, "{out} {error}");
        let found = document(dir, "check cases.csv");
        assert_eq!(found["verdict"], verdict);
        let cases = found["cases"].as_array().unwrap();
        assert_eq!(cases.len(), rows.len());
        for (at, (case, &row)) in cases.iter().zip(rows).enumerate() {
            assert_eq!((&case["verdict"], &case["row"]), (&ROWS[row].1.into(), &(at + 1).into()));
            // The line of a row is its sheet.
            let alone = format!("check cases.csv --row {} --profiles un-r157", at + 1);
            assert_eq!(said(dir, &alone).0, ROWS[row].2);
            let sheet = document(dir, &alone);
            assert_eq!(case["answer"], sheet["answer"]);
            for model in sheet["profiles"][0]["models"].as_array().unwrap() {
                let is_quiet = case["verdict"] == "no conflict";
                let word = match (model["collision"] == true, model["is_contact_like"] == true) {
                    (true, _) => "COLLIDES",
                    (false, true) => "touches",
                    (false, false) if is_quiet => "none",
                    (false, false) => "avoids",
                };
                assert_eq!(case[model["model"].as_str().unwrap()], word, "{case}");
            }
        }
        let line = out.lines().find(|line| line.contains(" away |") && line.contains("no conflict"));
        assert_eq!(line.is_some(), rows.contains(&2), "{out}");
    }
    // Flags override every row, as they override one.
    table(&[0, 1]);
    let (code, out, error) = run(dir, "check cases.csv --gap 200");
    assert!(code == 0 && out.contains("2 cases under un-r157: 2 preventable"), "{out} {error}");
}

/// The first vehicle that cuts out reaches the one ahead of it after 1.2 s, and needs 1.9 s to leave its path.
#[test]
fn a_cut_out_through_the_vehicle_ahead_is_no_traffic_and_counted_apart() {
    let dir = tempfile::tempdir().unwrap();
    let rows = "cut-out,60,1,20,1.5\ncut-out,60,1,60,1.5\n";
    file(dir.path(), "cases.csv", &format!("category,ego_speed_kmh,lateral_speed,ahead_gap,thw\n{rows}"));
    for check in ["check cases.csv", "check cases.csv --nominal"] {
        let counts = document(dir.path(), check);
        assert_eq!([&counts["counts"], &counts["no_such_traffic"]].map(|of| &of["preventable"]), [1, 1]);
        let (_, out, _) = run(dir.path(), check);
        assert!(out.starts_with("1 case of possible traffic under un-r157: 1 preventable\n"), "{out}");
        assert!(out.contains("No such traffic in 1 of 2 cases: the vehicle that cuts out drives"), "{out}");
    }
}

#[test]
fn the_answers_of_a_table_go_to_a_table_in_the_order_of_the_file() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let rows: String = [2, 1, 0, 3].iter().map(|&at: &usize| format!("{}\n", ROWS[at].0)).collect();
    file(dir, "cases.csv", &format!("{HEADER}{rows}no-gap,cut-in,60,40,,1\n"));
    assert_eq!(said(dir, "check cases.csv --rows answers.csv").0, 4, "one row has no gap");
    let answers = std::fs::read_to_string(dir.join("answers.csv")).unwrap();
    let verdicts: Vec<&str> = answers.lines().skip(1).map(|line| line.split(',').nth(2).unwrap()).collect();
    assert_eq!(verdicts, ["no conflict", "preventable", "not preventable", "no conflict"]);
    // The numbers of every driver are those of `simulate`, and the time of braking that of the sheet.
    let answers = document(dir, "check cases.csv");
    let sheet = document(dir, "check cases.csv --row 2 --profiles un-r157");
    let lanes = document(dir, "simulate --table cases.csv --row 2 --profile un-r157");
    for (model, lane) in
        std::iter::zip(sheet["profiles"][0]["models"].as_array().unwrap(), lanes["lanes"].as_array().unwrap())
    {
        let mut numbers = lane["outcome"].as_object().unwrap().clone();
        numbers.insert("braking_s".to_owned(), model["braking_s"].clone());
        assert!(model["model"] == lane["model"] && numbers.len() == 19, "{numbers:?}");
        for (name, number) in numbers {
            let key = format!("{}_{name}", model["model"].as_str().unwrap());
            assert_eq!(answers["cases"][1][&key], number, "{key}");
        }
    }
    assert_eq!(said(dir, "check cases.csv --nominal --rows nominal.csv").0, 4);
    let nominal = std::fs::read_to_string(dir.join("nominal.csv")).unwrap();
    assert!(
        nominal.starts_with("row,id,verdict,Reg157,CCHDM,RSS,FSM,note,rests_on\n"),
        "no column that no row fills: {nominal}"
    );
    refused(dir, "check cases.csv --row 2 --rows answers.csv", 2, "--rows");
}

/// Cases far from every boundary have the same answer by lanes as by the full check.
#[test]
fn a_nominal_batch_answers_by_lanes_and_says_that_nothing_else_was_examined() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let rows: String = ROWS.iter().map(|row| format!("{}\n", row.0)).collect();
    file(dir, "cases.csv", &format!("{HEADER}{rows}"));
    let nominal = "check cases.csv --nominal --backend cpu";
    let (code, out, error) = run(dir, nominal);
    assert!(code == 1 && out.contains("no answer is robust by this table"), "{out} {error}");
    let found = document(dir, nominal);
    assert_eq!(found["nominal"], true);
    for (case, row) in found["cases"].as_array().unwrap().iter().zip(ROWS) {
        assert_eq!(case["verdict"], row.1, "{case}");
    }
    assert_eq!(document(dir, &format!("{nominal} --threads 1")), found, "threads change nothing");
}

/// What `check` and every verb that takes `--scenarios` say of a table, in one line each.
fn notes(dir: &Path, table: &str) -> [String; 2] {
    file(dir, "t.csv", table);
    let (code, text) = said(dir, "check t.csv --nominal --backend cpu");
    assert!([0, 1, 8, 9, 10].contains(&code), "{code}: {text}");
    let read = read_scenario_file(&dir.join("t.csv"), Default::default()).unwrap();
    assert!(read.problems.is_empty(), "{:?}", read.problems);
    [text, read.notes.join("; ")]
}

#[test]
fn what_every_case_of_a_table_shares_may_be_a_mistake_and_is_told() {
    let dir = tempfile::tempdir().unwrap();
    let said = |header: &str, rows: &[&str]| {
        file(dir.path(), "t.csv", &format!("{header}\n{}\n", rows.join("\n")));
        said(dir.path(), "check t.csv --nominal --backend cpu").1
    };
    let cut_ins = "id,category,ego_speed_kmh,speed_kmh,gap,lateral_speed";
    let (faster, slower) = (["a,cut-in,72,108,40,1", "b,cut-in,60,90,18,0.8"], "c,cut-in,108,72,20,1");
    let told = "the vehicle that cuts in is faster than the ego in all 2 cases";
    assert!(said(cut_ins, &faster).contains(told), "{}", said(cut_ins, &faster));
    assert!(!said(cut_ins, &[faster[0], slower]).contains("is faster than the ego"));
    let lvds = "id,category,ego_speed_kmh,thw_s,acceleration_mps2";
    let in_g = ["a,lvd,60,1,-0.5", "b,lvd,70,1,-0.4", "c,lvd,80,1,-0.6", "d,lvd,90,1,-0.5", "e,lvd,100,1,-0.3"];
    assert!(said(lvds, &in_g).contains("none of 5 leaders brakes by more than 0.6 m/s²"), "{}", said(lvds, &in_g));
    assert!(!said(lvds, &[&in_g[..4], &["e,lvd,100,1,-5"]].concat()).contains("leaders brakes"));
}

#[test]
fn every_verb_doubts_the_same_values_of_a_table_and_names_their_place() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let header = "id,category,ego_speed_kmh,speed,thw_s,lateral_speed_mps,length,width,ego_length,ahead_gap";
    let table = |rows: &[&str]| format!("{header}\n{}\n", rows.join("\n"));
    let good = [
        "a,cut-in,108,80km/h,1.2,1.0,4.5,1.8,,",
        "b,cut-in,60,50km/h,2,0.6,18,2.55,4.5,",
        "c,cut-in,70,60km/h,2,0.6,,,,",
    ];
    // A slow ego is many seconds behind a vehicle that is near.
    let slow = "s,cut-in,5,4km/h,25,0.5,,,,";
    for clean in notes(dir, &table(&[&good[..], &[slow]].concat())) {
        assert!(!clean.contains("implausible") && !clean.contains("but the"), "{clean}");
    }
    for (rows, expected) in [
        (
            &["d,cut-in,108,80km/h,25,1,,,,", "e,cut-in,108,80km/h,40,1,,,,", "f,cut-in,90,80km/h,15,1,,,,"][..],
            "t.csv, line 2, column `thw_s`: 25 s is not plausible for a time headway (-10 to 10 s); is it in ms, or a gap in m?",
        ),
        (&["d,cut-in,108,80km/h,1,1,1.65,,,"], "line 2, column `length`: 1.65 m, but the width is 1.9 m"),
        (&["d,cut-in,108,80km/h,1,1,,,1.65,"], "line 2, column `ego_length`: 1.65 m, but the width is 1.9 m"),
        (
            &["d,cut-in,108,80km/h,1,1,,3.75,,"],
            "column `width`: 3.75 m is not plausible for a vehicle width (0.4 to 3.2 m)",
        ),
        (
            &["d,cut-in,108,80km/h,1,3.6,,,,"],
            "column `lateral_speed_mps`: 3.6 m/s is not plausible for a lateral speed of a lane change (0 to 3 m/s); 3.6 \
             looks like km/h: 1 m/s",
        ),
        (&["d,cut-out,60,0,1,1,,,,30"], "column `lateral_speed_mps`: 1 m/s, but the vehicle drives at 0 m/s"),
        (
            &[good[0], good[1], good[2], "d,cut-in,60,60m/s,1,1,,,,"],
            "t.csv, line 5, column `speed`: 60 m/s, but the others are up to 22.22 m/s: in km/h it is 16.67 m/s",
        ),
    ] {
        for said in notes(dir, &table(rows)) {
            assert!(said.contains(expected), "{expected}: {said}");
        }
    }
    // Headways of a flag have no ego.
    file(dir, "t.csv", &table(&good));
    let (_, text) = said(dir, "study --scenarios t.csv --models FSM --backend cpu --thw 1.2,12 --out out");
    assert!(text.contains("--thw: 12 s is not plausible for a time headway") && !text.contains("1.2 s is"), "{text}");
}

#[test]
fn an_end_speed_that_the_duration_cuts_off_and_a_table_of_another_kind_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let braking = |duration: &str| {
        format!("category,ego_speed_kmh,gap,acceleration,end_speed_kmh,duration_s\nlvd,60,20,-6,20,{duration}\n")
    };
    let says = "column `end_speed_kmh`: 5.556 m/s is not reached: after 1 s the speed is 10.67 m/s";
    file(dir, "t.csv", &braking("1"));
    for verb in ["check t.csv", "simulate --table t.csv", "study --scenarios t.csv"] {
        refused(dir, verb, 3, says);
    }
    // 40 km/h at 6 m/s² take 1.852 s; what is less than 0.1 km/h away is reached.
    for duration in ["1.85", "2", ""] {
        file(dir, "t.csv", &braking(duration));
        assert!([0, 1, 8, 9, 10].contains(&said(dir, "check t.csv --nominal").0), "{duration}");
    }
    file(
        dir,
        "t.csv",
        "id,category,time_s,ego_speed_mps,ego_length_m,ego_width_m,side,target_length_m,target_width_m,target_speed_mps\na,lvd,0,20,4,2,left,4,2,20\n",
    );
    refused(dir, "check t.csv", 3, "t.csv, line 1: this is a table of scenarios with series, not of cases");
    file(dir, "t.csv", "frame,id,x,y,width,height\n1,1,10,8,4,2\n");
    refused(dir, "check t.csv", 3, "t.csv, line 1: this is a table of tracks");
}
