//! Lanes of a driver outside the registry, side by side: all make the same step, then the driver decides for all. They lie
//! in blocks of [`LANES`] lanes; the last lane takes the place of one that ends, so the blocks stay full.

use rayon::prelude::*;

use crate::cpu::LANES;
use crate::cpu::batch_arrays::{Floats, LaneArrays, Slots, VehicleTracks, steady_from};
use crate::cpu::foreign::Unreacting;
use crate::cpu::lane_result::conclude;
use crate::cpu::shared_rules::Rules;
use crate::cpu::simd::{Beside, Instructions};
use crate::frame::{Frame, Simulation, Start};
use crate::lane_case::LaneCase;
use crate::lane_step::{LaneConstants, LaneState, OtherState, Seen, advance};
use crate::outcome::{NO_STEP, Outcome};
use lanesweep_model::driver::{DriverModel, LaneColumns, row};
use lanesweep_model::scalar::{Flag, Real};

/// Blocks that a thread steps at once.
const BLOCKS: usize = 64;

/// [`LANES`] lanes.
struct Block {
    lanes: LaneArrays<LANES>,
    /// The other vehicles at the present step: speed, lateral position, lateral speed.
    places: [[Floats; 3]; 2],
    /// First step from which on they keep all three.
    moves_until: u32,
    /// Lanes that made their last step.
    finished: Slots,
}

/// The rows of [`LaneColumns`] for some blocks.
type Rows<'c> = [&'c mut [f32]; row::COUNT];

/// One step of some blocks.
pub(crate) struct Turn<'c> {
    blocks: &'c mut [Block],
    rows: Rows<'c>,
    /// What the drivers decided at the step before.
    accelerations: &'c [f32],
    /// Series of the other vehicles.
    entries: &'c [f32],
    step: u32,
}

/// Lanes of a batch between two steps.
pub(crate) struct SideBySide<'c> {
    blocks: Vec<Block>,
    entries: &'c [f32],
    make_step: Beside,
    pub columns: LaneColumns,
    /// What the drivers decided at the last step, m/s²; an entry per lane, and more.
    pub accelerations: Vec<f32>,
}

impl<'c> SideBySide<'c> {
    /// Every case with every start, before the first step.
    pub(super) fn new(
        simulation: &Simulation<'_, f32, Unreacting>,
        cases: impl Iterator<Item = (&'c LaneCase<f32>, &'c [VehicleTracks; 2])>,
        entries: &'c [f32],
        starts: &[Start<f32>],
    ) -> Self {
        let mut blocks: Vec<Block> = Vec::new();
        let mut lanes = 0;
        for (case, tracks) in cases {
            let constants = LaneConstants::new(simulation, case);
            for &start in starts {
                let state = LaneState::new(simulation, case, start);
                if lanes % LANES == 0 {
                    let places = [[[0.0; LANES]; 3]; 2];
                    blocks.push(Block { lanes: LaneArrays::idle(), places, moves_until: 0, finished: 0 });
                }
                let block = &mut blocks[lanes / LANES];
                block.lanes.copy_from(lanes % LANES, &LaneArrays::of::<Unreacting>(&constants, tracks, &state, 0), 0);
                block.moves_until = block.moves_until.max(steady_from(tracks));
                lanes += 1;
            }
        }
        let rules =
            Rules::side_by_side(simulation.criteria, simulation.scene.is_pair, simulation.criteria.keeps_measures);
        let make_step = Beside::of(Instructions::best(), rules);
        let stride = blocks.len() * LANES;
        let columns = LaneColumns { lane: (0..lanes as i64).collect(), stride, ..LaneColumns::default() };
        SideBySide { accelerations: vec![0.0; stride], blocks, entries, make_step, columns }
    }

    /// Number of running lanes.
    pub(super) fn count(&self) -> usize {
        self.columns.lane.len()
    }

