//! Meaning of a point's numbers, as one flat record that host and device share. Twin: `Recipe` in
//! `shaders/shared/recipe.wgsl`.

// The record may be cast to bytes because it is `repr(C)` with 32-bit fields only and no padding; its sizes are checked
// at compile time below.
#![allow(unsafe_code)]

use bytemuck::{Pod, Zeroable};

use crate::lane_case::{LaneCase, LaneOther};
use lanesweep_model::driver::{AttentionRule, MODELS};
use lanesweep_model::scalar::Real;
use lanesweep_model::scenario::Category;
use lanesweep_model::scenario::parameterization::{LaneChange, Parameterization, SpeedProfile, Variable};

use super::points::MAX_PARAMETERS;

/// A variable that no parameter gives.
pub const NO_SLOT: u32 = u32::MAX;

/// How speeds and lateral positions follow from a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum CasePath {
    /// Constant speeds and accelerations.
    Kinematic,
    /// LVD ii: half a cosine.
    Sinusoid,
    /// Coefficients of a decomposition.
    Reduced,
}

impl CasePath {
    /// The path of a parameterization.
    pub fn of(id: &Parameterization) -> CasePath {
        match id.features().map(|features| features.speed) {
            None => CasePath::Reduced,
            Some(SpeedProfile::Sinusoidal) => CasePath::Sinusoid,
            Some(SpeedProfile::Constant | SpeedProfile::ConstantAcceleration) => CasePath::Kinematic,
        }
    }
}

/// Lateral motion of the principal vehicle on kinematic paths.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum LateralPath {
    /// In the middle of the ego's lane.
    Centred,
    /// From the side into the ego's lane at constant lateral speed.
    Entering,
    /// Out of the ego's lane at constant lateral speed.
    Leaving,
    /// Beside the ego's lane from the start.
    Gone,
}

impl LateralPath {
    /// The lateral path of a parameterization; unused on reduced paths.
    pub fn of(id: &Parameterization) -> LateralPath {
        let is_gradual = id.features().is_some_and(|features| features.lane_change == LaneChange::Gradual);
        match (id.category, is_gradual) {
            (Category::CutIn, true) => LateralPath::Entering,
            (Category::CutOut, true) => LateralPath::Leaving,
            (Category::CutOut, false) => LateralPath::Gone,
            (Category::CutIn | Category::Lvd, _) => LateralPath::Centred,
        }
    }
}

/// Columns of a reduction's vector.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ReducedColumns {
    /// Total number of columns of the vector.
    pub width: u32,
    /// Instants per series, at least 2.
    pub instants: u32,
    /// Coefficients.
    pub coefficients: u32,
    /// First column of the lateral series; [`NO_SLOT`] in LVD.
    pub lateral: u32,
    /// First column of the target's speed.
    pub speed: u32,
    /// First column of the speed ahead; [`NO_SLOT`] except in cut-outs.
    pub lead_speed: u32,
    /// Column of the ego's speed; LVD: first column of the leader's.
    pub ego_speed: u32,
    /// Column of D; [`NO_SLOT`] except in cut-outs.
    pub lead_gap: u32,
    /// Column of T.
    pub duration: u32,
}

/// Maximum number of bounded columns of a reconstruction.
pub const MAX_BOUNDS: usize = 8;

/// A column of a reconstruction that makes a draw invalid if it is out of range.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ColumnBound {
    /// The column.
    pub column: u32,
    /// 1 if its absolute value is bounded.
    pub is_distance: u32,
    /// Minimum valid value.
    pub lower: f32,
    /// Maximum valid value.
    pub upper: f32,
}

/// Constants for making a case from a point. Words and binary32 numbers only: host and device hold the same bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Recipe {
    /// [`CasePath`] as a number.
    pub path: u32,
    /// [`LateralPath`] as a number.
    pub lateral: u32,
    /// Parameters of a point.
    pub dimensions: u32,
    /// 1 if a second vehicle is ahead of the principal one.
    pub pair: u32,
    /// 1 if v1 < v0 and T = (v0 − v1)/ā in its range are required (LVD i and ii).
    pub decelerates: u32,
    /// 1 if accelerations continue after T.
    pub unlimited: u32,
    /// 1 if the criteria evaluate the principal vehicle.
    pub judged: u32,
    /// Last step of every lane.
    pub step_cap: u32,
    /// Index of the parameter that gives each [`Variable`], or [`NO_SLOT`].
    pub slots: [u32; Variable::ALL.len()],
    /// Columns of the reduction.
    pub columns: ReducedColumns,
    /// Minimum valid value of each parameter.
    pub lower: [f32; MAX_PARAMETERS],
    /// Maximum valid value of each parameter.
    pub upper: [f32; MAX_PARAMETERS],
    /// Number of bounded columns; 0 on kinematic paths.
    pub bounded: u32,
    /// The bounds of a reconstruction.
    pub bounds: [ColumnBound; MAX_BOUNDS],
    /// Minimum valid T that follows from other numbers, s.
    pub min_duration: f32,
    /// Maximum valid T that follows from other numbers, s.
    pub longest_duration: f32,
    /// Time step, s.
    pub dt: f32,
    /// 1/dt, 1/s.
    pub inverse_dt: f32,
    /// Lateral distance of a lane change, m.
    pub lane_change: f32,
    /// (L_e + L_o)/2 of the principal vehicle and of the one ahead, m.
    pub half_lengths: [f32; 2],
    /// (W_e + W_o)/2 of both, m.
    pub half_widths: [f32; 2],
    /// Length of the principal vehicle, m.
    pub principal_length: f32,
    /// Width of the ego, m.
    pub ego_width: f32,
    /// Width of its lane, m.
    pub lane_width: f32,
    /// Attention rule of each driver model, in the order of [`ModelId::ALL`](lanesweep_model::driver::ModelId::ALL).
    pub attention: [AttentionRule<f32>; MODELS],
}

const _: () = assert!(size_of::<AttentionRule<f32>>() == 16);
const _: () = assert!(size_of::<ReducedColumns>() == 36);
const _: () = assert!(size_of::<ColumnBound>() == 16);
const _: () =
    assert!(size_of::<Recipe>() == 4 * (8 + 11 + 9 + 2 * MAX_PARAMETERS + 1 + 5 + 4 + 3) + 16 * (MAX_BOUNDS + MODELS));

// SAFETY: `repr(C)`, fields of u32 and f32 only, no padding (asserted above), every bit pattern valid.
unsafe impl Zeroable for Recipe {}
// SAFETY: as above.
unsafe impl Pod for Recipe {}

impl Recipe {
    /// The record as a device reads it.
    pub fn words(&self) -> &[u32] {
        bytemuck::cast_slice(std::slice::from_ref(self))
    }

    /// How the motions follow from a point.
    pub(super) fn path(&self) -> CasePath {
        match self.path {
            0 => CasePath::Kinematic,
            1 => CasePath::Sinusoid,
            _ => CasePath::Reduced,
        }
    }

    /// The case of a void sample: no vehicle is present, and the ego stands. Its lanes end at once and fail no
    /// criterion.
    pub(super) fn void<R: Real>(&self) -> LaneCase<R> {
        let nobody = LaneOther {
            half_lengths: R::from_f64(self.half_lengths[0].into()),
            half_widths: R::from_f64(self.half_widths[0].into()),
            ..LaneOther::default()
        };
        LaneCase {
            others: [nobody; 2],
            ego_width: R::from_f64(self.ego_width.into()),
            lane_width: R::from_f64(self.lane_width.into()),
            ..LaneCase::default()
        }
    }
}
