//! Single samples that cannot be: one test for every reader. One wrong sample among thousands moves no mean, and yet it is the
//! peak deceleration of a scenario.

use super::noise::Noise;
use super::recording::{Recording, Track};
use lanesweep_model::plausibility::{Doubts, Quantity};
use lanesweep_support::readable::{significant, value};

/// A speed that differs so much from what the positions around it tell contradicts them, m/s.
const MAX_DIFFERENCE_MPS: f64 = 5.0;
/// Time before and after a sample over which positions tell its speed, s.
const REACH_S: f64 = 0.5;
/// Acceleration that may change the speed until then, m/s².
const ACCELERATION_MPS2: f64 = 12.0;
/// An acceleration within so many standard deviations of the noise is no single error: mining says what noise does.
const OVER_NOISE: f64 = 8.0;
/// A step along or across the road that is so much longer than the speed tells is a jump, m.
pub(super) const JUMP_ALONG_M: f64 = 2.0;
pub(super) const JUMP_ACROSS_M: f64 = 0.8;

/// Vehicles with samples whose speed contradicts the positions, or whose acceleration is beyond what is physical: how many, and
/// the first of them with its frame and problem in words; `None` without any.
pub(super) fn impossible(recording: &Recording) -> Option<(usize, String)> {
    let rate_hz = recording.frame_rate_hz;
    // Once, and only where it is needed.
    let noise_mps2 = std::cell::OnceCell::new();
    let is_noise = |value: f64| {
        let noise_mps2 = noise_mps2.get_or_init(|| Noise::of(recording).acceleration_mps2);
        value.abs() <= OVER_NOISE * noise_mps2
    };
    let of_track = |track: &Track| {
        contradicting_speed(track, rate_hz).or_else(|| unphysical_acceleration(track, rate_hz, is_noise))
    };
    let mut found = recording.tracks.iter().filter_map(|track| Some((track, of_track(track)?)));
    let (track, (k, problem)) = found.next()?;
    let first = format!("vehicle {} at frame {}: {problem}", track.id, track.first_frame + k as i64);
    Some((1 + found.count(), first))
}

fn contradicting_speed(track: &Track, rate_hz: f64) -> Option<(usize, String)> {
    let last = track.len() - 1;
    let reach = (REACH_S * rate_hz).round().max(1.0) as usize;
    (0..=last).find_map(|k| {
        let (from, to) = (k.saturating_sub(reach), (k + reach).min(last));
        // Positions too close in time are too noisy.
        if to < from + reach {
            return None;
        }
        let told_mps = (track.s_m[to] - track.s_m[from]) * rate_hz / (to - from) as f64;
        let off_s = ((from + to) as f64 / 2.0 - k as f64).abs() / rate_hz;
        let difference_mps = (track.v_s_mps[k] - told_mps).abs();
        (difference_mps > MAX_DIFFERENCE_MPS + ACCELERATION_MPS2 * off_s).then(|| {
            let (given, told) = (value(track.v_s_mps[k]), significant(told_mps, 3));
            (k, format!("its speed is {given} m/s, but it moves by {told} m/s"))
        })
    })
}

/// The acceleration of a sample, and the one that the speeds beside it tell; of a track of a second and longer.
fn unphysical_acceleration(track: &Track, rate_hz: f64, is_noise: impl Fn(f64) -> bool) -> Option<(usize, String)> {
    let mut doubts = Doubts::default();
    // The ends of a short track are all noise.
    let samples = if track.len() as f64 > 2.0 * REACH_S * rate_hz { track.len() } else { 0 };
    (0..samples).find_map(|k| {
        let (from, to) = (k.saturating_sub(1), (k + 1).min(track.len() - 1));
        let told = (track.v_s_mps[to] - track.v_s_mps[from]) * rate_hz / (to - from).max(1) as f64;
        let problem = [track.a_s_mps2[k], told].into_iter().find_map(|value| {
            doubts.check(Quantity::Acceleration, value, String::new).err().filter(|_| !is_noise(value))
        });
        problem.map(|problem| (k, problem))
    })
}

/// Whether a track has a step that its speeds do not tell.
pub(super) fn jumps(track: &Track, rate_hz: f64) -> bool {
    (1..track.len()).any(|k| {
        let by_m = track.s_m[k] - track.s_m[k - 1];
        let told_m = 0.5 * (track.v_s_mps[k] + track.v_s_mps[k - 1]) / rate_hz;
        (by_m - told_m).abs() > JUMP_ALONG_M || (track.d_m[k] - track.d_m[k - 1]).abs() > JUMP_ACROSS_M
    })
}
