//! Densities of scenario parameters, estimators and intervals. The rooms that its modules may use stand below; `lanesweep` is the crate for users.

use lanesweep_model::scenario;
use lanesweep_random::random;
use lanesweep_support::{Error, Place, Result, support};

#[path = "mod.rs"]
pub mod stats;
