//! The GPU: every lane is an invocation of a WGSL kernel, with the same verdict on every device.
//!
//! This room lists and chooses devices, builds pipelines of the shader files, owns the open device in a thread, and
//! runs the lanes of a plan as a backend. The physics is in `shaders/`, with twins in Rust. Device names come from
//! the command line, lanes from a plan; chunks are returned as by any backend.

mod adapters;
mod choice;
mod device;
mod generator;
mod owner;
mod pacing;
mod records;
mod ring;
mod scenes;
mod session;
mod spirv;
mod tally;

pub use crate::shader;
pub use adapters::{AdapterCard, Adapters, Api, DeviceKind};
pub use choice::choose;
pub use device::{BeforeJob, GpuOptions, Tampering};
pub use records::{DrawnRecord, Generation, Launch, OutcomeRecord, StartRecord, Tally};
pub use session::GpuBackend;
pub use spirv::exact_spirv;
