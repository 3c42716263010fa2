//! Numbers that stand for several things in one file: frames that begin again at another time are those of another recording, and a
//! vehicle that comes back after a pause is another vehicle.

use super::preset::Preset;
use super::raw::{RawRecording, RawVehicle};
use super::road::{median, range};
use super::samples::{AT, OTHER_CLOCK, Sample, Samples};
use lanesweep_support::readable::significant;

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
        match (recording.has_frames, rate_hz) {
            (false, _) => all.push(part_returning(recording, 1.0, preset)),
            (true, None) => all.push(recording),
            (true, Some(rate_hz)) => {
                all.extend(periods(recording, rate_hz).into_iter().map(|part| part_returning(part, rate_hz, preset)));
            }
        }
    }
    all
}

fn sorted(samples: &Samples, by: usize) -> Samples {
    let mut samples = samples.to_vec();
    samples.sort_by(|a, b| a[by].total_cmp(&b[by]));
    samples.iter().collect()
}

/// The recordings of a file whose frames begin again, as NGSIM's do in each of three periods; `id-1`, `id-2`, ….
fn periods(mut recording: RawRecording, rate_hz: f64) -> Vec<RawRecording> {
    // When its frame 0 would be.
    let zero_s = |samples: &Samples, k: usize| samples.of(OTHER_CLOCK, k) - samples.of(AT, k) / rate_hz;
    let of_vehicle = |of: &RawVehicle| (0..of.samples.len()).map(|k| zero_s(&of.samples, k)).collect::<Vec<f64>>();
    let zeros = || recording.vehicles.iter().flat_map(of_vehicle).filter(|zero| !zero.is_nan());
    let (low, high) = range(zeros());
    // Also without times.
    if high - low <= SAME_TIME_S {
        return vec![recording];
    }
    let mut zeros: Vec<f64> = zeros().collect();
    zeros.sort_by(f64::total_cmp);
    recording.vehicles.iter_mut().for_each(|of| of.samples = sorted(&of.samples, OTHER_CLOCK));
    let steps = recording.vehicles.iter().flat_map(|of| (1..of.samples.len()).map(move |k| (&of.samples, k)));
    let by = |(samples, k): (&Samples, usize), column: usize| samples.of(column, k) - samples.of(column, k - 1);
    let forward = steps.filter(|step| by(*step, OTHER_CLOCK) > 0.0);
    let ratio = median(&mut forward.map(|step| by(step, OTHER_CLOCK) * rate_hz / by(step, AT)).collect::<Vec<_>>());
    if ratio.is_nan() || (ratio - 1.0).abs() > MAX_RATE_DIFFERENCE {
        let told = significant(rate_hz / ratio, 3);
        recording.notes.push(format!(
            "frames and times contradict one another: {rate_hz} frames per second, {told} by the times; frames are used"
        ));
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
        for (part, samples) in parts.iter_mut().zip(of_part).filter(|(_, samples)| samples.len() > 0) {
            part.vehicles.push(RawVehicle { key: vehicle.key.clone(), samples });
        }
    }
    if strays > 0 {
        parts[0].notes.push(format!("{strays} rows have a time that does not fit their frame and are left out"));
    }
    parts
}

/// Makes vehicles of their own of those that come back. `per_s` is the number of frames, or seconds, per second.
fn part_returning(mut recording: RawRecording, per_s: f64, preset: &Preset) -> RawRecording {
    let vehicles = std::mem::take(&mut recording.vehicles);
    let numbers = vehicles.len();
    for mut vehicle in vehicles {
        if vehicle.samples.steps().any(|step| step < 0.0) {
            vehicle.samples = sorted(&vehicle.samples, AT);
        }
        let steps = vehicle.samples.steps().filter(|step| *step > 0.0);
        let pause = PAUSE_S.max(preset.max_gap_s) * per_s + 3.0 * steps.fold(f64::INFINITY, f64::min);
        if vehicle.samples.steps().all(|step| step <= pause) {
            recording.vehicles.push(vehicle);
            continue;
        }
        let samples = vehicle.samples.to_vec();
        let parts = samples.chunk_by(|a, b| b[AT] - a[AT] <= pause);
        let part = |part: &[Sample]| RawVehicle { key: vehicle.key.clone(), samples: part.iter().collect() };
        recording.vehicles.extend(parts.map(part));
    }
    let more = recording.vehicles.len() - numbers;
    if more > 0 {
        let note = format!("{more} times a number comes back after more than {PAUSE_S} s, for another vehicle");
        recording.notes.push(note);
    }
    recording
}
