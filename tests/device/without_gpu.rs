//! A program without GPUs names the feature that it lacks, wherever a device is asked for.

use std::process::Command;

use crate::common::device::software_device;

#[test]
fn a_device_asked_for_is_refused_with_the_name_of_the_feature() {
    // Says that the tests of the device are left out.
    assert!(software_device().is_none());
    for args in [&["devices"][..], &["verify"], &["study", "--backend", "gpu"], &["study", "--device", "0"]] {
        let output = Command::new(env!("CARGO_BIN_EXE_lanesweep")).args(args).output().unwrap();
        assert_eq!(output.status.code(), Some(7), "{args:?}");
        let message = String::from_utf8(output.stderr).unwrap();
        let message = message.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(message.contains("without the feature `gpu`"), "{args:?}: {message}");
    }
}
