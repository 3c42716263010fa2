//! A program without GPUs names the feature that it lacks, wherever a device is asked for.

use std::process::Command;

use crate::common::device::software_device;

#[test]
fn a_device_asked_for_is_refused_with_the_name_of_the_feature() {
    // Says that the tests of the device are left out.
    assert!(software_device().is_none());
    for asked in [
        &["verify", "devices"][..],
        &["verify"],
        &["study", "--backend", "gpu", "--dry-run"],
        &["study", "--device", "0", "--dry-run"],
    ] {
        let output = Command::new(env!("CARGO_BIN_EXE_lanesweep")).args(asked).output().unwrap();
        assert_eq!(output.status.code(), Some(7), "{asked:?}");
        let told = String::from_utf8(output.stderr).unwrap();
        let told = told.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(told.contains("without the feature `gpu`"), "{asked:?}: {told}");
    }
}
