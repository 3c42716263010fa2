//! The instruction sets that a batch of lanes can run on, chosen at run time: one binary is fast everywhere.
//!
//! Every set computes the same words. None has a fused multiply-add switched on: lanes round after every operation.

#![allow(unsafe_code)] // calls of functions compiled for an instruction set, after the machine was asked for it

use super::batch::{Batch, Rules, burst};
use super::frame::Simulation;
use super::instructions::Instructions;
use crate::driver::DriverModel;

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
