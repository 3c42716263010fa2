//! Random numbers of the generator: counter-based streams keyed by the purpose of the draw. No recording depends on
//! another, on the number of threads or on the machine.
//!
//! Transcendental functions come from `libm`, because system libraries differ in the last bits between platforms.

use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};

/// Purpose of a stream; streams of different purposes have no common numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Purpose {
    /// Lane counts, flows and fraction of trucks of a recording.
    Site = 1,
    /// Headways, drivers and vehicles at the upstream end.
    Inflow = 2,
    /// Acceleration noise and wander within the lane.
    Noise = 3,
    /// Decisions: lane changes, brakings.
    Decision = 4,
}

/// A stream of random numbers.
#[derive(Debug, Clone)]
pub(super) struct TrafficRandom {
    rng: ChaCha8Rng,
    spare_normal: Option<f64>,
}

impl TrafficRandom {
    /// The stream of one purpose in one carriageway of one recording.
    pub(super) fn new(seed: u64, recording: usize, carriageway: usize, purpose: Purpose) -> TrafficRandom {
        let mut key = [0_u8; 32];
        key[..8].copy_from_slice(&seed.to_le_bytes());
        key[8..16].copy_from_slice(&(recording as u64).to_le_bytes());
        key[16..24].copy_from_slice(&(carriageway as u64).to_le_bytes());
        let mut rng = ChaCha8Rng::from_seed(key);
        rng.set_stream(purpose as u64);
        TrafficRandom { rng, spare_normal: None }
    }

    /// Uniform in [0, 1), 53 bits.
    pub(super) fn uniform(&mut self) -> f64 {
        const STEP: f64 = 1.0 / (1_u64 << 53) as f64;
        (self.rng.next_u64() >> 11) as f64 * STEP
    }

    /// Uniform in [low, high).
    pub(super) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// True with this probability.
    pub(super) fn chance(&mut self, probability: f64) -> bool {
        self.uniform() < probability
    }

    /// Standard normal (Box and Muller; both values of a pair are used).
    pub(super) fn normal(&mut self) -> f64 {
        if let Some(z) = self.spare_normal.take() {
            return z;
        }
        // 1 − u lies in (0, 1], so the logarithm is finite.
        let radius = (-2.0 * libm::log(1.0 - self.uniform())).sqrt();
        let (sin, cos) = libm::sincos(2.0 * std::f64::consts::PI * self.uniform());
        self.spare_normal = Some(radius * sin);
        radius * cos
    }

    /// Normal with this mean and standard deviation, redrawn until inside [low, high], which must have some
    /// probability.
    pub(super) fn normal_within(&mut self, mean: f64, sd: f64, low: f64, high: f64) -> f64 {
        self.redraw(low, high, |s| mean + sd * s.normal())
    }

    /// Lognormal with this median and this spread of the logarithm, redrawn until inside [low, high].
    pub(super) fn lognormal_within(&mut self, median: f64, sigma: f64, low: f64, high: f64) -> f64 {
        self.redraw(low, high, |s| median * libm::exp(sigma * s.normal()))
    }

    /// Exponential with this mean, ≥ 0.
    pub(super) fn exponential(&mut self, mean: f64) -> f64 {
        -mean * libm::log(1.0 - self.uniform())
    }

    /// Draws until inside; clamps after many tries, so that unusual options cannot cause an endless loop.
    fn redraw(&mut self, low: f64, high: f64, draw: impl Fn(&mut TrafficRandom) -> f64) -> f64 {
        let mut value = draw(self);
        for _ in 0..1000 {
            if (low..=high).contains(&value) {
                return value;
            }
            value = draw(self);
        }
        value.clamp(low, high)
    }
}
