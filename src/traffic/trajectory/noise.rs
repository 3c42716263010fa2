//! Noise of accelerations: what a running median over half a second takes away while a vehicle changes its speed.
//! Braking that begins at once stays; noise, the steps of rounded values and single peaks do not.

use super::recording::Recording;
use super::tracks::median;

/// Window of the running median, s.
const SUSTAINED_S: f64 = 0.5;
/// A vehicle that changes its speed by less in a second keeps it, m/s.
const KEPT_MPS: f64 = 0.1;
/// Maximum number of tracks that are looked at.
const MAX_TRACKS: usize = 100;

/// Standard deviations of noise along the road, while speeds change; 0 below four samples per second, where nothing tells it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Noise {
    /// Of the accelerations, m/s².
    pub acceleration_mps2: f64,
    /// Of the positions across the road, m; NaN where nothing tells it.
    pub lateral_m: f64,
}

impl Noise {
    /// The noise of a recording.
    pub(crate) fn of(recording: &Recording) -> Noise {
        let rate_hz = recording.frame_rate_hz;
        let half = (0.5 * SUSTAINED_S * rate_hz) as usize;
        let reach = (0.5 * rate_hz).round().max(2.0) as usize;
        let (mut squares, mut count) = (0.0, 0_u64);
        let mut lateral: Vec<f64> = Vec::new();
        let every = recording.tracks.len().div_ceil(MAX_TRACKS).max(1);
        for track in recording.tracks.iter().step_by(every).filter(|track| track.len() > 2 * reach) {
            let (v, a, d) = (&track.v_s_mps, &track.a_s_mps2, &track.d_m);
            for k in reach..track.len() - reach {
                // A third difference has the variance of 20 positions.
                lateral.push((d[k + 2] - 3.0 * d[k + 1] + 3.0 * d[k] - d[k - 1]).abs());
                if (v[k + reach] - v[k - reach]).abs() < KEPT_MPS {
                    continue;
                }
                let noise = a[k] - median(&mut a[k - half..=k + half].to_vec());
                squares += noise * noise;
                count += 1;
            }
        }
        Noise {
            acceleration_mps2: (squares / count.max(1) as f64).sqrt(),
            // The median, because a simulator's lane change in one step is no noise.
            lateral_m: 1.4826 * median(&mut lateral) / 20.0_f64.sqrt(),
        }
    }
}
