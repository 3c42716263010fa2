//! The frame: one lane from start to end, step by step, with an observer.

use crate::criterion::Criteria;
use crate::driver::{DriverModel, Hazard, View};
use crate::profile::FrameProfile;
use crate::scalar::Real;
use crate::scenario::Tables;

use super::lane_case::LaneCase;
use super::lane_step::{LaneConstants, LaneState, Whereabouts, advance, conclude};
use super::outcome::Outcome;

/// Constants of the frame at one time step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame<R> {
    /// Time step, s.
    pub dt: R,
    /// 1/dt, 1/s.
    pub inverse_dt: R,
    /// Number of steps that are evaluated at most.
    pub step_cap: u32,
    /// Index 0 is one step after the nominal start.
    pub start_shift: bool,
    /// End where nothing can happen any more.
    pub end_when_settled: bool,
    /// Abort at lateral overlap with |TTC| above this, s (the JRC's rule for CCHDM); off where not positive.
    pub abort_above_ttc: R,
}

impl<R: Real> Frame<R> {
    /// Plain constants; `abort_above_ttc_s` is the driver model's.
    pub fn resolve(profile: &FrameProfile, abort_above_ttc_s: f64) -> Self {
        Frame {
            dt: R::from_f64(profile.dt_s),
            inverse_dt: R::from_f64(1.0 / profile.dt_s),
            step_cap: profile.step_cap(),
            start_shift: profile.start_shift,
            end_when_settled: profile.end_when_settled,
            abort_above_ttc: R::from_f64(abort_above_ttc_s),
        }
    }

    /// The constants by the names that the shaders give them; flags are 0 or 1.
    pub fn shader_constants(&self) -> Vec<(&'static str, f64)> {
        vec![
            ("frame_dt", self.dt.to_f64()),
            ("frame_inverse_dt", self.inverse_dt.to_f64()),
            ("frame_step_cap", f64::from(self.step_cap.max(1))),
            ("frame_start_shift", f64::from(u8::from(self.start_shift))),
            ("frame_end_when_settled", f64::from(u8::from(self.end_when_settled))),
            ("frame_abort_above_ttc", self.abort_above_ttc.to_f64()),
        ]
    }
}

/// The headway of a lane: it sets the initial gap, bumper to bumper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Start<R> {
    /// Time headway, s: the gap is this times the ego's speed.
    Headway(R),
    /// Gap, m.
    Gap(R),
}

/// One other vehicle at one step.
#[derive(Debug, Clone, Copy)]
pub struct Seen<R> {
    /// What the driver sees.
    pub view: View<R>,
    /// Lateral position, m.
    pub lateral: R,
    /// Present for the ego at this step.
    pub present: bool,
    /// TTC and BTN look at it.
    pub judged: bool,
}

/// One step of a lane, for traces.
#[derive(Debug, Clone, Copy)]
pub struct Step<R> {
    /// Index i.
    pub index: u32,
    /// Speed of the ego, m/s.
    pub v_ego: R,
    /// The other vehicles; the second only where the case has one.
    pub seen: [Seen<R>; 2],
    /// The result of the check that counts.
    pub hazard: Hazard<R>,
}

/// Listens to the steps of a lane. Sweeps listen to nothing and pay nothing.
pub trait Observer<R> {
    /// Called once per evaluated step.
    fn step(&mut self, step: &Step<R>);
}

/// Listens to nothing.
pub struct Silent;

impl<R> Observer<R> for Silent {
    #[inline(always)]
    fn step(&mut self, _: &Step<R>) {}
}

impl<R, F: FnMut(&Step<R>)> Observer<R> for F {
    fn step(&mut self, step: &Step<R>) {
        self(step);
    }
}

/// What all lanes of one model have in common.
#[derive(Debug, Clone, Copy)]
pub struct Simulation<'a, R, M> {
    /// Time and end rules.
    pub frame: &'a Frame<R>,
    /// Criteria.
    pub criteria: &'a Criteria<R>,
    /// The ego's driver.
    pub model: &'a M,
    /// Its position in the registry: selects the attention windows.
    pub model_index: usize,
}

/// Runs one lane.
#[inline(always)]
pub fn run_lane<R: Real, M: DriverModel<R>>(
    simulation: &Simulation<R, M>,
    case: &LaneCase<R>,
    tables: &Tables<R>,
    start: Start<R>,
    observer: &mut impl Observer<R>,
) -> Outcome<R> {
    let lane = LaneConstants::new(simulation, case);
    let is_pair = case.pair != 0;
    let mut state = LaneState::new(simulation, case, start);
    loop {
        let first = Whereabouts::of(&case.others[0].motion, tables, state.index);
        let second = if is_pair { Whereabouts::of(&case.others[1].motion, tables, state.index) } else { first };
        let places = [first, second];
        let index = state.index;
        let v_ego = state.v_ego;
        let moved = advance(simulation, is_pair, &lane, &state, &places);
        observer.step(&Step { index, v_ego, seen: moved.seen, hazard: moved.hazard });
        state = moved.state;
        if moved.ended || state.index >= simulation.frame.step_cap {
            return conclude(simulation, is_pair, &lane, &state, &places);
        }
    }
}
