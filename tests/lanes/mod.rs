//! Lanes on the CPU and what is counted of them: the physics, the plan, the scores.

mod conformance;
mod domain_claims;
mod foreign_driver;
mod hand_calculated;
mod measures;
mod partial;
mod pinned_lanes;
mod sampled_lanes;
mod score;
mod simd_equals_scalar;
mod verify_sets;
