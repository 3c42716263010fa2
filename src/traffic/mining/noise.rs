//! Whether noise decides what is found and kept: the noise of a recording beside the thresholds of mining.

use super::options::MiningOptions;
use crate::scenario::{Category, Scenario};
use crate::support::readable::{count_of, significant, value};
use crate::traffic::trajectory::{Noise, Recording, SUSTAINED_S, running_median};

/// Noise of accelerations above this fraction of the threshold of the peak can decide. Drivers who dawdle, as those of SUMO, make 0.22.
const MAX_FRACTION: f64 = 0.3;
/// The proposed smoothing leaves this fraction.
const LEFT_FRACTION: f64 = 0.05;
/// Lateral motion over the window of mining is so many standard deviations of noise at most by chance.
const LATERAL_DEVIATIONS: f64 = 4.0;

/// Notes on a recording whose noise can decide what is mined, with its scenarios; none for good data.
pub fn noise_notes(recording: &Recording, scenarios: &[Scenario], options: &MiningOptions) -> Vec<String> {
    let noise = Noise::of(recording);
    let threshold = options.lvd.min_peak_deceleration_mps2;
    let mut notes = Vec::new();
    if threshold > 0.0 && noise.acceleration_mps2 > MAX_FRACTION * threshold {
        let kept = scenarios.iter().filter(|found| found.category == Category::Lvd && found.kept);
        let brief = kept.clone().filter(|found| !is_sustained(recording, found, threshold)).count();
        let steps = match noise.speed_step_mps * recording.frame_rate_hz / 2.0 > noise.acceleration_mps2 {
            true => format!(", in steps of {} m/s", significant(noise.speed_step_mps, 2)),
            false => String::new(),
        };
        let what_to_do = match noise.smoothing_s(LEFT_FRACTION * threshold) {
            Some(window_s) => format!("smooth the positions by `smoothing_s = {window_s:?}` in a preset"),
            None => "no smoothing repairs this".to_owned(),
        };
        let brief = match brief {
            0 => String::new(),
            _ => format!(
                "{} of {} kept ones exceed it only in peaks of less than {} s; ",
                count_of(brief),
                count_of(kept.count()),
                value(SUSTAINED_S / 2.0)
            ),
        };
        notes.push(format!(
            "noise can decide which leader decelerations are found and kept: accelerations have a noise of {} m/s² (speeds of {} m/s\
             {steps}), the threshold of the peak is {} m/s²; {brief}{what_to_do}",
            significant(noise.acceleration_mps2, 2),
            significant(noise.speed_mps, 2),
            value(threshold)
        ));
    }
    let calm_m = options.lateral.quiescent_speed_mps * options.lateral.window_s;
    if LATERAL_DEVIATIONS * noise.lateral_m > calm_m {
        notes.push(format!(
            "noise can decide when lane changes begin and end: positions across the road have a noise of {} m, and less than {} m in \
             {} s count as no lateral motion",
            significant(noise.lateral_m, 2),
            significant(calm_m, 2),
            value(options.lateral.window_s)
        ));
    }
    notes
}

/// Whether the running median of a target's deceleration exceeds the threshold.
fn is_sustained(recording: &Recording, found: &Scenario, threshold: f64) -> bool {
    let Some(target) = recording.track(found.target_id) else { return true };
    let half = (0.5 * SUSTAINED_S * recording.frame_rate_hz) as usize;
    let samples = (found.frame0..=found.frame1).filter_map(|frame| target.index_of(frame));
    let mut inner = samples.filter(|k| (half..target.len().saturating_sub(half)).contains(k));
    inner.any(|k| -running_median(k, recording.frame_rate_hz, |k| target.a_s_mps2[k]) > threshold)
}
