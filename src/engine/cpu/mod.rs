//! Lanes on the CPU: single lanes, batches on vector instructions, and the work that verdict-only batches
//! skip ([`fast_forward`], [`steady_following`], [`lead_only`]), and lanes of drivers outside the registry ([`foreign`]). The step itself is [`lane_step`](super::lane_step)'s.

pub(crate) mod backend;
mod batch;
mod batch_arrays;
mod fast_forward;
pub(in crate::engine) mod foreign;
pub(in crate::engine) mod lane_result;
pub(in crate::engine) mod lane_stream;
mod lead_only;
pub(in crate::engine) mod pending_lanes;
pub(in crate::engine) mod runner;
pub(in crate::engine) mod series;
pub(in crate::engine) mod shared_rules;
pub(in crate::engine) mod simd;
mod steady_following;

/// Lanes of a batch: one AVX-512 register of binary32 values.
pub(in crate::engine) const LANES: usize = 16;
/// Steps of a burst. Equal to [`LANES`], so that a square of lanes and rows is transposed in registers.
pub(in crate::engine) const ROWS: usize = 16;
