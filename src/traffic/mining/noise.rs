//! Whether noise decides what is found and kept: the noise of a recording beside the thresholds of mining.

use super::options::MiningOptions;
use crate::trajectory::{Noise, Recording};
use lanesweep_support::readable::{significant, value};

/// Noise of accelerations above this fraction of the threshold of the peak can decide. Drivers who dawdle, as those of SUMO, make 0.22.
const MAX_FRACTION: f64 = 0.3;
/// Lateral motion over the window of mining is so many standard deviations of noise at most by chance.
const LATERAL_DEVIATIONS: f64 = 4.0;

/// Notes on a recording whose noise can decide what is mined; none for good data.
pub(super) fn noise_notes(recording: &Recording, options: &MiningOptions) -> Vec<String> {
    let noise = Noise::of(recording);
    let mut notes = Vec::new();
    let threshold = options.lvd.min_peak_deceleration_mps2;
    if threshold > 0.0 && noise.acceleration_mps2 > MAX_FRACTION * threshold {
        notes.push(format!(
            "noise can decide which leader decelerations are found and kept: that of accelerations is {} m/s², the threshold of the \
             peak {} m/s²; smooth the positions by `smoothing_s` in a preset, 1 s and longer",
            significant(noise.acceleration_mps2, 2),
            value(threshold)
        ));
    }
    let calm_m = options.lateral.quiescent_speed_mps * options.lateral.window_s;
    if LATERAL_DEVIATIONS * noise.lateral_m > calm_m {
        notes.push(format!(
            "noise can decide when lane changes begin and end: that of positions across the road is {} m, and less than {} m in {} s \
             count as no lateral motion",
            significant(noise.lateral_m, 2),
            significant(calm_m, 2),
            value(options.lateral.window_s)
        ));
    }
    notes
}
