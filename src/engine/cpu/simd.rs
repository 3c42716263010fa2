//! The instruction sets for batches of lanes, and their detection. The set is chosen at run time, so that one binary is
//! fast on every machine.
//!
//! Unit tests have AVX2 alone, which halves the time to compile them; `tests/lanes/simd_equals_scalar.rs` runs every set.
//!
//! Every set computes the same words. None enables fused multiply-add: lanes round after every operation.

// Calls functions compiled for an instruction set, after detecting that the machine supports it; their loads and
// stores.
#![allow(unsafe_code)]

#[cfg(all(target_arch = "x86_64", not(test)))]
use super::{
    LANES, ROWS,
    batch_arrays::{Slots, TrackArrays, Words},
    pending_lanes::ROOM,
    series::{goes_on, places},
};
use crate::cpu::batch::{Fleet, burst};
use crate::cpu::foreign::Unreacting;
use crate::cpu::pending_lanes::{Pending, take};
use crate::cpu::series::Window;
use crate::cpu::shared_rules::Rules;
use crate::cpu::side_by_side::{Turn, make_step_of, make_step_of_any};
use crate::frame::Simulation;
use lanesweep_model::driver::DriverModel;
use lanesweep_support::{Error, Place, Result};

/// [`burst`] compiled for an instruction set and a set of rules.
///
/// Only [`burst_for`] makes one, and only for instructions that the machine has.
pub(crate) struct Burst<M> {
    run: unsafe fn(&Simulation<f32, M>, &mut Fleet<'_>, &mut Pending),
}

impl<M> Burst<M> {
    /// Runs it.
    #[inline]
    pub(crate) fn run(&self, simulation: &Simulation<f32, M>, fleet: &mut Fleet<'_>, pending: &mut Pending) {
        // SAFETY: the functions are unsafe only because of the instructions that they use; `burst_for` has detected
        // that the machine supports these.
        unsafe { (self.run)(simulation, fleet, pending) }
    }
}

/// The function of a set of rules: one instance per set.
macro_rules! for_rules {
    ($burst:ident, $model:ty, $rules:expr) => {
        for_rules!($burst, $model, $rules, 0 1 2 3 4 5 6 7 8 9 10 11 12 13 18 19 20 21)
    };
    ($burst:ident, $model:ty, $rules:expr, $($set:literal)*) => {
        match Rules::ALL.iter().position(|set| *set == $rules)? {
            $($set => $burst::<$model, $set>,)*
            _ => return None,
        }
    };
}

/// The burst for these rules on an instruction set; `None` where lanes run one by one.
pub(crate) fn burst_for<M: DriverModel<f32>>(instructions: Instructions, rules: Rules) -> Option<Burst<M>> {
    if !instructions.is_available() {
        return None;
    }
    match instructions {
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx2 => Some(Burst { run: for_rules!(burst_avx2, M, rules) }),
        #[cfg(all(target_arch = "x86_64", not(test)))]
        Instructions::Avx512 => Some(Burst { run: for_rules!(burst_avx512, M, rules) }),
        #[cfg(target_arch = "aarch64")]
        Instructions::Neon => Some(Burst { run: for_rules!(burst_neon, M, rules) }),
        _ => None,
    }
}

/// A step of lanes side by side, compiled for an instruction set and a set of rules.
pub(crate) struct Beside(MakeStep);

type MakeStep = unsafe fn(&Simulation<'_, f32, Unreacting>, &mut Turn<'_>);

impl Beside {
    /// The step for these rules; without them, that for any.
    pub(super) fn of(instructions: Instructions, rules: Option<Rules>) -> Beside {
        Beside(rules.and_then(|rules| Beside::known(instructions, rules)).unwrap_or(make_step_of_any::<Unreacting>))
    }

    fn known(instructions: Instructions, rules: Rules) -> Option<MakeStep> {
        Some(match instructions {
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2 if instructions.is_available() => {
                for_rules!(beside_avx2, Unreacting, rules, 14 15 16 17 18 19 20 21)
            }
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512 if instructions.is_available() => {
                for_rules!(beside_avx512, Unreacting, rules, 14 15 16 17 18 19 20 21)
            }
            _ => return None,
        })
    }

