//! Lanes on the CPU and what is counted of them: the physics, the plan, the scores.

#[path = "../common/mod.rs"]
mod common;
#[path = "../common/counting.rs"]
mod counting;

mod conformance;
mod domain_claims;
mod hand_calculated;
mod measures;
mod partial;
mod sampled_lanes;
mod score;
mod simd_equals_scalar;
mod verify_sets;
