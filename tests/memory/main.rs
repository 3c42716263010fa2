//! What no input may ask for: both files need the allocator that counts.
#![allow(clippy::disallowed_methods, clippy::undocumented_unsafe_blocks, reason = "a program of its own")]

#[path = "../common/mod.rs"]
mod common;

#[path = "mutated_inputs/memory.rs"]
mod memory;
mod mutated_inputs;
mod table_memory;

#[global_allocator]
static ALLOCATOR: memory::Counting = memory::Counting;
