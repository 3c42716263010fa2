//! Scheduled braking of a leader without a cause in the traffic: one or two phases, each with a rise, a hold and a
//! release.

use super::options::Behaviour;
use super::random::TrafficRandom;

/// Minimum peak of a scheduled braking, m/s². Weaker braking occurs in the traffic anyway, so the rate factor does
/// not apply to it.
const WEAKEST_PEAK_MPS2: f64 = 2.0;
/// Maximum peak, m/s² (dry road).
const HARDEST_PEAK_MPS2: f64 = 7.5;
/// Fraction of brakings with a second phase.
const SECOND_PHASE: f64 = 0.35;

/// Standard deviation of the logarithm of the hold, and the longest hold over its median.
const HOLD_SIGMA: f64 = 0.2;
const LONGEST_HOLD: f64 = 3.0;

/// One rise, hold and release.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Phase {
    peak_mps2: f64,
    start_s: f64,
    rise_s: f64,
    hold_s: f64,
    release_s: f64,
    /// Change of the deceleration over the hold, as a fraction of the peak.
    sag: f64,
}

impl Phase {
    fn end_s(&self) -> f64 {
        self.start_s + self.rise_s + self.hold_s + self.release_s
    }

    fn deceleration(&self, elapsed_s: f64) -> f64 {
        let half_cosine = |share: f64| 0.5 * (1.0 - libm::cos(std::f64::consts::PI * share));
        let t = elapsed_s - self.start_s;
        let held = t - self.rise_s;
        let released = held - self.hold_s;
        if t <= 0.0 || released >= self.release_s {
            0.0
        } else if held <= 0.0 {
            self.peak_mps2 * half_cosine(t / self.rise_s)
        } else if released <= 0.0 {
            self.peak_mps2 * (1.0 - self.sag * held / self.hold_s)
        } else {
            self.peak_mps2 * (1.0 - self.sag) * (1.0 - half_cosine(released / self.release_s))
        }
    }
}

/// A scheduled braking.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Braking {
    first: Phase,
    second: Option<Phase>,
    /// Time since the start, s.
    pub elapsed_s: f64,
}

impl Braking {
    /// Draws peak and shape.
    pub(super) fn draw(behaviour: &Behaviour, stream: &mut TrafficRandom) -> Braking {
        let excess_mps2 = stream.exponential(behaviour.braking_excess_mps2);
        let peak = (WEAKEST_PEAK_MPS2 + excess_mps2).min(HARDEST_PEAK_MPS2);
        let first = Self::phase(behaviour, peak, 0.0, stream);
        let second = stream.chance(SECOND_PHASE).then(|| {
            // Starts between the middle of the first release and a second after it.
            let start = first.end_s() - 0.5 * first.release_s + stream.between(0.0, 1.5);
            Self::phase(behaviour, peak * stream.between(0.35, 0.95), start, stream)
        });
        Braking { first, second, elapsed_s: 0.0 }
    }

    fn phase(behaviour: &Behaviour, peak_mps2: f64, start_s: f64, stream: &mut TrafficRandom) -> Phase {
        let rise_s = stream.lognormal_within(0.7, 0.4, 0.3, 2.5);
        let median_s = behaviour.braking_hold_s;
        let hold_s = stream.lognormal_within(median_s, HOLD_SIGMA, 0.04, LONGEST_HOLD * median_s);
        let release_s = stream.lognormal_within(1.3, 0.4, 0.5, 4.0);
        // Limited by a car's brakes: 12.65 m/s³ on average.
        let quickest_s = peak_mps2 / 12.65;
        Phase {
            peak_mps2,
            start_s,
            rise_s: rise_s.max(quickest_s),
            hold_s,
            release_s: release_s.max(quickest_s),
            // The deceleration changes little in a short hold.
            sag: stream.between(-0.05, 0.35).max(0.0) * hold_s.min(1.0),
        }
    }

    /// Commanded acceleration now, ≤ 0, m/s².
    pub(super) fn acceleration(&self) -> f64 {
        let first = self.first.deceleration(self.elapsed_s);
        let second = self.second.map_or(0.0, |phase| phase.deceleration(self.elapsed_s));
        -first.max(second)
    }

    /// The braking has ended.
    pub(super) fn is_over(&self) -> bool {
        self.elapsed_s >= self.second.unwrap_or(self.first).end_s()
    }
}
