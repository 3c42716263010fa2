//! Many lanes side by side: the step of [`super::lane_step`] looped over arrays, which a compiler turns into
//! vector instructions. No second source of any model.
//!
//! A batch runs bursts of steps. Where a lane ends, its slot takes the next lane of the stream at once, so no
//! lane waits for another. Nothing here depends on the instruction set; [`super::simd`] chooses it.

use crate::criterion::{BtnForm, Criteria, LateralGate};
use crate::driver::DriverModel;
use crate::scenario::{LATERAL_SAMPLED, Motion, SPEED_SAMPLED, Tables};

use super::batch_arrays::{BURST, ConstantsOfLanes, LANES, PlacesOfLanes, StateOfLanes};
use super::frame::{Frame, Simulation, Start};
use super::instructions::Instructions;
use super::lane_case::LaneCase;
use super::lane_step::{LaneConstants, LaneState, Whereabouts, advance, conclude};
use super::outcome::Outcome;

/// What is known of a stream of lanes before it runs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stream {
    /// Instructions that it is to run on.
    pub instructions: Instructions,
    /// Some case has a second vehicle.
    pub is_pair: bool,
    /// Continuous values are wanted, not verdicts alone.
    pub values: bool,
}

/// What all lanes of a batch share and a loop need not ask: each set has its own loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Rules {
    is_pair: bool,
    is_ratio: bool,
    sees_overlap: bool,
    aborts: bool,
    /// Only verdicts are wanted: smallest and largest values are not gathered.
    is_verdict_only: bool,
}

impl Rules {
    /// Number of sets.
    pub(super) const SETS: u32 = 20;

    /// Of a simulation; `None` for the exact form of the BTN, which iterates and runs lane by lane.
    pub(super) fn of(frame: &Frame<f32>, criteria: &Criteria<f32>, stream: Stream) -> Option<Rules> {
        let Stream { is_pair, values, .. } = stream;
        let is_ratio = match criteria.btn.form() {
            BtnForm::EquivalentDelay => false,
            BtnForm::DistanceRatio => true,
            BtnForm::Exact => return None,
        };
        let sees_overlap = criteria.gate == LateralGate::Overlap;
        let aborts = frame.abort_above_ttc > 0.0;
        // Seldom used rules have no loop of their own for verdicts alone.
        Some(Rules { is_pair, is_ratio, sees_overlap, aborts, is_verdict_only: !values && !is_ratio && !aborts })
    }

    /// As a number below [`Rules::SETS`].
    pub(super) const fn bits(self) -> u32 {
        let seldom = if self.is_verdict_only { 4 } else { self.is_ratio as u32 | (self.aborts as u32) << 1 };
        self.is_pair as u32 | (self.sees_overlap as u32) << 1 | seldom << 2
    }

    const fn from_bits(bits: u32) -> Rules {
        let seldom = bits >> 2;
        Rules {
            is_pair: bits & 1 != 0,
            sees_overlap: bits & 2 != 0,
            is_ratio: seldom & 1 != 0,
            aborts: seldom & 2 != 0,
            is_verdict_only: seldom & 4 != 0,
        }
    }

    /// The constants with everything that these rules decide written as constants.
    #[inline(always)]
    fn applied(self, frame: &Frame<f32>, criteria: &Criteria<f32>) -> (Frame<f32>, Criteria<f32>) {
        let form = if self.is_ratio { BtnForm::DistanceRatio } else { BtnForm::EquivalentDelay };
        let gate = if self.sees_overlap { LateralGate::Overlap } else { LateralGate::EgoWidth };
        let abort_above_ttc = if self.aborts { frame.abort_above_ttc } else { 0.0 };
        // A batch takes lanes after their first step: from then on every gap moves.
        let frame = Frame { abort_above_ttc, start_shift: true, ..*frame };
        let keeps_values = !self.is_verdict_only;
        (frame, Criteria { gate, keeps_values, btn: criteria.btn.known_as(form), ..*criteria })
    }
}

/// The lanes in flight.
#[derive(Debug, Clone, Copy)]
pub(super) struct Batch {
    constants: ConstantsOfLanes,
    state: StateOfLanes,
    places: PlacesOfLanes,
}

/// Steps of all lanes of a batch from row `row` of the burst to `until`, or until one ends. Gives the next row.
#[inline(always)]
pub(super) fn burst<M: DriverModel<f32>, const RULES: u32>(
    simulation: &Simulation<f32, M>,
    batch: &mut Batch,
    row: usize,
    until: usize,
) -> usize {
    let rules = Rules::from_bits(RULES);
    let (frame, criteria) = rules.applied(simulation.frame, simulation.criteria);
    let model = *simulation.model;
    let simulation = &Simulation { frame: &frame, criteria: &criteria, model: &model, ..*simulation };
    let constants = batch.constants;
    let places = &batch.places;
    let mut state = batch.state;
    let mut row = row;
    let until = until.min(BURST);
    while row < until {
        let mut ended = 0;
        for k in 0..LANES {
            let moved = advance(simulation, rules.is_pair, &constants.at(k), &state.at(k), &places.at(row, k));
            state.set(k, &moved.state, moved.ended);
            ended |= u32::from(moved.ended);
        }
        row += 1;
        if ended != 0 {
            break;
        }
    }
    batch.state = state;
    row
}

