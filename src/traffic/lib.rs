//! Traffic: recordings as read, and the scenarios found in them.
//!
//! [`trajectory`] reads recordings (highD's format) and generates synthetic ones; [`mining`] finds cut-ins, cut-outs
//! and leader decelerations. A [`Source`] loads and mines either, or reads a scenario file. Scenarios go to
//! [`scenario`](lanesweep_model::scenario).

pub mod mining;
mod provenance;
pub mod trajectory;

pub use provenance::Source;
