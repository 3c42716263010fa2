//! The GPU: every lane an invocation of a WGSL kernel, the same verdict on every device.

mod records;
pub mod shader;
mod spirv;

pub use records::{Launch, OutcomeRecord, StartRecord};
pub use spirv::{Checks, exact_spirv};
