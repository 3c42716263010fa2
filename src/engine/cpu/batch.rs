//! Many lanes in parallel: the step of [`crate::lane_step`] in a loop over arrays, which the compiler
//! vectorizes. The source code of the models is shared with single lanes.
//!
//! A burst is [`ROWS`] steps of [`BATCHES`] batches in turn. Each step of a batch depends on the previous one, but
//! batches are independent, which hides the latency of the instructions. A finished lane stays unchanged until the
//! burst ends. A lane in steady following continues to its end, which changes no verdict. `cpu/simd.rs`
//! selects the instruction set; nothing here depends on it.

use crate::cpu::batch_arrays::{FixedArrays, Floats, LaneArrays, Slots, StateArrays, TrackArrays, Words};
use crate::cpu::fast_forward::quiescent_steps;
use crate::cpu::pending_lanes::{Lanes, Pending, ROOM};
use crate::cpu::series::Window;
use crate::cpu::shared_rules::Rules;
use crate::cpu::steady_following::steady_steps;
use crate::cpu::{LANES, ROWS};
use crate::frame::Simulation;
use crate::lane_step::{LaneConstants, LaneState, OtherState, advance};
use lanesweep_model::driver::DriverModel;
use lanesweep_model::scalar::{Flag, Real};

/// Batches of a burst.
pub(crate) const BATCHES: usize = 3;

/// Minimum number of steps before a lane that did not qualify is examined again. For quiescent steps the wait also
/// grows with the number of steps already made.
const LOOK_AGAIN: u32 = 4 * ROWS as u32;
const LOOK_AGAIN_DIVISOR: u32 = 4;

/// Fewer steady-following steps are cheaper without moving the lane to another stage.
const MIN_STEADY_STEPS: u32 = 6 * ROWS as u32;

/// The batches in flight, and the series that their lanes read.
pub(crate) struct Fleet<'c> {
    pub batches: [Batch; BATCHES],
    entries: &'c [f32],
}

/// [`LANES`] lanes in flight.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Batch {
    lanes: LaneArrays<LANES>,
    /// The steps alternate between these two buffers (ping-pong), so that a vector is never stored in parts.
    after: StateArrays<LANES>,
    windows: [[Window; 3]; 2],
    /// Steps of the first row.
    from: Words,
    /// Slots that no lane uses.
    pub free: Slots,
    /// Slots whose lane has made its last step in this burst.
    pub finished: Slots,
    /// Slots whose lane may be quiescent: the other vehicles' motions have ended and the ego kept its speed.
    pub quiescent: Slots,
    /// Slots whose lane may move to another stage.
    pub leaving: Slots,
    /// Speeds of the egos at the first row, and the gaps before it.
    speeds: Floats,
    gaps: Floats,
}

impl<'c> Fleet<'c> {
    /// All slots are free. `vehicles` are the other vehicles that the batches evaluate.
    pub(super) fn new(stream: &Lanes<'_>, entries: &'c [f32], vehicles: [usize; 2]) -> Self {
        let window = |vehicle: usize, quantity: usize| {
            Window::new(stream.tracks.iter().map(|tracks| tracks[vehicle][quantity]), entries)
        };
        let windows = vehicles.map(|vehicle| [0, 1, 2].map(|quantity| window(vehicle, quantity)));
        let lanes = LaneArrays::idle();
        let batch = Batch {
            lanes,
            after: lanes.state,
            windows,
            from: [0; LANES],
            free: !0,
            finished: 0,
            quiescent: 0,
            leaving: 0,
            speeds: [0.0; LANES],
            gaps: [0.0; LANES],
        };
        Fleet { batches: [batch; BATCHES], entries }
    }
}

impl Batch {
    /// Index of the slot's lane within the stream.
    #[inline(always)]
    pub(super) fn lane(&self, k: usize) -> u32 {
        self.lanes.fixed.ego.lane[k]
    }

