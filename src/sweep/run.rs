//! The one loop above the backends: chunks of units, hand-over of a failed chunk to another backend.

use std::ops::Range;

use super::backend::{Backend, Chunk, Wanted};
use super::plan::LanePlan;
use crate::Result;

/// Lanes of a chunk, about: enough to keep every thread busy, little enough to show progress.
const CHUNK_LANES: u64 = 1 << 17;

/// How a sweep went.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct SweepSummary {
    /// Lanes computed.
    pub lanes: u64,
    /// Chunks that the first backend could not compute and the fallback did.
    pub redone_chunks: u64,
}

/// Runs an interval of units on a backend and gives every chunk, in order, to `each`. A chunk that the
/// backend cannot compute is computed by `fallback`, where there is one.
pub fn sweep(
    plan: &LanePlan,
    units: Range<u64>,
    backend: &dyn Backend,
    fallback: Option<&dyn Backend>,
    wanted: Wanted,
    mut each: impl FnMut(Chunk) -> Result<()>,
) -> Result<SweepSummary> {
    let mut session = backend.prepare(plan)?;
    let mut summary = SweepSummary::default();
    for range in chunks(plan, units) {
        let computed = session.run(range.clone(), wanted).and_then(|chunk| chunk.check(plan).map(|()| chunk));
        let chunk = match (computed, fallback) {
            (Ok(chunk), _) => chunk,
            (Err(error), Some(fallback)) => {
                let name = backend.describe();
                tracing::warn!("{name} could not compute units {range:?} ({error}); {} does", fallback.describe());
                summary.redone_chunks += 1;
                let chunk = fallback.prepare(plan)?.run(range, wanted)?;
                chunk.check(plan)?;
                chunk
            }
            (Err(error), None) => return Err(error),
        };
        summary.lanes += chunk.verdicts.len() as u64;
        each(chunk)?;
    }
    Ok(summary)
}

/// Splits an interval of units into chunks of about 131,072 lanes, at least one unit each.
pub fn chunks(plan: &LanePlan, units: Range<u64>) -> Vec<Range<u64>> {
    let most = plan.blocks.iter().map(|b| plan.lanes_per_unit(b)).max().unwrap_or(1).max(1);
    let step = (CHUNK_LANES / most).max(1);
    let mut ranges = Vec::new();
    let mut from = units.start;
    while from < units.end {
        let to = units.end.min(from + step);
        ranges.push(from..to);
        from = to;
    }
    ranges
}
