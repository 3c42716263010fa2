//! What every backend offers. No type of a thread pool or a device appears here.

use std::ops::Range;

use super::outcome::{Outcome, Verdicts};
use super::plan::LanePlan;
use super::watch::Watch;
use crate::model::criterion::Criterion;
use crate::model::scalar::Real;
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
    /// No lane at all: failures and smallest values per variant and model.
    Counts,
}

/// Failures and smallest values of the lanes of one block, variant and model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellCounts {
    /// Lanes.
    pub lanes: u64,
    /// Lanes that failed, per criterion in the order of [`Criterion::ALL`].
    pub failed: [u64; Criterion::ALL.len()],
    /// Lanes that ended at the time cap.
    pub capped: u64,
    /// Smallest TTC, s; infinite where no ego closed in.
    pub min_ttc_s: f64,
    /// Smallest gap, m; infinite where there was none.
    pub min_gap_m: f64,
}

impl CellCounts {
    /// No lane yet.
    pub const EMPTY: CellCounts = CellCounts {
        lanes: 0,
        failed: [0; Criterion::ALL.len()],
        capped: 0,
        min_ttc_s: f64::INFINITY,
        min_gap_m: f64::INFINITY,
    };

    /// Counts one lane.
    pub fn count<R: Real>(&mut self, outcome: &Outcome<R>) {
        self.lanes += 1;
        for criterion in Criterion::ALL {
            self.failed[criterion.index()] += u64::from(outcome.verdicts.failed(criterion));
        }
        self.capped += u64::from(outcome.verdicts.capped());
        self.min_ttc_s = self.min_ttc_s.min(outcome.min_ttc.to_f64());
        self.min_gap_m = self.min_gap_m.min(outcome.min_gap.to_f64());
    }

    /// Counts other lanes of the same cell.
    pub fn add(&mut self, other: &CellCounts) {
        self.lanes += other.lanes;
        for (ours, theirs) in self.failed.iter_mut().zip(other.failed) {
            *ours += theirs;
        }
        self.capped += other.capped;
        self.min_ttc_s = self.min_ttc_s.min(other.min_ttc_s);
        self.min_gap_m = self.min_gap_m.min(other.min_gap_m);
    }
}

/// The lanes of an interval of units, in the plan's order.
#[derive(Debug, Clone, PartialEq)]
pub struct Chunk {
    /// Units, counted over all blocks.
    pub units: Range<u64>,
    /// Index of the first lane.
    pub first_lane: u64,
    /// One per lane; empty where counts were wanted.
    pub verdicts: Vec<Verdicts>,
    /// One per lane where outcomes were wanted, else empty. Values are exact widenings of the lane's own.
    pub outcomes: Vec<Outcome<f64>>,
    /// The lanes that a [watch](Watch) marked, ascending, with their outcomes; `None` without a watch.
    pub valued: Option<Vec<(u64, Outcome<f64>)>>,
    /// One per cell of the plan ([`LanePlan::cell`]) where counts were wanted, else empty.
    pub counts: Vec<CellCounts>,
    /// Lanes that the fallback computed, and lanes that were computed again on the CPU and are equal. The executor sets both.
    pub redone_and_rechecked: [u64; 2],
}

impl Chunk {
    /// Number of lanes.
    pub fn lanes(&self) -> u64 {
        if self.counts.is_empty() { self.verdicts.len() as u64 } else { self.counts.iter().map(|c| c.lanes).sum() }
    }

    /// Checks that it is what was asked for; see [`Chunk::check`].
    ///
    /// # Errors
    /// [`Error::Internal`] where it is not.
    pub fn check_asked(&self, plan: &LanePlan, units: &Range<u64>, wanted: Wanted) -> Result<()> {
        let complete = match wanted {
            Wanted::Verdicts | Wanted::Watched(_) => self.counts.is_empty(),
            Wanted::Outcomes => self.outcomes.len() == self.verdicts.len(),
            Wanted::Counts => !self.counts.is_empty(),
        };
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
            && if self.counts.is_empty() {
                self.verdicts.len() == lanes
            } else {
                self.counts.len() == plan.cell_count()
                    && self.counts.iter().map(|c| c.lanes).sum::<u64>() == lanes as u64
            };
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
