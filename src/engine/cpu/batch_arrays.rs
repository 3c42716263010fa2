//! Lanes in parallel: the types of [`crate::lane_step`] as arrays over `N` lanes.

// Arrays of words are cast to rows of words.
#![allow(unsafe_code)]

use bytemuck::{Pod, Zeroable};

use crate::cpu::LANES;
use crate::cpu::shared_rules::Rules;
use crate::lane_step::{LaneConstants, LaneState, OtherConstants, Record};
use crate::outcome::NO_STEP;
use lanesweep_model::criterion::{BrakeThreatMaximum, Measures, TtcMinimum};
use lanesweep_model::driver::{DriverModel, DriverState};
use lanesweep_model::scalar::Flag;

/// Marks a lane that never leaves its batch.
pub(crate) const NEVER_LEAVES: u32 = Flag::LATEST_STEP;

/// Slots of a batch: one bit each.
pub(crate) type Slots = u16;

/// Parts of [`LaneArrays`].
const PARTS: usize = 7;

/// One number per lane.
pub(crate) type Floats = [f32; LANES];
/// One word per lane.
pub(crate) type Words = [u32; LANES];

/// One series in the pool of `series.rs`; it is constant from its last entry on.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Track {
    /// Its first entry.
    pub first: u32,
    /// Offset of the last entry from the first.
    pub last: u32,
}

/// Series of another vehicle's speed, m/s, lateral position, m, and lateral speed towards the ego, m/s.
pub(crate) type VehicleTracks = [Track; 3];

/// All data of `N` lanes except the other vehicles' motions, which are in series.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct LaneArrays<const N: usize> {
    pub fixed: FixedArrays<N>,
    pub state: StateArrays<N>,
}

/// [`LaneConstants`] as arrays, and the positions of the other vehicles' series.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct FixedArrays<const N: usize> {
    pub ego: EgoArrays<N>,
    pub others: [OtherArrays<N>; 2],
}

/// Constants of the lanes that do not belong to another vehicle.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub(crate) struct EgoArrays<const N: usize> {
    /// Index of the lane within the stream.
    pub lane: [u32; N],
    width: [f32; N],
    marking_gap: [f32; N],
    pub horizon: [u32; N],
    /// No search for quiescent steps before this step.
    pub eventful_until: [u32; N],
    /// From this step on the lane may be quiescent: the other vehicles keep speed and lateral position.
    pub still_from: [u32; N],
    /// From this step on the lane may move to another stage.
    pub leaves_from: [u32; N],
}

/// Constants of another vehicle.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub(crate) struct OtherArrays<const N: usize> {
    half_lengths: [f32; N],
    half_widths: [f32; N],
    present_from: [u32; N],
    present_until: [u32; N],
    attend_from: [u32; N],
    judged: [u32; N],
    /// Speed, lateral position and lateral speed of the vehicle.
    pub tracks: [TrackArrays<N>; 3],
}

/// Positions of the series of one quantity.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub(crate) struct TrackArrays<const N: usize> {
    /// Index of the first entry.
    pub first: [u32; N],
    /// Offset of the last entry from the first.
    pub last: [u32; N],
}

/// [`LaneState`] as arrays.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct StateArrays<const N: usize> {
    pub moving: MovingArrays<N>,
    pub ahead: AheadArrays<N>,
    pub values: ValueArrays<N>,
    pub measures: MeasureArrays<N>,
}

/// Fields that every step changes.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub(crate) struct MovingArrays<const N: usize> {
    pub index: [u32; N],
    pub v_ego: [f32; N],
    pub v_before: [f32; N],
    pub gap: [f32; N],
    deceleration: [f32; N],
    delay_steps: [u32; N],
    ttc_failed: [u32; N],
    btn_failed: [u32; N],
    pub over: [u32; N],
}

/// Fields that a step changes if there is a second vehicle.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub(crate) struct AheadArrays<const N: usize> {
    pub gap: [f32; N],
}

/// Fields that every step changes in a sweep that returns values.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub(crate) struct ValueArrays<const N: usize> {
    reaction_step: [u32; N],
    ttc_gap: [f32; N],
    ttc_closing: [f32; N],
    btn_numerator: [f32; N],
    btn_denominator: [f32; N],
    min_gap: [f32; N],
}

/// Fields of [`Measures`].
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub(crate) struct MeasureArrays<const N: usize> {
    thw_gap: [f32; N],
    thw_speed: [f32; N],
    drac_numerator: [f32; N],
    drac_denominator: [f32; N],
    tet_steps: [u32; N],
    tit_sum: [f32; N],
    pet_begun: [u32; N],
    pet_distance: [f32; N],
    pet_speed: [f32; N],
    pet_steps: [u32; N],
}

