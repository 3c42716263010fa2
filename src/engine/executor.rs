//! The executor: the loop above the backends. It runs chunks of units, rechecks a sample of a device's lanes on the
//! CPU, and passes a failed chunk to the fallback backend.

use std::ops::Range;
use std::sync::Arc;

use super::backend::{Backend, Chunk, Session, Wanted};
use super::plan::LanePlan;
use super::recheck::{Recheck, RecheckOptions};
use lanesweep_support::cancel::Cancel;
use lanesweep_support::{Error, Result};

/// The backend of a run, its fallback, and the lanes to recheck. `Executor<'static>` owns its backends;
/// `Executor::new(&backend)` borrows one and lives as long as the backend.
#[derive(Clone)]
pub struct Executor<'a> {
    /// Computes the lanes.
    pub backend: Arc<dyn Backend + 'a>,
    /// Computes the chunks that the backend cannot compute.
    pub fallback: Option<Arc<dyn Backend + 'a>>,
    /// Which lanes the CPU recomputes, as [`Backend::rechecked_by`] says; `None` recomputes none.
    pub recheck: Option<RecheckOptions>,
    /// Maximum number of lanes in a chunk; `None` selects the backend's default. A run is journalled and cancelled
    /// between chunks.
    pub chunk_lanes: Option<u64>,
    /// Ends a sweep after the current chunk when requested.
    pub cancel: Cancel,
    /// Called with the number of units of every finished chunk.
    pub progress: Option<Arc<dyn Fn(u64) + Send + Sync>>,
}

/// Summary of a sweep.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SweepSummary {
    /// Lanes computed.
    pub lanes: u64,
    /// Chunks computed by the fallback because the backend failed.
    pub redone_chunks: u64,
    /// Lanes of these chunks.
    pub redone_lanes: u64,
    /// Lanes recomputed on the CPU with every step, all equal.
    pub rechecked_lanes: u64,
    /// Device time, s; `None` if the device cannot measure it.
    pub device_s: Option<f64>,
}

impl SweepSummary {
    /// Adds the summary of another sweep of the same run.
    pub fn add(&mut self, other: &SweepSummary) {
        self.lanes += other.lanes;
        self.redone_chunks += other.redone_chunks;
        self.redone_lanes += other.redone_lanes;
        self.rechecked_lanes += other.rechecked_lanes;
        self.device_s = self.device_s.zip(other.device_s).map(|(a, b)| a + b);
    }
}

impl<'a> Executor<'a> {
    /// An executor without fallback and recheck.
    pub fn new(backend: impl Backend + 'a) -> Self {
        Executor {
            backend: Arc::new(backend),
            fallback: None,
            recheck: None,
            chunk_lanes: None,
            cancel: Cancel::default(),
            progress: None,
        }
    }

    /// Sets the fallback.
    pub fn with_fallback(self, fallback: impl Backend + 'a) -> Self {
        Executor { fallback: Some(Arc::new(fallback)), ..self }
    }

    /// Sets the cancellation token.
    pub fn with_cancel(self, cancel: Cancel) -> Self {
        Executor { cancel, ..self }
    }

    /// Rechecks one lane in `ONE_IN`; the seed selects which.
    pub fn with_recheck(self, seed: u64) -> Self {
        Executor { recheck: Some(RecheckOptions::of_seed(seed)), ..self }
    }

    /// Sets the callback for finished units.
    pub fn with_progress(self, progress: impl Fn(u64) + Send + Sync + 'static) -> Self {
        Executor { progress: Some(Arc::new(progress)), ..self }
    }

