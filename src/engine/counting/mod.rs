//! Counts of sampled lanes: verdicts of samples by headway, model and criterion, and by kernel. Integers, so that the order
//! of samples has no effect. A device counts where its lanes are; the host counts the verdicts of other backends.

mod kernel_counts;
mod layout;
mod sample_tally;

pub(super) use kernel_counts::packed;
pub use kernel_counts::{KernelCounts, cell_of};
#[cfg(feature = "gpu")]
pub(super) use layout::PackedLanes;
pub use layout::{CountLayout, Counted};
pub use sample_tally::SampleTally;
