//! Lanes on a device. Without one the tests say so and pass; `LANESWEEP_REQUIRE_DEVICE=1` makes that a failure.

#[cfg(feature = "gpu")]
mod counting;
#[cfg(feature = "gpu")]
mod device_command_line;
#[cfg(feature = "gpu")]
mod device_equals_cpu;
#[cfg(feature = "gpu")]
mod device_failures;
#[cfg(feature = "gpu")]
mod device_size;
#[cfg(feature = "gpu")]
mod exact_division;
#[cfg(feature = "gpu")]
mod kernel;
#[cfg(feature = "gpu")]
mod mixed_shards;
#[cfg(feature = "gpu")]
mod random_on_device;
#[cfg(feature = "gpu")]
mod shaders;
#[cfg(feature = "gpu")]
mod wgsl;
#[cfg(not(feature = "gpu"))]
mod without_gpu;