/// A lane that waits for a slot.
#[derive(Clone, Copy)]
pub(super) struct Waiting<'c> {
    /// Its case.
    pub case: &'c LaneCase<f32>,
    /// Its headway.
    pub start: Start<f32>,
    /// Where its outcome belongs.
    pub at: usize,
}

/// A lane in a slot, beside the arrays.
struct Slot<'c> {
    waiting: Waiting<'c>,
    /// From this step on the other vehicles keep their speeds and lateral positions.
    steady_from: u32,
    /// The rows hold what it will see for ever.
    is_steady: bool,
}

/// Runs a stream of lanes of one model; `next` gives the lanes, `steps` is a [`burst`], `each` takes the outcomes,
/// in the order in which lanes end.
pub(super) fn run_stream<'c, M: DriverModel<f32>>(
    simulation: &Simulation<f32, M>,
    tables: &Tables<f32>,
    steps: impl Fn(&mut Batch, usize, usize) -> usize,
    mut next: impl FnMut() -> Option<Waiting<'c>>,
    mut each: impl FnMut(usize, Outcome<f32>),
) {
    let step_cap = simulation.frame.step_cap;
    let mut batch = Batch { constants: ConstantsOfLanes::IDLE, state: StateOfLanes::IDLE, places: PlacesOfLanes::IDLE };
    let mut slots: [Option<Slot>; LANES] = [const { None }; LANES];
    for (k, slot) in slots.iter_mut().enumerate() {
        *slot = admit(simulation, tables, &mut batch, k, &mut next, &mut each);
    }
    let mut row = BURST;
    while slots.iter().any(Option::is_some) {
        if row == BURST {
            row = 0;
            for (k, lane) in slots.iter_mut().enumerate() {
                if let Some(lane) = lane.as_mut().filter(|lane| !lane.is_steady) {
                    look_ahead(&mut batch, k, lane, tables, row);
                }
            }
        }
        // No lane steps beyond the cap, so no step asks for it.
        let oldest = batch.state.index.iter().fold(0, |a, &b| a.max(b));
        row = steps(&mut batch, row, row + step_cap.saturating_sub(oldest) as usize);
        for (k, slot) in slots.iter_mut().enumerate() {
            let Some(lane) = slot else {
                batch.state.index[k] = 0;
                continue;
            };
            if batch.state.ended[k] == 0 && batch.state.index[k] < step_cap {
                continue;
            }
            let places = batch.places.at(row - 1, k);
            let (constants, state) = (batch.constants.at(k), batch.state.at(k));
            let is_pair = lane.waiting.case.pair != 0;
            each(lane.waiting.at, conclude(simulation, is_pair, &constants, &state, &places));
            *slot = admit(simulation, tables, &mut batch, k, &mut next, &mut each);
            if let Some(lane) = slot {
                look_ahead(&mut batch, k, lane, tables, row);
            }
        }
    }
}

/// Puts the next lane that survives its first step into a slot; an empty slot idles.
#[inline(never)]
fn admit<'c, M: DriverModel<f32>>(
    simulation: &Simulation<f32, M>,
    tables: &Tables<f32>,
    batch: &mut Batch,
    k: usize,
    next: &mut impl FnMut() -> Option<Waiting<'c>>,
    each: &mut impl FnMut(usize, Outcome<f32>),
) -> Option<Slot<'c>> {
    while let Some(waiting) = next() {
        let case = waiting.case;
        let is_pair = case.pair != 0;
        let mut constants = LaneConstants::new(simulation, case);
        if !is_pair {
            // Among pairs it runs with a second vehicle that is never present.
            constants.others[1].present_until = 0;
        }
        let places = case.others.map(|other| Whereabouts::of(&other.motion, tables, 0));
        let start = LaneState::new(simulation, case, waiting.start);
        let moved = advance(simulation, is_pair, &constants, &start, &places);
        if moved.ended || moved.state.index >= simulation.frame.step_cap {
            each(waiting.at, conclude(simulation, is_pair, &constants, &moved.state, &places));
            continue;
        }
        batch.constants.set(k, &constants);
        batch.state.set(k, &moved.state, false);
        let steady_from = case.others.iter().map(|other| steady_from(&other.motion)).max().unwrap_or(0);
        return Some(Slot { waiting, steady_from, is_steady: false });
    }
    batch.constants.present_until[0][k] = 0;
    batch.constants.present_until[1][k] = 0;
    batch.constants.horizon[k] = u32::MAX;
    batch.state.index[k] = 0;
    None
}

/// First step from which on a motion changes no more.
fn steady_from(motion: &Motion<f32>) -> u32 {
    let speed = if motion.kind & SPEED_SAMPLED != 0 { motion.speed_len } else { motion.speed_until.saturating_add(1) };
    let lateral =
        if motion.kind & LATERAL_SAMPLED != 0 { motion.lateral_len } else { motion.lateral_until.saturating_add(1) };
    speed.max(lateral)
}

/// Decodes what the lane of a slot sees from `row` to the end of the burst.
#[inline(never)]
fn look_ahead(batch: &mut Batch, k: usize, lane: &mut Slot, tables: &Tables<f32>, row: usize) {
    let index = batch.state.index[k];
    let vehicles = if lane.waiting.case.pair != 0 { 2 } else { 1 };
    for (vehicle, other) in lane.waiting.case.others.iter().enumerate().take(vehicles) {
        batch.places.fill(vehicle, k, row, &other.motion, tables, index);
    }
    lane.is_steady = row == 0 && index >= lane.steady_from;
}
