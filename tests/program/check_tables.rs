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

const BOTH: &str = "60 has no unit: as m/s it is 216 km/h, as km/h 16.67 m/s";

#[test]
fn a_bare_speed_is_refused_in_every_way_to_give_a_case_and_0_is_not() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    file(dir, "bare.toml", "category = \"cut-in\"\nego_speed = 60\nspeed_kmh = 40\ngap = 15\nlateral_speed = 1\n");
    file(dir, "bare.csv", "category,ego_speed,speed_kmh,gap,lateral_speed\ncut-in,60,40,15,1\n");
    file(
        dir,
        "instants.csv",
        "id,category,time_s,ego_speed,ego_length,ego_width,side,target_length,target_width,target_v,target_y\n\
         a,cut-in,0,60,4,2,left,4,2,20,3.5\na,cut-in,1,60,4,2,left,4,2,20,2.5\n",
    );
    for (line, status, place) in [
        ("check --category cut-in --ego-speed 60", 2, "--ego-speed"),
        ("check bare.toml", 2, "bare.toml, line 2, `ego_speed`"),
        ("simulate --case-file bare.toml", 2, "bare.toml, line 2, `ego_speed`"),
        ("check bare.csv", 3, "bare.csv, line 2, column `ego_speed`"),
        ("check bare.csv --row 1", 3, "bare.csv, line 2, column `ego_speed`"),
        ("simulate --table bare.csv", 3, "bare.csv, line 2, column `ego_speed`"),
        ("study --scenarios bare.csv", 3, "bare.csv, line 2, column `ego_speed`"),
        ("study --scenarios instants.csv", 3, "instants.csv, line 2, column `ego_speed`, scenario a"),
    ] {
        let (code, error) = said(dir, line);
        assert!(code == status && error.contains(BOTH) && error.contains(place), "{line}: {code} {error}");
        assert!(error.contains("60km/h or 60m/s"), "{line}: {error}");
        assert_eq!(error.contains("`ego_speed_kmh`"), status == 3 || place.contains("toml"), "{line}: {error}");
    }
    file(dir, "still.csv", "category,ego_speed_kmh,speed,gap,acceleration\nlvd,60,0,60,-1\n");
    // A standing vehicle needs no unit.
    ran(dir, "simulate --table still.csv --models FSM");
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

#[test]
fn two_units_of_one_quantity_and_units_of_another_are_refused_with_their_place() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    for (keys, line, problem) in [
        ("speed_kmh = 40\nspeed_mps = 11", "line 3", "`speed_mps` says the same as `speed_kmh`"),
        ("ego_speed_mps = \"60km/h\"", "line 2", "its name says another unit"),
        ("ego_speed_mph = 37", "line 2", "its name says miles per hour"),
        ("ego_speed = \"60m\"", "line 2", "write a speed such as 60km/h"),
        ("ego_speed = true", "line 2", "expected a number, or a text with its unit"),
        ("gap = \"15km\"", "line 2", "write a length in metres"),
        ("thw = \"1200ms\"", "line 2", "write a time in seconds"),
        ("acceleration = \"-0.6g\"", "line 2", "-5.884m/s2 if -0.6 g is meant"),
        ("lateral_sped = 1", "line 2", "did you mean `lateral_speed`?"),
    ] {
        file(dir, "case.toml", &format!("category = \"cut-in\"\n{keys}\n"));
        let (code, error) = said(dir, "check case.toml");
        let place = format!("case.toml, {line}");
        assert!(code == 2 && error.contains(&place) && error.contains(problem), "{keys}: {error}");
    }
    for (header, row, place, problem) in [
        ("speed_kmh,speed_mps", "40,11", "column `speed_mps`", "holds the same as the column `speed_kmh`"),
        ("ego_speed_mps", "60km/h", "column `ego_speed_mps`", "its name says another unit"),
        ("gap", "15km", "column `gap`", "write a length in metres"),
        ("acceleration", "-0.6g", "column `acceleration`", "-5.884m/s2 if -0.6 g is meant"),
    ] {
        file(dir, "case.csv", &format!("category,{header}\ncut-in,{row}\n"));
        let (code, error) = said(dir, "check case.csv");
        assert!(code == 3 && error.contains(place) && error.contains(problem), "{header}: {error}");
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

#[test]
fn a_row_that_cannot_be_judged_is_named_and_the_others_are_judged() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let mild = ROWS[1].0;
    for (row, place) in [
        ("b,cut-in,fast,72,36,1", "cases.csv, line 3, column `ego_speed_kmh`"),
        ("b,cut-in,108,72,36,", "cases.csv, line 3, column `lateral_speed`"),
        ("b,cut-in,108,72,,1", "cases.csv, line 3, column `gap, thw`"),
        ("b,cut-in,108,72,36,1,9", "cases.csv, line 3"),
        ("b,cutin,108,72,36,1", "cases.csv, line 3, column `category`"),
        ("b,cut-in,1080,72,36,1", "cases.csv, line 3, column `ego_speed_kmh`"),
    ] {
        file(dir, "cases.csv", &format!("{HEADER}{mild}\n{row}\nlast,cut-in,60,70,12,1\n"));
        let (code, out, error) = run(dir, "check cases.csv");
        assert!(code == 4 && error.contains(place), "{row}: {code} {error}");
        assert!(out.contains("2 cases under un-r157: 1 preventable, 1 no conflict; 1 row cannot be judged"), "{out}");
        let found = document(dir, "check cases.csv");
        assert!(found["cannot_be_judged"][0].as_str().unwrap().contains(place), "{found}");
        let rows: Vec<&Value> = found["cases"].as_array().unwrap().iter().map(|case| &case["row"]).collect();
        assert_eq!(rows, [1, 3]);
    }
    file(dir, "cases.csv", HEADER);
    assert_eq!(run(dir, "check cases.csv").0, 3, "a table without rows has no answer");
}

#[test]
fn of_two_rows_with_one_id_neither_is_used_in_any_path() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let again = "away,cut-in,108,72,40,1";
    file(dir, "cases.csv", &format!("{HEADER}{}\n{}\n{again}\n", ROWS[2].0, ROWS[1].0));
    let said = "cases.csv, line 4, column `id`: this id belongs to line 2 too";
    let (code, out, error) = run(dir, "check cases.csv");
    assert!(code == 4 && error.contains(said), "{error}");
    assert!(out.contains("1 case under un-r157: 1 preventable; 2 rows cannot be judged"), "{out}");
    assert!(!out.contains("away") && error.contains("line 2, column `id`: this id belongs to line 4 too"), "{error}");
    for line in ["check cases.csv --row 3", "simulate --table cases.csv --row 3"] {
        refused(dir, line, 3, said);
    }
    refused(dir, "study --scenarios cases.csv", 3, "this id belongs to line 2 too");
}

#[test]
fn what_shows_one_case_asks_for_a_row_of_a_table_with_several() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    file(dir, "cases.csv", &format!("{HEADER}{}\n{}\n", ROWS[0].0, ROWS[1].0));
    for hint in ["--sheet", "--row N"] {
        refused(dir, "check cases.csv --sheet case.html", 2, hint);
    }
    ran(dir, "check cases.csv --row 2 --sheet case.html");
    assert!(dir.join("case.html").exists());
    refused(dir, "check cases.csv --profiles un-r157,paper", 2, "under one profile");
    refused(dir, "simulate --table cases.csv", 2, "the table has several cases");
    refused(dir, "simulate --table cases.csv", 2, "--row N");
}