    /// Makes it.
    pub(super) fn run(&self, simulation: &Simulation<'_, f32, Unreacting>, turn: &mut Turn<'_>) {
        // SAFETY: as in `Burst::run`; `known` has detected the instructions.
        unsafe { (self.0)(simulation, turn) }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn beside_avx2<M: DriverModel<f32>, const RULES: u32>(simulation: &Simulation<'_, f32, M>, turn: &mut Turn<'_>) {
    make_step_of::<M, RULES>(simulation, turn);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw")]
fn beside_avx512<M: DriverModel<f32>, const RULES: u32>(simulation: &Simulation<'_, f32, M>, turn: &mut Turn<'_>) {
    make_step_of::<M, RULES>(simulation, turn);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn burst_avx2<M: DriverModel<f32>, const RULES: u32>(
    simulation: &Simulation<f32, M>,
    fleet: &mut Fleet<'_>,
    pending: &mut Pending,
) {
    burst::<M, RULES>(simulation, fleet, pending, take, Window::turn);
}

#[cfg(all(target_arch = "x86_64", not(test)))]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw")]
fn burst_avx512<M: DriverModel<f32>, const RULES: u32>(
    simulation: &Simulation<f32, M>,
    fleet: &mut Fleet<'_>,
    pending: &mut Pending,
) {
    burst::<M, RULES>(
        simulation,
        fleet,
        pending,
        |rows, pending, from, slots| take_avx512(rows, pending, from, slots),
        |window, tracks, steps, entries| turn_avx512(window, tracks, steps, entries),
    );
}

#[cfg(target_arch = "aarch64")]
fn burst_neon<M: DriverModel<f32>, const RULES: u32>(
    simulation: &Simulation<f32, M>,
    fleet: &mut Fleet<'_>,
    pending: &mut Pending,
) {
    burst::<M, RULES>(simulation, fleet, pending, take, Window::turn);
}

/// [`take`] in registers: expands consecutive entries of a row into the slots.
#[cfg(all(target_arch = "x86_64", not(test)))]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw")]
#[inline]
fn take_avx512(rows: &mut [Words], pending: &[[u32; ROOM]], from: usize, slots: Slots) {
    use std::arch::x86_64::*;
    assert!(from + LANES <= ROOM, "lanes are taken from beyond the room");
    for (row, pending) in rows.iter_mut().zip(pending) {
        // SAFETY: the row of pending lanes has LANES entries from this position on, as asserted above; a row of a batch
        // has LANES.
        unsafe {
            let next = _mm512_loadu_si512(pending.as_ptr().add(from).cast());
            let old = _mm512_loadu_si512(row.as_ptr().cast());
            _mm512_storeu_si512(row.as_mut_ptr().cast(), _mm512_mask_expand_epi32(old, slots, next));
        }
    }
}

/// [`Window::turn`] in registers: a square of 16 lanes and 16 steps is transposed by 64 shuffles.
#[cfg(all(target_arch = "x86_64", not(test)))]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw")]
#[inline]
fn turn_avx512(window: &mut Window, tracks: &TrackArrays<LANES>, steps: &Words, entries: &[f32]) {
    use std::arch::x86_64::*;
    const { assert!(LANES == 16 && ROWS == 16) };
    let places = places(tracks, steps);
    let mut furthest = 0;
    for &from in &places {
        furthest = furthest.max(from);
    }
    assert!(furthest as usize + ROWS <= entries.len(), "a lane reads beyond the series");
    // No closures or iterator adapters here: those of the standard library are not compiled for these instructions.
    let mut r = [_mm512_setzero_ps(); 16];
    for (register, &from) in r.iter_mut().zip(&places) {
        // SAFETY: ROWS entries follow each position, as asserted above.
        *register = unsafe { _mm512_loadu_ps(entries.as_ptr().add(from as usize)) };
    }
    // Transposes blocks of 4 × 4 within the quarters of the registers.
    for lanes in r.chunks_exact_mut(4) {
        let low_01 = _mm512_castps_pd(_mm512_unpacklo_ps(lanes[0], lanes[1]));
        let high_01 = _mm512_castps_pd(_mm512_unpackhi_ps(lanes[0], lanes[1]));
        let low_23 = _mm512_castps_pd(_mm512_unpacklo_ps(lanes[2], lanes[3]));
        let high_23 = _mm512_castps_pd(_mm512_unpackhi_ps(lanes[2], lanes[3]));
        lanes[0] = _mm512_castpd_ps(_mm512_unpacklo_pd(low_01, low_23));
        lanes[1] = _mm512_castpd_ps(_mm512_unpackhi_pd(low_01, low_23));
        lanes[2] = _mm512_castpd_ps(_mm512_unpacklo_pd(high_01, high_23));
        lanes[3] = _mm512_castpd_ps(_mm512_unpackhi_pd(high_01, high_23));
    }
    // Quarter p of register 4q + j holds step 4p + j of lanes 4q to 4q + 3: transposes the quarters.
    for j in 0..4 {
        let (a, b, c, d) = (r[j], r[4 + j], r[8 + j], r[12 + j]);
        let (low_ab, high_ab) = (_mm512_shuffle_f32x4::<0x44>(a, b), _mm512_shuffle_f32x4::<0xee>(a, b));
        let (low_cd, high_cd) = (_mm512_shuffle_f32x4::<0x44>(c, d), _mm512_shuffle_f32x4::<0xee>(c, d));
        let rows = [
            _mm512_shuffle_f32x4::<0x88>(low_ab, low_cd),
            _mm512_shuffle_f32x4::<0xdd>(low_ab, low_cd),
            _mm512_shuffle_f32x4::<0x88>(high_ab, high_cd),
            _mm512_shuffle_f32x4::<0xdd>(high_ab, high_cd),
        ];
        for (p, row) in rows.into_iter().enumerate() {
            // SAFETY: a row has 16 numbers.
            unsafe { _mm512_storeu_ps(window.rows[4 * p + j].as_mut_ptr(), row) };
        }
    }
    window.moves = goes_on(tracks, steps);
}

/// How the CPU runs lanes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Instructions {
    /// One lane at a time.
    Scalar,
    /// x86-64, 256 bits: Haswell (2013), Zen (2017) and later.
    Avx2,
    /// x86-64, 512 bits (F, VL, DQ, BW): Skylake-X (2017), Zen 4 (2022) and later.
    Avx512,
    /// AArch64, 128 bits: every AArch64 processor.
    Neon,
}

impl Instructions {
    /// All, slowest first.
    pub const ALL: [Instructions; 4] =
        [Instructions::Scalar, Instructions::Neon, Instructions::Avx2, Instructions::Avx512];

    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Instructions::Scalar => "scalar",
            Instructions::Avx2 => "AVX2",
            Instructions::Avx512 => "AVX-512",
            Instructions::Neon => "NEON",
        }
    }

    /// Whether this machine supports it.
    pub fn is_available(self) -> bool {
        match self {
            Instructions::Scalar => true,
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2 => is_x86_feature_detected!("avx2"),
            #[cfg(all(target_arch = "x86_64", not(test)))]
            Instructions::Avx512 => {
                is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512bw")
            }
            #[cfg(target_arch = "aarch64")]
            Instructions::Neon => true,
            #[allow(unreachable_patterns)] // where every set belongs to the architecture
            _ => false,
        }
    }

    /// The instruction sets of this machine, slowest first.
    pub fn available() -> Vec<Instructions> {
        Instructions::ALL.into_iter().filter(|set| set.is_available()).collect()
    }

    /// The fastest of this machine, except NEON: LLVM's cost model leaves the batch's loop scalar there (Rust 1.95),
    /// so single lanes are faster.
    pub fn best() -> Instructions {
        let chosen = |set: &Instructions| set.is_available() && *set != Instructions::Neon;
        Instructions::ALL.into_iter().rev().find(chosen).unwrap_or(Instructions::Scalar)
    }

    /// Returns the instruction set if this machine supports it.
    ///
    /// # Errors
    /// [`Error::Usage`] if it does not.
    pub(super) fn checked(self) -> Result<Instructions> {
        if self.is_available() {
            return Ok(self);
        }
        let names: Vec<&str> = Instructions::available().into_iter().map(Instructions::name).collect();
        let problem = format!("this machine does not have {}", self.name());
        Err(Error::usage(Place::item("instructions"), problem, format!("it has {}", names.join(", "))))
    }
}

impl std::fmt::Display for Instructions {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}
