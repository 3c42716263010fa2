//! Sampling: a density becomes lanes.
//!
//! Here live the way from a density file to a case generator and the plan of a sampling run. Here lives nothing
//! about estimators. Densities come from [`crate::density`], lanes run in [`crate::sweep`].

mod generator;
mod plan;

pub use generator::{SAMPLE_PURPOSE, SampleSource, generator_of, generator_of_points};
pub use plan::{SampleHeadways, SamplePlanOptions, plan_points, plan_samples};
