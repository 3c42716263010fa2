//! Many lanes side by side: the step of [`super::lane_step`] looped over arrays, which a compiler turns into
//! vector instructions. No second source of any model.
//!
//! A batch runs bursts of steps. Where a lane ends, its slot takes the next lane of the stream at once, so no
//! lane waits for another. Nothing here depends on the instruction set; [`super::simd`] chooses it.

use crate::criterion::{BrakeThreatMaximum, BtnForm, Criteria, LateralGate, TtcMinimum};
use crate::driver::{DriverModel, DriverState};
use crate::scenario::{LATERAL_SAMPLED, Motion, SPEED_SAMPLED, Tables};

use super::frame::{Frame, Simulation, Start};
use super::lane_case::LaneCase;
use super::lane_step::{LaneConstants, LaneState, OtherConstants, Place, Record, advance, conclude};
use super::outcome::Outcome;

/// Lanes of a batch: one AVX-512 register of binary32.
pub(super) const LANES: usize = 16;
/// Steps whose motions are decoded ahead.
const BURST: usize = 32;

type Floats = [f32; LANES];
type Words = [u32; LANES];

/// What all lanes of a batch share and a loop need not ask: each set has its own loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Rules {
    is_pair: bool,
    is_ratio: bool,
    sees_overlap: bool,
    aborts: bool,
}

impl Rules {
    /// Number of sets.
    pub(super) const SETS: u32 = 16;

    /// Of a simulation; `None` for the exact form of the BTN, which iterates and runs lane by lane.
    pub(super) fn of(frame: &Frame<f32>, criteria: &Criteria<f32>, is_pair: bool) -> Option<Rules> {
        let is_ratio = match criteria.btn.form() {
            BtnForm::EquivalentDelay => false,
            BtnForm::DistanceRatio => true,
            BtnForm::Exact => return None,
        };
        let sees_overlap = criteria.gate == LateralGate::Overlap;
        Some(Rules { is_pair, is_ratio, sees_overlap, aborts: frame.abort_above_ttc > 0.0 })
    }

    /// As a number below [`Rules::SETS`].
    pub(super) const fn bits(self) -> u32 {
        self.is_pair as u32 | (self.is_ratio as u32) << 1 | (self.sees_overlap as u32) << 2 | (self.aborts as u32) << 3
    }

    const fn from_bits(bits: u32) -> Rules {
        Rules { is_pair: bits & 1 != 0, is_ratio: bits & 2 != 0, sees_overlap: bits & 4 != 0, aborts: bits & 8 != 0 }
    }

    /// The constants with everything that these rules decide written as constants.
    #[inline(always)]
    fn applied(self, frame: &Frame<f32>, criteria: &Criteria<f32>) -> (Frame<f32>, Criteria<f32>) {
        let form = if self.is_ratio { BtnForm::DistanceRatio } else { BtnForm::EquivalentDelay };
        let gate = if self.sees_overlap { LateralGate::Overlap } else { LateralGate::EgoWidth };
        let abort_above_ttc = if self.aborts { frame.abort_above_ttc } else { 0.0 };
        // A batch takes lanes after their first step: from then on every gap moves.
        let frame = Frame { abort_above_ttc, start_shift: true, ..*frame };
        (frame, Criteria { gate, btn: criteria.btn.known_as(form), ..*criteria })
    }
}

/// [`LaneConstants`] as arrays.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
struct ConstantsOfLanes {
    half_lengths: [Floats; 2],
    half_widths: [Floats; 2],
    present_from: [Words; 2],
    present_until: [Words; 2],
    attend_from: [Words; 2],
    judged: [Words; 2],
    ego_width: Floats,
    horizon: Words,
}

impl ConstantsOfLanes {
    /// No vehicle is ever present, and nothing is ever over.
    const IDLE: Self = ConstantsOfLanes {
        half_lengths: [[0.0; LANES]; 2],
        half_widths: [[0.0; LANES]; 2],
        present_from: [[0; LANES]; 2],
        present_until: [[0; LANES]; 2],
        attend_from: [[u32::MAX; LANES]; 2],
        judged: [[0; LANES]; 2],
        ego_width: [0.0; LANES],
        horizon: [u32::MAX; LANES],
    };

    #[inline(always)]
    fn at(&self, k: usize) -> LaneConstants<f32> {
        let other = |vehicle: usize| OtherConstants {
            half_lengths: self.half_lengths[vehicle][k],
            half_widths: self.half_widths[vehicle][k],
            present_from: self.present_from[vehicle][k],
            present_until: self.present_until[vehicle][k],
            attend_from: self.attend_from[vehicle][k],
            judged: self.judged[vehicle][k],
        };
        LaneConstants { others: [other(0), other(1)], ego_width: self.ego_width[k], horizon: self.horizon[k] }
    }

