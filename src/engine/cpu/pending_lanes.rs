//! Pending lanes in the layout of a batch. A case is written once for all its headways; free slots take its rows one by
//! one.

use lanesweep_model::driver::DriverModel;

use crate::cpu::LANES;
use crate::cpu::batch_arrays::{LaneArrays, NEVER_LEAVES, Slots, VehicleTracks, Words, steady_from};
use crate::cpu::lead_only::lead_only_from;
use crate::frame::{Simulation, Start};
use crate::lane_case::LaneCase;
use crate::lane_step::{LaneConstants, LaneState};

/// Maximum number of pending lanes: 29 KiB with one other vehicle for verdicts, 60 KiB with all fields, padding
/// included.
pub(crate) const MAX_PENDING: usize = 256;

/// Capacity with padding: cases are written, and lanes are read, for [`LANES`] lanes at once.
pub(crate) const ROOM: usize = MAX_PENDING + LANES;

/// The lanes of a stream: every case with every start, all starts of a case in sequence.
#[derive(Clone, Copy)]
pub(crate) struct Lanes<'c> {
    /// Its cases.
    pub cases: &'c [LaneCase<f32>],
    /// Their motions, unrolled.
    pub tracks: &'c [[VehicleTracks; 2]],
    /// The headways.
    pub starts: &'c [Start<f32>],
    /// Each case has only the start with its own index, instead of all starts.
    pub one_start_each: bool,
    /// Every step is made with all vehicles; no lane moves to another stage.
    pub every_step: bool,
    /// A step of one of its lanes [may cross](crate::scene::may_cross) another vehicle.
    pub may_cross: bool,
}

impl<'c> Lanes<'c> {
    /// The starts of a case.
    #[inline(always)]
    fn starts_of(&self, case: usize) -> &'c [Start<f32>] {
        if self.one_start_each { &self.starts[case..=case] } else { self.starts }
    }
}

/// Lanes pending for one stage: the next lanes of a stream, and those moved here from another stage.
pub(crate) struct Pending {
    lanes: Box<LaneArrays<ROOM>>,
    /// The sweep returns values, not only verdicts.
    values: bool,
    /// Lanes with a single vehicle are tested for steady following.
    asks_steady: bool,
    /// The first pending lane.
    first: usize,
    /// One past the last pending lane.
    end: usize,
    /// Index of the next case, and of its next start.
    case: usize,
    start: usize,
    /// Index of the next lane within the stream.
    lane: u32,
}

impl Pending {
    /// State at the start of a stream.
    pub(super) fn new(values: bool, asks_steady: bool) -> Self {
        Pending {
            lanes: Box::new(LaneArrays::idle()),
            values,
            asks_steady,
            first: 0,
            end: 0,
            case: 0,
            start: 0,
            lane: 0,
        }
    }

    /// Number of pending lanes.
    #[inline(always)]
    pub(super) fn count(&self) -> usize {
        self.end - self.first
    }

    /// Takes the next lanes; returns the place of the first.
    #[inline(always)]
    pub(super) fn take(&mut self, count: usize) -> usize {
        let from = self.first;
        self.first += count;
        from
    }

    /// All lanes, pending lanes included.
    #[inline(always)]
    pub(super) fn lanes(&self) -> &LaneArrays<ROOM> {
        &self.lanes
    }

    /// Ensures that at least this many lanes are pending, if the stream has more.
    ///
    /// `sets_apart`: the series, if lanes that continue with the second vehicle only move out.
    #[inline]
    pub(super) fn have<M: DriverModel<f32>>(
        &mut self,
        min_count: usize,
        simulation: &Simulation<f32, M>,
        stream: &Lanes<'_>,
        sets_apart: Option<&[f32]>,
    ) {
        if self.count() >= min_count || self.case == stream.cases.len() {
            return;
        }
        self.close_up(simulation.scene.is_pair);
        while self.end < MAX_PENDING && self.case < stream.cases.len() {
            self.add(simulation, stream, sets_apart);
        }
    }

    /// Number of lanes that still fit.
    #[inline(always)]
    pub(super) fn has_room(&self, count: usize) -> bool {
        self.count() + count <= MAX_PENDING
    }

    /// Adds a lane that continues with the second vehicle only.
    pub(super) fn add_lead_only(&mut self, lanes: &LaneArrays<LANES>, k: usize) {
        let leaves_from = if self.asks_steady { lanes.steady_from(k, 1) + 1 } else { NEVER_LEAVES };
        self.add_single(lanes, k, 1, leaves_from);
    }

    /// Adds a lane with a single vehicle, unchanged.
    pub(super) fn add_lane(&mut self, lanes: &LaneArrays<LANES>, k: usize, leaves_from: u32) {
        self.add_single(lanes, k, 0, leaves_from);
    }

    fn add_single(&mut self, lanes: &LaneArrays<LANES>, k: usize, vehicle: usize, leaves_from: u32) {
        if self.end == MAX_PENDING {
            self.close_up(false);
        }
        self.lanes.set_single(self.end, lanes, k, vehicle, leaves_from);
        self.end += 1;
    }

    /// Moves the pending lanes to the front.
    fn close_up(&mut self, is_pair: bool) {
        for part in self.lanes.parts_mut(is_pair, self.values, self.values) {
            for row in part {
                row.copy_within(self.first..self.end, 0);
            }
        }
        (self.first, self.end) = (0, self.end - self.first);
    }

    /// Adds lanes of the next case.
    fn add<M: DriverModel<f32>>(
        &mut self,
        simulation: &Simulation<f32, M>,
        stream: &Lanes<'_>,
        sets_apart: Option<&[f32]>,
    ) {
        let case = &stream.cases[self.case];
        let tracks = &stream.tracks[self.case];
        let constants = LaneConstants::new(simulation, case);
        let leaves_from = match sets_apart {
            Some(entries) => lead_only_from(simulation, &constants, tracks, entries),
            None if self.asks_steady => steady_from(tracks) + 1,
            None => NEVER_LEAVES,
        };
        let all = stream.starts_of(self.case);
        let starts = &all[self.start..];
        let starts = &starts[..starts.len().min(MAX_PENDING - self.end)];
        for starts in starts.chunks(LANES) {
            let state = LaneState::new(simulation, case, starts[0]);
            let lane = LaneArrays::of::<M>(&constants, tracks, &state, leaves_from);
            self.lanes.fill(self.end, &lane, simulation.scene.is_pair, self.values);
            for &start in starts {
                self.lanes.start(self.end, self.lane, LaneState::new(simulation, case, start).gaps);
                self.end += 1;
                self.lane += 1;
            }
        }
        self.start += starts.len();
        if self.start == all.len() {
            (self.start, self.case) = (0, self.case + 1);
        }
    }
}

/// Gives the slots, in their order, the entries of every row from a place on: one by one, on every machine.
#[inline(always)]
pub(crate) fn take(rows: &mut [Words], pending: &[[u32; ROOM]], from: usize, slots: Slots) {
    for (row, pending) in rows.iter_mut().zip(pending) {
        let (mut left, mut from) = (slots, from);
        while left != 0 {
            row[left.trailing_zeros() as usize] = pending[from];
            left &= left - 1;
            from += 1;
        }
    }
}
