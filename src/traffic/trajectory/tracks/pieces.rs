//! The time base of a recording: its frame rate, and gapless pieces of tracks at its frames.

use std::borrow::Cow;

use super::preset::Preset;
use super::raw::{RawRecording, RawSample};
use super::road::{cross, dot, median, unit};
use super::samples::Samples;
use super::understanding::{TIMES, Understanding};
use crate::support::readable::significant;
use crate::{Error, Place, Result};

/// A sample this far off the raster of times, in frames, is interpolated.
const OFF_RASTER: f64 = 0.02;
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
}

/// The frame rate, and the tracks in gapless pieces at its frames.
pub(super) fn pieces(
    raw: &mut RawRecording,
    preset: &Preset,
    about: &mut Understanding,
    place: &Place,
) -> Result<(f64, Vec<Piece>)> {
    for vehicle in &mut raw.vehicles {
        if vehicle.samples.steps().all(|step| step > 0.0) {
            continue;
        }
        let mut samples = vehicle.samples.to_vec();
        samples.sort_by(|a, b| a.at.total_cmp(&b.at));
        let count = samples.len();
        samples.dedup_by(|later, first| {
            let is_repeated = later.at == first.at;
            let apart_m = |axis: usize| (later.xy_m[axis] - first.xy_m[axis]).abs();
            about.conflicts += u64::from(is_repeated && apart_m(0).max(apart_m(1)) > SAME_PLACE_M);
            is_repeated
        });
        about.duplicates += (count - samples.len()) as u64;
        vehicle.samples = samples.iter().collect();
    }
    let bad = |problem: &str, help: &str| Error::input(place.clone(), problem, help);
    let mut steps: Vec<f64> = raw.vehicles.iter().flat_map(|vehicle| vehicle.samples.steps()).collect();
    if steps.is_empty() {
        return Err(bad("no vehicle has two samples", "check the columns for vehicle and time"));
    }
    let step = median(&mut steps);
    let origin = raw.vehicles.iter().map(|vehicle| vehicle.samples.at(0)).fold(f64::INFINITY, f64::min);
    // (frames of the recording per unit of `at`, frame at the origin)
    let (rate_hz, scale, first) = if raw.has_frames {
        let rate_hz = raw.frame_rate_hz.or(preset.frame_rate_hz).ok_or_else(|| {
            bad("the frame rate is unknown", "set `frame_rate_hz` in the preset, or name a column for `time`")
        })?;
        about.rate_source = if raw.frame_rate_hz.is_some() { "meta file" } else { "preset" }.to_owned();
        let stride = step.round().max(1.0);
        if stride > 1.0 {
            let (source, apart_s) = (&about.rate_source, significant(stride / rate_hz, 3));
            let text = format!(
                "frame numbers rise by {stride} from row to row; at {rate_hz} frames per second ({source}), rows are {apart_s} s apart"
            );
            about.warn(text);
        }
        (rate_hz / stride, 1.0 / stride, origin / stride)
    } else {
        let rate_hz = rate_of_times(raw, step);
        about.rate_source = TIMES.to_owned();
        if let Some(said) = preset.frame_rate_hz.filter(|said| (said / rate_hz - 1.0).abs() > 0.02) {
            about.refuse(format!("the times have {rate_hz:.2} frames per second, the preset says {said}"));
        }
        (rate_hz, rate_hz, if origin.abs() < 1e6 { origin * rate_hz } else { 0.0 })
    };
    if !(0.1..=1e4).contains(&rate_hz) {
        return Err(bad(
            &format!("{rate_hz} frames per second: the times or the frame rate are wrong"),
            "check the unit of `time` (s, ms, us, ns, date), or `frame_rate_hz`",
        ));
    }
    let factor = preset.resample_hz.map_or(1.0, |wanted| wanted / rate_hz);
    let rate_hz = rate_hz * factor;
    about.rate_hz = rate_hz;
    let frame = |at: f64| first.round() * factor + (at - origin) * scale * factor;
    let max_gap = (preset.max_gap_s * rate_hz).max(1.0) + 0.5 + factor;
    let time_s = |at: f64| frame(at) / rate_hz;
    let mut differences_m: Vec<f64> =
        raw.vehicles.iter().flat_map(|of| step_differences_m(&of.samples.to_vec(), time_s)).collect();
    let jump_m = JUMP_M.max(JUMP_OVER_NOISE * median(&mut differences_m));
    drop(differences_m);
    let rows: usize = raw.vehicles.iter().map(|vehicle| vehicle.samples.len()).sum();
    let mut pieces = Vec::new();
    let mut total = 0.0;
    let mut first_jump = None;
    for (vehicle, of) in raw.vehicles.iter_mut().enumerate() {
        // From here on, pieces hold them.
        let mut stored = std::mem::take(&mut of.samples);
        let samples = stored.to_vec();
        let differences_m = step_differences_m(&samples, time_s);
        let mut from = 0;
        for to in 1..=samples.len() {
            if to < samples.len() && frame(samples[to].at) - frame(samples[to - 1].at) <= max_gap {
                let by_m = differences_m[to - 1];
                if by_m <= jump_m {
                    continue;
                }
                about.jumps += 1;
                first_jump.get_or_insert((of.key.clone(), frame(samples[to].at).round(), by_m));
            }
            let piece = &samples[from..to];
            from = to;
            let frames: Vec<f64> = piece.iter().map(|sample| frame(sample.at)).collect();
            total += frames[frames.len() - 1] - frames[0] + 1.0;
            if total > SAMPLES_PER_ROW * rows as f64 + FREE_SAMPLES {
                let problem = "the tracks have far more frames than the file has rows";
                return Err(bad(problem, "check the unit of `time`, the frame rates and `max_gap_s`"));
            }
            let (at_frames, first_frame) = at_frames(piece, &frames, about);
            if at_frames.len() >= MIN_PIECE {
                let is_whole = matches!(at_frames, Cow::Borrowed(_)) && piece.len() == samples.len();
                let samples = if is_whole { std::mem::take(&mut stored) } else { at_frames.iter().collect() };
                pieces.push(Piece { vehicle, first_frame, samples });
            } else {
                about.short_pieces += 1;
            }
        }
    }
    about.split_tracks = (pieces.len() as u64).saturating_sub(raw.vehicles.len() as u64 + about.jumps);
    if about.split_tracks > 0 {
        let text = format!(
            "gaps longer than {} s split the tracks of {} vehicles into {}: see `max_gap_s`",
            preset.max_gap_s,
            raw.vehicles.len(),
            pieces.len()
        );
        about.find(about.split_tracks > raw.vehicles.len() as u64, text);
    }
    if let Some((vehicle, frame, by_m)) = first_jump {
        let text = format!(
            "{} step(s) that no vehicle makes split tracks, the first is that of vehicle {vehicle} to frame {frame}, by {} m: a number \
             used again, or wrong positions",
            about.jumps,
            significant(by_m, 3)
        );
        about.find(about.jumps > raw.vehicles.len() as u64, text);
    }
    if pieces.is_empty() {
        return Err(bad("no vehicle is in view for three samples", "check the columns for vehicle and time"));
    }
    Ok((rate_hz, pieces))
}

