//! What every backend offers. No type of a thread pool or a device appears here.

use std::ops::Range;

use super::outcome::{Outcome, Verdicts};
use super::plan::LanePlan;
use crate::{Error, Result};

/// How much of a lane comes back.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wanted {
    /// Verdict bits only.
    Verdicts,
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
    /// One per lane.
    pub verdicts: Vec<Verdicts>,
    /// One per lane where outcomes were wanted, else empty. Values are exact widenings of the lane's own.
    pub outcomes: Vec<Outcome<f64>>,
}

impl Chunk {
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
            && self.verdicts.len() == lanes
            && [0, lanes].contains(&self.outcomes.len());
        if fits {
            Ok(())
        } else {
            Err(Error::Internal(format!("a chunk of units {:?} does not fit its plan", self.units)))
        }
    }
}

/// A place where lanes are computed.
pub trait Backend: Send + Sync {
    /// One line: what computes, with how many threads or on which device, in which arithmetic.
    fn describe(&self) -> String;
    /// Uploads or casts what the plan holds, once.
    fn prepare<'p>(&self, plan: &'p LanePlan) -> Result<Box<dyn Session + 'p>>;
}

/// A backend at work on one plan.
pub trait Session {
    /// Computes all lanes of an interval of units. On an error the interval can be given to another session.
    fn run(&mut self, units: Range<u64>, wanted: Wanted) -> Result<Chunk>;
}
