//! The time base of a recording: its frame rate, and gapless pieces of tracks at its frames.

use std::borrow::Cow;

use super::boxes::{Sized, sized};
use super::preset::Preset;
use super::raw::{RawRecording, RawVehicle};
use super::road::{cross, dot, median, range, unit};
use super::samples::{AT, DIRECTION, OTHER_CLOCK, Sample, Samples, X, Y, between};
use super::understanding::Understanding;
use lanesweep_support::readable::{significant, value};
use lanesweep_support::{Error, Place, Result};

/// A sample this far off the raster of times, in frames, is interpolated.
const OFF_RASTER: f64 = 0.02;
/// Parts of the unit of rounded times by which the first of them may be off.
const OFFSETS: [f64; 5] = [0.0, 0.25, -0.25, 0.5, -0.5];
/// Rows of one vehicle and time that are farther apart contradict each other, m.
const SAME_PLACE_M: f64 = 0.1;
/// Pieces of a track with fewer samples tell nothing.
const MIN_PIECE: usize = 3;
/// A step that differs by more from those before and after it, along the way, is none that a vehicle makes, m.
const JUMP_M: f64 = 2.0;
/// The same to the side: simulators change lanes in one step.
const JUMP_ASIDE_M: f64 = 8.0;
/// A jump is so many times longer than the usual difference of two steps, which noise makes.
const JUMP_OVER_NOISE: f64 = 10.0;
/// Acceleration that may lie between two steps, m/s².
const ACCELERATION_MPS2: f64 = 15.0;
/// Maximum number of samples that one row of a file becomes by interpolation, beyond [`FREE_SAMPLES`] for all.
const SAMPLES_PER_ROW: f64 = 200.0;
const FREE_SAMPLES: f64 = 1e5;

/// A gapless stretch of a vehicle's track at the frames of the recording.
pub(super) struct Piece {
    pub vehicle: usize,
    pub first_frame: i64,
    pub samples: Samples,
    pub sized: Sized,
    /// Sign of the travel along the road, if the file has it.
    pub direction: Option<f64>,
}

impl Piece {
    /// From its first position to its last, m.
    pub(super) fn travel_m(&self) -> [f64; 2] {
        let (a, b) = (self.samples.xy_m(0), self.samples.xy_m(self.samples.len() - 1));
        [b[0] - a[0], b[1] - a[1]]
    }
}

/// The frame rate, and the tracks in gapless pieces at its frames.
pub(super) fn pieces(
    raw: &mut RawRecording,
    preset: &Preset,
    about: &mut Understanding,
    place: &Place,
) -> Result<(f64, Vec<Piece>)> {
    leave_out_repeated(&mut raw.vehicles, about);
    let bad = |problem: &str, help: &str| Error::input(place.clone(), problem, help);
    let (rate_hz, factor, frame) = clock(raw, preset, about, &bad)?;
    let time_s = |at: f64| frame(at) / rate_hz;
    let max_gap = (preset.max_gap_s * rate_hz).max(1.0) + 0.5 + factor;
    let mut differences_m: Vec<f64> =
        raw.vehicles.iter().flat_map(|of| step_differences_m(&of.samples.to_vec(), time_s)).collect();
    let jump_m = JUMP_M.max(JUMP_OVER_NOISE * median(&mut differences_m));
    drop(differences_m);
    let vehicles = raw.vehicles.len();
    let rows: usize = raw.vehicles.iter().map(|vehicle| vehicle.samples.len()).sum();
    let mut pieces = Vec::new();
    let (mut total, mut jumps, mut short, mut interpolated) = (0.0, 0, 0, 0);
    let mut first_jump = None;
    for (vehicle, of) in raw.vehicles.iter_mut().enumerate() {
        // From here on, pieces hold them.
        let mut stored = std::mem::take(&mut of.samples);
        let samples = stored.to_vec();
        let differences_m = step_differences_m(&samples, time_s);
        let frames: Vec<f64> = samples.iter().map(|sample| frame(sample[AT])).collect();
        let mut from = 0;
        for to in 1..=samples.len() {
            if to < samples.len() && frames[to] - frames[to - 1] <= max_gap {
                let by_m = differences_m[to - 1];
                if by_m <= jump_m {
                    continue;
                }
                jumps += 1;
                first_jump.get_or_insert((of.key.clone(), frames[to].round(), by_m));
            }
            let (piece, frames) = (&samples[from..to], &frames[from..to]);
            from = to;
            total += frames[frames.len() - 1] - frames[0] + 1.0;
            if total > SAMPLES_PER_ROW * rows as f64 + FREE_SAMPLES {
                let problem = "the tracks have far more frames than the file has rows";
                return Err(bad(problem, "check the unit of `time`, the frame rates and `max_gap_s`"));
            }
            let (at_frames, first_frame) = at_frames(piece, frames);
            let is_whole = matches!(at_frames, Cow::Borrowed(all) if all.len() == samples.len());
            interpolated += if let Cow::Owned(samples) = &at_frames { samples.len() as u64 } else { 0 };
            if at_frames.len() < MIN_PIECE {
                short += 1;
                continue;
            }
            let direction = Some(stored.of(DIRECTION, 0)).filter(|sign| !sign.is_nan());
            let part = (!is_whole).then(|| at_frames.iter().collect());
            let sized = sized(part.as_ref().unwrap_or(&stored), &stored, &raw.classes, preset);
            let samples = part.unwrap_or_else(|| std::mem::take(&mut stored));
            pieces.push(Piece { vehicle, first_frame, samples, sized, direction });
        }
    }
    let gaps = pieces.len().saturating_sub(vehicles + jumps);
    about.find_of(gaps as u64, gaps > vehicles, "gaps longer than `max_gap_s` split tracks");
    if let Some((vehicle, frame, by_m)) = first_jump {
        let by_m = significant(by_m, 3);
        about.find(jumps > vehicles, format!(
            "{jumps} step(s) that no vehicle makes split tracks, the first is that of vehicle {vehicle} to frame {frame}, by {by_m} m: a number used again, or wrong positions"
        ));
    }
    about.warn_of(short, "piece(s) of tracks are too short to be used");
    about.warn_of(interpolated, "samples are of tracks that were interpolated: gaps, or times off the raster");
    if pieces.is_empty() {
        return Err(bad("no vehicle is in view for three samples", "check the columns for vehicle and time"));
    }
    Ok((rate_hz, pieces))
}

