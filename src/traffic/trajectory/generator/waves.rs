//! Stop-and-go waves of dense traffic: the speed that the traffic downstream allows, as a function of place and time.
//!
//! Waves travel upstream at the speed that is known from motorways (Treiber and Kesting, *Traffic Flow Dynamics*, 2013,
//! chapter 18: 15 to 20 km/h), so a driver meets them quicker than a place does.

use std::f64::consts::PI;

use super::behaviour::Behaviour;
use super::random::TrafficRandom;

/// Speed at which waves travel upstream, m/s.
const WAVE_MPS: f64 = 4.5;
/// Standard deviation of the logarithm of the mean speed. Few carriageways are dense, so they are much alike: else the
/// failures of the default recordings would depend on the seed more than on anything else.
const SPEED_SIGMA: f64 = 0.15;
/// Middle period of the waves at a place, s.
const PERIOD_S: f64 = 70.0;
/// Slowest speed in a wave, m/s.
const SLOWEST_MPS: f64 = 1.5;
/// Share of the variance that each lane has for itself: drivers change lanes where the next one is faster.
const OWN_SHARE: f64 = 0.3;
/// Waves that add up.
const PARTS: usize = 3;

/// A sum of sinusoids with unit variance.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Ripple([(f64, f64); PARTS]);

impl Ripple {
    fn draw(stream: &mut TrafficRandom) -> Ripple {
        Ripple(std::array::from_fn(|k| {
            let rate = 2.0 * PI / (PERIOD_S * [0.6, 1.0, 1.7][k] * stream.between(0.85, 1.15));
            (rate, stream.between(0.0, 2.0 * PI))
        }))
    }

    fn at(&self, time_s: f64) -> f64 {
        let sum: f64 = self.0.iter().map(|(rate, phase)| libm::sin(rate * time_s + phase)).sum();
        sum * (2.0 / PARTS as f64).sqrt()
    }
}

/// The waves of one carriageway.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Waves {
    mean_mps: f64,
    amplitude: f64,
    common: Ripple,
    lanes: Vec<Ripple>,
}

impl Waves {
    /// Draws the mean speed and the waves of a carriageway.
    pub fn draw(behaviour: &Behaviour, lanes: usize, stream: &mut TrafficRandom) -> Waves {
        let mean_mps = stream.lognormal_within(behaviour.dense_speed_mps, SPEED_SIGMA, 3.0, 40.0);
        let common = Ripple::draw(stream);
        let lanes = (0..lanes).map(|_| Ripple::draw(stream)).collect();
        Waves { mean_mps, amplitude: behaviour.wave_amplitude, common, lanes }
    }

    /// Speed that traffic allows at a place and time, m/s.
    pub fn limit_mps(&self, lane: usize, s_m: f64, time_s: f64) -> f64 {
        let time_s = time_s + s_m / WAVE_MPS;
        let (common, own) = (self.common.at(time_s), self.lanes[lane].at(time_s));
        let wave = (1.0 - OWN_SHARE).sqrt() * common + OWN_SHARE.sqrt() * own;
        (self.mean_mps * (1.0 + self.amplitude * wave)).max(SLOWEST_MPS)
    }
}
