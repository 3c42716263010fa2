//! Random numbers: one stream per (purpose, seed, category, unit, variant), so a case depends neither on other cases
//! nor on threads.

use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};

use crate::scenario::Category;

/// Purpose of a stream; streams of different purposes never share a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Purpose {
    /// The series that the cases share.
    Pool = 1,
    /// Random cases.
    Random = 2,
    /// Cut-outs whose cutting-out vehicle hits the one ahead.
    Freeze = 3,
    /// Cases on thresholds.
    Threshold = 4,
    /// The series that cases on thresholds share.
    ThresholdPool = 5,
}

/// A stream of random numbers.
pub(super) struct CaseRandom(ChaCha8Rng);

impl CaseRandom {
    /// The stream of one thing.
    pub fn new(purpose: Purpose, seed: u64, category: Category, unit: u64, variant: usize) -> CaseRandom {
        let mut key = [0_u8; 32];
        key[..8].copy_from_slice(&seed.to_le_bytes());
        key[8..16].copy_from_slice(&unit.to_le_bytes());
        key[16..20].copy_from_slice(&(variant as u32).to_le_bytes());
        key[20] = category as u8;
        key[21] = purpose as u8;
        CaseRandom(ChaCha8Rng::from_seed(key))
    }

    /// Uniform in [0, 1), 53 bits.
    pub fn uniform(&mut self) -> f64 {
        const STEP: f64 = 1.0 / (1_u64 << 53) as f64;
        (self.0.next_u64() >> 11) as f64 * STEP
    }

    /// Uniform in [low, high).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// True with this probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.uniform() < probability
    }

    /// An index below `count`; 0 if `count` is 0.
    pub fn below(&mut self, count: usize) -> usize {
        ((u128::from(self.0.next_u64()) * count as u128) >> 64) as usize
    }

    /// 1 or −1: left or right.
    pub fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }
}
