//! The arrays of a batch: what [`super::lane_step`] calls one lane, for [`LANES`] lanes side by side.

use crate::criterion::{BrakeThreatMaximum, TtcMinimum};
use crate::driver::DriverState;
use crate::flag::Flag;

use super::lane_step::{LaneConstants, LaneState, OtherConstants, Record, Whereabouts};
use super::rules::Rules;
use super::series::VehicleTracks;
use super::window::Window;

/// Lanes of a batch: one AVX-512 register of binary32.
pub(super) const LANES: usize = 16;
/// Steps of a burst: a square of lanes and rows is turned in registers.
pub(super) const ROWS: usize = 16;

/// One number per lane.
pub(super) type Floats = [f32; LANES];
/// One word per lane.
pub(super) type Words = [u32; LANES];

/// [`LaneConstants`] as arrays.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct ConstantsOfLanes {
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
    /// No vehicle is ever present.
    pub(super) const IDLE: Self = ConstantsOfLanes {
        half_lengths: [[0.0; LANES]; 2],
        half_widths: [[0.0; LANES]; 2],
        present_from: [[0; LANES]; 2],
        present_until: [[0; LANES]; 2],
        attend_from: [[0; LANES]; 2],
        judged: [[0; LANES]; 2],
        ego_width: [0.0; LANES],
        horizon: [0; LANES],
    };

    #[inline(always)]
    /// Of one lane.
    pub(super) fn at(&self, k: usize) -> LaneConstants<f32> {
        let other = |vehicle: usize| OtherConstants {
            half_lengths: self.half_lengths[vehicle][k],
            half_widths: self.half_widths[vehicle][k],
            present_from: self.present_from[vehicle][k],
            present_until: self.present_until[vehicle][k],
            attend_from: self.attend_from[vehicle][k],
            judged: Flag::from_bits(self.judged[vehicle][k]),
        };
        LaneConstants { others: [other(0), other(1)], ego_width: self.ego_width[k], horizon: self.horizon[k] }
    }

    #[inline(always)]
    pub(super) fn set(&mut self, k: usize, lane: &LaneConstants<f32>) {
        for (vehicle, other) in lane.others.iter().enumerate() {
            self.half_lengths[vehicle][k] = other.half_lengths;
            self.half_widths[vehicle][k] = other.half_widths;
            self.present_from[vehicle][k] = other.present_from;
            self.present_until[vehicle][k] = other.present_until;
            self.attend_from[vehicle][k] = other.attend_from;
            self.judged[vehicle][k] = other.judged.to_bits();
        }
        self.ego_width[k] = lane.ego_width;
        self.horizon[k] = lane.horizon;
    }
}

/// [`LaneState`] as arrays.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct StateOfLanes {
    pub(super) index: Words,
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
    pub(super) over: Words,
}

impl StateOfLanes {
    pub(super) const IDLE: Self = StateOfLanes {
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
        over: [u32::MAX; LANES],
    };

    #[inline(always)]
    pub(super) fn at(&self, k: usize) -> LaneState<f32> {
        LaneState {
            index: self.index[k],
            v_ego: self.v_ego[k],
            v_before: self.v_before[k],
            gaps: [self.gaps[0][k], self.gaps[1][k]],
            driver: DriverState { deceleration: self.deceleration[k], delay_steps: self.delay_steps[k] },
            reaction_step: self.reaction_step[k],
            record: Record {
                ttc: TtcMinimum {
                    gap: self.ttc_gap[k],
                    closing: self.ttc_closing[k],
                    failed: Flag::from_bits(self.ttc_failed[k]),
                },
                btn: BrakeThreatMaximum {
                    numerator: self.btn_numerator[k],
                    denominator: self.btn_denominator[k],
                    failed: Flag::from_bits(self.btn_failed[k]),
                },
                min_gap: self.min_gap[k],
            },
            over: Flag::from_bits(self.over[k]),
        }
    }

    /// All of a lane.
    #[inline(always)]
    pub(super) fn set(&mut self, k: usize, lane: &LaneState<f32>) {
        self.set_verdicts(k, lane);
        self.gaps[1][k] = lane.gaps[1];
        self.reaction_step[k] = lane.reaction_step;
        self.ttc_gap[k] = lane.record.ttc.gap;
        self.ttc_closing[k] = lane.record.ttc.closing;
        self.btn_numerator[k] = lane.record.btn.numerator;
        self.btn_denominator[k] = lane.record.btn.denominator;
        self.min_gap[k] = lane.record.min_gap;
    }

    /// What moves in a step under these rules.
    #[inline(always)]
    pub(super) fn set_moved(&mut self, k: usize, lane: &LaneState<f32>, rules: Rules) {
        if !rules.is_verdict_only {
            return self.set(k, lane);
        }
        self.set_verdicts(k, lane);
        if rules.is_pair {
            self.gaps[1][k] = lane.gaps[1];
        }
    }

    #[inline(always)]
    fn set_verdicts(&mut self, k: usize, lane: &LaneState<f32>) {
        self.index[k] = lane.index;
        self.v_ego[k] = lane.v_ego;
        self.v_before[k] = lane.v_before;
        self.gaps[0][k] = lane.gaps[0];
        self.deceleration[k] = lane.driver.deceleration;
        self.delay_steps[k] = lane.driver.delay_steps;
        self.ttc_failed[k] = lane.record.ttc.failed.to_bits();
        self.btn_failed[k] = lane.record.btn.failed.to_bits();
        self.over[k] = lane.over.to_bits();
    }
}

/// The other vehicles of all lanes over the steps of a burst.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct PlacesOfLanes {
    speed: [Window; 2],
    position: [Window; 2],
    towards: [Window; 2],
}

impl PlacesOfLanes {
    pub(super) const IDLE: Self =
        PlacesOfLanes { speed: [Window::IDLE; 2], position: [Window::IDLE; 2], towards: [Window::IDLE; 2] };

    #[inline(always)]
    pub(super) fn at(&self, row: usize, k: usize) -> [Whereabouts<f32>; 2] {
        let place = |vehicle: usize| Whereabouts {
            speed: self.speed[vehicle].rows[row][k],
            position: self.position[vehicle].rows[row][k],
            towards: self.towards[vehicle].rows[row][k],
        };
        [place(0), place(1)]
    }

    /// Gives a slot the series of its next lane.
    #[inline(always)]
    pub(super) fn set(&mut self, k: usize, tracks: &[VehicleTracks; 2], entries: &[f32], vehicles: usize) {
        for (vehicle, tracks) in tracks.iter().enumerate().take(vehicles) {
            self.speed[vehicle].set(k, tracks.speed, entries);
            self.position[vehicle].set(k, tracks.position, entries);
            self.towards[vehicle].set(k, tracks.towards, entries);
        }
    }

    /// The windows of a vehicle: speed, lateral position, lateral speed.
    #[inline(always)]
    pub(super) fn windows(&mut self, vehicle: usize) -> [&mut Window; 3] {
        [&mut self.speed[vehicle], &mut self.position[vehicle], &mut self.towards[vehicle]]
    }
}
