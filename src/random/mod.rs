//! Numbers at random that are pure functions of (seed, index): any part of a sample can be made anywhere, in any
//! order, on the CPU and on a device, with the same bits.
//!
//! Here lives nothing about scenarios. Twins in WGSL stand in `shaders/shared`.

mod philox;

pub use philox::{Stream, philox4x32_10};
