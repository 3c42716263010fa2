//! What the counting kernel is told of a plan.

use super::device::{Kernel, PipelineSpec};
use super::ring::TallyJob;
use crate::{CountLayout, LanePlan};

/// Maximum number of samples of a counted job, so that no count of it overflows.
pub(super) const MAX_COUNTED: u64 = 1 << 25;

/// Maximum number of counts of a job.
const MAX_COUNTS: usize = 1 << 20;

/// The counting of a plan, if a device can do it: few enough counts for a workgroup.
pub(super) fn counter(plan: &LanePlan) -> Option<(CountLayout, TallyJob)> {
    let layout = CountLayout::new(plan);
    let fits = plan.generator().is_some()
        && plan.blocks.len() == 1
        && layout.of_every_sample() <= CountLayout::GATHERED
        && layout.total() <= MAX_COUNTS;
    let pipeline = PipelineSpec { kernel: Kernel::Count, constants: layout.shader_constants() };
    fits.then(|| (layout, TallyJob { pipeline, counts: layout.total() }))
}