    /// A lane after its last step, and the other vehicles at that step.
    #[inline(always)]
    pub(super) fn last_step(&self, k: usize) -> (LaneConstants<f32>, LaneState<f32>, [OtherState<f32>; 2]) {
        let state = self.lanes.state.at(k);
        let row = (state.index - 1 - self.from[k]) as usize;
        (self.lanes.fixed.at(k), state, places(&self.windows, row, k))
    }

    /// A free slot keeps values at a step that delays no other slot.
    #[inline(always)]
    fn clear_free(&mut self) {
        let mut left = self.free;
        while left != 0 {
            self.lanes.state.moving.index[left.trailing_zeros() as usize] = 0;
            left &= left - 1;
        }
    }

    /// Used slots whose lane is over or has reached the step cap.
    #[inline(always)]
    fn find_finished(&mut self, step_cap: u32) {
        let moving = &self.lanes.state.moving;
        let ego = &self.lanes.fixed.ego;
        let (mut finished, mut quiescent, mut leaving) = (0, 0, 0);
        for k in 0..LANES {
            let is_finished = Flag::from_bits(moving.over[k]) | Flag::of(moving.index[k] >= step_cap);
            finished |= u16::from(is_finished.holds()) << k;
            let index = moving.index[k];
            let is_worth_a_look = index > ego.eventful_until[k];
            let is_still = index > ego.still_from[k] && moving.gap[k] == self.gaps[k];
            quiescent |= u16::from(moving.v_ego[k] == self.speeds[k] && (is_worth_a_look || is_still)) << k;
            leaving |= u16::from(index >= ego.leaves_from[k]) << k;
        }
        self.finished = finished & !self.free;
        self.quiescent = quiescent & !finished & !self.free;
        self.leaving = leaving & !finished & !self.free;
    }

    /// Restores the slots after a steady-following burst, which moved only the fields of
    /// [`StateArrays::set_steady_following`].
    #[inline(always)]
    fn end_steady_following(&mut self) {
        let LaneArrays { fixed, state } = &mut self.lanes;
        let moving = &mut state.moving;
        // The state before the last step is still in the buffer that the step read.
        moving.v_before = self.after.moving.v_ego;
        for k in 0..LANES {
            let last = moving.index[k] + ROWS as u32 - 1;
            moving.index[k] = last + 1;
            // The first such step ended the lane, and no verdict has changed since. A lane at standstill is settled as
            // well, because no leader in steady following drives backwards.
            let settled = !(moving.v_before[k] - self.windows[0][0].rows[ROWS - 1][k]).is_positive();
            moving.over[k] = (Flag::reached(last, fixed.ego.horizon[k]) & settled).to_bits();
        }
    }

    /// Skips quiescent steps of a lane where that pays; otherwise examines the lane again later.
    pub(super) fn jump_ahead<M: DriverModel<f32>>(&mut self, simulation: &Simulation<f32, M>, k: usize) {
        let (constants, state, places) = self.last_step(k);
        let LaneArrays { fixed, state: arrays } = &mut self.lanes;
        let eventful_until = &mut fixed.ego.eventful_until[k];
        match quiescent_steps(simulation, &constants, &state, &places) {
            Some(quiescent) => {
                arrays.moving.index[k] += quiescent.steps;
                arrays.moving.gap[k] = quiescent.gaps[0];
                arrays.ahead.gap[k] = quiescent.gaps[1];
                *eventful_until = arrays.moving.index[k];
            }
            None => {
                // A lane at standstill was examined only because it stands still; its regular examination may be due
                // later.
                if state.index > *eventful_until {
                    *eventful_until = state.index + LOOK_AGAIN.max(state.index / LOOK_AGAIN_DIVISOR);
                }
                fixed.ego.still_from[k] = state.index + LOOK_AGAIN;
            }
        }
    }

    /// Frees the slots whose lanes have finished.
    pub(super) fn free_finished(&mut self) {
        self.free |= self.finished;
    }

