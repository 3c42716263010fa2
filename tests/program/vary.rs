//! Variations of a case, and another simulator's results for them.

use std::path::Path;
use std::process::Command;

use serde_json::Value;

fn run(dir: &Path, args: &[&str]) -> (i32, String, String) {
    let output =
        Command::new(env!("CARGO_BIN_EXE_lanesweep")).current_dir(dir).env("NO_COLOR", "1").args(args).output();
    let output = output.unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code().unwrap(), text(&output.stdout), text(&output.stderr))
}

const CASE: [&str; 10] =
    ["--category", "cut-in", "--ego-speed", "72km/h", "--speed", "36km/h", "--gap", "20", "--lateral-speed", "1.0"];
const RANGES: [&str; 4] = ["--range", "gap_m=5..45", "--range", "lateral_speed_mps=0.5..2"];

/// Results of a simulator that is ours, with a profile of its own; it has no row of the first case.
fn results_of(dir: &Path, profile: &str, leave_out: usize) -> String {
    let mut table = "id,collision,reaction_s,braking_s,min_gap_m\n".to_owned();
    let cases = std::fs::read_to_string(dir.join("out/cases.csv")).unwrap();
    for (row, line) in cases.lines().skip(1).enumerate().skip(leave_out) {
        let row = (row + 1).to_string();
        let args =
            ["check", "out/cases.csv", "--row", &row, "--models", "CCHDM", "--profiles", profile, "--format", "json"];
        let sheet: Value = serde_json::from_str(&run(dir, &args).1).unwrap();
        let model = &sheet["profiles"][0]["models"][0];
        let field = |name: &str| model[name].as_f64().map_or(String::new(), |value| value.to_string());
        table += &format!(
            "{},{},{},{},{}\n",
            line.split(',').next().unwrap(),
            model["collision"],
            field("reaction_s"),
            field("braking_s"),
            field("min_gap_m")
        );
    }
    table
}

#[test]
fn an_error_of_a_tenth_of_a_second_in_a_delay_is_found_and_named() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let counts = ["--inside", "12", "--edge", "4", "--outside", "4", "--boundary", "3", "--out", "out"];
    let (code, out, error) = run(dir, &[&["vary"], &CASE[..], &RANGES, &counts].concat());
    assert!(code == 0 && out.contains("cases in"), "{error}");
    let cases = std::fs::read_to_string(dir.join("out/cases.csv")).unwrap();
    assert!(cases.starts_with("id,category,ego_speed_mps,speed_mps,gap_m,"), "{cases}");
    for (name, count) in [("inside-", 12), ("edge-", 4), ("boundary-", 6)] {
        assert_eq!(cases.lines().filter(|line| line.starts_with(name)).count(), count, "{name}");
    }
    // The table answers as the cases were answered when they were made: pairs differ.
    let found: Value =
        serde_json::from_str(&run(dir, &["check", "out/cases.csv", "--nominal", "--format", "json"]).1).unwrap();
    let verdict = |id: &str| {
        let cases = found["cases"].as_array().unwrap();
        cases.iter().find(|case| case["id"] == id).unwrap()["verdict"].clone()
    };
    assert!((1..=3).any(|pair| verdict(&format!("boundary-{pair}a")) != verdict(&format!("boundary-{pair}b"))));

    let compare = |name: &str| {
        let (code, out, error) =
            run(dir, &["check", "out/cases.csv", "--results", name, "--models", "CCHDM", "--format", "json"]);
        (code, serde_json::from_str::<Value>(&out).unwrap_or_else(|_| panic!("{error}")))
    };
    // The same driver agrees in every case.
    std::fs::write(dir.join("same.csv"), results_of(dir, "un-r157", 0)).unwrap();
    let (code, same) = compare("same.csv");
    assert_eq!((code, &same["agreeing"], &same["cause"]), (0, &same["cases"], &Value::Null), "{same}");
    // A driver whose delay is 0.1 s longer: the reaction agrees, the braking is the first that differs.
    let mut text = include_str!("../../configs/profiles/un-r157.toml").to_owned();
    text = text.replace("name = \"un-r157\"", "name = \"planted\"").replace("delay_s = 0.75", "delay_s = 0.85");
    std::fs::write(dir.join("planted.toml"), text).unwrap();
    std::fs::write(dir.join("late.csv"), results_of(dir, "planted.toml", 1)).unwrap();
    // An error in a few cases is no cause of most differences, and no agreement either.
    let same = std::fs::read_to_string(dir.join("same.csv")).unwrap();
    let late = std::fs::read_to_string(dir.join("late.csv")).unwrap();
    let fields = |line: &str| line.split(',').map(str::to_owned).collect::<Vec<_>>();
    let later = |own: &&str| {
        late.lines().map(fields).find(|of| of[0] == fields(own)[0]).filter(|of| of[3].parse::<f64>().is_ok())
    };
    let own = same.lines().skip(1).find(|own| later(own).is_some_and(|of| of[1] == fields(own)[1])).unwrap();
    let mut few = fields(own);
    few[3] = later(&own).unwrap()[3].clone();
    std::fs::write(dir.join("few.csv"), same.replace(own, &few.join(","))).unwrap();
    let (code, few) = compare("few.csv");
    assert_eq!((code, &few["agreeing"], &few["cause"]), (5, &few["cases"], &Value::Null), "{few}");
    assert!(few["cause_sentence"].as_str().unwrap().contains("braking_s in 1 of"), "{few}");
    // A column of empty fields is counted, not dropped.
    let without: String = same
        .lines()
        .enumerate()
        .map(|(row, line)| {
            let mut of = fields(line);
            of[3] = if row == 0 { of[3].clone() } else { String::new() };
            of.join(",") + "\n"
        })
        .collect();
    std::fs::write(dir.join("without.csv"), without).unwrap();
    let (_, found) = compare("without.csv");
    let brakes = found["differences"].as_array().unwrap().iter().find(|of| of["quantity"] == "braking_s").unwrap();
    assert!(brakes["cases"] == 0 && brakes["only ours"].as_u64() > Some(0), "{brakes}");
    let (code, late) = compare("late.csv");
    assert_eq!((code, &late["cause"], &late["without_result"]), (5, &"braking_s".into(), &1.into()), "{late}");
    let sentence = late["cause_sentence"].as_str().unwrap();
    assert!(sentence.contains("the beginning of the braking is 0.100 s later there"), "{sentence}");
    // The page has the sentence, and what identifies both tables.
    let files = ["--results", "late.csv", "--models", "CCHDM", "--sheet", "late.html", "--author", "A. Author"];
    run(dir, &[&["check", "out/cases.csv"], &files[..]].concat());
    let page = std::fs::read_to_string(dir.join("late.html")).unwrap();
    assert!(page.contains(sentence) && page.contains("A. Author") && page.matches("SHA-256 ").count() == 3, "{page}");
}

