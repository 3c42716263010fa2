//! `--format json` prints one document with the numbers that the tables and files have.

use std::path::Path;

use serde_json::Value;

use crate::common::program::{json as document, ran};

fn json(dir: &Path, line: &str) -> Value {
    serde_json::from_str(&ran(dir, &format!("{line} --format json"))).unwrap()
}

const SMALL: &str = "--synth-recordings 2 --config generator.duration_s=200";

#[test]
fn a_study_prints_its_record_and_a_merged_one_the_same() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let study = format!("study {SMALL} --backend cpu");
    let whole = json(dir, &format!("{study} --out whole --published --config study.compare_reference=true"));
    assert_eq!(whole, document(&dir.join("whole/run.json")));
    assert_eq!(whole["synthetic"], Value::Bool(true));
    assert!(whole["published"]["failures"].as_array().is_some_and(|rows| rows.len() == 36), "{}", whole["published"]);

    let plan = json(dir, &format!("{study} --plan-only --out parts"));
    assert_eq!(plan["lanes"], whole["lanes"]);
    for shard in ["0/2", "1/2"] {
        ran(dir, &format!("{study} --shard {shard} --out parts"));
    }
    let merged = json(dir, "merge parts");
    for name in ["best", "categories", "data", "plan_sha256", "lanes"] {
        assert_eq!(merged[name], whole[name], "{name}");
    }
}

#[test]
fn densities_and_samples_print_what_their_files_hold() {
    let dir = tempfile::tempdir().unwrap();
    let fitted = json(dir.path(), &format!("fit --categories cut-in --parameterizations 2 --out d {SMALL}"));
    let density = &fitted["densities"][0];
    assert_eq!((density["parameterization"].as_str(), density["file"].as_str()), (Some("2"), Some("d/cut-in-2.json")));
    assert!(density["parameters"].as_array().unwrap().iter().all(|p| p["unit"].is_string() && p["mean"].is_number()));
    let printed = json(dir.path(), "sample d/cut-in-2.json --samples 2000 --thw 1.2 --backend cpu --out s");
    assert_eq!(printed, document(&dir.path().join("s/estimate.json")));
}

#[test]
fn maps_traces_and_checks_print_documents() {
    let dir = tempfile::tempdir().unwrap();
    let map = "map lvd --x deceleration_mps2=1..9/2 --y ego_speed_kmh=60,120 --set thw_s=0.6 --backend cpu --out m";
    let printed = json(dir.path(), map);
    assert_eq!(printed, document(&dir.path().join("m/map.json")));
    let case = "--category cut-in --ego-speed 30m/s --speed 20m/s --thw 0.4 --lateral-speed 1.5";
    let simulate = format!("simulate --models all {case}");
    let (printed, csv) = (json(dir.path(), &simulate), ran(dir.path(), &simulate));
    assert_eq!(printed["steps"].as_array().unwrap().len(), csv.lines().count() - 1);
    let lanes = printed["lanes"].as_array().unwrap();
    assert!(lanes.len() >= 4);
    for lane in lanes {
        let outcome = &lane["outcome"];
        assert_eq!(outcome["collision"] == Value::Bool(true), outcome["contact_s"].is_number(), "{lane}");
    }

    let verify = "verify --backend cpu --random-lanes 24 --config verify.threshold_units=1 --synth-recordings 1";
    let printed = json(dir.path(), verify);
    let sets = printed["sets"].as_array().unwrap();
    assert_eq!((printed["equal"].as_bool(), sets.len()), (Some(true), 3));
    let lanes =
        |set: &Value| set["tallies"].as_array().unwrap().iter().map(|t| t["lanes"].as_u64().unwrap()).sum::<u64>();
    assert_eq!(sets.iter().map(lanes).sum::<u64>(), printed["lanes"].as_u64().unwrap());

    let devices = json(dir.path(), "devices");
    assert!(devices["devices"].is_array());
}
