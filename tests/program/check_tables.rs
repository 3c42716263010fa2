//! Units of a case in every way to give one, and tables of cases that `lanesweep check` judges whole.

use std::path::Path;

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
    for (rows, status, verdict) in [
        (&[0, 1, 2, 3][..], 1, "not preventable"),
        (&[2, 1, 0], 1, "not preventable"),
        (&[1, 2], 0, "preventable"),
        (&[2, 3], 9, "no conflict"),
    ] {
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
