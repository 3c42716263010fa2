//! Studies, samples, maps and checks. The rooms that its modules may use stand below; `lanesweep` is the crate for users.

use lanesweep_engine::engine;
use lanesweep_model::{model, scenario};
use lanesweep_random::random;
use lanesweep_stats::stats;
use lanesweep_support::{Error, Place, Result, settings, support};
use lanesweep_traffic::traffic;

#[path = "mod.rs"]
pub mod run;