/// Sorts the samples of each vehicle by time, and leaves out all but the first of one time.
fn leave_out_repeated(vehicles: &mut [RawVehicle], about: &mut Understanding) {
    let (mut rows, mut repeated, mut conflicts) = (0, 0, 0);
    for vehicle in vehicles {
        rows += vehicle.samples.len() as u64;
        if vehicle.samples.steps().all(|step| step > 0.0) {
            continue;
        }
        let mut samples = vehicle.samples.to_vec();
        samples.sort_by(|a, b| a[AT].total_cmp(&b[AT]));
        let count = samples.len();
        samples.dedup_by(|later, first| {
            let is_repeated = later[AT] == first[AT];
            let apart_m = (later[X] - first[X]).abs().max((later[Y] - first[Y]).abs());
            conflicts += u64::from(is_repeated && apart_m > SAME_PLACE_M);
            is_repeated
        });
        repeated += (count - samples.len()) as u64;
        vehicle.samples = samples.iter().collect();
    }
    about.warn_of(repeated, "rows repeat vehicle and time of another row and are left out");
    let what = "of these rows name another position; the first row counts: check `vehicle` and `time`";
    about.find_of(conflicts, 100 * conflicts > rows, what);
}

/// The frame rate, frames of the recording per frame as recorded, and what turns frames or times of the file into frames of
/// the recording.
fn clock(
    raw: &mut RawRecording,
    preset: &Preset,
    about: &mut Understanding,
    bad: &dyn Fn(&str, &str) -> Error,
) -> Result<(f64, f64, impl Fn(f64) -> f64 + use<>)> {
    let mut steps: Vec<f64> = raw.vehicles.iter().flat_map(|vehicle| vehicle.samples.steps()).collect();
    if steps.is_empty() {
        return Err(bad("no vehicle has two samples", "check the columns for vehicle and time"));
    }
    let step = median(&mut steps);
    let of_times = if raw.has_frames { None } else { Some(on_raster(&mut raw.vehicles, step)) };
    let origin = raw.vehicles.iter().map(|vehicle| vehicle.samples.of(AT, 0)).fold(f64::INFINITY, f64::min);
    // Frames as recorded: per second, per unit of the file's times, and that of the first time.
    let (source, rate_hz, scale, first) = if let Some(rate_hz) = of_times {
        about.seen.rate_is_of_times = true;
        if let Some(said) = preset.frame_rate_hz.filter(|said| (said / rate_hz - 1.0).abs() > 0.02) {
            about.refuse(format!("the times have {rate_hz:.2} frames per second, the preset says {said}"));
        }
        ("times", rate_hz, rate_hz, if origin.abs() < 1e6 { origin * rate_hz } else { 0.0 })
    } else {
        let rate_hz = raw.frame_rate_hz.or(preset.frame_rate_hz).ok_or_else(|| {
            bad("the frame rate is unknown", "set `frame_rate_hz` in the preset, or name a column for `time`")
        })?;
        let source = if raw.frame_rate_hz.is_some() { "meta file" } else { "preset" };
        let stride = step.round().max(1.0);
        (source, rate_hz / stride, 1.0 / stride, origin / stride)
    };
    if !(0.1..=1e4).contains(&rate_hz) {
        let problem = format!("{rate_hz} frames per second: the times or the frame rate are wrong");
        return Err(bad(&problem, "check the unit of `time` (s, ms, us, ns, date), or `frame_rate_hz`"));
    }
    let factor = preset.resample_hz.map_or(1.0, |wanted| wanted / rate_hz);
    about.fact("rate", format!("{} Hz, from the {source}", value(rate_hz * factor)));
    let first = first.round() * factor;
    Ok((rate_hz * factor, factor, move |at| first + (at - origin) * scale * factor))
}

