//! `--format json` prints one document with the numbers that the tables and files have.

use std::path::Path;
use std::process::Command;

use serde_json::Value;

fn lanesweep(dir: &Path, args: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_lanesweep")).current_dir(dir).args(args).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{args:?}: {message}");
    String::from_utf8(output.stdout).unwrap()
}

fn json(dir: &Path, args: &[&str]) -> Value {
    let args: Vec<&str> = args.iter().chain(&["--format", "json"]).copied().collect();
    serde_json::from_str(&lanesweep(dir, &args)).unwrap()
}

const SMALL: [&str; 6] = ["--synth-recordings", "2", "--config", "generator.duration_s=200", "--backend", "cpu"];

#[test]
fn a_study_prints_its_record_and_a_merged_one_the_same() {
    let dir = tempfile::tempdir().unwrap();
    let study = |more: &[&str]| {
        let args: Vec<&str> = ["study"].iter().chain(&SMALL).chain(more).copied().collect();
        args.into_iter().map(str::to_owned).collect::<Vec<_>>()
    };
    let run = |more: &[&str]| {
        let args = study(more);
        json(dir.path(), &args.iter().map(String::as_str).collect::<Vec<_>>())
    };
    let whole = run(&["--out", "whole", "--published", "--config", "study.compare_reference=true"]);
    let file: Value = serde_json::from_slice(&std::fs::read(dir.path().join("whole/run.json")).unwrap()).unwrap();
    assert_eq!(whole, file);
    assert_eq!(whole["synthetic"], Value::Bool(true));
    assert!(whole["published"]["failures"].as_array().is_some_and(|rows| rows.len() == 36), "{}", whole["published"]);

    let plan = run(&["--plan-only", "--out", "parts"]);
    assert_eq!(plan["lanes"], whole["lanes"]);
    for shard in ["0/2", "1/2"] {
        let args = study(&["--shard", shard, "--out", "parts"]);
        lanesweep(dir.path(), &args.iter().map(String::as_str).collect::<Vec<_>>());
    }
    let merged = json(dir.path(), &["merge", "parts"]);
    for name in ["best", "categories", "data", "plan_sha256", "lanes"] {
        assert_eq!(merged[name], whole[name], "{name}");
    }
}

#[test]
fn densities_and_samples_print_what_their_files_hold() {
    let dir = tempfile::tempdir().unwrap();
    let fit: Vec<&str> = ["fit", "--categories", "cut-in", "--parameterizations", "2", "--out", "d"]
        .into_iter()
        .chain(SMALL.into_iter().take(4))
        .collect();
    let fitted = json(dir.path(), &fit);
    let density = &fitted["densities"][0];
    assert_eq!((density["parameterization"].as_str(), density["file"].as_str()), (Some("2"), Some("d/cut-in-2.json")));
    assert!(density["parameters"].as_array().unwrap().iter().all(|p| p["unit"].is_string() && p["mean"].is_number()));

    let sample = ["sample", "d/cut-in-2.json", "--samples", "2000", "--thw", "1.2", "--backend", "cpu", "--out", "s"];
    let printed = json(dir.path(), &sample);
    let file: Value = serde_json::from_slice(&std::fs::read(dir.path().join("s/estimate.json")).unwrap()).unwrap();
    assert_eq!(printed, file);
}

#[test]
fn maps_traces_and_checks_print_documents() {
    let dir = tempfile::tempdir().unwrap();
    let map = ["map", "lvd", "--x", "deceleration_mps2=1..9/2", "--y", "ego_speed_kmh=60,120", "--set", "thw_s=0.6"];
    let map: Vec<&str> = map.iter().chain(&["--backend", "cpu", "--out", "m"]).copied().collect();
    let printed = json(dir.path(), &map);
    let file: Value = serde_json::from_slice(&std::fs::read(dir.path().join("m/map.json")).unwrap()).unwrap();
    assert_eq!(printed, file);

    let case =
        ["--category", "cut-in", "--ego-speed", "30m/s", "--speed", "20m/s", "--thw", "0.4", "--lateral-speed", "1.5"];
    let simulate: Vec<&str> = ["simulate", "--models", "all"].iter().chain(&case).copied().collect();
    let (printed, csv) = (json(dir.path(), &simulate), lanesweep(dir.path(), &simulate));
    assert_eq!(printed["steps"].as_array().unwrap().len(), csv.lines().count() - 1);
    let lanes = printed["lanes"].as_array().unwrap();
    assert!(lanes.len() >= 4);
    for lane in lanes {
        let outcome = &lane["outcome"];
        assert_eq!(outcome["collision"] == Value::Bool(true), outcome["contact_s"].is_number(), "{lane}");
    }

    let verify = [
        "verify",
        "--backend",
        "cpu",
        "--random-lanes",
        "24",
        "--config",
        "verify.threshold_units=1",
        "--synth-recordings",
        "1",
    ];
    let printed = json(dir.path(), &verify);
    let sets = printed["sets"].as_array().unwrap();
    assert_eq!((printed["equal"].as_bool(), sets.len()), (Some(true), 3));
    let lanes =
        |set: &Value| set["tallies"].as_array().unwrap().iter().map(|t| t["lanes"].as_u64().unwrap()).sum::<u64>();
    assert_eq!(sets.iter().map(lanes).sum::<u64>(), printed["lanes"].as_u64().unwrap());

    let devices = json(dir.path(), &["devices"]);
    assert!(devices["devices"].is_array());
}
