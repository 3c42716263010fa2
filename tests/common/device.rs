//! Where device tests find a device: a software Vulkan, which any machine can have.

#![allow(dead_code)] // every test binary uses its own part

use std::io::Write;

use lanesweep::engine::Backend;
#[cfg(feature = "gpu")]
use lanesweep::engine::gpu::{Adapters, Api, DeviceKind, GpuBackend, GpuOptions};

/// The devices of this machine and the index of its software Vulkan (Mesa's llvmpipe: on Debian, libvulkan1 and
/// mesa-vulkan-drivers); where there is none, says so loudly and gives `None`: the test returns. With the
/// environment variable `LANESWEEP_REQUIRE_DEVICE` it fails instead, so that no check is skipped unseen.
#[cfg(feature = "gpu")]
pub fn software_device() -> Option<(Adapters, usize)> {
    let adapters = Adapters::enumerate();
    let is_it = |kind, api| kind == DeviceKind::Software && api == Api::Vulkan;
    if let Some(index) = adapters.cards().iter().position(|card| is_it(card.kind, card.api)) {
        return Some((adapters, index));
    }
    without_device("needs a software Vulkan (Debian: libvulkan1 mesa-vulkan-drivers)");
    None
}

/// The software device, open.
#[cfg(feature = "gpu")]
pub fn software_backend() -> Option<Box<dyn Backend>> {
    let (adapters, index) = software_device()?;
    Some(Box::new(GpuBackend::open(&adapters, index, GpuOptions::default()).unwrap()))
}

/// The same of a program without GPUs: none, said as loudly.
#[cfg(not(feature = "gpu"))]
pub fn software_device() -> Option<((), usize)> {
    without_device("needs the feature `gpu`");
    None
}

/// None.
#[cfg(not(feature = "gpu"))]
pub fn software_backend() -> Option<Box<dyn Backend>> {
    software_device();
    None
}

fn without_device(why: &str) {
    assert!(std::env::var_os("LANESWEEP_REQUIRE_DEVICE").is_none(), "LANESWEEP_REQUIRE_DEVICE is set, but this {why}");
    // Past the test harness, which shows the output of failing tests only.
    let _ = writeln!(std::io::stderr(), "SKIPPED: {why}");
}
