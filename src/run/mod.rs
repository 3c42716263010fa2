//! Runs: what is planned, computed in parts, merged and scored.
//!
//! [`study`] compares parameterizations with recordings, [`sampling`] estimates probabilities, [`compare`] sets both beside
//! one another, [`grid`] sweeps maps, [`check`] judges single cases, [`justify`] a parameterization.
//! [`forecast`] tells what a run would be, [`close_following`] how many failures come from headways below 0.5 s.
//! [`parts`] splits, journals and merges them; [`score`] turns a study's counts into recall, precision and F1.

pub mod check;
pub mod close_following;
pub mod compare;
pub mod forecast;
pub mod grid;
pub mod justify;
pub mod parts;
#[cfg(test)]
mod plan_mutations;
pub mod sampling;
pub mod score;
pub mod study;