    /// Ends a run with `done` of `of` units if cancellation is requested and units are left.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub fn check_cancelled(&self, done: u64, of: u64) -> Result<()> {
        if done < of && self.cancel.requested() {
            return Err(Error::Interrupted { done: format!("{done} of {of} units are done"), is_kept: false });
        }
        Ok(())
    }

    /// Computes an interval of units and passes every chunk, in order, to `each`. If the backend cannot compute a
    /// chunk, the fallback does.
    ///
    /// # Errors
    /// Those of the backend if there is no fallback, of the fallback, and of `each`. [`Error::Verification`] if a
    /// rechecked lane differs. [`Error::Interrupted`] between chunks after [`Executor::cancel`] is requested.
    pub fn sweep(
        &self,
        plan: &LanePlan,
        units: Range<u64>,
        wanted: Wanted,
        each: impl FnMut(Chunk) -> Result<()>,
    ) -> Result<SweepSummary> {
        let recheck = self.recheck.map(|options| Recheck::new(plan, options));
        self.sweep_checked(plan, units, wanted, recheck.as_ref(), each)
    }

    /// The same with a check by the caller.
    pub(super) fn sweep_checked(
        &self,
        plan: &LanePlan,
        units: Range<u64>,
        wanted: Wanted,
        recheck: Option<&Recheck>,
        mut each: impl FnMut(Chunk) -> Result<()>,
    ) -> Result<SweepSummary> {
        let Executor { backend, fallback, chunk_lanes, .. } = self;
        let fallback = fallback.as_deref();
        let max_lanes = chunk_lanes.unwrap_or(u64::MAX);
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
        // Rechecks a chunk and passes it on.
        let mut deliver = |mut chunk: Chunk, computed_by: &dyn Backend, redone: u64| {
            let by = computed_by.rechecked_by(wanted);
            let rechecked = recheck.map(|recheck| recheck.check(&chunk, &computed_by.describe(), by));
            let rechecked = rechecked.transpose()?.unwrap_or(0);
            let lanes = plan.first_lane_of(chunk.units.end) - chunk.first_lane;
            chunk.redone_and_rechecked = [redone * lanes, rechecked];
            summary.redone_chunks += redone;
            summary.redone_lanes += redone * lanes;
            summary.rechecked_lanes += rechecked;
            summary.lanes += lanes;
            let (of_chunk, done) = (chunk.units.end - chunk.units.start, chunk.units.end - units.start);
            each(chunk)?;
            if let Some(progress) = &self.progress {
                progress(of_chunk);
            }
            self.check_cancelled(done, units.end - units.start)
        };
        let mut from = units.start;
        // Units that the backend knows to be next.
        let mut announced: Option<Range<u64>> = None;
        // The backend computes no units before this one.
        let mut redo_until = if session.is_some() { units.start } else { units.end };
        while from < units.end {
            if let Some(session) = session.as_mut().filter(|_| from >= redo_until) {
                let lanes = session.chunk_lanes(wanted).min(max_lanes);
                let range = announced.take().unwrap_or_else(|| from..next_cut(plan, from, units.end, lanes));
                if range.end < units.end {
                    let next = range.end..next_cut(plan, range.end, units.end, lanes);
                    session.announce(next.clone());
                    announced = Some(next);
                }
                match (compute(plan, session.as_mut(), &range, wanted), fallback) {
                    (Ok(chunk), _) => {
                        deliver(chunk, &**backend, 0)?;
                        from = range.end;
                        continue;
                    }
                    (Err(error), Some(fallback)) => {
                        if redo.is_none() {
                            let name = fallback.describe();
                            tracing::warn!("{error}; {name} computes this part, and what else the device cannot");
                        }
                        redo_until = range.end;
                        announced = None;
                    }
                    (Err(error), None) => return Err(error),
                }
            }
            let Some(fallback) = fallback else {
                return Err(Error::Internal("the sweep has no backend".to_owned()));
            };
            let session = match &mut redo {
                Some(session) => session,
                none => none.insert(fallback.prepare(plan)?),
            };
            let range = from..next_cut(plan, from, redo_until, session.chunk_lanes(wanted).min(max_lanes));
            deliver(compute(plan, session.as_mut(), &range, wanted)?, fallback, 1)?;
            from = range.end;
        }
        summary.device_s = session.as_ref().and_then(|s| s.device_seconds());
        Ok(summary)
    }
}

/// Computes a chunk and checks that it holds what was requested.
fn compute(plan: &LanePlan, session: &mut dyn Session, units: &Range<u64>, wanted: Wanted) -> Result<Chunk> {
    let chunk = session.run(units.clone(), wanted)?;
    chunk.check_requested(plan, units, wanted)?;
    Ok(chunk)
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

/// End of a chunk that begins at a unit and holds about `lanes` lanes, at least one unit.
fn next_cut(plan: &LanePlan, from: u64, end: u64, lanes: u64) -> u64 {
    let max_per_unit = plan.blocks.iter().map(|b| plan.lanes_per_unit(b)).max().unwrap_or(1).max(1);
    end.min(from + (lanes / max_per_unit).max(1))
}
