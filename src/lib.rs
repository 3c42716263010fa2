//! lanesweep: a massively parallel sweeper for the scenario-based assessment of automated driving systems.
//!
//! Rooms in the order of the data: [`trajectory`] → [`scenario`] → [`driver`] and [`criterion`] →
//! [`sweep`].

pub mod conformance;
pub mod criterion;
pub mod driver;
pub mod error;
pub mod parameterization;
pub mod profile;
pub mod scalar;
pub mod scenario;
pub mod sweep;
pub mod trajectory;

pub use error::{Error, Place, Result};
