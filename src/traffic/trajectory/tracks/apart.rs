//! Numbers that stand for several things in one file: frames that begin again at another time are those of another recording, and a
//! vehicle that comes back after a pause is another vehicle.

use super::preset::Preset;
use super::raw::RawRecording;
use super::road::{median, range};
use super::samples::Samples;
use crate::support::readable::significant;

/// Times of a frame that are farther apart belong to two recordings, s.
const SAME_TIME_S: f64 = 1.0;
/// Fewer rows with such times are mistakes.
const MIN_ROWS: usize = 20;
/// Frames per second that differ from those of the times by this fraction contradict them.
const MAX_RATE_DIFFERENCE: f64 = 0.02;
/// A number that comes back after so long, beyond three steps of its vehicle, is that of another one, s.
const PAUSE_S: f64 = 2.0;

/// Recordings in which a number stands for one vehicle or frame.
pub(super) fn apart(recordings: Vec<RawRecording>, preset: &Preset) -> Vec<RawRecording> {
    let mut all = Vec::new();
    for recording in recordings {
        let rate_hz = recording.frame_rate_hz.or(preset.frame_rate_hz);
        let per_s = if recording.has_frames { rate_hz } else { Some(1.0) };
        let parts = match rate_hz.filter(|_| recording.has_frames) {
            Some(rate_hz) => periods(recording, rate_hz),
            None => vec![recording],
        };
        for mut part in parts {
            per_s.into_iter().for_each(|per_s| part_returning(&mut part, per_s, preset));
            all.push(part);
        }
    }
    all
}

/// The recordings of a file whose frames begin again, as NGSIM's do in each of three periods; `id-1`, `id-2`, ….
fn periods(mut recording: RawRecording, rate_hz: f64) -> Vec<RawRecording> {
    // When its frame 0 would be.
    let zero_s = |samples: &Samples, k: usize| samples.other_clock(k) - samples.at(k) / rate_hz;
    let of_vehicle = |samples: &'_ Samples| (0..samples.len()).map(|k| zero_s(samples, k)).collect::<Vec<f64>>();
    let zeros = || recording.vehicles.iter().flat_map(|of| of_vehicle(&of.samples)).filter(|zero| !zero.is_nan());
    let (low, high) = range(zeros());
    // Also without times.
    if high - low <= SAME_TIME_S {
        return vec![recording];
    }
    let mut zeros: Vec<f64> = zeros().collect();
    zeros.sort_by(f64::total_cmp);
    let mut ratios: Vec<f64> = Vec::new();
    for vehicle in &mut recording.vehicles {
        let mut samples = vehicle.samples.to_vec();
        samples.sort_by(|a, b| a.other_clock.total_cmp(&b.other_clock));
        vehicle.samples = samples.iter().collect();
        let pairs = samples.windows(2).filter(|pair| pair[1].other_clock > pair[0].other_clock);
        ratios.extend(
            pairs.map(|pair| (pair[1].other_clock - pair[0].other_clock) * rate_hz / (pair[1].at - pair[0].at)),
        );
    }
    let ratio = median(&mut ratios);
    if ratio.is_nan() || (ratio - 1.0).abs() > MAX_RATE_DIFFERENCE {
        let note = format!(
            "frames and times contradict one another: {rate_hz} frames per second, {} by the times; frames are used",
            significant(rate_hz / ratio, 3)
        );
        recording.notes.push(note);
        return vec![recording];
    }
    let same = zeros.chunk_by(|a, b| b - a <= SAME_TIME_S).filter(|group| group.len() >= MIN_ROWS);
    let begins: Vec<[f64; 2]> = same.map(|group| [group[0], group[group.len() - 1]]).collect();
    if begins.len() < 2 {
        return vec![recording];
    }
    let vehicles = std::mem::take(&mut recording.vehicles);
    let part = |number: usize| RawRecording { id: format!("{}-{number}", recording.id), ..recording.clone() };
    let mut parts: Vec<RawRecording> = (1..=begins.len()).map(part).collect();
    parts[1..].iter_mut().for_each(|part| part.incomplete = 0);
    let mut strays = 0;
    for vehicle in vehicles {
        let mut of_part = vec![Samples::default(); parts.len()];
        for k in 0..vehicle.samples.len() {
            let zero = zero_s(&vehicle.samples, k);
            match begins.iter().position(|[first, last]| *first <= zero && zero <= *last) {
                Some(at) => of_part[at].push(&vehicle.samples.get(k)),
                None => strays += 1,
            }
        }
        for (part, samples) in parts.iter_mut().zip(of_part).filter(|(_, samples)| !samples.is_empty()) {
            part.vehicles.push(vehicle.part(samples));
        }
    }
    if strays > 0 {
        parts[0].notes.push(format!("{strays} rows have a time that does not fit their frame and are left out"));
    }
    parts
}

/// Makes vehicles of their own of those that come back. `per_s` is the unit of `at` per second.
fn part_returning(recording: &mut RawRecording, per_s: f64, preset: &Preset) {
    let vehicles = std::mem::take(&mut recording.vehicles);
    let numbers = vehicles.len();
    for mut vehicle in vehicles {
        if vehicle.samples.steps().any(|step| step < 0.0) {
            let mut samples = vehicle.samples.to_vec();
            samples.sort_by(|a, b| a.at.total_cmp(&b.at));
            vehicle.samples = samples.iter().collect();
        }
        let steps = vehicle.samples.steps().filter(|step| *step > 0.0);
        let pause = PAUSE_S.max(preset.max_gap_s) * per_s + 3.0 * steps.fold(f64::INFINITY, f64::min);
        if vehicle.samples.steps().all(|step| step <= pause) {
            recording.vehicles.push(vehicle);
            continue;
        }
        let samples = vehicle.samples.to_vec();
        let parts = samples.chunk_by(|a, b| b.at - a.at <= pause);
        recording.vehicles.extend(parts.map(|part| vehicle.part(part.iter().collect())));
    }
    let more = recording.vehicles.len() - numbers;
    if more > 0 {
        recording
            .notes
            .push(format!("{more} times a number comes back after more than {PAUSE_S} s, for another vehicle"));
    }
}