macro_rules! made_of_rows {
    ($($arrays:ident)+) => {
        $(
            // SAFETY: arrays of binary32 or 32-bit words; all zeros are valid for both.
            unsafe impl<const N: usize> Zeroable for $arrays<N> {}
            // SAFETY: as above; all entries have size and alignment 4, so there is no padding.
            unsafe impl<const N: usize> Pod for $arrays<N> {}
            impl<const N: usize> Rows<N> for $arrays<N> {}
        )+
    };
}

made_of_rows! { EgoArrays OtherArrays TrackArrays MovingArrays AheadArrays ValueArrays MeasureArrays }

impl<const N: usize> LaneArrays<N> {
    /// No lanes: all slots are over.
    pub(super) fn idle() -> Self {
        let moving = MovingArrays { over: [Flag::TRUE.to_bits(); N], ..Zeroable::zeroed() };
        let (ahead, values, measures) = (Zeroable::zeroed(), Zeroable::zeroed(), Zeroable::zeroed());
        let state = StateArrays { moving, ahead, values, measures };
        LaneArrays { fixed: FixedArrays { ego: Zeroable::zeroed(), others: Zeroable::zeroed() }, state }
    }

    /// All rows that a stream with these properties needs, part by part.
    #[inline(always)]
    pub(super) fn parts(&self, is_pair: bool, values: bool, measures: bool) -> [&[[u32; N]]; PARTS] {
        let FixedArrays { ego, others: [principal, second] } = &self.fixed;
        let StateArrays { moving, ahead, values: gathered, measures: measured } = &self.state;
        let (second, ahead): (&[_], &[_]) = if is_pair { (second.rows(), ahead.rows()) } else { (&[], &[]) };
        let gathered: &[_] = if values { gathered.rows() } else { &[] };
        let measured: &[_] = if measures { measured.rows() } else { &[] };
        [ego.rows(), principal.rows(), second, moving.rows(), ahead, gathered, measured]
    }

    /// Mutable version of `parts`.
    #[inline(always)]
    pub(super) fn parts_mut(&mut self, is_pair: bool, values: bool, measures: bool) -> [&mut [[u32; N]]; PARTS] {
        let FixedArrays { ego, others: [principal, second] } = &mut self.fixed;
        let StateArrays { moving, ahead, values: gathered, measures: measured } = &mut self.state;
        let (second, ahead): (&mut [_], &mut [_]) =
            if is_pair { (second.rows_mut(), ahead.rows_mut()) } else { (&mut [], &mut []) };
        let gathered: &mut [_] = if values { gathered.rows_mut() } else { &mut [] };
        let measured: &mut [_] = if measures { measured.rows_mut() } else { &mut [] };
        [ego.rows_mut(), principal.rows_mut(), second, moving.rows_mut(), ahead, gathered, measured]
    }

    /// Writes one lane into [`LANES`] lanes of its case. Only their gaps and indices differ; [`LaneArrays::start`] sets these.
    #[inline(always)]
    pub(super) fn fill(&mut self, from: usize, lane: &LaneArrays<1>, is_pair: bool, values: bool) {
        for (part, words) in
            self.parts_mut(is_pair, values, values).into_iter().zip(lane.parts(is_pair, values, values))
        {
            for (row, [word]) in part.iter_mut().zip(words) {
                row[from..from + LANES].fill(*word);
            }
        }
    }

    /// Copies one lane of others to place `to`.
    #[inline]
    pub(super) fn copy_from<const M: usize>(&mut self, to: usize, lanes: &LaneArrays<M>, k: usize) {
        for (part, from) in self.parts_mut(true, true, true).into_iter().zip(lanes.parts(true, true, true)) {
            copy(part, to, from, k);
        }
    }

    /// Copies one of these lanes to place `to`, where it continues with one of its vehicles. For verdicts only.
    #[inline]
    pub(super) fn set_single(
        &mut self,
        to: usize,
        lanes: &LaneArrays<LANES>,
        k: usize,
        vehicle: usize,
        leaves_from: u32,
    ) {
        let (fixed, state) = (&lanes.fixed, &lanes.state);
        copy(self.fixed.ego.rows_mut(), to, fixed.ego.rows(), k);
        copy(self.fixed.others[0].rows_mut(), to, fixed.others[vehicle].rows(), k);
        copy(self.state.moving.rows_mut(), to, state.moving.rows(), k);
        self.fixed.ego.leaves_from[to] = leaves_from;
        if vehicle == 1 {
            self.state.moving.gap[to] = state.ahead.gap[k];
            let steady_from = lanes.steady_from(k, 1);
            (self.fixed.ego.eventful_until[to], self.fixed.ego.still_from[to]) = (steady_from, steady_from);
        }
    }

