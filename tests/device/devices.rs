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

/// The same on a machine where no driver of Vulkan or OpenGL answers.
fn without_drivers(home: &tempfile::TempDir) -> Command {
    let mut command = devices(home);
    let empty = home.path().join("empty.json");
    std::fs::write(&empty, "").unwrap();
    command.env("VK_DRIVER_FILES", &empty).env("VK_ICD_FILENAMES", home.path().join("missing.json"));
    command.env("__EGL_VENDOR_LIBRARY_FILENAMES", home.path().join("missing.json"));
    command
}

fn stdout(mut command: Command) -> String {
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[cfg(target_os = "linux")]
#[test]
fn a_machine_without_any_driver_is_told_what_to_install() {
    let home = tempfile::tempdir().unwrap();
    let text = stdout(without_drivers(&home));
    for part in ["No compute device", "libvulkan1 mesa-vulkan-drivers", "--backend auto selects the CPU"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let mut json = without_drivers(&home);
    json.args(["--format", "json"]);
    let seen: serde_json::Value = serde_json::from_str(&stdout(json)).unwrap();
    assert_eq!((&seen["devices"], &seen["auto"]), (&serde_json::json!([]), &serde_json::Value::Null));
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
    let named = choose(adapters.cards(), BackendChoice::Gpu, Some(name));
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
