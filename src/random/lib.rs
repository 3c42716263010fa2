//! Random numbers as pure functions of (seed, index): any part of a sample can be made anywhere, in any order, on the
//! CPU and on a device, with the same bits.
//!
//! [`Stream`] (Philox) turns an index into random words; [`standard_normal`] and [`choose`] turn a word into a deviate. Everything between index and deviate is 32-bit integer arithmetic and
//! exact conversions, then f32 additions and multiplications in the written order. Tables are made on the host in f64,
//! with operations that give the same bits on every machine, and go to devices as data.
//!
//! This module contains nothing about scenarios. Its WGSL twins are in `shaders/shared`, with the same file names.

mod normal;
mod philox;

pub use normal::{normal_table, standard_normal};
pub use philox::{Stream, choose, philox4x32_10};
