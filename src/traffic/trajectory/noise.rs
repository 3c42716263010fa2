//! Noise of speeds and accelerations: what a running median over half a second takes away while a vehicle changes its speed.
//! Braking that begins at once stays; noise, the steps of rounded values and single peaks do not.

use super::recording::Recording;

/// Window of the running median, s.
pub(crate) const SUSTAINED_S: f64 = 0.5;
/// A vehicle that changes its speed by less in a second keeps it, m/s.
const KEPT_MPS: f64 = 0.1;
/// Maximum number of tracks that are looked at.
const MAX_TRACKS: usize = 100;
/// Windows of smoothing that are proposed, s, and their step.
const SMOOTHING_S: [f64; 2] = [1.0, 3.0];
const SMOOTHING_STEP_S: f64 = 0.5;

/// Standard deviations of noise along the road, while speeds change; 0 below four samples per second, where nothing tells it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Noise {
    /// Of the accelerations, m/s².
    pub acceleration_mps2: f64,
    /// Of the speeds, m/s.
    pub speed_mps: f64,
    /// The smallest usual change of a speed, m/s.
    pub speed_step_mps: f64,
    /// Of the positions, m.
    pub position_m: f64,
    /// Of the positions across the road, m.
    pub lateral_m: f64,
    rate_hz: f64,
}

impl Noise {
    /// The noise of a recording.
    pub(crate) fn of(recording: &Recording) -> Noise {
        let rate_hz = recording.frame_rate_hz;
        let reach = (0.5 * rate_hz).round().max(2.0) as usize;
        let (mut accelerations, mut told, mut third) = (0.0, 0.0, 0.0);
        let (mut count, mut steps, mut lateral): (u64, Vec<f64>, Vec<f64>) = (0, Vec::new(), Vec::new());
        let third_difference = |x: &[f64], k: usize| x[k + 2] - 3.0 * x[k + 1] + 3.0 * x[k] - x[k - 1];
        let every = recording.tracks.len().div_ceil(MAX_TRACKS).max(1);
        for track in recording.tracks.iter().step_by(every).filter(|track| track.len() > 2 * reach) {
            let v = &track.v_s_mps;
            let change = |k: usize| (v[k + 1] - v[k - 1]) * rate_hz / 2.0;
            for k in reach..track.len() - reach {
                lateral.push(third_difference(&track.d_m, k).abs());
                if (v[k + reach] - v[k - reach]).abs() < KEPT_MPS {
                    continue;
                }
                let of_given = track.a_s_mps2[k] - running_median(k, rate_hz, |k| track.a_s_mps2[k]);
                let of_told = change(k) - running_median(k, rate_hz, change);
                accelerations += of_given * of_given;
                told += of_told * of_told;
                third += third_difference(&track.s_m, k) * third_difference(&track.s_m, k);
                count += 1;
                steps.extend(Some((v[k + 1] - v[k]).abs()).filter(|step| *step > 1e-9));
            }
        }
        let mean = |sum: f64| (sum / count.max(1) as f64).sqrt();
        let quantile = |values: &mut [f64], part: f64| match (part * values.len() as f64) as usize {
            at if at < values.len() => *values.select_nth_unstable_by(at, f64::total_cmp).1,
            _ => 0.0,
        };
        Noise {
            acceleration_mps2: mean(accelerations),
            speed_mps: mean(told) * std::f64::consts::SQRT_2 / rate_hz,
            speed_step_mps: quantile(&mut steps, 0.05),
            position_m: mean(third) / 20.0_f64.sqrt(),
            // The median, because a simulator's lane change in one step is no noise.
            lateral_m: 1.4826 * quantile(&mut lateral, 0.5) / 20.0_f64.sqrt(),
            rate_hz,
        }
    }

    /// The window of smoothing that leaves so much noise of accelerations, s: that of the second derivative of a cubic fitted to n
    /// positions is √720 σ / (n^2.5 Δt²). `None` if it is too long.
    pub(crate) fn smoothing_s(&self, left_mps2: f64) -> Option<f64> {
        let of_one = 720.0_f64.sqrt() * self.position_m * self.rate_hz * self.rate_hz;
        let needed_s = libm::pow(of_one / left_mps2, 0.4) / self.rate_hz;
        let [min, max] = SMOOTHING_S;
        let window_s = (needed_s / SMOOTHING_STEP_S).ceil() * SMOOTHING_STEP_S;
        (window_s <= max).then_some(window_s.max(min))
    }
}

/// Median of the values around a sample, of those within [`SUSTAINED_S`].
pub(crate) fn running_median(k: usize, rate_hz: f64, value: impl Fn(usize) -> f64) -> f64 {
    let half = (0.5 * SUSTAINED_S * rate_hz) as usize;
    let mut near: Vec<f64> = (k - half..=k + half).map(value).collect();
    *near.select_nth_unstable_by(half, f64::total_cmp).1
}