/// By how much each step of a vehicle differs from what the step before it and the one after it tell, whichever is closer, less
/// what an acceleration explains, m. What lies to the side counts for less.
fn step_differences_m(samples: &[Sample], time_s: impl Fn(f64) -> f64) -> Vec<f64> {
    let (Some(first), Some(last)) = (samples.first(), samples.last()) else { return Vec::new() };
    let minus = |a: &Sample, b: &Sample| [a[X] - b[X], a[Y] - b[Y]];
    let steps: Vec<([f64; 2], f64)> =
        samples.windows(2).map(|pair| (minus(&pair[1], &pair[0]), time_s(pair[1][AT]) - time_s(pair[0][AT]))).collect();
    let overall = unit(minus(last, first));
    let difference_m = |k: usize, beside: usize| {
        let ((by, dt_s), (other, other_s)) = (steps[k], steps[beside]);
        let scale = dt_s / other_s;
        let off = [by[0] - scale * other[0], by[1] - scale * other[1]];
        // A slow step has no direction.
        let is_slow = libm::hypot(other[0], other[1]) < other_s;
        let along = unit(other).filter(|_| !is_slow).or(overall).unwrap_or([1.0, 0.0]);
        let explained_m = ACCELERATION_MPS2 * dt_s * (dt_s + other_s) / 2.0;
        (dot(along, off).abs() - explained_m).max(cross(along, off).abs() * JUMP_M / JUMP_ASIDE_M)
    };
    let beside = |k: usize| [k.checked_sub(1), Some(k + 1).filter(|next| *next < steps.len())];
    let closest = |k: usize| beside(k).into_iter().flatten().map(|other| difference_m(k, other)).reduce(f64::min);
    (0..steps.len()).map(|k| closest(k).unwrap_or(0.0).max(0.0)).collect()
}

