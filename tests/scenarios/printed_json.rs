//! `--format json` prints one document: the record that the run leaves.

use std::path::Path;

use serde_json::Value;

use crate::common::program::{json as document, ran};

fn json(dir: &Path, line: &str) -> Value {
    serde_json::from_str(&ran(dir, &format!("{line} --format json"))).unwrap()
}

#[test]
fn what_is_printed_is_the_record_of_the_run() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    let study = "study --synth-recordings 2 --config generator.duration_s=200 --backend cpu";
    let fit = "fit --synth-recordings 2 --categories cut-in --parameterizations 2 --out d";
    assert_eq!(json(dir, fit)["densities"][0]["file"], "d/cut-in-2.json");
    let map = "map lvd --x deceleration_mps2=1..9/2 --y ego_speed_kmh=60,120 --set thw_s=0.6 --backend cpu --out m";
    for (line, record) in [
        (&*format!("{study} --out whole --published --config study.compare_reference=true"), "whole/run.json"),
        ("sample d/cut-in-2.json --samples 2000 --thw 1.2 --backend cpu --out s", "s/estimate.json"),
        (map, "m/map.json"),
    ] {
        assert_eq!(json(dir, line), document(&dir.join(record)), "{line}");
    }
    let whole = document(&dir.join("whole/run.json"));
    assert_eq!(whole["published"]["rates"], 36, "{}", whole["published"]);
    let verify =
        json(dir, "verify --backend cpu --random-lanes 24 --config verify.threshold_units=1 --synth-recordings 1");
    assert_eq!((verify["equal"].as_bool(), verify["sets"].as_array().unwrap().len()), (Some(true), 3));
    assert!(json(dir, "devices")["devices"].is_array());
}