/// By how much each step of a vehicle differs from what the step before it and the one after it tell, whichever is closer, less
/// what an acceleration explains, m. What lies to the side counts for less.
fn step_differences_m(samples: &[RawSample], time_s: impl Fn(f64) -> f64) -> Vec<f64> {
    let (Some(first), Some(last)) = (samples.first(), samples.last()) else { return Vec::new() };
    let minus = |a: [f64; 2], b: [f64; 2]| [a[0] - b[0], a[1] - b[1]];
    let steps: Vec<([f64; 2], f64)> = samples
        .windows(2)
        .map(|pair| (minus(pair[1].xy_m, pair[0].xy_m), time_s(pair[1].at) - time_s(pair[0].at)))
        .collect();
    let overall = unit(minus(last.xy_m, first.xy_m));
    let difference_m = |k: usize, beside: usize| {
        let ((by, dt_s), (other, other_s)) = (steps[k], steps[beside]);
        let scale = dt_s / other_s;
        let off = minus(by, [scale * other[0], scale * other[1]]);
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

/// Steps over time of all vehicles, because a rounded step is not exact, and vehicles may have times of their own.
fn rate_of_times(raw: &RawRecording, step: f64) -> f64 {
    let (mut steps, mut span) = (0.0, 0.0);
    for by in raw.vehicles.iter().flat_map(|vehicle| vehicle.samples.steps()) {
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
fn at_frames<'a>(piece: &'a [RawSample], frames: &[f64], about: &mut Understanding) -> (Cow<'a, [RawSample]>, i64) {
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
        samples.push(RawSample::between(&piece[a], &piece[b], part));
        frame += 1.0;
    }
    let off = |frame: &f64| (frame - frame.round()).abs();
    about.interpolated += samples.len() as u64;
    about.off_raster_frames = frames.iter().map(off).fold(about.off_raster_frames, f64::max);
    (samples.into(), first as i64)
}