    /// Makes the next step with the drivers' last decisions.
    pub(super) fn step(&mut self, simulation: &Simulation<'_, f32, Unreacting>, step: u32) {
        let SideBySide { blocks, entries, make_step, columns, accelerations } = self;
        columns.step = step;
        columns.rows.resize(row::COUNT * columns.stride, 0.0);
        let mut rows: Vec<_> =
            columns.rows.chunks_mut(columns.stride).map(|row| row.chunks_mut(BLOCKS * LANES)).collect();
        let turns = blocks.chunks_mut(BLOCKS).zip(accelerations.chunks(BLOCKS * LANES));
        let mut turns: Vec<Turn<'_>> = turns
            .map(|(blocks, accelerations)| {
                let rows = std::array::from_fn(|row| rows[row].next().unwrap_or_default());
                Turn { blocks, rows, accelerations, entries, step }
            })
            .collect();
        turns.par_iter_mut().for_each(|turn| make_step.run(simulation, turn));
    }

    /// Takes out the lanes that made their last step, with the drivers' decisions; passes their positions and outcomes.
    pub(super) fn take_finished(
        &mut self,
        simulation: &Simulation<'_, f32, Unreacting>,
        mut each: impl FnMut(usize, Outcome<f32>),
    ) {
        for at in (0..self.blocks.len()).rev() {
            let mut finished = std::mem::take(&mut self.blocks[at].finished);
            while finished != 0 {
                let k = finished.ilog2() as usize;
                finished &= !(1 << k);
                let block = &self.blocks[at];
                let mut state = block.lanes.state.at(k);
                if self.accelerations[at * LANES + k] < 0.0 && state.reaction_step == NO_STEP {
                    state.reaction_step = state.index - 1;
                }
                let outcome = conclude(simulation, &block.lanes.fixed.at(k), &state, &places_of(&block.places, k));
                each(self.columns.lane[at * LANES + k] as usize, outcome);
                self.remove(at * LANES + k);
            }
        }
        let stride = self.count().div_ceil(LANES) * LANES;
        let columns = &mut self.columns;
        if stride != columns.stride && stride > 0 {
            self.blocks.truncate(stride / LANES);
            let rows = columns.state.len() / columns.stride;
            for row in 1..rows {
                columns.state.copy_within(row * columns.stride..row * columns.stride + stride, row * stride);
            }
            columns.state.truncate(rows * stride);
            columns.rows.truncate(row::COUNT * stride);
            columns.stride = stride;
        }
    }

    /// The last lane takes the place of this one.
    fn remove(&mut self, to: usize) {
        let last = self.count() - 1;
        let mut lane = LaneArrays::<1>::idle();
        if last != to {
            let from = &self.blocks[last / LANES];
            lane.copy_from(0, &from.lanes, last % LANES);
            let (moves_until, places) = (from.moves_until, from.places);
            let block = &mut self.blocks[to / LANES];
            block.lanes.copy_from(to % LANES, &lane, 0);
            block.moves_until = block.moves_until.max(moves_until);
            for (quantities, from) in block.places.iter_mut().flatten().zip(places.iter().flatten()) {
                quantities[to % LANES] = from[last % LANES];
            }
        }
        self.blocks[last / LANES].lanes.copy_from(last % LANES, &LaneArrays::<1>::idle(), 0);
        self.accelerations[to] = self.accelerations[last];
        self.columns.lane.swap_remove(to);
        self.columns.state.chunks_mut(self.columns.stride).for_each(|row| row[to] = row[last]);
    }
}

/// The other vehicles as a lane sees them.
#[inline(always)]
fn places_of(places: &[[Floats; 3]; 2], k: usize) -> [OtherState<f32>; 2] {
    let [[speed, position, towards], [speed_2, position_2, towards_2]] = places;
    [
        OtherState { speed: speed[k], position: position[k], towards: towards[k] },
        OtherState { speed: speed_2[k], position: position_2[k], towards: towards_2[k] },
    ]
}

impl Block {
    /// Moves the other vehicles to a step.
    #[inline(always)]
    fn move_others(&mut self, entries: &[f32], step: u32) {
        for (places, other) in self.places.iter_mut().zip(&self.lanes.fixed.others) {
            for (place, tracks) in places.iter_mut().zip(&other.tracks) {
                for k in 0..LANES {
                    place[k] = entries[(tracks.first[k] + step.min(tracks.last[k])) as usize];
                }
            }
        }
    }
}

