//! What a run must never do to its user's files. Locks are in `mechanisms.rs`.

use crate::common::program::{json, names, ran};
use crate::common::{self};

use std::path::Path;

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap()
}

/// What a folder of results or a document says of its data.
fn is_synthetic(value: &serde_json::Value) -> bool {
    let label = value.pointer("/synthetic").or(value.pointer("/density/provenance/synthetic"));
    label.and_then(serde_json::Value::as_bool).expect("the document says whether its data are made up")
}

#[test]
fn the_label_of_made_up_data_is_in_the_data_and_follows_them_everywhere() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    ran(dir, "-q tracks --convert recordings --synth-recordings 2 --config generator.duration_s=150");
    // Copied without the sentence beside them, as among recordings of other origin.
    std::fs::remove_file(dir.join("recordings/SYNTHETIC.txt")).unwrap();
    ran(dir, "-q mine recordings --out s.jsonl");
    // What was driven is told beside the file, which may be lost too.
    std::fs::remove_file(dir.join("s.exposure.json")).unwrap();
    let mut files = vec!["recordings", "--scenarios s.jsonl", "--scenarios s.csv"];
    if cfg!(feature = "parquet") {
        ran(dir, "-q mine recordings --out s.parquet");
        std::fs::remove_file(dir.join("s.parquet.exposure.json")).unwrap();
        files.push("--scenarios s.parquet");
    }
    std::fs::write(
        dir.join("s.csv"),
        "id,category,ego_speed_mps,time_s,ego_length,ego_width,side,target_length,target_width,target_v,\
         target_y,synthetic\na,cut-in,30,0,4,2,left,4,2,20,3.5,1\na,,,1,,,,,,20,2.5,\n",
    )
    .unwrap();
    for file in files {
        let report = ran(dir, &format!("-q study {file} --out out")).replace('\n', " ");
        assert!(report.contains("No number here is a statement about real traffic"), "{file}");
        assert!(is_synthetic(&json(&dir.join("out/run.json"))), "{file}");
        for figure in names(&dir.join("out")).iter().filter(|name| name.ends_with(".svg")) {
            assert!(read(&dir.join("out").join(figure)).contains("SYNTHETIC DATA"), "{figure}");
        }
    }
    let id = read(&dir.join("s.jsonl")).lines().next().map(|line| line.parse::<serde_json::Value>().unwrap()).unwrap();
    let lane = format!("--scenarios s.jsonl --lane {}/S/1.2s/RSS", id["id"].as_str().unwrap());
    for line in [
        "fit --scenarios s.jsonl --categories lvd --parameterizations i --config fit.valid_draws=1000 --out i.json",
        "sample i.json --samples 500 --thw 0.6 --out sampled",
        &format!("simulate {lane}"),
    ] {
        assert!(is_synthetic(&ran(dir, &format!("-q {line} --format json")).parse().unwrap()), "{line}");
    }
    ran(dir, &format!("-q simulate --xosc played {lane}"));
    let played = names(&dir.join("played")).into_iter().find(|name| name.ends_with(".xosc")).unwrap();
    assert!(read(&dir.join("played").join(played)).contains("SYNTHETIC DATA"));
}
