//! The program: its commands, runs that are killed and resumed, devices, the book.

mod common;
#[cfg(feature = "gpu")]
mod device;
mod program;
mod runs;
