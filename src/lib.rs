//! lanesweep: a massively parallel sweeper for the scenario-based assessment of automated driving systems.
//!
//! Rooms in the order of the data: [`trajectory`] → [`mining`] → [`scenario`].

mod atomic_file;
pub mod error;
pub mod mining;
pub mod scenario;
pub mod trajectory;

pub use error::{Error, Place, Result};
