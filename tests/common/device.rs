//! Where device tests find a device: a software Vulkan, which any machine can have.

use lanesweep::engine::Backend;
#[cfg(feature = "gpu")]
use lanesweep::engine::gpu::{Adapters, Api, DeviceKind, GpuBackend, GpuOptions, Tampering};

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

#[cfg(feature = "gpu")]
pub fn open(options: GpuOptions) -> Option<GpuBackend> {
    tampered(options, Tampering::default())
}

#[cfg(feature = "gpu")]
pub fn tampered(options: GpuOptions, tampering: Tampering) -> Option<GpuBackend> {
    let (adapters, index) = software_device()?;
    Some(GpuBackend::open_tampered(&adapters, index, options, tampering).unwrap())
}

/// A text of the shaders that is replaced.
#[cfg(feature = "gpu")]
pub fn patched(from: &str, to: &str) -> Option<GpuBackend> {
    let shader_patch = Some((from.to_owned(), to.to_owned()));
    tampered(GpuOptions::default(), Tampering { shader_patch, ..Default::default() })
}

/// Before a job the device is lost for good, or has no memory for it.
#[cfg(feature = "gpu")]
pub fn failing_at(at_job: u64, is_lost: bool) -> Option<GpuBackend> {
    let before_job = move |job, device: &wgpu::Device| match job == at_job {
        true if is_lost => {
            device.destroy();
            Ok(())
        }
        true => Err("it has no memory for this job"),
        false => Ok(()),
    };
    tampered(
        GpuOptions::default(),
        Tampering { before_job: Some(std::sync::Arc::new(before_job)), ..Default::default() },
    )
}

#[cfg(feature = "gpu")]
pub fn software_backend() -> Option<Box<dyn Backend>> {
    Some(Box::new(open(GpuOptions::default())?))
}

/// The same of a program without GPUs: none, said as loudly.
#[cfg(not(feature = "gpu"))]
pub fn software_device() -> Option<((), usize)> {
    without_device("needs the feature `gpu`");
    None
}

#[cfg(not(feature = "gpu"))]
pub fn software_backend() -> Option<Box<dyn Backend>> {
    software_device();
    None
}

fn without_device(why: &str) {
    assert!(std::env::var_os("LANESWEEP_REQUIRE_DEVICE").is_none(), "LANESWEEP_REQUIRE_DEVICE is set, but this {why}");
    super::skipped(why);
}
