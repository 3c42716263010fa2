//! Lanes on a device. Without one the tests say so and pass; `LANESWEEP_REQUIRE_DEVICE=1` makes that a failure.

mod counting;
mod device_command_line;
mod device_equals_cpu;
mod device_failures;
mod device_size;
mod exact_division;
mod kernel;
mod mixed_shards;
mod random_on_device;
mod shaders;
mod wgsl;
