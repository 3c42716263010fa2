//! Densities and estimators.

#[path = "../common/mod.rs"]
mod common;

mod claim_coverage;
mod density;
mod drawn_scenarios;
mod estimator_coverage;
mod estimators;
mod estimators_on_lanes;
mod fit;
