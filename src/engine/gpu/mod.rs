//! The GPU: every lane is an invocation of a WGSL kernel, with the same verdict on every device.
//!
//! Here live the list of devices and the choice among them, the way from the shaders' files to a pipeline, the
//! thread that owns the open device, and the backend that gives it the lanes of a plan. Here lives no physics:
//! a lane means the same on every device, and what it means stands in `shaders/` beside its Rust twins. Device
//! names come from the command line, lanes from a plan; chunks go back as those of any backend.

mod adapters;
mod backend;
mod choice;
mod device;
mod generator;
mod inputs;
mod owner;
mod pacing;
mod records;
mod ring;
mod session;
pub mod shader;
mod spirv;
mod visible;

pub use adapters::{AdapterCard, AdapterLimits, Adapters, Api, DeviceKind};
pub use backend::GpuBackend;
pub use choice::choose;
pub use device::{Fault, FaultKind, GpuOptions};
pub use records::Generation;
pub use records::{Launch, OutcomeRecord, StartRecord};
pub use spirv::{Checks, exact_spirv};
pub use visible::{visible, visible_here};
