//! OpenSCENARIO: export of concrete scenarios.
//!
//! This module holds exported scenarios ([`Concrete`]), their two files (ASAM OpenSCENARIO XML 1.2 and ASAM OpenDRIVE
//! 1.7), and the conversion of lanes, which come from [`lanesweep_run::reopen`].

mod concrete;
mod lanes;
mod road;
mod scenario_file;

pub use concrete::{Concrete, EgoMotion, PlayedVehicle, Vertex};
pub use lanes::{PlayOptions, concrete_case, concrete_lanes};
pub use scenario_file::{INDEX, export_folder};

/// Date of every file; it is constant, so that the same input gives the same bytes.
const DATE: &str = "1970-01-01T00:00:00";
