//! Statistics: random numbers, densities of scenario parameters, estimators of rare events and their intervals.
//!
//! Nothing here steps a lane: estimators ask a limit state, which the run answers with lanes.

pub mod density;
pub mod estimate;

pub use lanesweep_random as random;
