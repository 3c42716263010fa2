//! Random numbers as pure functions of seed and index. The rooms that its modules may use stand below; `lanesweep` is the crate for users.

use lanesweep_support::{Error, Place, Result};

#[path = "mod.rs"]
pub mod random;
