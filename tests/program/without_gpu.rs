//! A program without GPUs names the feature that it lacks, wherever a device is asked for.

use std::path::Path;

use crate::common::device::software_device;
use crate::common::program::refused;

#[test]
fn a_device_asked_for_is_refused_with_the_name_of_the_feature() {
    // Says that the tests of the device are left out.
    assert!(software_device().is_none());
    for line in ["devices", "verify", "study --backend gpu", "study --device 0"] {
        refused(Path::new("."), line, 7, "without the feature `gpu`");
    }
}
