//! The instruction sets that a batch of lanes can run on, chosen at run time: one binary is fast everywhere.
//!
//! Every set computes the same words. None has a fused multiply-add switched on: lanes round after every operation.

#![allow(unsafe_code)] // calls of functions compiled for an instruction set, after the machine was asked for it

use super::batch::{Batch, Rules, burst};
use super::frame::Simulation;
use crate::driver::DriverModel;
use crate::{Error, Place, Result};

/// How the CPU runs lanes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Instructions {
    /// One lane at a time.
    Scalar,
    /// x86-64, 256 bits: Haswell (2013), Zen (2017) and later.
    Avx2,
    /// x86-64, 512 bits (F, VL, DQ, BW): Skylake-X (2017), Zen 4 (2022) and later.
    Avx512,
    /// AArch64, 128 bits: every one.
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

    /// Does this machine have it?
    pub fn is_available(self) -> bool {
        match self {
            Instructions::Scalar => true,
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2 => is_x86_feature_detected!("avx2"),
            #[cfg(target_arch = "x86_64")]
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

    /// Those of this machine, slowest first.
    pub fn available() -> Vec<Instructions> {
        Instructions::ALL.into_iter().filter(|set| set.is_available()).collect()
    }

    /// The fastest of this machine. NEON only where it is asked for: LLVM's cost model leaves the batch's loop
    /// scalar there (Rust 1.95), and then lanes one by one are faster.
    pub fn best() -> Instructions {
        let chosen = |set: &Instructions| set.is_available() && *set != Instructions::Neon;
        Instructions::ALL.into_iter().rev().find(chosen).unwrap_or(Instructions::Scalar)
    }

    /// Itself, where this machine has it.
    ///
    /// # Errors
    /// [`Error::Usage`] where it has not.
    pub fn checked(self) -> Result<Instructions> {
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

/// [`burst`] compiled for an instruction set and a set of rules.
///
/// Only [`burst_for`] makes one, and only for instructions that the machine has.
pub(super) struct Burst<M> {
    run: unsafe fn(&Simulation<f32, M>, &mut Batch, usize, usize) -> usize,
}

impl<M> Burst<M> {
    /// Runs it.
    #[inline]
    pub(super) fn run(&self, simulation: &Simulation<f32, M>, batch: &mut Batch, row: usize, until: usize) -> usize {
        // SAFETY: the functions are unsafe for one reason, the instructions that they may use; `burst_for` has
        // asked the machine for them.
        unsafe { (self.run)(simulation, batch, row, until) }
    }
}

/// The function of a set of rules: one instance per set.
macro_rules! for_rules {
    ($burst:ident, $model:ty, $rules:expr) => {
        match $rules.bits() {
            0 => $burst::<$model, 0>,
            1 => $burst::<$model, 1>,
            2 => $burst::<$model, 2>,
            3 => $burst::<$model, 3>,
            4 => $burst::<$model, 4>,
            5 => $burst::<$model, 5>,
            6 => $burst::<$model, 6>,
            7 => $burst::<$model, 7>,
            8 => $burst::<$model, 8>,
            9 => $burst::<$model, 9>,
            10 => $burst::<$model, 10>,
            11 => $burst::<$model, 11>,
            12 => $burst::<$model, 12>,
            13 => $burst::<$model, 13>,
            14 => $burst::<$model, 14>,
            15 => $burst::<$model, 15>,
            16 => $burst::<$model, 16>,
            17 => $burst::<$model, 17>,
            18 => $burst::<$model, 18>,
            19 => $burst::<$model, 19>,
            Rules::SETS.. => return None,
        }
    };
}

/// The burst for these rules on an instruction set; `None` where lanes run one by one.
pub(super) fn burst_for<M: DriverModel<f32>>(instructions: Instructions, rules: Rules) -> Option<Burst<M>> {
    if !instructions.is_available() {
        return None;
    }
    match instructions {
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx2 => Some(Burst { run: for_rules!(burst_avx2, M, rules) }),
        #[cfg(target_arch = "x86_64")]
        Instructions::Avx512 => Some(Burst { run: for_rules!(burst_avx512, M, rules) }),
        #[cfg(target_arch = "aarch64")]
        Instructions::Neon => Some(Burst { run: for_rules!(burst_neon, M, rules) }),
        _ => None,
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn burst_avx2<M: DriverModel<f32>, const RULES: u32>(
    simulation: &Simulation<f32, M>,
    batch: &mut Batch,
    row: usize,
    until: usize,
) -> usize {
    burst::<M, RULES>(simulation, batch, row, until)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw")]
fn burst_avx512<M: DriverModel<f32>, const RULES: u32>(
    simulation: &Simulation<f32, M>,
    batch: &mut Batch,
    row: usize,
    until: usize,
) -> usize {
    burst::<M, RULES>(simulation, batch, row, until)
}

#[cfg(target_arch = "aarch64")]
fn burst_neon<M: DriverModel<f32>, const RULES: u32>(
    simulation: &Simulation<f32, M>,
    batch: &mut Batch,
    row: usize,
    until: usize,
) -> usize {
    burst::<M, RULES>(simulation, batch, row, until)
}