#[test]
fn results_without_a_case_an_id_or_a_driver_are_refused_by_name() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    std::fs::write(
        dir.join("cases.csv"),
        "id,category,ego_speed_kmh,speed_kmh,gap,lateral_speed\na,cut-in,60,40,15,1\n",
    )
    .unwrap();
    for (results, models, status, said) in [
        ("id,collision\na,0\nb,0\n", "CCHDM", 3, "results.csv, line 3, column `id`: `b` is the id of no case"),
        ("id,collision\na,0\na,1\n", "CCHDM", 3, "or of two results"),
        ("id,collision\na,maybe\n", "CCHDM", 3, "neither true nor false"),
        ("id,crash\na,0\n", "CCHDM", 3, "`collision`: it is missing"),
        ("id,collision,t_break_s\na,0,1\n", "CCHDM", 3, "there is no such column"),
        ("id,collision,braking_s\na,0,nan\n", "CCHDM", 3, "is not finite"),
        ("id,collision\n", "CCHDM", 3, "it has no rows"),
        ("id,collision\na,0\n", "CCHDM,FSM", 2, "one driver"),
    ] {
        std::fs::write(dir.join("results.csv"), results).unwrap();
        let (code, _, error) = run(dir, &["check", "cases.csv", "--results", "results.csv", "--models", models]);
        let error = error.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
        assert!(code == status && error.contains(said), "{code} {error}");
    }
    let (code, _, error) = run(dir, &[&["vary"], &CASE[..], &["--range", "gap_m=40..5"]].concat());
    assert!(code == 2 && error.contains("--range"), "{error}");
    let both = ["--range", "gap_m=5..40", "--range", "thw_s=0.5..2"];
    let (code, _, error) = run(dir, &[&["vary"], &CASE[..], &both].concat());
    assert!(code == 2 && error.contains("say the same twice"), "{error}");
    let (code, _, error) = run(dir, &[&["vary"], &CASE[..]].concat());
    assert!(code == 2 && error.contains("range"), "{error}");
}

#[test]
fn every_variation_is_a_scenario_for_an_own_controller() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let counts = ["--inside", "2", "--edge", "1", "--outside", "0", "--boundary", "0", "--xosc", "--out", "out"];
    let (code, _, error) = run(dir, &[&["vary"], &CASE[..], &RANGES, &counts].concat());
    assert_eq!(code, 0, "{error}");
    let index = std::fs::read_to_string(dir.join("out/xosc/index.csv")).unwrap();
    assert!(index.contains("001-inside-1.xosc") && index.lines().count() == 4, "{index}");
    assert!(dir.join("out/xosc/003-edge-1.xodr").exists());
}
