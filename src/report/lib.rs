//! Tables, figures, pages and exported scenarios. The rooms that its modules may use stand below; `lanesweep` is the crate for users.

use lanesweep_engine::engine;
use lanesweep_model::{model, scenario};
use lanesweep_run::run;
use lanesweep_stats::stats;
use lanesweep_support::{Error, Place, Result, support};
use lanesweep_traffic::traffic;

#[path = "mod.rs"]
pub mod report;
