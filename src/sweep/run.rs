//! The one loop above the backends: chunks of units, a sample of a device's lanes checked on the CPU,
//! hand-over of a failed chunk to another backend.

use std::ops::Range;

use super::backend::{Backend, Chunk, Session, Wanted};
use super::plan::LanePlan;
use super::recheck::Recheck;
use crate::{Error, Result};

/// How a sweep is run.
#[derive(Clone, Copy)]
pub struct SweepOptions<'a> {
    /// How much of a lane comes back.
    pub wanted: Wanted,
    /// Computes what the first backend cannot.
    pub fallback: Option<&'a dyn Backend>,
    /// Checks a sample of the first backend's lanes.
    pub recheck: Option<&'a Recheck<'a>>,
}

impl SweepOptions<'_> {
    /// Without fallback or check.
    pub fn plain(wanted: Wanted) -> Self {
        SweepOptions { wanted, fallback: None, recheck: None }
    }
}

/// How a sweep went.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SweepSummary {
    /// Lanes computed.
    pub lanes: u64,
    /// Chunks that the first backend could not compute and the fallback did.
    pub redone_chunks: u64,
    /// Their lanes.
    pub redone_lanes: u64,
    /// Lanes of the first backend that were computed again on the CPU, all equal.
    pub rechecked_lanes: u64,
    /// Time that the device itself computed, s, where it can tell.
    pub device_s: Option<f64>,
}

impl SweepSummary {
    /// Two sweeps of the same run.
    pub fn add(&mut self, other: &SweepSummary) {
        self.lanes += other.lanes;
        self.redone_chunks += other.redone_chunks;
        self.redone_lanes += other.redone_lanes;
        self.rechecked_lanes += other.rechecked_lanes;
        self.device_s = self.device_s.zip(other.device_s).map(|(a, b)| a + b);
    }
}

/// Runs an interval of units on a backend and gives every chunk, in order, to `each`. A chunk that the
/// backend cannot compute is computed by the fallback, where there is one.
///
/// # Errors
/// Of the backend where there is no fallback, of the fallback, of `each`; [`Error::Verification`] where a
/// checked lane differs.
pub fn sweep(
    plan: &LanePlan,
    units: Range<u64>,
    backend: &dyn Backend,
    options: &SweepOptions,
    mut each: impl FnMut(Chunk) -> Result<()>,
) -> Result<SweepSummary> {
    let &SweepOptions { wanted, fallback, recheck } = options;
    let mut summary = SweepSummary::default();
    let mut redo: Option<Box<dyn Session + '_>> = None;
    let mut session = match (backend.prepare(plan), fallback) {
        (Ok(session), _) => Some(session),
        (Err(error), Some(fallback)) => {
            tracing::warn!("{error}; {} computes instead", fallback.describe());
            None
        }
        (Err(error), None) => return Err(error),
    };
    let mut from = units.start;
    while from < units.end {
        let lanes = session.as_ref().or(redo.as_ref()).map_or(1 << 17, |s| s.chunk_lanes(wanted));
        let range = from..next_cut(plan, from, units.end, lanes);
        from = range.end;
        let computed = session.as_mut().map(|s| chunk_and_samples(plan, s.as_mut(), range.clone(), wanted, recheck));
        let chunk = match (computed, fallback) {
            (Some(Ok((chunk, samples))), _) => {
                if let Some(recheck) = recheck {
                    let device = backend.describe();
                    summary.rechecked_lanes += recheck.check(&chunk, &device)?;
                    for sample in &samples {
                        summary.rechecked_lanes += recheck.check_all(sample, &device)?;
                    }
                }
                chunk
            }
            (failed, Some(fallback)) => {
                if let Some(Err(error)) = failed
                    && redo.is_none()
                {
                    let name = fallback.describe();
                    tracing::warn!("{error}; {name} computes this part, and what else the device cannot");
                }
                if redo.is_none() {
                    redo = Some(fallback.prepare(plan)?);
                }
                let Some(session) = redo.as_mut() else {
                    return Err(Error::Internal("the fallback has no session".to_owned()));
                };
                let chunk = session.run(range.clone(), wanted)?;
                chunk.check_asked(plan, &range, wanted)?;
                summary.redone_chunks += 1;
                summary.redone_lanes += chunk.lanes();
                chunk
            }
            (Some(Err(error)), None) => return Err(error),
            (None, None) => return Err(Error::Internal("the sweep has no backend".to_owned())),
        };
        summary.lanes += chunk.lanes();
        each(chunk)?;
    }
    summary.device_s = session.as_ref().and_then(|s| s.device_seconds());
    Ok(summary)
}

/// A chunk, and lanes to check where it holds none: counts hold no lanes, so some units are asked for again, lane
/// by lane.
fn chunk_and_samples(
    plan: &LanePlan,
    session: &mut dyn Session,
    units: Range<u64>,
    wanted: Wanted,
    recheck: Option<&Recheck>,
) -> Result<(Chunk, Vec<Chunk>)> {
    let chunk = session.run(units.clone(), wanted)?;
    chunk.check_asked(plan, &units, wanted)?;
    let Some(recheck) = recheck.filter(|_| wanted == Wanted::Counts) else { return Ok((chunk, Vec::new())) };
    let samples = recheck.units(units).map(|unit| session.run(unit..unit + 1, Wanted::Verdicts));
    Ok((chunk, samples.collect::<Result<_>>()?))
}

/// Splits an interval of units into chunks of about 131,072 lanes, at least one unit each.
pub fn chunks(plan: &LanePlan, units: Range<u64>) -> Vec<Range<u64>> {
    let mut ranges = Vec::new();
    let mut from = units.start;
    while from < units.end {
        let to = next_cut(plan, from, units.end, 1 << 17);
        ranges.push(from..to);
        from = to;
    }
    ranges
}

/// End of a chunk that begins at a unit and holds about so many lanes, at least one unit.
fn next_cut(plan: &LanePlan, from: u64, end: u64, lanes: u64) -> u64 {
    let most = plan.blocks.iter().map(|b| plan.lanes_per_unit(b)).max().unwrap_or(1).max(1);
    end.min(from + (lanes / most).max(1))
}