    /// Moves lanes out that continue with the second vehicle only.
    pub(super) fn set_apart_lead_only(&mut self, apart: &mut Pending) {
        while self.leaving != 0 && apart.has_room(1) {
            let k = self.leaving.trailing_zeros() as usize;
            self.leaving &= self.leaving - 1;
            apart.add_lead_only(&self.lanes, k);
            self.free |= 1 << k;
        }
    }

    /// Moves out lanes with enough steady-following steps; the others are examined again later.
    pub(super) fn set_apart_steady_following<M: DriverModel<f32>>(
        &mut self,
        simulation: &Simulation<f32, M>,
        apart: &mut Pending,
    ) {
        while self.leaving != 0 {
            let k = self.leaving.trailing_zeros() as usize;
            self.leaving &= self.leaving - 1;
            if self.lanes.state.moving.index[k] - self.from[k] > ROWS as u32 {
                // The lane jumped ahead to a step that this burst has not seen.
                continue;
            }
            let (constants, state, places) = self.last_step(k);
            let steps = steady_steps(simulation, &constants, &state, &places[0]);
            if steps < MIN_STEADY_STEPS {
                self.lanes.fixed.ego.leaves_from[k] = state.index + LOOK_AGAIN;
            } else if apart.has_room(1) {
                apart.add_lane(&self.lanes, k, state.index + steps - (ROWS as u32 - 1));
                self.free |= 1 << k;
            }
        }
    }

    /// Returns lanes whose steady-following steps are used up.
    pub(super) fn set_back<M: DriverModel<f32>>(&mut self, simulation: &Simulation<f32, M>, back: &mut Pending) {
        let ego = &self.lanes.fixed.ego;
        let mut used_up = 0;
        for k in 0..LANES {
            used_up |= u16::from(self.lanes.state.moving.index[k] >= ego.leaves_from[k]) << k;
        }
        used_up &= !self.free;
        while used_up != 0 {
            let k = used_up.trailing_zeros() as usize;
            used_up &= used_up - 1;
            let (constants, state) = (self.lanes.fixed.at(k), self.lanes.state.at(k));
            let steps = steady_steps(simulation, &constants, &state, &places(&self.windows, ROWS - 1, k)[0]);
            if steps < ROWS as u32 {
                back.add_lane(&self.lanes, k, state.index + LOOK_AGAIN);
                self.free |= 1 << k;
            } else {
                self.lanes.fixed.ego.leaves_from[k] = state.index + steps - (ROWS as u32 - 1);
            }
        }
    }
}

