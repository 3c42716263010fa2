//! Recordings, generated traffic and the mining of scenarios. The rooms that its modules may use stand below; `lanesweep` is the crate for users.

use lanesweep_model::scenario;
use lanesweep_support::{Error, Place, Result, settings, support};

#[path = "mod.rs"]
pub mod traffic;
