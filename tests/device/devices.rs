//! `lanesweep devices` on a machine with a software device, and on one with none.

use std::process::Command;

use crate::common::device::software_device;
use lanesweep::engine::BackendChoice;
use lanesweep::engine::gpu::choose;

/// The verb in a home of its own.
fn devices(home: &tempfile::TempDir) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lanesweep"));
    command.arg("devices").env("NO_COLOR", "1").env("XDG_RUNTIME_DIR", home.path());
    command
}

fn stdout(mut command: Command) -> String {
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn the_software_device_is_listed_but_taken_only_by_name() {
    let Some((adapters, index)) = software_device() else { return };
    let name = &adapters.cards()[index].name;
    let home = tempfile::tempdir().unwrap();
    let text = stdout(devices(&home));
    assert!(text.contains(name.split(' ').next().unwrap()) && text.contains("software"), "{text}");
    assert!(text.lines().all(|line| line.chars().count() <= 120), "{text}");
    assert!(text.lines().count() == adapters.cards().len() + 1 && text.contains("exact path"), "{text}");
    let named = choose(adapters.cards(), BackendChoice::Gpu, Some(&name.parse().unwrap()));
    assert_eq!(named.unwrap(), Some(index));
    let auto = choose(adapters.cards(), BackendChoice::Auto, None).unwrap();
    assert!(auto.is_none_or(|auto| adapters.cards()[auto].is_real()));
    assert_eq!(adapters.take(index).unwrap().get_info().name.trim(), name);
}

#[test]
fn a_driver_that_misses_its_runtime_folder_does_not_look_like_a_failure_of_ours() {
    let home = tempfile::tempdir().unwrap();
    let mut command = devices(&home);
    command.env_remove("XDG_RUNTIME_DIR").env_remove("DISPLAY").env_remove("NODEVICE_SELECT");
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.is_empty(), "{said}");
}
