//! `devices`, `verify`, `--backend` and `--device` as their users type them.

use crate::common::device::software_device;
use crate::common::program::{command, files, json, ran, said, same, without_host};
use lanesweep::engine::BackendChoice;
use lanesweep::engine::gpu::{Adapters, choose};

fn device() -> Option<String> {
    software_device().map(|(_, index)| index.to_string())
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
    if Adapters::enumerate().cards().iter().any(|card| card.is_real()) {
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

#[test]
fn the_software_device_is_listed_but_taken_only_by_name() {
    let Some((adapters, index)) = software_device() else { return };
    let name = &adapters.cards()[index].name;
    let text = ran(std::path::Path::new("."), "devices");
    assert!(text.contains(name.split(' ').next().unwrap()) && text.contains("software"), "{text}");
    assert!(text.lines().all(|line| line.chars().count() <= 120), "{text}");
    assert!(text.lines().count() == adapters.cards().len() + 1 && text.contains("exact path"), "{text}");
    let named = choose(adapters.cards(), BackendChoice::Gpu, Some(name));
    assert_eq!(named.unwrap(), Some(index));
    let auto = choose(adapters.cards(), BackendChoice::Auto, None).unwrap();
    assert!(auto.is_none_or(|auto| adapters.cards()[auto].is_real()));
    assert_eq!(adapters.take(index).unwrap().get_info().name.trim(), name);
}

#[test]
fn a_driver_that_misses_its_runtime_folder_does_not_look_like_a_failure_of_ours() {
    let mut command = command(std::path::Path::new("."), &["devices"]);
    command.env_remove("XDG_RUNTIME_DIR").env_remove("DISPLAY").env_remove("NODEVICE_SELECT");
    let output = command.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(0) && said.is_empty(), "{said}");
}
