//! The interface of every backend. No type of a thread pool or a device appears here.
//!
//! A sweep may return verdicts for all lanes and values for some: a [`Watch`] selects these by their verdicts. The
//! [executor](super::Executor) then recomputes the marked lanes one by one.

use std::ops::Range;

use super::counting::{Counted, Counting};
use super::outcome::{Outcome, Verdicts};
use super::plan::LanePlan;
use crate::model::criterion::{Criteria, Criterion};
use crate::model::driver::{MODELS, ModelId};
use crate::model::profile::Profile;
use crate::model::scalar::Real;
use crate::{Error, Result};

/// Which results a sweep returns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Wanted {
    /// Verdict bits only.
    Verdicts,
    /// Verdict bits, and the continuous values of the lanes that the watch marks. A backend's verdicts show the marks;
    /// the [executor](super::Executor) computes the values of these lanes. A backend without marks returns every
    /// outcome.
    Watched(Watch),
    /// Verdict bits and the continuous values.
    Outcomes,
}

impl Wanted {
    /// The watch of a watched sweep; else `None`.
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
    /// One per lane; none in a counted chunk.
    pub verdicts: Vec<Verdicts>,
    /// One per lane if outcomes were requested, else empty. Values are exact widenings of the lane's values.
    pub outcomes: Vec<Outcome<f64>>,
    /// The lanes that a [watch](Watch) marked, ascending, with their outcomes; `None` without a watch.
    pub valued: Option<Vec<(u64, Outcome<f64>)>>,
    /// Counts in place of `verdicts`, if a backend [counts](Backend::prepare_counting).
    pub counted: Option<Counted>,
    /// Lanes computed by the fallback, and lanes recomputed on the CPU with equal results. Set by the executor.
    pub redone_and_rechecked: [u64; 2],
}

impl Chunk {
    /// Number of lanes with verdicts.
    pub fn lanes(&self) -> u64 {
        self.verdicts.len() as u64
    }

    /// Verdicts of a lane, by its place in the chunk.
    pub fn verdicts_of(&self, at: usize) -> Verdicts {
        match &self.counted {
            Some(counted) => counted.verdicts(at),
            None => self.verdicts[at],
        }
    }

    /// The outcome of a marked lane.
    pub fn valued_lane(&self, lane: u64) -> Option<&Outcome<f64>> {
        let valued = self.valued.as_ref()?;
        let at = valued.binary_search_by_key(&lane, |(lane, _)| *lane).ok()?;
        Some(&valued[at].1)
    }

    /// Checks that the chunk holds the requested units and results; see [`Chunk::check`].
    ///
    /// # Errors
    /// [`Error::Internal`] if it does not.
    pub(super) fn check_requested(&self, plan: &LanePlan, units: &Range<u64>, wanted: Wanted) -> Result<()> {
        let complete =
            wanted != Wanted::Outcomes || (self.outcomes.len() == self.verdicts.len() && self.counted.is_none());
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
    /// The same for a sweep that needs counts and no verdicts of single lanes. A backend that cannot count returns
    /// verdicts.
    fn prepare_counting<'p>(&self, plan: &'p LanePlan, _counting: &Counting) -> Result<Box<dyn Session + 'p>> {
        self.prepare(plan)
    }
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
    fn prepare_counting<'p>(&self, plan: &'p LanePlan, counting: &Counting) -> Result<Box<dyn Session + 'p>> {
        (**self).prepare_counting(plan, counting)
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

/// Which lanes of a model get values. Backends may mark more lanes than requested, never fewer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Marks {
    /// None.
    Nothing,
    /// Contacts with at least this closing speed, m/s ≥ 0.
    Contacts(f64),
    /// Lanes with a minimum TTC below this, s, and all contacts. At least the profile's threshold: the TTC criterion
    /// itself marks, so unmarked lanes keep their verdicts.
    TtcBelow(f64),
    /// Lanes that fail the BTN criterion.
    BtnFailures,
}

/// The marks of every model, in the order of [`ModelId::ALL`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Watch(pub [Marks; MODELS]);

impl Watch {
    /// No lane of any model.
    pub const NOTHING: Watch = Watch([Marks::Nothing; MODELS]);

    /// The criteria for lanes of a model under which their verdicts show the marks.
    pub(super) fn criteria<R: Real>(&self, profile: &Profile, model: ModelId, criteria: Criteria<R>) -> Criteria<R> {
        let mut criteria = criteria;
        match self.0[model.index()] {
            Marks::Nothing | Marks::BtnFailures => {}
            Marks::Contacts(closing_mps) => criteria.marks_contacts_from = R::from_f64(closing_mps),
            Marks::TtcBelow(ttc_s) => {
                // Rounding may reduce the product to the limit although the quotient is below it.
                let above = ttc_s.max(profile.criteria.ttc_threshold_s) * (1.0 + 1e-6);
                criteria.ttc.threshold = R::from_f64(above);
            }
        }
        criteria
    }

    /// Whether the verdicts of a lane mark it.
    pub(super) fn marks(&self, model: ModelId, verdicts: Verdicts) -> bool {
        match self.0[model.index()] {
            Marks::Nothing => false,
            Marks::Contacts(_) => verdicts.0 & Verdicts::MARKED_CONTACT == Verdicts::MARKED_CONTACT,
            Marks::TtcBelow(_) => verdicts.failed(Criterion::Ttc) || verdicts.failed(Criterion::Collision),
            Marks::BtnFailures => verdicts.failed(Criterion::Btn),
        }
    }