    /// The step from which on a vehicle keeps speed and lateral position.
    #[inline]
    pub(super) fn steady_from(&self, k: usize, vehicle: usize) -> u32 {
        let [speed, position, towards] = &self.fixed.others[vehicle].tracks;
        speed.last[k].max(position.last[k]).max(towards.last[k])
    }

    /// Sets the lane index of this slot, and its gaps to the other vehicles.
    #[inline(always)]
    pub(super) fn start(&mut self, k: usize, lane: u32, gaps: [f32; 2]) {
        self.fixed.ego.lane[k] = lane;
        self.state.moving.gap[k] = gaps[0];
        self.state.ahead.gap[k] = gaps[1];
    }
}

impl LaneArrays<1> {
    /// A lane before its first step.
    #[inline(always)]
    pub(super) fn of<M: DriverModel<f32>>(
        constants: &LaneConstants<f32>,
        tracks: &[VehicleTracks; 2],
        state: &LaneState<f32>,
        leaves_from: u32,
    ) -> Self {
        let other = |vehicle: usize| {
            let of = &constants.others[vehicle];
            OtherArrays {
                half_lengths: [of.half_lengths],
                half_widths: [of.half_widths],
                present_from: [of.present_from],
                present_until: [of.present_until],
                attend_from: [of.attend_from],
                judged: [of.judged.to_bits()],
                tracks: tracks[vehicle].map(|Track { first, last }| TrackArrays { first: [first], last: [last] }),
            }
        };
        let steady_from = [steady_from(tracks)];
        let ego = EgoArrays {
            lane: [0],
            width: [constants.ego_width],
            marking_gap: [constants.marking_gap],
            horizon: [constants.horizon],
            eventful_until: steady_from,
            still_from: steady_from,
            leaves_from: [leaves_from],
        };
        let mut lane = LaneArrays { fixed: FixedArrays { ego, others: [other(0), other(1)] }, ..LaneArrays::idle() };
        // Rules of two vehicles with all values: every row is written.
        lane.state.set::<M>(0, state, Rules::ALL[1]);
        lane
    }
}

impl<const N: usize> FixedArrays<N> {
    /// The constants of a lane.
    #[inline(always)]
    pub(super) fn at(&self, k: usize) -> LaneConstants<f32> {
        let other = |vehicle: usize| {
            let other = &self.others[vehicle];
            OtherConstants {
                half_lengths: other.half_lengths[k],
                half_widths: other.half_widths[k],
                present_from: other.present_from[k],
                present_until: other.present_until[k],
                attend_from: other.attend_from[k],
                judged: Flag::from_bits(other.judged[k]),
            }
        };
        LaneConstants {
            others: [other(0), other(1)],
            ego_width: self.ego.width[k],
            marking_gap: self.ego.marking_gap[k],
            horizon: self.ego.horizon[k],
        }
    }
}

/// The step from which on these vehicles keep speed and lateral position.
pub(crate) fn steady_from(tracks: &[VehicleTracks]) -> u32 {
    tracks.iter().flatten().map(|track| track.last).max().unwrap_or(0)
}

impl<const N: usize> StateArrays<N> {
    /// Sets the state of one lane.
    #[inline(always)]
    pub(super) fn at(&self, k: usize) -> LaneState<f32> {
        let StateArrays { moving, ahead, values, measures } = self;
        LaneState {
            index: moving.index[k],
            v_ego: moving.v_ego[k],
            v_before: moving.v_before[k],
            gaps: [moving.gap[k], ahead.gap[k]],
            driver: DriverState { deceleration: moving.deceleration[k], delay_steps: moving.delay_steps[k] },
            reaction_step: values.reaction_step[k],
            record: Record {
                ttc: TtcMinimum {
                    gap: values.ttc_gap[k],
                    closing: values.ttc_closing[k],
                    failed: Flag::from_bits(moving.ttc_failed[k]),
                },
                btn: BrakeThreatMaximum {
                    numerator: values.btn_numerator[k],
                    denominator: values.btn_denominator[k],
                    failed: Flag::from_bits(moving.btn_failed[k]),
                },
                min_gap: values.min_gap[k],
                measures: Measures {
                    thw_gap: measures.thw_gap[k],
                    thw_speed: measures.thw_speed[k],
                    drac_numerator: measures.drac_numerator[k],
                    drac_denominator: measures.drac_denominator[k],
                    tet_steps: measures.tet_steps[k],
                    tit_sum: measures.tit_sum[k],
                    pet_begun: Flag::from_bits(measures.pet_begun[k]),
                    pet_distance: measures.pet_distance[k],
                    pet_speed: measures.pet_speed[k],
                    pet_steps: measures.pet_steps[k],
                },
            },
            over: Flag::from_bits(moving.over[k]),
        }
    }

