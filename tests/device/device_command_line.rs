//! `verify`, `--backend` and `--device` as their users type them.

use crate::common::device::software_device;
use crate::common::program::{files, json, ran, said, same, without_host};

fn device() -> Option<String> {
    software_device().map(|(_, index)| index.to_string())
}

/// Has this machine a GPU of its own? Then the tests of its absence say nothing.
fn has_gpu() -> bool {
    lanesweep::engine::gpu::Adapters::enumerate().cards().iter().any(|card| card.is_real())
}

const SMALL: &str = "--synth-recordings 1 --config generator.duration_s=120";

#[test]
fn a_study_on_a_device_writes_the_same_files_as_on_the_cpu() {
    let Some(device) = device() else { return };
    let dir = tempfile::tempdir().unwrap();
    let study = |out: &str, backend: &str| {
        ran(dir.path(), &format!("-q study --out {out} --rows {out}/lanes.csv {SMALL} {backend}"))
    };
    let on_cpu = study("cpu", "--backend cpu");
    assert!(on_cpu == study("device", &format!("--backend gpu --device {device}")), "the tables differ");
    let [cpu, on_device] = ["cpu", "device"].map(|folder| without_host(files(&dir.path().join(folder))));
    same(&on_device, &cpu, "device");
    assert!(cpu.len() >= 10 && cpu.contains_key("lanes.csv"), "{:?}", cpu.keys());
    let record = json(&dir.path().join("device/run.json"));
    assert_eq!((&record["device"]["exact_path"], &record["sweep"]["redone_lanes"]), (&true.into(), &0.into()));
    let (lanes, rechecked) = (record["lanes"].as_u64(), record["sweep"]["rechecked_lanes"].as_u64());
    assert!(rechecked.unwrap() >= lanes.unwrap() / 1000, "{record}");
}

#[test]
fn a_gpu_that_is_not_there_has_its_own_exit_code_and_nothing_is_written() {
    if has_gpu() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let (code, text) = said(dir.path(), &format!("study --backend gpu --out out {SMALL}"));
    assert!(code == 7 && text.contains("no GPU") && text.contains("--backend cpu"), "{code} {text}");
    assert!(!dir.path().join("out").exists());
    let (code, text) = said(dir.path(), "verify");
    assert_eq!(code, 7, "{text}");
    let (problem, help) = text.split_once("help:").unwrap();
    assert!(!problem.contains("--backend") && problem.contains("compares a device with the CPU"), "{text}");
    assert!(help.contains("--device") && help.contains("--backend cpu compares"), "{text}");
}
