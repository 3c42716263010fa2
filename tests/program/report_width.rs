//! What a study prints fits in the terminal: the answer in 28 lines of 80 columns.

use std::collections::BTreeSet;
use std::path::Path;

use crate::common::golden;
use crate::common::mined::scenarios_of;
use crate::common::program::{command, json, table, words};
use lanesweep::scenario::write_scenarios;

fn assert_fits(text: &str, width: usize) {
    for line in text.lines() {
        assert!(line.chars().count() <= width, "{} columns: {line}", line.chars().count());
        assert_eq!(line.matches('[').count(), line.matches(']').count(), "an interval on two lines: {line}");
    }
}

fn study(dir: &Path, columns: &str, flags: &str) -> (String, String) {
    let line = format!("study --backend cpu {flags}");
    let output = command(dir, &words(&line)).env("COLUMNS", columns).output().unwrap();
    let [out, err] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    assert!(output.status.success(), "{err}");
    (out, err)
}

/// The record says what the rows say, which are binary32.
#[test]
fn undecided_runs_and_fits_in_sample_are_those_of_the_rows() {
    let dir = tempfile::tempdir().unwrap();
    write_scenarios(&dir.path().join("s.jsonl"), scenarios_of(4)).unwrap();
    let flags = "--scenarios s.jsonl --rows rows.csv --out out --config study.folds=1 --figures plain";
    let (out, _) = study(dir.path(), "80", flags);
    assert!(out.contains("F1 [95 %] (SVD in sample):") && !out.contains("no fit has seen"), "{out}");
    let results = table(&dir.path().join("out/results.csv"));
    let fits: BTreeSet<&str> = results.iter().map(|row| &*row["fit"]).collect();
    assert!(fits.contains("in sample") && !fits.contains("cross-validated"), "{fits:?}");
    let rows = table(&dir.path().join("rows.csv"));
    let (record, mut checked) = (json(&dir.path().join("out/run.json")), 0);
    for category in record["categories"].as_array().unwrap() {
        for capped in category["capped_s"].as_array().unwrap() {
            let is_own = |row: &&std::collections::BTreeMap<String, String>| {
                let of = ["category", "model", "variant", "capped"].map(|key| row[key].as_str());
                of == [category["category"].as_str().unwrap(), capped["model"].as_str().unwrap(), "S", "1"]
            };
            let own: Vec<f64> = rows.iter().filter(is_own).map(|row| row["min_ttc_s"].parse().unwrap()).collect();
            let least = own.iter().copied().fold(f64::INFINITY, f64::min);
            assert_eq!(capped["runs"], own.len(), "{capped}");
            let found = capped["min_ttc_s"].as_f64().unwrap_or(f64::INFINITY);
            assert!(found == least || (found / least - 1.0).abs() < 1e-3, "{capped}: {least}");
            checked += 1;
        }
    }
    assert!(checked > 2, "{record}");
    // A plain figure has its texts beside it, and says itself what the data are.
    let read = |name: &str| std::fs::read_to_string(dir.path().join("out/figures").join(name)).unwrap();
    let (svg, text) = (read("f1-cut-in.svg"), read("f1-cut-in.txt"));
    assert!(svg.contains("width=\"88mm\"") && !svg.contains(">cut-in: F1 of parameterized against recorded</text>"));
    let description = svg.split("<desc>").nth(1).unwrap().split("</desc>").next().unwrap();
    assert!(description.contains("SYNTHETIC DATA") && text.contains("SYNTHETIC DATA"), "{description} {text}");
}

const GENERATED: &str = "--synth-recordings 2 --config generator.duration_s=120";

#[test]
fn a_study_answers_on_one_screen() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::copy(golden("paper_sumo_01_02_scenarios.jsonl"), dir.path().join("recorded.jsonl")).unwrap();
    let one = format!("{GENERATED} --categories cut-in --models FSM");
    for flags in [GENERATED, "--scenarios recorded.jsonl", &one] {
        let (out, err) = study(dir.path(), "80", flags);
        assert_fits(&out, 80);
        let on_screen = |text: &str| text.lines().filter(|line| !line.starts_with(" WARN")).count();
        assert!(on_screen(&out) + on_screen(&err) <= 28, "{err}{out}");
        for said in ["missed, invented", "ties with", "data for decision", "Next, ", "FSM"] {
            assert!(out.contains(said), "{said}: {out}");
        }
        assert!(err.contains("report.html"), "where the page is: {err}");
    }
    assert_fits(&study(dir.path(), "50", GENERATED).0, 50);
}
