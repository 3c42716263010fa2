//! `verify`, `--backend` and `--device` as their users type them.

use crate::common;

use std::path::Path;
use std::process::Output;

use crate::common::device::software_device;
use assert_cmd::Command;

fn lanesweep(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_lanesweep")).env("NO_COLOR", "1").args(args).output().unwrap()
}

fn code(output: &Output) -> i32 {
    output.status.code().expect("the program ended by itself")
}

fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).split_whitespace().collect::<Vec<_>>().join(" ")
}

/// `--device` with the index of the software device.
fn device() -> Option<String> {
    software_device().map(|(_, index)| index.to_string())
}

/// Has this machine a GPU of its own? Then the tests of its absence say nothing.
fn has_gpu() -> bool {
    lanesweep::engine::gpu::Adapters::enumerate().cards().iter().any(|card| card.is_real())
}

const SMALL: [&str; 4] = ["--synth-recordings", "1", "--config", "generator.duration_s=120"];

#[test]
fn a_study_on_a_device_writes_the_same_files_as_on_the_cpu() {
    let Some(device) = device() else { return };
    let dir = tempfile::tempdir().unwrap();
    let run = |name: &str, backend: &[&str]| {
        let out = dir.path().join(name);
        let lanes = out.join("lanes.csv");
        let (out, lanes) = (out.to_str().unwrap(), lanes.to_str().unwrap());
        let output = lanesweep(&[&["-q", "study", "--out", out, "--rows", lanes], &SMALL[..], backend].concat());
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        stdout(&output)
    };
    let on_cpu = run("cpu", &["--backend", "cpu"]);
    assert!(on_cpu == run("device", &["--backend", "gpu", "--device", &device]), "the tables differ");
    let mut files = 0;
    for entry in std::fs::read_dir(dir.path().join("cpu")).unwrap() {
        let name = entry.unwrap().file_name();
        let read = |folder: &str| std::fs::read(dir.path().join(folder).join(&name)).unwrap();
        if name == "run.json" {
            let record: serde_json::Value = serde_json::from_slice(&read("device")).unwrap();
            assert_eq!(record["device"]["exact_path"], true);
            assert_eq!(record["sweep"]["redone_lanes"], 0);
            let (lanes, rechecked) = (record["lanes"].as_u64(), record["sweep"]["rechecked_lanes"].as_u64());
            assert!(rechecked.unwrap() >= lanes.unwrap() / 1000, "{record}");
        } else if name == "report.html" {
            // All but what tells of the machine.
            let page = |folder: &str| String::from_utf8(read(folder)).unwrap();
            let parts = ["cpu", "device"].map(|folder| common::page::without_host(&page(folder)));
            assert!(parts[0] == parts[1] && page("device").contains("exact path"));
        } else {
            assert!(read("cpu") == read("device"), "{}", name.display());
            files += 1;
        }
    }
    assert!(files >= 8, "{files} files");
}

#[test]
fn verify_passes_on_the_software_device_and_says_what_it_compared() {
    let Some(device) = device() else { return };
    let args = ["-q", "verify", "--device", &device, "--random-lanes", "400", "--config", "verify.threshold_units=2"];
    let output = lanesweep(&[&args[..], &SMALL].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let text = stdout(&output);
    for part in ["Under test: GPU", "Random lanes", "Lanes on thresholds", "Study", "every word equals the CPU's"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    assert!(text.lines().skip(2).all(|line| line.chars().count() <= 120), "{text}");
}

#[test]
fn a_lane_can_be_run_again_from_its_key() {
    let Some(device) = device() else { return };
    let key = "random-cut-out-seed157-0000003/mixed/12m/FSM";
    let output = lanesweep(&["verify", "--device", &device, "--random-lanes", "400", "--lane", key]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let text = stdout(&output);
    assert!(text.contains(key) && text.contains("min_ttc") && text.contains("f64 reference"), "{text}");
    let unknown = lanesweep(&["verify", "--device", &device, "--random-lanes", "400", "--lane", "random-nothing"]);
    assert_eq!(code(&unknown), 2);
    assert!(stderr(&unknown).contains("no lane `random-nothing`"), "{}", stderr(&unknown));
}

#[test]
fn the_cpu_backend_can_be_verified_without_any_device() {
    let args = ["-q", "verify", "--backend", "cpu", "--random-lanes", "400", "--config", "verify.threshold_units=1"];
    let output = lanesweep(&[&args[..], &SMALL].concat());
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert!(stdout(&output).contains("Under test: CPU"));
}

#[test]
fn a_gpu_that_is_not_there_has_its_own_exit_code_and_nothing_is_written() {
    if has_gpu() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    let output = lanesweep(&[&["study", "--backend", "gpu", "--out", out.to_str().unwrap()], &SMALL[..]].concat());
    assert_eq!(code(&output), 7, "{}", stderr(&output));
    assert!(stderr(&output).contains("no GPU") && stderr(&output).contains("--backend cpu"), "{}", stderr(&output));
    assert!(!Path::new(&out).exists());
    let verify = lanesweep(&["verify"]);
    let said = stderr(&verify);
    assert_eq!(code(&verify), 7, "{said}");
    let (problem, help) = said.split_once("help:").unwrap();
    assert!(!problem.contains("--backend") && problem.contains("compares a device with the CPU"), "{said}");
    assert!(help.contains("--device") && help.contains("--backend cpu compares"), "{said}");
}

#[test]
fn contradicting_flags_are_answered_with_what_to_write() {
    let cases: [(&[&str], &str); 6] = [
        (&["study", "--backend", "cpu", "--device", "0"], "--device"),
        (&["study", "--config", "study.reference=true", "--backend", "gpu"], "binary64"),
        (&["study", "--config", "study.reference=true", "--device", "llvmpipe"], "binary64"),
        (&["study", "--backend", "tpu"], "tpu"),
        (&["study", "--device", "no such device"], "no such device"),
        (&["verify", "--backend", "cpu", "--random-lanes", "0"], "--random-lanes"),
    ];
    for (args, part) in cases {
        let output = lanesweep(args);
        assert_eq!(code(&output), 2, "{args:?}: {}", stderr(&output));
        assert!(stderr(&output).contains(part), "{args:?}: {}", stderr(&output));
    }
}

#[test]
fn recordings_without_a_scenario_are_an_input_that_cannot_be_verified() {
    let args = ["-q", "verify", "--backend", "cpu", "--random-lanes", "40", "--config", "verify.threshold_units=1"];
    let output = lanesweep(&[&args[..], &["--synth-recordings", "1", "--config", "generator.duration_s=1"]].concat());
    assert_eq!(code(&output), 3, "{}", stderr(&output));
    assert!(stderr(&output).contains("no scenario to simulate"), "{}", stderr(&output));
}
