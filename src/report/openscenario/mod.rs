//! OpenSCENARIO: export of concrete scenarios, import of parameter distributions.
//!
//! This module holds exported scenarios ([`Concrete`]), their two files (ASAM OpenSCENARIO XML 1.2 and ASAM OpenDRIVE
//! 1.7), the conversion of lanes, and the reader of `ParameterValueDistribution` files.
//! Lanes come from [`crate::run::reopen`]; imported data go to [`crate::run::grid`] and [`crate::engine`].

mod concrete;
mod distribution;
mod distribution_file;
mod lanes;
mod parameters;
mod road;
mod samples;
mod scenario_file;
mod xml_at;

pub use concrete::{Concrete, EgoMotion, PlayedVehicle, Vertex};
pub use distribution::{Distribution, Draw, Range};
pub use distribution_file::{
    Deterministic, DistributionFile, Distributions, Stochastic, TextParameter, parse_distribution, read_distribution,
};
pub use lanes::{PlayOptions, concrete_case, concrete_lanes};
pub use parameters::{Names, Rename, variations};
pub use samples::{DistributionSamples, Sampled, SampledFile, SampledParameter, reopen};
pub use scenario_file::{IndexRow, export_folder};

/// Date of every file; it is constant, so that the same input gives the same bytes.
const DATE: &str = "1970-01-01T00:00:00";
