//! Lanes on the CPU: single lanes, batches on vector instructions, and the work that verdict-only batches skip
//! ([`fast_forward`], [`steady_following`], [`lead_only`]), and lanes of drivers outside the registry ([`foreign`],
//! [`side_by_side`]). The step itself is [`lane_step`](super::lane_step)'s.

pub(crate) mod backend;
mod batch;
mod batch_arrays;
mod fast_forward;
pub(crate) mod foreign;
pub(crate) mod lane_result;
pub(crate) mod lane_stream;
mod lead_only;
pub(crate) mod pending_lanes;
pub(crate) mod runner;
pub(crate) mod series;
pub(crate) mod shared_rules;
mod side_by_side;
pub(crate) mod simd;
mod steady_following;

/// Lanes of a batch: one AVX-512 register of binary32 values.
pub(crate) const LANES: usize = 16;
/// Steps of a burst. Equal to [`LANES`], so that a square of lanes and rows is transposed in registers.
pub(crate) const ROWS: usize = 16;
