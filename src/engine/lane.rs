//! One lane from start to end, step by step, with an observer.

use lanesweep_model::driver::{DriverModel, Hazard};
use lanesweep_model::scalar::Real;
use lanesweep_model::scenario::Tables;

use super::cpu::lane_result::conclude;
use super::frame::{Simulation, Start};
use super::lane_case::LaneCase;
use super::lane_step::{LaneConstants, LaneState, OtherState, Seen, advance};
use super::outcome::Outcome;

/// One step of a lane, for traces.
#[derive(Debug, Clone, Copy)]
pub struct Step<R> {
    /// Index i.
    pub index: u32,
    /// Speed of the ego, m/s.
    pub v_ego: R,
    /// The other vehicles; the second only where the case has one.
    pub seen: [Seen<R>; 2],
    /// The hazard that determines the reaction.
    pub hazard: Hazard<R>,
}

/// Ignores a step. Use this function instead of a closure: all drivers are compiled again for each type of observer.
#[inline(always)]
pub fn silent<R>(_: &Step<R>) {}

/// Runs one lane; `observer` gets every step.
#[inline(always)]
pub(super) fn run_lane<R: Real, M: DriverModel<R>>(
    simulation: &Simulation<R, M>,
    case: &LaneCase<R>,
    tables: &Tables<R>,
    start: Start<R>,
    mut observer: impl FnMut(&Step<R>),
) -> Outcome<R> {
    let lane = LaneConstants::new(simulation, case);
    let is_pair = simulation.scene.is_pair;
    let mut state = LaneState::new(simulation, case, start);
    loop {
        let first = OtherState::of(&case.others[0].motion, tables, state.index);
        let second = if is_pair { OtherState::of(&case.others[1].motion, tables, state.index) } else { first };
        let places = [first, second];
        let index = state.index;
        let v_ego = state.v_ego;
        let moved = advance(simulation, &lane, &state, &places);
        observer(&Step { index, v_ego, seen: moved.seen, hazard: moved.hazard });
        state = moved.state;
        if state.over.holds() || state.index >= simulation.frame.step_cap {
            return conclude(simulation, &lane, &state, &places);
        }
    }
}
