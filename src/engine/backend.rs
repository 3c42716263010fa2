//! The interface of every backend. No type of a thread pool or a device appears here.

use std::ops::Range;

use super::counting::Counted;
use super::outcome::{Outcome, Verdicts};
use super::plan::LanePlan;
use lanesweep_support::{Error, Result};

/// Which results a sweep returns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wanted {
    /// Verdict bits only.
    Verdicts,
    /// [Counts](Counted) of the verdicts of samples, or the verdicts if the backend does not count.
    Counts,
    /// Verdict bits and the continuous values.
    Outcomes,
}

/// The lanes of an interval of units, in the plan's order.
#[derive(Debug, Clone, PartialEq)]
pub struct Chunk {
    /// Units, counted over all blocks.
    pub units: Range<u64>,
    /// Index of the first lane.
    pub first_lane: u64,
    /// One per lane; none in a counted chunk.
    pub verdicts: Vec<Verdicts>,
    /// One per lane if outcomes were requested, else empty. Values are exact widenings of the lane's values.
    pub outcomes: Vec<Outcome<f64>>,
    /// Counts in place of `verdicts`, if they were requested and the backend counts.
    pub counted: Option<Counted>,
    /// Lanes computed by the fallback, and lanes recomputed on the CPU with equal results. Set by the executor.
    pub redone_and_rechecked: [u64; 2],
}

impl Chunk {
    /// Number of lanes with verdicts.
    pub(crate) fn lanes(&self) -> u64 {
        self.verdicts.len() as u64
    }

    /// Verdicts of a lane, by its place in the chunk.
    pub(crate) fn verdicts_of(&self, at: usize) -> Verdicts {
        match &self.counted {
            Some(counted) => counted.verdicts(at),
            None => self.verdicts[at],
        }
    }

    /// Checks that the chunk holds the requested units and results; see [`Chunk::check`].
    ///
    /// # Errors
    /// [`Error::Internal`] if it does not.
    pub(super) fn check_requested(&self, plan: &LanePlan, units: &Range<u64>, wanted: Wanted) -> Result<()> {
        let complete = match wanted {
            Wanted::Counts => true,
            Wanted::Verdicts => self.counted.is_none(),
            Wanted::Outcomes => self.counted.is_none() && self.outcomes.len() == self.verdicts.len(),
        };
        if self.units == *units && complete {
            self.check(plan)
        } else {
            Err(Error::Internal(format!("units {units:?} were asked for, {wanted:?}, and others came")))
        }
    }

    /// Checks that the chunk holds exactly the lanes of its units in this plan.
    ///
    /// # Errors
    /// [`Error::Internal`] if it does not: its backend has a defect.
    pub fn check(&self, plan: &LanePlan) -> Result<()> {
        let first_lane = plan.first_lane_of(self.units.start);
        let lanes = plan.first_lane_of(self.units.end).saturating_sub(first_lane) as usize;
        let fits = self.units.start <= self.units.end
            && self.units.end <= plan.unit_count()
            && self.first_lane == first_lane
            && [0, lanes].contains(&self.outcomes.len())
            && self.verdicts.len() == if self.counted.is_some() { 0 } else { lanes };
        if fits {
            Ok(())
        } else {
            Err(Error::Internal(format!("a chunk of units {:?} does not fit its plan", self.units)))
        }
    }
}

/// How a sample of a backend's lanes is [recomputed](super::RecheckOptions).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecheckBy {
    /// Not at all: the backend runs single lanes on the CPU, or its batches make every step.
    Nothing,
    /// In CPU batches that make every step, some of them also as single lanes. This checks the rules for skipping
    /// steps.
    Batches,
    /// On the CPU, without any promise of a driver model: values as single lanes, verdicts in batches that make every
    /// step, some of them also as single lanes.
    Lanes,
}

/// A device or processor that computes lanes.
pub trait Backend: Send + Sync {
    /// How an [executor](super::Executor) with rechecks verifies a sample of the lanes.
    fn rechecked_by(&self, _wanted: Wanted) -> RecheckBy {
        RecheckBy::Lanes
    }
    /// One line: processor with number of threads, or device; and the arithmetic.
    fn describe(&self) -> String;
    /// Uploads or converts the plan's data, once.
    fn prepare<'p>(&self, plan: &'p LanePlan) -> Result<Box<dyn Session + 'p>>;
}

impl<B: Backend + ?Sized> Backend for &B {
    fn rechecked_by(&self, wanted: Wanted) -> RecheckBy {
        (**self).rechecked_by(wanted)
    }
    fn describe(&self) -> String {
        (**self).describe()
    }
    fn prepare<'p>(&self, plan: &'p LanePlan) -> Result<Box<dyn Session + 'p>> {
        (**self).prepare(plan)
    }
}

/// A backend with one prepared plan.
pub trait Session {
    /// Computes all lanes of an interval of units. After an error another session can compute the interval.
    fn run(&mut self, units: Range<u64>, wanted: Wanted) -> Result<Chunk>;
    /// Announces the units of the call after the next one, so that a device may begin with them before that call returns
    /// its results.
    fn announce(&mut self, _units: Range<u64>) {}
    /// Recommended number of lanes per call: enough to keep the backend busy, but few enough to end within seconds,
    /// because a run can be cancelled only between calls. Results do not depend on it.
    fn chunk_lanes(&self, _wanted: Wanted) -> u64;
    /// Device time so far, s; `None` if the device cannot measure it.
    fn device_seconds(&self) -> Option<f64> {
        None
    }
}