/// The same with rules that are known when it is compiled.
#[inline(always)]
pub(crate) fn make_step_of<M: DriverModel<f32>, const RULES: u32>(
    simulation: &Simulation<'_, f32, M>,
    turn: &mut Turn<'_>,
) {
    let rules = const { Rules::ALL[RULES as usize] };
    let (frame, criteria) = rules.applied(simulation.frame, simulation.criteria);
    let simulation = &Simulation { frame: &frame, criteria: &criteria, scene: rules.scene, ..*simulation };
    make_step(simulation, rules, turn);
}

/// The same with any rules.
pub(crate) fn make_step_of_any<M: DriverModel<f32>>(simulation: &Simulation<'_, f32, M>, turn: &mut Turn<'_>) {
    // A set that keeps everything.
    make_step(simulation, Rules::ALL[1], turn);
}

/// One step of some blocks: applies what the drivers decided, moves, and writes what they see.
#[inline(always)]
fn make_step<M: DriverModel<f32>>(simulation: &Simulation<'_, f32, M>, rules: Rules, turn: &mut Turn<'_>) {
    let Turn { blocks, rows, accelerations, entries, step } = turn;
    let &Frame { dt, step_cap, .. } = simulation.frame;
    for (at, block) in blocks.iter_mut().enumerate() {
        let lanes = at * LANES..(at + 1) * LANES;
        if *step <= block.moves_until {
            block.move_others(entries, *step);
        }
        let mut decided: Floats = [0.0; LANES];
        decided.copy_from_slice(&accelerations[lanes.clone()]);
        let before = block.lanes.state;
        let mut seen = [[0.0; LANES]; row::COUNT];
        let mut finished = [0; LANES];
        for k in 0..LANES {
            let mut state = before.at(k);
            let is_first = Flag::of(decided[k] < 0.0) & Flag::of(state.reaction_step == NO_STEP);
            state.reaction_step = is_first.choose(step.wrapping_sub(1), state.reaction_step);
            state.v_ego = (state.v_ego + decided[k] * dt).larger(0.0);
            let constants = block.lanes.fixed.at(k);
            let moved = advance(simulation, &constants, &state, &places_of(&block.places, k));
            seen[row::EGO_SPEED][k] = moved.seen[0].view.v_ego;
            seen[row::EGO_ACCELERATION][k] = moved.seen[0].view.a_ego;
            let [first, second] = row::VEHICLES;
            show(&mut seen, k, first, &moved.seen[0], Flag::reached(*step, constants.others[0].attend_from));
            if simulation.scene.is_pair {
                show(&mut seen, k, second, &moved.seen[1], Flag::reached(*step, constants.others[1].attend_from));
            }
            let is_last = moved.state.over | Flag::reached(moved.state.index, step_cap);
            finished[k] = (!state.over & is_last).one();
            block.lanes.state.set::<M>(k, &moved.state, rules);
        }
        block.finished = (0..LANES).fold(0, |slots, k| slots | (finished[k] as Slots) << k);
        for (row, seen) in rows.iter_mut().zip(&seen) {
            row[lanes.clone()].copy_from_slice(seen);
        }
    }
}

/// Writes what a driver sees of another vehicle into the rows from `first` on.
#[inline(always)]
fn show(rows: &mut [Floats; row::COUNT], k: usize, first: usize, seen: &Seen<f32>, may_attend: Flag) {
    rows[first + row::PRESENT][k] = seen.present.choose(1.0, 0.0);
    rows[first + row::ATTENDED][k] = (seen.present & may_attend).choose(1.0, 0.0);
    rows[first + row::SPEED][k] = seen.view.v_other;
    rows[first + row::GAP][k] = seen.view.gap;
    rows[first + row::LATERAL_GAP][k] = seen.view.lateral_gap;
    rows[first + row::LATERAL_SPEED][k] = seen.view.lateral_towards;
    rows[first + row::HALF_LENGTHS][k] = seen.view.half_lengths;
}
