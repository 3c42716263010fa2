//! Drivers, criteria, profiles, cases and scenarios. The rooms that its modules may use stand below; `lanesweep` is the crate for users.

use lanesweep_support::{Error, Place, Result, settings, support};

#[macro_use]
#[path = "mod.rs"]
pub mod model;
pub mod scenario;
