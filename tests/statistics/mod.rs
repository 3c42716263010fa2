//! Densities and estimators.

mod claim_coverage;
mod density;
mod drawn_scenarios;
mod estimator_coverage;
mod estimators;
mod estimators_on_lanes;
mod random;
