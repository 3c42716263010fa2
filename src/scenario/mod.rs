//! Scenarios: what was found in a recording ([`Scenario`]) and what is simulated ([`Case`]).
//!
//! Here live the mined scenario, its file format, and the concrete case with its motions. Here lives
//! nothing about how scenarios are found or parameterized. Data comes from [`crate::mining`] or from a
//! scenario file and goes to [`crate::parameterization`].

mod case;
mod jsonl;
mod mined;
mod motion;
mod schema;

pub use case::{Ahead, Case, Participant};
pub use jsonl::{read_scenarios, write_scenarios, write_scenarios_to};
pub use mined::{Category, Ego, Other, Scenario, Side};
pub use motion::{LATERAL_SAMPLED, Lateral, LateralState, Motion, SPEED_SAMPLED, Speed, Tables};