/// The rate of the times, of which `step` is the median step. Times that were rounded, to their last digit or to binary32, become
/// those of the raster that they are within half a unit of; numbers of frames win where the file has them.
fn on_raster(vehicles: &mut [RawVehicle], step: f64) -> f64 {
    let rate = rate_of_times(vehicles, step);
    let all = |column: usize| {
        vehicles.iter().flat_map(move |of| (0..of.samples.len()).map(move |k| of.samples.of(column, k)))
    };
    let unit_s = unit_of_times(|| all(AT));
    let mut by_frames: Vec<f64> = vehicles
        .iter()
        .flat_map(|of| (1..of.samples.len()).map(|k| of.samples.of(OTHER_CLOCK, k) - of.samples.of(OTHER_CLOCK, k - 1)))
        .collect();
    let stride = median(&mut by_frames);
    let has_frames = stride >= 1.0 && all(OTHER_CLOCK).all(|frame| frame.fract() == 0.0);
    if !has_frames && unit_s * rate <= OFF_RASTER {
        return rate;
    }
    let (first_s, first_frame) = (vehicles[0].samples.of(AT, 0), vehicles[0].samples.of(OTHER_CLOCK, 0));
    // Steps of the raster since the first time, which may itself be off by `off_s`.
    let steps = |of: &Samples, k: usize, rate: f64, off_s: f64| match has_frames {
        true => (of.of(OTHER_CLOCK, k) - first_frame) / stride,
        false => ((of.of(AT, k) - first_s - off_s) * rate).round(),
    };
    // By how much times are off the raster, the least and the most.
    let off = |rate: f64, off_s: f64| {
        let off = |of: &Samples, k: usize| of.of(AT, k) - first_s - steps(of, k, rate, off_s) / rate;
        range(vehicles.iter().flat_map(|of| (0..of.samples.len()).map(|k| off(&of.samples, k)).collect::<Vec<f64>>()))
    };
    let whole = rate.round();
    let usual = [whole, whole / 1.001].into_iter().filter(|usual| (usual / rate - 1.0).abs() < 0.01);
    let tried = usual.chain([rate]).flat_map(|rate| OFFSETS.map(|part| (rate, part * unit_s)));
    let fit = |limit_s: f64, (rate, off_s): (f64, f64)| {
        let (low, high) = off(rate, off_s);
        (high - low <= limit_s * (1.0 + 1e-6)).then_some((rate, off_s, first_s + 0.5 * (low + high)))
    };
    let limit_s = if has_frames { unit_s.max(OFF_RASTER / rate) } else { unit_s };
    let near = if (whole / rate - 1.0).abs() < 1e-3 { whole } else { rate };
    let by_frames = || fit(0.9 / rate, (near, 0.0)).filter(|_| has_frames);
    let found = { tried }.find_map(|tried| fit(limit_s, tried)).or_else(by_frames);
    let Some((rate, off_s, zero_s)) = found else { return rate };
    for of in vehicles.iter_mut() {
        let mut samples = of.samples.to_vec();
        for (k, sample) in samples.iter_mut().enumerate() {
            sample[AT] = zero_s + steps(&of.samples, k, rate, off_s) / rate;
        }
        of.samples = samples.iter().collect();
    }
    rate
}

/// The unit of the last digit of times, s, at least 0.1 ms, or that of binary32; 0 for others.
fn unit_of_times<I: Iterator<Item = f64>>(times: impl Fn() -> I) -> f64 {
    let is_unit = |unit: &f64| {
        let off = |time: f64| (time / unit - (time / unit).round()).abs();
        times().all(|time| off(time) < 1e-6 + 1e-15 * (time / unit).abs())
    };
    let single_s = times().fold(0.0, |most: f64, time| most.max(time.abs())) * f64::from(f32::EPSILON);
    match [1.0, 0.1, 0.01, 1e-3, 1e-4].iter().find(|unit| is_unit(unit)) {
        // A number of binary32 may have been written as a text.
        Some(unit) if single_s < *unit => unit + single_s,
        Some(unit) => *unit,
        None if times().all(|time| f64::from(time as f32) == time) => single_s,
        None => 0.0,
    }
}

/// Steps over time of all vehicles, because a rounded step is not exact, and vehicles may have times of their own.
fn rate_of_times(vehicles: &[RawVehicle], step: f64) -> f64 {
    let (mut steps, mut span) = (0.0, 0.0);
    for by in vehicles.iter().flat_map(|vehicle| vehicle.samples.steps()) {
        // A gap tells less about the step.
        if by < 5.5 * step {
            steps += (by / step).round();
            span += by;
        }
    }
    let rate = if span > 0.0 && steps > 0.0 { steps / span } else { 1.0 / step };
    let whole = rate.round();
    if whole >= 1.0 && (rate / whole - 1.0).abs() < 3e-4 { whole } else { rate }
}

/// The samples at whole frames: as they are, or by linear interpolation.
fn at_frames<'a>(piece: &'a [Sample], frames: &[f64]) -> (Cow<'a, [Sample]>, i64) {
    let first = frames[0].round();
    let is_on = |(k, frame): (usize, &f64)| (frame - first - k as f64).abs() <= OFF_RASTER;
    if frames.iter().enumerate().all(is_on) {
        return (piece.into(), first as i64);
    }
    let first = (frames[0] - OFF_RASTER).ceil();
    let last = (frames[frames.len() - 1] + OFF_RASTER).floor();
    let mut samples = Vec::new();
    let mut k = 0;
    let mut frame = first;
    while frame <= last {
        while k + 2 < frames.len() && frames[k + 1] <= frame {
            k += 1;
        }
        let (a, b) = (k, (k + 1).min(frames.len() - 1));
        let part = if b > a { ((frame - frames[a]) / (frames[b] - frames[a])).clamp(0.0, 1.0) } else { 0.0 };
        samples.push(between(&piece[a], &piece[b], part));
        frame += 1.0;
    }
    (samples.into(), first as i64)
}