    fn set(&mut self, k: usize, lane: &LaneConstants<f32>) {
        for (vehicle, other) in lane.others.iter().enumerate() {
            self.half_lengths[vehicle][k] = other.half_lengths;
            self.half_widths[vehicle][k] = other.half_widths;
            self.present_from[vehicle][k] = other.present_from;
            self.present_until[vehicle][k] = other.present_until;
            self.attend_from[vehicle][k] = other.attend_from;
            self.judged[vehicle][k] = other.judged;
        }
        self.ego_width[k] = lane.ego_width;
        self.horizon[k] = lane.horizon;
    }
}

/// [`LaneState`] as arrays.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
struct StateOfLanes {
    index: Words,
    v_ego: Floats,
    v_before: Floats,
    gaps: [Floats; 2],
    deceleration: Floats,
    delay_steps: Words,
    reaction_step: Words,
    ttc_gap: Floats,
    ttc_closing: Floats,
    ttc_failed: Words,
    btn_numerator: Floats,
    btn_denominator: Floats,
    btn_failed: Words,
    min_gap: Floats,
    /// 1 where the last step was the lane's last.
    ended: Words,
}

impl StateOfLanes {
    const IDLE: Self = StateOfLanes {
        index: [0; LANES],
        v_ego: [0.0; LANES],
        v_before: [0.0; LANES],
        gaps: [[0.0; LANES]; 2],
        deceleration: [0.0; LANES],
        delay_steps: [0; LANES],
        reaction_step: [0; LANES],
        ttc_gap: [0.0; LANES],
        ttc_closing: [0.0; LANES],
        ttc_failed: [0; LANES],
        btn_numerator: [0.0; LANES],
        btn_denominator: [0.0; LANES],
        btn_failed: [0; LANES],
        min_gap: [0.0; LANES],
        ended: [0; LANES],
    };

    #[inline(always)]
    fn at(&self, k: usize) -> LaneState<f32> {
        LaneState {
            index: self.index[k],
            v_ego: self.v_ego[k],
            v_before: self.v_before[k],
            gaps: [self.gaps[0][k], self.gaps[1][k]],
            driver: DriverState { deceleration: self.deceleration[k], delay_steps: self.delay_steps[k] },
            reaction_step: self.reaction_step[k],
            record: Record {
                ttc: TtcMinimum { gap: self.ttc_gap[k], closing: self.ttc_closing[k], failed: self.ttc_failed[k] != 0 },
                btn: BrakeThreatMaximum {
                    numerator: self.btn_numerator[k],
                    denominator: self.btn_denominator[k],
                    failed: self.btn_failed[k] != 0,
                },
                min_gap: self.min_gap[k],
            },
        }
    }

    #[inline(always)]
    fn set(&mut self, k: usize, lane: &LaneState<f32>, ended: bool) {
        self.index[k] = lane.index;
        self.v_ego[k] = lane.v_ego;
        self.v_before[k] = lane.v_before;
        self.gaps[0][k] = lane.gaps[0];
        self.gaps[1][k] = lane.gaps[1];
        self.deceleration[k] = lane.driver.deceleration;
        self.delay_steps[k] = lane.driver.delay_steps;
        self.reaction_step[k] = lane.reaction_step;
        self.ttc_gap[k] = lane.record.ttc.gap;
        self.ttc_closing[k] = lane.record.ttc.closing;
        self.ttc_failed[k] = u32::from(lane.record.ttc.failed);
        self.btn_numerator[k] = lane.record.btn.numerator;
        self.btn_denominator[k] = lane.record.btn.denominator;
        self.btn_failed[k] = u32::from(lane.record.btn.failed);
        self.min_gap[k] = lane.record.min_gap;
        self.ended[k] = u32::from(ended);
    }
}

/// The other vehicles of all lanes over the steps of a burst.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
struct PlacesOfLanes {
    speed: [[Floats; BURST]; 2],
    position: [[Floats; BURST]; 2],
    towards: [[Floats; BURST]; 2],
}

impl PlacesOfLanes {
    const IDLE: Self = PlacesOfLanes {
        speed: [[[0.0; LANES]; BURST]; 2],
        position: [[[0.0; LANES]; BURST]; 2],
        towards: [[[0.0; LANES]; BURST]; 2],
    };

    #[inline(always)]
    fn at(&self, row: usize, k: usize) -> [Place<f32>; 2] {
        let place = |vehicle: usize| Place {
            speed: self.speed[vehicle][row][k],
            position: self.position[vehicle][row][k],
            towards: self.towards[vehicle][row][k],
        };
        [place(0), place(1)]
    }

    /// Decodes a motion from a step on, into the rows from `row` on.
    fn fill(&mut self, vehicle: usize, k: usize, row: usize, motion: &Motion<f32>, tables: &Tables<f32>, step: u32) {
        for ahead in row..BURST {
            let place = Place::of(motion, tables, step + (ahead - row) as u32);
            self.speed[vehicle][ahead][k] = place.speed;
            self.position[vehicle][ahead][k] = place.position;
            self.towards[vehicle][ahead][k] = place.towards;
        }
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
        let places = case.others.map(|other| Place::of(&other.motion, tables, 0));
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
