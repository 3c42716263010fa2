//! Errors, files, tables and locks. The rooms that its modules may use stand below; `lanesweep` is the crate for users.

#[path = "mod.rs"]
pub mod support;

pub use support::error::{Error, Place, Result};
