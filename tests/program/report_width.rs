//! What a study prints fits in the terminal: the answer in 28 lines of 80 columns.

use std::path::Path;

use crate::common::golden;
use crate::common::program::command;

fn assert_fits(text: &str, width: usize) {
    for line in text.lines() {
        assert!(line.chars().count() <= width, "{} columns: {line}", line.chars().count());
        assert_eq!(line.matches('[').count(), line.matches(']').count(), "an interval on two lines: {line}");
    }
}

/// stdout and stderr.
fn study(dir: &Path, columns: &str, args: &[&str]) -> (String, String) {
    let output =
        command(dir, &[]).env("COLUMNS", columns).args(["study", "--backend", "cpu"]).args(args).output().unwrap();
    let [out, err] = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    assert!(output.status.success(), "{err}");
    (out, err)
}

const GENERATED: [&str; 4] = ["--synth-recordings", "2", "--config", "generator.duration_s=120"];

#[test]
fn a_study_answers_on_one_screen() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::copy(golden("paper_sumo_01_02_scenarios.jsonl"), dir.path().join("recorded.jsonl")).unwrap();
    let recorded = ["--scenarios", "recorded.jsonl"];
    let one = ["--categories", "cut-in", "--models", "FSM"];
    for args in [&GENERATED[..], &recorded[..], &[&GENERATED[..], &one[..]].concat()] {
        let (out, err) = study(dir.path(), "80", args);
        assert_fits(&out, 80);
        let on_screen = |text: &str| text.lines().filter(|line| !line.starts_with(" WARN")).count();
        assert!(on_screen(&out) + on_screen(&err) <= 28, "{err}{out}");
        for said in ["missed collisions", "ties with", "data for decision", "Next, ", "FSM"] {
            assert!(out.contains(said), "{said}: {out}");
        }
        assert!(err.contains("report.html"), "where the page is: {err}");
    }
    assert_fits(&study(dir.path(), "50", &GENERATED).0, 50);
}
