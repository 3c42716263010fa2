//! What a run must never do to its user's files.

mod common;

use std::path::Path;
use std::process::Output;

use assert_cmd::Command;

fn lanesweep(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_lanesweep")).env("NO_COLOR", "1").args(args).output().unwrap()
}

fn refused(args: &[&str], hint: &str) {
    let output = lanesweep(args);
    let said = String::from_utf8_lossy(&output.stderr).split_whitespace().collect::<Vec<_>>().join(" ");
    assert_eq!(output.status.code(), Some(2), "{args:?}: {said}");
    assert!(said.contains(hint), "{args:?} should say `{hint}`: {said}");
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[test]
fn an_output_never_replaces_an_input_or_another_result() {
    let dir = tempfile::tempdir().unwrap();
    let (recordings, out) = (dir.path().join("recordings"), dir.path().join("out"));
    let made = lanesweep(&["-q", "synth", text(&recordings), "--synth-recordings", "1", "--synth-duration", "60"]);
    assert!(made.status.success());
    let tracks = recordings.join("01_tracks.csv");
    let before = std::fs::read(&tracks).unwrap();
    refused(&["mine", text(&recordings), "-o", text(&tracks)], "would be overwritten");
    refused(&["study", text(&recordings), "--lanes", text(&tracks), "--out", text(&out)], "would be overwritten");
    refused(&["synth", text(&recordings), "--synth-recordings", "1"], "already holds a recording");
    assert!(std::fs::read(&tracks).unwrap() == before);

    let scenarios = dir.path().join("scenarios.jsonl");
    std::fs::copy(common::golden("paper_sumo_01_02_scenarios.jsonl"), &scenarios).unwrap();
    let study = |lanes: &Path| {
        refused(
            &["study", "--scenarios", text(&scenarios), "--lanes", text(lanes), "--out", text(&out)],
            "would be overwritten",
        );
    };
    study(&scenarios);
    std::fs::create_dir(&out).unwrap();
    study(&out.join("report.txt"));
}

#[test]
fn a_study_on_written_synthetic_recordings_still_says_synthetic() {
    let dir = tempfile::tempdir().unwrap();
    let (recordings, out) = (dir.path().join("recordings"), dir.path().join("out"));
    lanesweep(&["-q", "synth", text(&recordings), "--synth-recordings", "1", "--synth-duration", "120"]);
    let study = lanesweep(&["-q", "study", text(&recordings), "--out", text(&out)]);
    assert!(String::from_utf8_lossy(&study.stdout).contains("SYNTHETIC DATA"), "{study:?}");
}

#[test]
fn what_an_earlier_run_left_in_the_folder_does_not_stay_beside_a_new_record() {
    let dir = tempfile::tempdir().unwrap();
    let (scenarios, out) = (common::golden("paper_sumo_01_02_scenarios.jsonl"), dir.path().join("out"));
    let run = |more: &[&str]| {
        let args = ["-q", "study", "--scenarios", text(&scenarios), "--out", text(&out)];
        let output = lanesweep(&[&args[..], more].concat());
        assert!(output.status.success(), "{output:?}");
    };
    run(&["--compare-reference"]);
    assert!(out.join("radar-cut-in.svg").exists() && out.join("reference.csv").exists());
    std::fs::write(out.join("notes.txt"), "mine").unwrap();
    run(&["--categories", "lvd"]);
    assert!(!out.join("radar-cut-in.svg").exists() && !out.join("reference.csv").exists());
    assert!(out.join("radar-lvd.svg").exists());
    assert!(out.join("notes.txt").exists(), "only our own files are taken away");
}

#[test]
fn values_that_no_lane_can_hold_are_refused_with_their_line() {
    let dir = tempfile::tempdir().unwrap();
    let scenarios = dir.path().join("scenarios.jsonl");
    let golden = std::fs::read_to_string(common::golden("paper_sumo_01_02_scenarios.jsonl")).unwrap();
    std::fs::write(&scenarios, golden.replacen("\"v0\":34.39", "\"v0\":1e300", 1)).unwrap();
    let study = lanesweep(&["study", "--scenarios", text(&scenarios), "--out", text(&dir.path().join("out"))]);
    let said = String::from_utf8_lossy(&study.stderr).split_whitespace().collect::<Vec<_>>().join(" ");
    assert_eq!(study.status.code(), Some(3), "{said}");
    assert!(said.contains("line 1") && said.contains("ego.v0"), "{said}");
    refused(&["simulate", "--category", "lvd", "--model", "FSM", "--ego-speed", "30", "--gap", "1e300"], "at most 1e6");
}

#[test]
fn flags_that_would_not_be_heeded_and_absurd_numbers_of_threads_are_refused() {
    let scenarios = common::golden("paper_sumo_01_02_scenarios.jsonl");
    let lane = "01_cut_in_81_74_836/S/1.2s/RSS";
    refused(&["simulate", "--scenarios", text(&scenarios), "--lane", lane, "--gap", "5"], "would not be heeded");
    refused(&["study", "--threads", "100000000"], "at most 4096");
}
