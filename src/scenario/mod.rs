//! Scenarios: what was found in a recording ([`Scenario`]) and what is simulated.
//!
//! Here live the mined scenario, its file format, and the concrete case with its motions. Here lives
//! nothing about how scenarios are found or parameterized. Data comes from [`crate::mining`] or from a
//! scenario file and goes to [`crate::parameterization`].

mod jsonl;
mod mined;
mod schema;

pub use jsonl::{read_scenarios, write_scenarios, write_scenarios_to};
pub use mined::{Category, Ego, Other, Scenario, Side};
