//! Densities and estimators.

#[path = "../common/mod.rs"]
mod common;

mod density;
mod drawn_scenarios;
mod estimator_coverage;
mod estimators;
mod estimators_on_lanes;
mod fit;