    /// Whether a lane with this outcome must be marked.
    pub(super) fn means(&self, model: ModelId, outcome: &Outcome<f64>) -> bool {
        let collided = outcome.verdicts.failed(Criterion::Collision);
        match self.0[model.index()] {
            Marks::Nothing => false,
            Marks::Contacts(closing_mps) => collided && outcome.impact_closing_speed.abs() >= closing_mps,
            Marks::TtcBelow(ttc_s) => collided || outcome.min_ttc < ttc_s,
            Marks::BtnFailures => outcome.verdicts.failed(Criterion::Btn),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::ops::Range;

    use crate::engine::verify::{RandomOptions, random_plan};
    use crate::engine::{
        Backend, Chunk, CpuBackend, Executor, LanePlan, RecheckBy, RecheckOptions, Session, Wanted, same_words,
    };
    use crate::{Error, Result};

    fn plan() -> LanePlan {
        let options = RandomOptions { lanes_per_model_and_category: 3000, ..Default::default() };
        random_plan(&Profile::load("paper").unwrap(), &options).unwrap()
    }

    fn chunk(plan: &LanePlan, backend: &dyn Backend, wanted: Wanted) -> Result<Chunk> {
        let mut all = None;
        let executor = Executor {
            recheck: Some(RecheckOptions { seed: 3, one_in: 5 }),
            chunk_lanes: Some(u64::MAX),
            ..Executor::new(backend)
        };
        executor.sweep(plan, 0..plan.unit_count(), wanted, |chunk| {
            match &mut all {
                None => all = Some(chunk),
                Some(all) => {
                    all.verdicts.extend(chunk.verdicts);
                    all.outcomes.extend(chunk.outcomes);
                    all.valued = all.valued.take().zip(chunk.valued).map(|(a, b)| [a, b].concat());
                }
            }
            Ok(())
        })?;
        Ok(all.unwrap())
    }

    const WATCHES: [Marks; 6] = [
        Marks::Nothing,
        Marks::Contacts(0.0),
        Marks::Contacts(7.5),
        Marks::TtcBelow(1.0),
        Marks::TtcBelow(4.0),
        Marks::BtnFailures,
    ];

    #[test]
    fn every_lane_that_is_meant_is_valued_and_no_verdict_changes() {
        let (plan, cpu) = (plan(), CpuBackend::lane_arithmetic());
        let every_value = chunk(&plan, &cpu, Wanted::Outcomes).unwrap();
        for marks in WATCHES {
            let watch = Watch([marks; MODELS]);
            let watched = chunk(&plan, &cpu, Wanted::Watched(watch)).unwrap();
            assert!(watched.verdicts == every_value.verdicts, "{marks:?}");
            let Some(valued) = watched.valued else { continue };
            for (lane, outcome) in &valued {
                assert!(same_words(outcome, &every_value.outcomes[*lane as usize]), "{marks:?}, lane {lane}");
            }
            let mut meant = 0;
            for (outcome, lane) in every_value.outcomes.iter().zip(0_u64..) {
                let model = plan.models[plan.model_of(lane)];
                if watch.means(model, outcome) {
                    meant += 1;
                    assert!(valued.binary_search_by_key(&lane, |(lane, _)| *lane).is_ok(), "{marks:?}, lane {lane}");
                }
            }
            assert_eq!(marks == Marks::Nothing, meant == 0, "{marks:?}");
            assert!(valued.len() <= meant + plan.lane_count() as usize / 50, "{marks:?}: {} of {meant}", valued.len());
        }
    }

    /// A backend with correct verdicts that marks nothing.
    struct WithoutMarks(CpuBackend<f32>);

    struct SessionWithoutMarks<'p>(Box<dyn Session + 'p>);

    impl Backend for WithoutMarks {
        fn rechecked_by(&self, _: Wanted) -> RecheckBy {
            RecheckBy::Lanes
        }

        fn describe(&self) -> String {
            "a device that marks nothing".to_owned()
        }

        fn prepare<'p>(&self, plan: &'p LanePlan) -> Result<Box<dyn Session + 'p>> {
            Ok(Box::new(SessionWithoutMarks(self.0.prepare(plan)?)))
        }
    }

    impl Session for SessionWithoutMarks<'_> {
        fn chunk_lanes(&self, wanted: Wanted) -> u64 {
            self.0.chunk_lanes(wanted)
        }

        fn run(&mut self, units: Range<u64>, _: Wanted) -> Result<Chunk> {
            self.0.run(units, Wanted::Verdicts)
        }
    }

    #[test]
    fn a_mark_that_is_missing_stops_the_run() {
        let (plan, defective) = (plan(), WithoutMarks(CpuBackend::lane_arithmetic()));
        for marks in [Marks::Contacts(7.5), Marks::TtcBelow(4.0)] {
            let error = chunk(&plan, &defective, Wanted::Watched(Watch([marks; MODELS]))).unwrap_err();
            assert!(matches!(error, Error::Verification(_)), "{marks:?}: {error}");
        }
    }
}