    /// State of a steadily following lane: the fields that its steps read. These steps are not the first, the reaction
    /// time is over, and no criterion is evaluated.
    #[inline(always)]
    pub(super) fn is_steady(&self, k: usize) -> LaneState<f32> {
        let moving = &self.moving;
        LaneState {
            index: 1,
            v_ego: moving.v_ego[k],
            v_before: moving.v_ego[k],
            gaps: [moving.gap[k]; 2],
            driver: DriverState { deceleration: moving.deceleration[k], delay_steps: 0 },
            reaction_step: NO_STEP,
            record: Record::new(),
            over: Flag::FALSE,
        }
    }

    /// Copies the fields that a steady-following step changes.
    #[inline(always)]
    pub(super) fn set_steady_following<M: DriverModel<f32>>(&mut self, k: usize, lane: &LaneState<f32>) {
        self.moving.v_ego[k] = lane.v_ego;
        self.moving.gap[k] = lane.gaps[0];
        if M::KEEPS_DECELERATION {
            self.moving.deceleration[k] = lane.driver.deceleration;
        }
    }

    /// Sets the rows that a step of a model changes under these rules.
    #[inline(always)]
    pub(super) fn set<M: DriverModel<f32>>(&mut self, k: usize, lane: &LaneState<f32>, rules: Rules) {
        let StateArrays { moving, ahead, values, measures: rows } = self;
        moving.index[k] = lane.index;
        moving.v_ego[k] = lane.v_ego;
        if M::SEES_OWN_ACCELERATION || !rules.is_verdict_only {
            moving.v_before[k] = lane.v_before;
        }
        moving.gap[k] = lane.gaps[0];
        if M::KEEPS_DECELERATION {
            moving.deceleration[k] = lane.driver.deceleration;
        }
        moving.delay_steps[k] = lane.driver.delay_steps;
        moving.ttc_failed[k] = lane.record.ttc.failed.to_bits();
        moving.btn_failed[k] = lane.record.btn.failed.to_bits();
        moving.over[k] = lane.over.to_bits();
        if rules.scene.is_pair {
            ahead.gap[k] = lane.gaps[1];
        }
        if rules.is_verdict_only {
            return;
        }
        values.reaction_step[k] = lane.reaction_step;
        values.ttc_gap[k] = lane.record.ttc.gap;
        values.ttc_closing[k] = lane.record.ttc.closing;
        values.btn_numerator[k] = lane.record.btn.numerator;
        values.btn_denominator[k] = lane.record.btn.denominator;
        values.min_gap[k] = lane.record.min_gap;
        if !rules.keeps_measures {
            return;
        }
        let measures = lane.record.measures;
        rows.thw_gap[k] = measures.thw_gap;
        rows.thw_speed[k] = measures.thw_speed;
        rows.drac_numerator[k] = measures.drac_numerator;
        rows.drac_denominator[k] = measures.drac_denominator;
        rows.tet_steps[k] = measures.tet_steps;
        rows.tit_sum[k] = measures.tit_sum;
        rows.pet_begun[k] = measures.pet_begun.to_bits();
        rows.pet_distance[k] = measures.pet_distance;
        rows.pet_speed[k] = measures.pet_speed;
        rows.pet_steps[k] = measures.pet_steps;
    }
}

/// A structure of arrays of `N` words each, accessible as rows.
trait Rows<const N: usize>: Pod {
    /// All rows.
    fn rows(&self) -> &[[u32; N]] {
        bytemuck::cast_slice(std::slice::from_ref(self))
    }

    /// All rows, mutable.
    fn rows_mut(&mut self) -> &mut [[u32; N]] {
        bytemuck::cast_slice_mut(std::slice::from_mut(self))
    }
}

