//! Lateral motion: the lane change as a quintic, and the wander within a lane.

use super::options::Behaviour;
use super::random::TrafficRandom;
use crate::trajectory::VehicleClass;

/// Published range of lane-change durations, s.
const DURATION_S: [f64; 2] = [2.9, 7.3];
/// Standard deviation of the duration's logarithm.
const DURATION_SIGMA: f64 = 0.28;
/// Factor on the median duration of the changes of trucks.
const TRUCK_DURATION: f64 = 1.2;
/// Standard deviation of the acceleration of a driver who accelerates during a change, as a fraction of its mean.
const ACCELERATION_SPREAD: f64 = 0.4;
/// Its maximum, m/s²; more than most vehicles have at motorway speeds.
const MAX_ACCELERATION_MPS2: f64 = 2.8;
/// Standard deviation of the asymmetry. 0 is the symmetric quintic; at ±1.5 the crossing is about a tenth of the
/// duration earlier or later.
const ASYMMETRY_SD: f64 = 0.7;

/// One lane change, from start to end.
///
/// `d(t) = from + (to − from) q(φ(t/T))` with the quintic `q(τ) = 10τ³ − 15τ⁴ + 6τ⁵` (rest to rest in
/// speed and acceleration) and a mild distortion of time `φ(τ) = τ + κ τ²(1−τ)²`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LaneChangeMotion {
    /// Lane it leaves.
    pub from_lane: usize,
    /// Lane it enters.
    pub to_lane: usize,
    /// Time since the start, s.
    pub elapsed_s: f64,
    /// Duration T, s.
    pub duration_s: f64,
    /// Acceleration where there is room, m/s².
    pub acceleration_mps2: Option<f64>,
    from_m: f64,
    to_m: f64,
    asymmetry: f64,
}

impl LaneChangeMotion {
    /// Draws duration, shape and acceleration of a change between two lanes and two lateral positions.
    pub(super) fn draw(
        lanes: (usize, usize),
        way_m: (f64, f64),
        class: VehicleClass,
        accelerates: bool,
        behaviour: &Behaviour,
        stream: &mut TrafficRandom,
    ) -> LaneChangeMotion {
        let of_class = if class == VehicleClass::Truck { TRUCK_DURATION } else { 1.0 };
        let median_s = behaviour.change_duration_s * of_class;
        let duration_s = stream.lognormal_within(median_s, DURATION_SIGMA, DURATION_S[0], DURATION_S[1]);
        let asymmetry = stream.normal_within(0.0, ASYMMETRY_SD, -1.5, 1.5);
        let mean_mps2 = behaviour.change_acceleration_mps2;
        let acceleration_mps2 = accelerates
            .then(|| stream.normal_within(mean_mps2, ACCELERATION_SPREAD * mean_mps2, 0.0, MAX_ACCELERATION_MPS2));
        let ((from_lane, to_lane), (from_m, to_m)) = (lanes, way_m);
        LaneChangeMotion { from_lane, to_lane, elapsed_s: 0.0, duration_s, acceleration_mps2, from_m, to_m, asymmetry }
    }

    /// Elapsed fraction of the duration, 0 to 1.
    pub(super) fn phase(&self) -> f64 {
        (self.elapsed_s / self.duration_s).min(1.0)
    }

    /// Lateral position and lateral speed now, m and m/s.
    pub(super) fn position_and_speed(&self) -> (f64, f64) {
        let t = self.phase();
        let rest = 1.0 - t;
        let warped = t + self.asymmetry * t * t * rest * rest;
        let warp_rate = 1.0 + 2.0 * self.asymmetry * t * rest * (1.0 - 2.0 * t);
        let shape = warped * warped * warped * (10.0 - 15.0 * warped + 6.0 * warped * warped);
        let slope = 30.0 * warped * warped * (1.0 - warped) * (1.0 - warped);
        let way = self.to_m - self.from_m;
        (self.from_m + way * shape, way * slope * warp_rate / self.duration_s)
    }
}

/// Wander around the intended position: a damped oscillator driven by white noise.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Wander {
    /// Deviation, m, left positive.
    pub offset_m: f64,
    /// Its rate, m/s.
    pub rate_mps: f64,
}

impl Wander {
    /// Standard deviation of the deviation, m.
    const SD_M: f64 = 0.10;
    /// Natural frequency of a driver's steering corrections, rad/s.
    const FREQUENCY_RADPS: f64 = 0.5;
    /// Damping ratio.
    const DAMPING: f64 = 0.8;

    /// Advances by `dt_s` with one standard normal number.
    pub(super) fn step(&mut self, dt_s: f64, normal: f64) {
        const W: f64 = Wander::FREQUENCY_RADPS;
        let drive = Self::SD_M * (4.0 * Self::DAMPING * W * W * W * dt_s).sqrt();
        let rate = self.rate_mps - (2.0 * Self::DAMPING * W * self.rate_mps + W * W * self.offset_m) * dt_s;
        // Position uses the old rate, because a sample's speed belongs to the same instant.
        self.offset_m += self.rate_mps * dt_s;
        self.rate_mps = rate + drive * normal;
    }
}
