//! The profile's constants for one category, resolved, and the dispatch over driver models.

use crate::criterion::Criteria;
use crate::driver::{Cchdm, Fsm, ModelId, Reg157, Rss};
use crate::profile::Profile;
use crate::scalar::Real;
use crate::scenario::{Category, Tables};

use super::frame::{Frame, Observer, Simulation, Start, run_lane};
use super::lane_case::LaneCase;
use super::outcome::Outcome;

/// Everything a lane of one category takes from the profile, as plain constants.
#[derive(Debug, Clone, Copy)]
pub struct Constants<R> {
    /// Time and end rules.
    pub frame: Frame<R>,
    /// Criteria.
    pub criteria: Criteria<R>,
    /// Reg157.
    pub reg157: Reg157<R>,
    /// CCHDM.
    pub cchdm: Cchdm<R>,
    /// RSS.
    pub rss: Rss<R>,
    /// FSM.
    pub fsm: Fsm<R>,
    /// CCHDM only: abort at lateral overlap with |TTC| above this, s; 0 is off.
    pub cchdm_abort: R,
}

impl<R: Real> Constants<R> {
    /// Resolves a profile, in f64, and rounds once.
    pub fn resolve(profile: &Profile, category: Category) -> Self {
        let dt_s = profile.frame.dt_s;
        let abort = if profile.cchdm.abort_on_large_ttc { profile.cchdm.ttc_s } else { 0.0 };
        Constants {
            frame: Frame {
                dt: R::from_f64(dt_s),
                inverse_dt: R::from_f64(1.0 / dt_s),
                step_cap: profile.step_cap(),
                start_shift: profile.frame.start_shift,
                end_when_settled: profile.frame.end_when_settled,
                abort_above_ttc: R::ZERO,
            },
            criteria: profile.criteria.resolve(),
            reg157: profile.reg157.resolve(dt_s, category),
            cchdm: profile.cchdm.resolve(dt_s, category),
            rss: profile.rss.resolve(dt_s),
            fsm: profile.fsm.resolve(dt_s),
            cchdm_abort: R::from_f64(abort),
        }
    }

    /// Runs one lane with the chosen model.
    #[inline]
    pub fn run(
        &self,
        model: ModelId,
        case: &LaneCase<R>,
        tables: &Tables<R>,
        start: Start<R>,
        observer: &mut impl Observer<R>,
    ) -> Outcome<R> {
        let (criteria, model_index) = (&self.criteria, model.index());
        let frame = &self.frame;
        match model {
            ModelId::Reg157 => {
                let model = &self.reg157;
                run_lane(&Simulation { frame, criteria, model, model_index }, case, tables, start, observer)
            }
            ModelId::Cchdm => {
                let frame = &Frame { abort_above_ttc: self.cchdm_abort, ..self.frame };
                let model = &self.cchdm;
                run_lane(&Simulation { frame, criteria, model, model_index }, case, tables, start, observer)
            }
            ModelId::Rss => {
                let model = &self.rss;
                run_lane(&Simulation { frame, criteria, model, model_index }, case, tables, start, observer)
            }
            ModelId::Fsm => {
                let model = &self.fsm;
                run_lane(&Simulation { frame, criteria, model, model_index }, case, tables, start, observer)
            }
        }
    }
}