/// Copies entry `k` of every row to place `to`.
#[inline(always)]
fn copy<const N: usize, const M: usize>(rows: &mut [[u32; N]], to: usize, from: &[[u32; M]], k: usize) {
    for (row, from) in rows.iter_mut().zip(from) {
        row[to] = from[k];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lanesweep_model::driver::Fsm;

    #[test]
    fn rows_lie_in_the_order_of_their_names() {
        let mut ego = EgoArrays::<4>::zeroed();
        ego.horizon[3] = 7;
        assert_eq!(ego.rows(), [[0; 4], [0; 4], [0; 4], [0, 0, 0, 7], [0; 4], [0; 4], [0; 4]]);
        let mut moving = MovingArrays::<4>::zeroed();
        moving.rows_mut().last_mut().unwrap()[1] = 5;
        assert_eq!(moving.over, [0, 5, 0, 0]);
    }

    /// Writing a lane into a slot, or its state after a step, reaches every row and can be read back.
    #[test]
    fn no_row_of_a_lane_is_forgotten() {
        let other = OtherConstants {
            half_lengths: 1.0,
            half_widths: 2.0,
            present_from: 3,
            present_until: 4,
            attend_from: 5,
            judged: Flag::TRUE,
        };
        let constants = LaneConstants { others: [other; 2], ego_width: 6.0, marking_gap: 8.0, horizon: 7 };
        let track = Track { first: 8, last: 9 };
        let tracks = [[track; 3]; 2];
        let record = Record {
            ttc: TtcMinimum { gap: 10.0, closing: 11.0, failed: Flag::TRUE },
            btn: BrakeThreatMaximum { numerator: 12.0, denominator: 13.0, failed: Flag::TRUE },
            min_gap: 14.0,
            measures: Measures {
                thw_gap: 41.0,
                thw_speed: 42.0,
                drac_numerator: 43.0,
                drac_denominator: 44.0,
                tet_steps: 45,
                tit_sum: 46.0,
                pet_begun: Flag::TRUE,
                pet_distance: 47.0,
                pet_speed: 48.0,
                pet_steps: 49,
            },
        };
        let state = LaneState {
            index: 15,
            v_ego: 16.0,
            v_before: 17.0,
            gaps: [18.0, 19.0],
            driver: DriverState { deceleration: 20.0, delay_steps: 21 },
            reaction_step: 22,
            record,
            over: Flag::TRUE,
        };
        let mut lanes = LaneArrays::<32>::idle();
        lanes.fill(16, &LaneArrays::of::<Fsm<f32>>(&constants, &tracks, &state, 24), true, true);
        lanes.start(31, 23, state.gaps);
        assert!(lanes.parts(true, true, true).into_iter().flatten().all(|row| row[31] != 0), "{lanes:?}");
        assert_eq!(lanes.state.at(31), state);

        // A lane that continues with the second vehicle has it first, with its gap.
        let mut batch = LaneArrays::<LANES>::idle();
        let second = Track { first: 31, last: 32 };
        let ahead = OtherConstants { half_lengths: 33.0, attend_from: 34, ..other };
        let pair = LaneConstants { others: [other, ahead], ..constants };
        batch.fill(0, &LaneArrays::of::<Fsm<f32>>(&pair, &[tracks[0], [second; 3]], &state, 24), true, false);
        batch.start(5, 23, state.gaps);
        let mut pending = LaneArrays::<32>::idle();
        pending.set_single(31, &batch, 5, 1, NEVER_LEAVES);
        let single = pending.fixed.at(31);
        assert_eq!((single.others[0].half_lengths, single.others[0].attend_from, single.horizon), (33.0, 34, 7));
        assert_eq!((pending.fixed.ego.lane[31], pending.fixed.ego.leaves_from[31]), (23, NEVER_LEAVES));
        assert!(pending.fixed.others[0].tracks.iter().all(|track| (track.first[31], track.last[31]) == (31, 32)));
        assert_eq!((pending.fixed.ego.eventful_until[31], pending.state.at(31).gaps[0]), (32, state.gaps[1]));
        assert!(pending.parts(false, false, false).into_iter().flatten().all(|row| row[31] != 0), "{pending:?}");

        // A lane that continues with its first vehicle keeps everything except the step at which it leaves.
        let mut pending = LaneArrays::<32>::idle();
        pending.set_single(31, &batch, 5, 0, 25);
        assert_eq!(pending.fixed.at(31).others[0].half_lengths, 1.0);
        assert_eq!((pending.fixed.ego.lane[31], pending.fixed.ego.leaves_from[31]), (23, 25));
        assert_eq!((pending.fixed.ego.eventful_until[31], pending.state.at(31).gaps[0]), (32, state.gaps[0]));
        assert!(pending.parts(false, false, false).into_iter().flatten().all(|row| row[31] != 0), "{pending:?}");

        let mut after: StateArrays<LANES> = LaneArrays::idle().state;
        let everything = Rules::ALL[1];
        after.set::<Fsm<f32>>(3, &state, everything);
        assert_eq!(after.at(3), state);
    }
}
