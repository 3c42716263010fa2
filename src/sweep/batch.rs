//! Many lanes side by side: the step of [`super::lane_step`] looped over arrays, which a compiler turns into
//! vector instructions. No second source of any model.
//!
//! A burst is [`ROWS`] steps of some batches in turn. One step of a batch needs the step before it, and so does its
//! next one; the batches need nothing of one another, which keeps the machine busy while results are on their way.
//! A lane that is over stays as it is until the burst ends. Nothing here depends on the instruction set;
//! [`super::simd`] chooses it.

use crate::driver::DriverModel;
use crate::flag::Flag;

use super::batch_arrays::{ConstantsOfLanes, LANES, PlacesOfLanes, ROWS, StateOfLanes, Words};
use super::frame::Simulation;
use super::lane_step::{LaneConstants, LaneState, Whereabouts, advance};
use super::rules::Rules;
use super::series::VehicleTracks;
use super::window::Window;

/// Batches of a burst.
pub(super) const BATCHES: usize = 3;

/// The batches in flight.
pub(super) type Fleet = [Batch; BATCHES];

/// Slots of the batches: one bit each.
pub(super) type Slots = [u16; BATCHES];

/// [`LANES`] lanes in flight.
#[derive(Debug, Clone, Copy)]
pub(super) struct Batch {
    constants: ConstantsOfLanes,
    state: StateOfLanes,
    /// Where a step that reads `state` writes, and the other way round: a vector is never stored in parts.
    after: StateOfLanes,
    places: PlacesOfLanes,
    /// Steps of the first row.
    from: Words,
}

impl Batch {
    /// No slot is used.
    pub const IDLE: Self = Batch {
        constants: ConstantsOfLanes::IDLE,
        state: StateOfLanes::IDLE,
        after: StateOfLanes::IDLE,
        places: PlacesOfLanes::IDLE,
        from: [0; LANES],
    };

    /// Puts a lane into a slot.
    #[inline(always)]
    pub fn admit(
        &mut self,
        k: usize,
        constants: &LaneConstants<f32>,
        state: &LaneState<f32>,
        tracks: &[VehicleTracks; 2],
        entries: &[f32],
        vehicles: usize,
    ) {
        self.constants.set(k, constants);
        self.state.set(k, state);
        self.places.set(k, tracks, entries, vehicles);
    }

    /// Leaves a slot empty.
    pub fn idle(&mut self, k: usize) {
        self.state.over[k] = Flag::TRUE.to_bits();
    }

    /// A lane after its last step, and the other vehicles at that step.
    #[inline(always)]
    pub fn last_step(&self, k: usize) -> (LaneConstants<f32>, LaneState<f32>, [Whereabouts<f32>; 2]) {
        let state = self.state.at(k);
        let row = (state.index - 1 - self.from[k]) as usize;
        (self.constants.at(k), state, self.places.at(row, k))
    }

    /// The furthest step of a lane that is not over.
    #[inline(always)]
    fn furthest(&self) -> u32 {
        let mut furthest = 0;
        for k in 0..LANES {
            let runs = !Flag::from_bits(self.state.over[k]);
            furthest = furthest.max(runs.choose(self.state.index[k], 0));
        }
        furthest
    }

    /// Slots whose lane is over or has reached the step cap.
    #[inline(always)]
    fn finished(&self, step_cap: u32) -> u16 {
        let mut finished = 0;
        for k in 0..LANES {
            let is_finished = Flag::from_bits(self.state.over[k]) | Flag::of(self.state.index[k] >= step_cap);
            finished |= u16::from(is_finished.holds()) << k;
        }
        finished
    }
}

/// The next steps of all lanes; `turn` is [`Window::turn`]. Gives the slots whose lanes have none left.
#[inline(always)]
pub(super) fn burst<M: DriverModel<f32>, const RULES: u32>(
    simulation: &Simulation<f32, M>,
    fleet: &mut Fleet,
    entries: &[f32],
    turn: impl Fn(&mut Window, &Words, &[f32]),
) -> Slots {
    let rules = Rules::from_bits(RULES);
    let (frame, criteria) = rules.applied(simulation.frame, simulation.criteria);
    let model = *simulation.model;
    let simulation = &Simulation { frame: &frame, criteria: &criteria, model: &model, ..*simulation };
    let mut furthest = 0;
    for batch in fleet.iter_mut() {
        batch.from = batch.state.index;
        furthest = furthest.max(batch.furthest());
        for vehicle in 0..1 + usize::from(rules.is_pair) {
            let is_seen = [true, true, M::SEES_LATERAL_SPEED];
            for (window, is_seen) in batch.places.windows(vehicle).into_iter().zip(is_seen) {
                if is_seen && window.moves {
                    turn(window, &batch.from, entries);
                }
            }
        }
    }
    // No lane steps beyond the cap, so no step asks for it.
    let rows = (frame.step_cap.max(1).saturating_sub(furthest) as usize).min(ROWS);
    for row in 0..rows {
        for batch in fleet.iter_mut() {
            let Batch { constants, state, after, places, .. } = batch;
            if row % 2 == 0 {
                step(simulation, rules, constants, places, row, state, after);
            } else {
                step(simulation, rules, constants, places, row, after, state);
            }
        }
    }
    if rows % 2 == 1 {
        for batch in fleet.iter_mut() {
            batch.state = batch.after;
        }
    }
    let mut finished = [0; BATCHES];
    for (finished, batch) in finished.iter_mut().zip(fleet) {
        *finished = batch.finished(frame.step_cap);
    }
    finished
}

/// One step of a batch.
#[inline(always)]
fn step<M: DriverModel<f32>>(
    simulation: &Simulation<f32, M>,
    rules: Rules,
    constants: &ConstantsOfLanes,
    places: &PlacesOfLanes,
    row: usize,
    before: &StateOfLanes,
    after: &mut StateOfLanes,
) {
    for k in 0..LANES {
        let moved = advance(simulation, rules.is_pair, &constants.at(k), &before.at(k), &places.at(row, k));
        after.set_moved(k, &moved.state, rules);
    }
}
