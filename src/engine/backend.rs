//! What every backend offers. No type of a thread pool or a device appears here.

use std::ops::Range;

use super::outcome::{Outcome, Verdicts};
use super::plan::LanePlan;
use super::watch::Watch;
use crate::{Error, Result};

/// How much of a lane comes back.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Wanted {
    /// Verdict bits only.
    Verdicts,
    /// Verdict bits, and the continuous values of the lanes that the watch marks. A backend's verdicts show the marks;
    /// the [executor](super::Executor) values these lanes. A backend without marks returns every outcome.
    Watched(Watch),
    /// Verdict bits and the continuous values.
    Outcomes,
}

impl Wanted {
    /// The watch of a sweep that has one.
    pub(super) fn watch(self) -> Option<Watch> {
        match self {
            Wanted::Watched(watch) => Some(watch),
            Wanted::Verdicts | Wanted::Outcomes => None,
        }
    }
}

/// The lanes of an interval of units, in the plan's order.
#[derive(Debug, Clone, PartialEq)]
pub struct Chunk {
    /// Units, counted over all blocks.
    pub units: Range<u64>,
    /// Index of the first lane.
    pub first_lane: u64,
    /// One per lane.
    pub verdicts: Vec<Verdicts>,
    /// One per lane where outcomes were wanted, else empty. Values are exact widenings of the lane's own.
    pub outcomes: Vec<Outcome<f64>>,
    /// The lanes that a [watch](Watch) marked, ascending, with their outcomes; `None` without a watch.
    pub valued: Option<Vec<(u64, Outcome<f64>)>>,
    /// Lanes that the fallback computed, and lanes that were computed again on the CPU and are equal. The executor sets both.
    pub redone_and_rechecked: [u64; 2],
}

impl Chunk {
    /// Number of lanes.
    pub fn lanes(&self) -> u64 {
        self.verdicts.len() as u64
    }

    /// Checks that it is what was asked for; see [`Chunk::check`].
    ///
    /// # Errors
    /// [`Error::Internal`] where it is not.
    pub fn check_asked(&self, plan: &LanePlan, units: &Range<u64>, wanted: Wanted) -> Result<()> {
        let complete = wanted != Wanted::Outcomes || self.outcomes.len() == self.verdicts.len();
        if self.units == *units && complete {
            self.check(plan)
        } else {
            Err(Error::Internal(format!("units {units:?} were asked for, {wanted:?}, and others came")))
        }
    }

    /// Checks that it holds exactly the lanes of its units in this plan.
    ///
    /// # Errors
    /// [`Error::Internal`] where it does not: its backend has a defect.
    pub fn check(&self, plan: &LanePlan) -> Result<()> {
        let first_lane = plan.first_lane_of(self.units.start);
        let lanes = plan.first_lane_of(self.units.end).saturating_sub(first_lane) as usize;
        let fits = self.units.start <= self.units.end
            && self.units.end <= plan.unit_count()
            && self.first_lane == first_lane
            && [0, lanes].contains(&self.outcomes.len())
            && self.verdicts.len() == lanes;
        if fits {
            Ok(())
        } else {
            Err(Error::Internal(format!("a chunk of units {:?} does not fit its plan", self.units)))
        }
    }
}

/// How one lane in so many of a backend is [computed again](super::RecheckOptions).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecheckBy {
    /// Not at all: its lanes are single lanes of the CPU or make every step in its batches.
    Nothing,
    /// In batches of the CPU that make every step, some of them as single lanes: what steps are left out by is checked.
    Batches,
    /// As single lanes of the CPU, which take no promise of a driver model.
    Lanes,
}

/// A place where lanes are computed.
pub trait Backend: Send + Sync {
    /// How a sample of its lanes is checked where an [executor](super::Executor) is to check.
    fn rechecked_by(&self, _wanted: Wanted) -> RecheckBy {
        RecheckBy::Lanes
    }
    /// One line: what computes, with how many threads or on which device, in which arithmetic.
    fn describe(&self) -> String;
    /// Uploads or casts what the plan holds, once.
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

/// A backend at work on one plan.
pub trait Session {
    /// Computes all lanes of an interval of units. On an error the interval can be given to another session.
    fn run(&mut self, units: Range<u64>, wanted: Wanted) -> Result<Chunk>;
    /// Lanes that one call should hold: enough to keep the backend busy, and so few that it ends within seconds, because
    /// a run looks between its calls whether it is to end. Results do not depend on it.
    fn chunk_lanes(&self, _wanted: Wanted) -> u64;
    /// Time that the device itself has computed so far, s, where it can tell.
    fn device_seconds(&self) -> Option<f64> {
        None
    }
}
