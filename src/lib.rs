//! lanesweep: a massively parallel sweeper for the scenario-based assessment of automated driving systems.
//!
//! Rooms in the order of the data: [`trajectory`] → [`mining`] → [`scenario`] → [`parameterization`] →
//! [`driver`] and [`criterion`] → [`sweep`]. Beside them: [`profile`] (every constant as data), [`scalar`]
//! (the number a lane computes with), [`random`], [`density`] and
//! [`estimate`] (samples of rare events), [`gpu`] (compute devices), [`grid`] (maps), [`conformance`] (other simulators' tables),
//! [`parts`] (shards, journals, merging), [`table`] (tables in files), [`openscenario`] (played scenarios and
//! distributions of parameters), [`cluster`] (scripts for workload managers), [`interrupt`] (ending early in
//! good order), [`settings`] (what may be configured) and [`cli`].

mod atomic_file;
pub mod cli;
pub mod cluster;
pub mod conformance;
pub mod criterion;
pub mod density;
#[macro_use]
pub mod driver;
pub mod error;
pub mod estimate;
pub mod gpu;
pub mod grid;
mod input_file;
pub mod interrupt;
mod lock;
pub mod mining;
pub mod openscenario;
pub mod parameterization;
pub mod parts;
pub mod profile;
pub mod random;
pub mod report;
pub mod sampling;
pub mod scalar;
pub mod scenario;
pub mod score;
pub mod settings;
pub mod sweep;
pub mod table;
mod toml_file;
pub mod trajectory;
pub mod verify;

pub use error::{Error, Place, Result};