/// Makes the next steps of all lanes; pending lanes take the free slots. Each instruction set has its own `take`, which
/// gathers consecutive entries of every row for the free slots. Its own `turn` is [`Window::turn`].
#[inline(always)]
pub(crate) fn burst<M: DriverModel<f32>, const RULES: u32>(
    simulation: &Simulation<f32, M>,
    fleet: &mut Fleet<'_>,
    pending: &mut Pending,
    take: impl Fn(&mut [[u32; LANES]], &[[u32; ROOM]], usize, Slots),
    turn: impl Fn(&mut Window, &TrackArrays<LANES>, &Words, &[f32]),
) {
    let rules = const { Rules::ALL[RULES as usize] };
    let (frame, criteria) = rules.applied(simulation.frame, simulation.criteria);
    let model = *simulation.model;
    let simulation =
        &Simulation { frame: &frame, criteria: &criteria, model: &model, scene: rules.scene, ..*simulation };
    let Fleet { batches, entries } = fleet;
    let mut furthest = [0; LANES];
    for batch in batches.iter_mut() {
        let slots = lowest(batch.free, pending.count());
        if slots != 0 {
            let from = pending.take(slots.count_ones() as usize);
            let values = !rules.is_verdict_only;
            let pending = pending.lanes().parts(rules.scene.is_pair, values, rules.keeps_measures);
            for (rows, pending) in
                batch.lanes.parts_mut(rules.scene.is_pair, values, rules.keeps_measures).into_iter().zip(pending)
            {
                take(rows, pending, from, slots);
            }
            batch.free &= !slots;
        }
        batch.clear_free();
        batch.from = batch.lanes.state.moving.index;
        batch.speeds = batch.lanes.state.moving.v_ego;
        batch.gaps = batch.lanes.state.moving.gap;
        for (furthest, &index) in furthest.iter_mut().zip(&batch.from) {
            *furthest = index.max(*furthest);
        }
        let is_steady = rules.scene.is_steady;
        let is_seen = [true, !is_steady, M::SEES_LATERAL_SPEED && !is_steady];
        let Batch { lanes, windows, from, .. } = batch;
        for (windows, other) in windows.iter_mut().zip(&lanes.fixed.others).take(1 + usize::from(rules.scene.is_pair)) {
            for ((window, tracks), is_seen) in windows.iter_mut().zip(&other.tracks).zip(is_seen) {
                window.moves |= slots != 0 && !window.stands;
                if is_seen && window.moves {
                    turn(window, tracks, from, entries);
                }
            }
        }
    }
    // No lane steps beyond the cap, so no step tests for it; a steadily following lane is far from it.
    let left = frame.step_cap.max(1).saturating_sub(largest(furthest)) as usize;
    let rows = if rules.scene.is_steady { ROWS } else { left.min(ROWS) };
    for row in 0..rows {
        for batch in batches.iter_mut() {
            let Batch { lanes, after, windows, .. } = batch;
            if row % 2 == 0 {
                step(simulation, rules, &lanes.fixed, windows, row, &lanes.state, after);
            } else {
                step(simulation, rules, &lanes.fixed, windows, row, after, &mut lanes.state);
            }
        }
    }
    for batch in batches.iter_mut() {
        if rows % 2 == 1 {
            batch.lanes.state = batch.after;
        }
        if rules.scene.is_steady {
            batch.end_steady_following();
        }
        batch.find_finished(frame.step_cap);
    }
}

/// One step of a batch.
#[inline(always)]
fn step<M: DriverModel<f32>>(
    simulation: &Simulation<f32, M>,
    rules: Rules,
    fixed: &FixedArrays<LANES>,
    windows: &[[Window; 3]; 2],
    row: usize,
    before: &StateArrays<LANES>,
    after: &mut StateArrays<LANES>,
) {
    for k in 0..LANES {
        if rules.scene.is_steady {
            let moved = advance(simulation, &fixed.at(k), &before.is_steady(k), &places(windows, row, k));
            after.set_steady_following::<M>(k, &moved.state);
        } else {
            let moved = advance(simulation, &fixed.at(k), &before.at(k), &places(windows, row, k));
            after.set::<M>(k, &moved.state, rules);
        }
    }
}

/// The other vehicles as a lane sees them at row `row`.
#[inline(always)]
fn places(windows: &[[Window; 3]; 2], row: usize, k: usize) -> [OtherState<f32>; 2] {
    let place = |vehicle: usize| {
        let [speed, position, towards] = &windows[vehicle];
        OtherState { speed: speed.rows[row][k], position: position.rows[row][k], towards: towards.rows[row][k] }
    };
    [place(0), place(1)]
}

/// The maximum, by halving, so that the compiler can vectorize it.
#[inline(always)]
fn largest(mut words: Words) -> u32 {
    let mut half = LANES / 2;
    while half > 0 {
        for k in 0..half {
            words[k] = words[k].max(words[k + half]);
        }
        half /= 2;
    }
    words[0]
}

/// The first `count` of these slots.
#[inline(always)]
fn lowest(slots: Slots, count: usize) -> Slots {
    let mut beyond = slots;
    for _ in 0..count.min(LANES) {
        beyond &= beyond.wrapping_sub(1);
    }
    slots & !beyond
}
