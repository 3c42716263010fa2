//! From what a file says to a [`Recording`]: time base, gaps, boxes, road, lanes, speeds.

use super::lanes::{LaneSource, Lateral, lane_lines, lines_of_map};
use super::preset::{Preset, Reference, RoadSource, Role, Side};
use super::raw::{NO_LABEL, RawRecording, RawSample, RawVehicle, to_centre_m};
use super::road::{OnRoad, Path, RoadLine, cross, dot, median};
use super::smooth::{central, savitzky_golay};
use super::understanding::{Exclusion, Understanding, UnderstoodCarriageway};
use crate::support::plausibility::NOISE_MPS;
use crate::traffic::trajectory::{Carriageway, NO_LANE, Recording, Track, VehicleClass};
use crate::{Error, Place, Result};

/// A sample this far off the raster of times, in frames, is interpolated.
const OFF_RASTER: f64 = 0.02;
/// Pieces of a track with fewer samples tell nothing.
const MIN_PIECE: usize = 3;
/// Maximum number of paths that the road is fitted to.
const FITTED_PATHS: usize = 400;
/// Time between positions that the road is fitted to, s.
const FITTED_STEP_S: f64 = 0.2;
/// Length and width where neither file nor preset has them, m.
const USUAL_CAR_M: [f64; 2] = [4.6, 1.9];
const USUAL_TRUCK_M: [f64; 2] = [12.0, 2.5];
/// A vehicle of this length is a lorry if no class tells, m.
const TRUCK_FROM_M: f64 = 7.0;
/// Maximum number of samples that one row of a file becomes by interpolation, beyond [`FREE_SAMPLES`] for all.
const SAMPLES_PER_ROW: f64 = 200.0;
const FREE_SAMPLES: f64 = 1e5;

/// A gapless stretch of a vehicle's track at the frames of the recording.
struct Piece {
    vehicle: usize,
    first_frame: i64,
    samples: Vec<RawSample>,
}

/// A piece on its carriageway.
struct Placed {
    piece: Piece,
    is_forward: bool,
    on: Vec<OnRoad>,
}

/// The recording, and what was understood.
pub(super) fn assemble(
    mut raw: RawRecording,
    preset: &Preset,
    roles: &[Role],
    place: &Place,
) -> Result<(Recording, Understanding)> {
    let mut about = Understanding::new(&raw.id, raw.incomplete);
    let before = raw.vehicles.len();
    raw.vehicles.retain(|vehicle| !is_ignored(vehicle, preset));
    about.ignored = (before - raw.vehicles.len()) as u64;
    let (rate_hz, pieces) = pieces(&mut raw, preset, &mut about, place)?;
    let boxes: Vec<Sized> = raw.vehicles.iter().map(|vehicle| sized(vehicle, preset)).collect();
    about.assumed_sizes = boxes.iter().filter(|of| of.is_assumed).count() as u64;
    about.changing_sizes = boxes.iter().filter(|of| of.changes).count() as u64;
    let has_heading = roles.contains(&Role::Heading);
    let y_sign = if preset.axes.y == Side::Right { -1.0 } else { 1.0 };
    let mut pieces = pieces;
    for piece in &mut pieces {
        centre(piece, &boxes[piece.vehicle], preset.reference, has_heading, y_sign);
    }
    let (lines, forward) = road(&pieces, &raw, preset, rate_hz).ok_or_else(|| {
        Error::input(place.clone(), "no vehicle moves, so the road is unknown", "check x and y and their units")
    })?;
    let shift_along = match (preset.reference, has_heading) {
        (Reference::Front, false) => -0.5,
        (Reference::Rear, false) => 0.5,
        _ => 0.0,
    };
    let mut placed: Vec<Placed> = pieces
        .into_iter()
        .zip(forward)
        .map(|(piece, is_forward)| {
            let path: Path = piece.samples.iter().map(|sample| sample.xy_m).collect();
            let mut on = lines[usize::from(is_forward)].as_ref().map_or(Vec::new(), |line| line.project_all(&path));
            let by_m = shift_along * boxes[piece.vehicle].length_m;
            on.iter_mut().for_each(|p| p.s_m += by_m);
            Placed { piece, is_forward, on }
        })
        .collect();
    describe_road(&mut about, &lines, &placed);
    about.oncoming_left_m = oncoming_left_m(&lines, &placed);
    let mut carriageways: Vec<Carriageway> = Vec::new();
    let mut index = [usize::MAX; 2];
    for (side, name) in [(0, "1"), (1, "2")] {
        let here = || placed.iter().filter(|of| usize::from(of.is_forward) == side);
        let tracks = here().count();
        let stride = rate_hz.round().max(1.0) as usize;
        let laterals: Vec<Lateral> = here()
            .flat_map(|of| {
                of.on.iter().zip(&of.piece.samples).step_by(stride).map(|(on, sample)| (on.d_m, sample.lane))
            })
            .collect();
        let of_map = lines[side].as_ref().map(|line| map_lines(line, &raw.boundaries)).unwrap_or_default();
        let found = match of_map.len() {
            2.. => Some((of_map, LaneSource::Map)).filter(|_| !laterals.is_empty()),
            _ => lane_lines(&laterals, preset.lanes.width_m),
        };
        let Some((lane_lines_m, source)) = found else { continue };
        if source == LaneSource::Names {
            about.lane_offset_error_m =
                place_by_offset(&mut placed, side == 1, &lane_lines_m).or(about.lane_offset_error_m);
        }
        index[side] = carriageways.len();
        about.carriageways.push(UnderstoodCarriageway::of(name, &lane_lines_m, source, tracks));
        carriageways.push(Carriageway { name: name.to_owned(), lane_lines_m });
    }
    order_sideways(&mut carriageways, &mut placed);
    let ids = ids(&placed, &raw.vehicles);
    about.renumbered = ids.iter().zip(&placed).any(|(id, of)| raw.vehicles[of.piece.vehicle].key != id.to_string());
    let mut tracks: Vec<Track> = Vec::with_capacity(placed.len());
    for (of, id) in placed.iter().zip(ids) {
        let vehicle = &boxes[of.piece.vehicle];
        let carriageway = index[usize::from(of.is_forward)];
        let Some(lanes) = carriageways.get(carriageway) else { continue };
        tracks.push(track(of, id, vehicle, carriageway, lanes, (rate_hz, preset.smoothing_s), &mut about));
    }
    tracks.sort_by_key(|track| track.id);
    about.label_mismatch = label_mismatch(&placed, &carriageways, index);
    about.heading_facts = heading_facts(&placed, rate_hz);
    let recording = Recording { id: raw.id, frame_rate_hz: rate_hz, carriageways, tracks, synthetic: raw.synthetic };
    let (recording, excluded) = about.judge(recording, preset);
    about.excluded = excluded;
    if recording.tracks.is_empty() {
        return Err(Error::input(
            place.clone(),
            "no vehicle is left",
            "see what `lanesweep tracks` says about the file",
        ));
    }
    Ok((recording, about))
}

fn is_ignored(vehicle: &RawVehicle, preset: &Preset) -> bool {
    vehicle.samples.is_empty() || vehicle.class.as_ref().is_some_and(|class| begins_so(class, &preset.classes.ignored))
}

fn begins_so(class: &str, list: &[String]) -> bool {
    let class = class.to_lowercase();
    list.iter().any(|text| class.starts_with(&text.to_lowercase()))
}

/// A vehicle's box.
struct Sized {
    length_m: f64,
    width_m: f64,
    class: VehicleClass,
    /// The file has no size.
    is_assumed: bool,
    /// It varies by more than a tenth.
    changes: bool,
}

fn sized(vehicle: &RawVehicle, preset: &Preset) -> Sized {
    let class = vehicle.class.as_deref().unwrap_or_default();
    let of = |sizes: &[f64]| {
        let value = median(&mut sizes.to_vec());
        (!value.is_nan()).then_some(value)
    };
    let (length_m, width_m) = (of(&vehicle.lengths_m), of(&vehicle.widths_m));
    let is_named_truck = begins_so(class, &preset.classes.truck);
    let truck_from_m = preset.classes.truck_from_m;
    let is_long = |from_m: f64| length_m.is_some_and(|length_m| length_m >= from_m);
    let is_truck = match truck_from_m {
        Some(from_m) => is_long(from_m) && (preset.classes.truck.is_empty() || is_named_truck || class.is_empty()),
        None if preset.classes.truck.is_empty() || class.is_empty() => is_long(TRUCK_FROM_M),
        None => is_named_truck,
    };
    let usual = preset.sizes.get(class).or_else(|| preset.sizes.get("default")).copied();
    let usual = usual.unwrap_or(if is_truck { USUAL_TRUCK_M } else { USUAL_CAR_M });
    let varies = |sizes: &[f64]| {
        let (low, high) = sizes.iter().fold((f64::INFINITY, 0.0_f64), |(l, h), v| (l.min(*v), h.max(*v)));
        sizes.len() > 1 && high > 1.1 * low
    };
    Sized {
        length_m: length_m.unwrap_or(usual[0]),
        width_m: width_m.unwrap_or(usual[1]),
        class: if is_truck { VehicleClass::Truck } else { VehicleClass::Car },
        is_assumed: length_m.is_none() || width_m.is_none(),
        changes: varies(&vehicle.lengths_m) || varies(&vehicle.widths_m),
    }
}

/// The frame rate, and the tracks in gapless pieces at its frames.
fn pieces(
    raw: &mut RawRecording,
    preset: &Preset,
    about: &mut Understanding,
    place: &Place,
) -> Result<(f64, Vec<Piece>)> {
    for vehicle in &mut raw.vehicles {
        vehicle.samples.sort_by(|a, b| a.at.total_cmp(&b.at));
        let count = vehicle.samples.len();
        vehicle.samples.dedup_by(|a, b| a.at == b.at);
        about.duplicates += (count - vehicle.samples.len()) as u64;
    }
    let bad = |problem: &str, help: &str| Error::input(place.clone(), problem, help);
    let mut steps: Vec<f64> =
        raw.vehicles.iter().flat_map(|vehicle| vehicle.samples.windows(2).map(|w| w[1].at - w[0].at)).collect();
    if steps.is_empty() {
        return Err(bad("no vehicle has two samples", "check the columns for vehicle and time"));
    }
    let step = median(&mut steps);
    let origin = raw.vehicles.iter().map(|vehicle| vehicle.samples[0].at).fold(f64::INFINITY, f64::min);
    // (frames of the recording per unit of `at`, frame at the origin)
    let (rate_hz, scale, first) = if raw.has_frames {
        let rate_hz = raw.frame_rate_hz.or(preset.frame_rate_hz).ok_or_else(|| {
            bad("the frame rate is unknown", "set `frame_rate_hz` in the preset, or name a column for `time`")
        })?;
        about.rate_source = if raw.frame_rate_hz.is_some() { "meta file" } else { "preset" }.to_owned();
        let stride = step.round().max(1.0);
        (rate_hz / stride, 1.0 / stride, origin / stride)
    } else {
        let rate_hz = rate_of_times(raw, step);
        about.rate_source = "times".to_owned();
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
    let rows: usize = raw.vehicles.iter().map(|vehicle| vehicle.samples.len()).sum();
    let mut pieces = Vec::new();
    let mut total = 0.0;
    for (vehicle, of) in raw.vehicles.iter().enumerate() {
        let samples = &of.samples;
        let mut from = 0;
        for to in 1..=samples.len() {
            if to < samples.len() && frame(samples[to].at) - frame(samples[to - 1].at) <= max_gap {
                continue;
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
                pieces.push(Piece { vehicle, first_frame, samples: at_frames });
            } else {
                about.short_pieces += 1;
            }
        }
    }
    if pieces.is_empty() {
        return Err(bad("no vehicle is in view for three samples", "check the columns for vehicle and time"));
    }
    Ok((rate_hz, pieces))
}

/// Steps of the recording over its duration, because a rounded step is not exact.
fn rate_of_times(raw: &RawRecording, step: f64) -> f64 {
    let mut times: Vec<f64> = raw.vehicles.iter().flat_map(|v| v.samples.iter().map(|sample| sample.at)).collect();
    times.sort_by(f64::total_cmp);
    times.dedup_by(|a, b| *a - *b < 0.25 * step);
    let steps: f64 = times.windows(2).map(|pair| ((pair[1] - pair[0]) / step).round()).sum();
    let span = times[times.len() - 1] - times[0];
    let rate = if span > 0.0 { steps / span } else { 1.0 / step };
    let whole = rate.round();
    if whole >= 1.0 && (rate / whole - 1.0).abs() < 3e-4 { whole } else { rate }
}

/// The samples at whole frames: as they are, or by linear interpolation.
fn at_frames(piece: &[RawSample], frames: &[f64], about: &mut Understanding) -> (Vec<RawSample>, i64) {
    let first = frames[0].round();
    let is_on = |(k, frame): (usize, &f64)| (frame - first - k as f64).abs() <= OFF_RASTER;
    if frames.iter().enumerate().all(is_on) {
        return (piece.to_vec(), first as i64);
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
        samples.push(mix(&piece[a], &piece[b], part));
        frame += 1.0;
    }
    let off = |frame: &f64| (frame - frame.round()).abs();
    about.interpolated += samples.len() as u64;
    about.off_raster_frames = frames.iter().map(off).fold(about.off_raster_frames, f64::max);
    (samples, first as i64)
}

fn mix(a: &RawSample, b: &RawSample, part: f64) -> RawSample {
    let one = |a: f64, b: f64| {
        if part == 0.0 {
            a
        } else if part == 1.0 {
            b
        } else {
            a + part * (b - a)
        }
    };
    let two = |a: [f64; 2], b: [f64; 2]| [one(a[0], b[0]), one(a[1], b[1])];
    RawSample {
        at: one(a.at, b.at),
        xy_m: two(a.xy_m, b.xy_m),
        heading: two(a.heading, b.heading),
        speed_mps: one(a.speed_mps, b.speed_mps),
        velocity_mps: two(a.velocity_mps, b.velocity_mps),
        along_mps: two(a.along_mps, b.along_mps),
        acceleration_mps2: one(a.acceleration_mps2, b.acceleration_mps2),
        acceleration_xy_mps2: two(a.acceleration_xy_mps2, b.acceleration_xy_mps2),
        lane: if part < 0.5 { a.lane } else { b.lane },
        lane_offset_m: if part < 0.5 { a.lane_offset_m } else { b.lane_offset_m },
    }
}

/// Moves the positions from the reference point to the middle of the box.
fn centre(piece: &mut Piece, of: &Sized, reference: Reference, has_heading: bool, y_sign: f64) {
    if reference == Reference::Centre || (reference != Reference::Corner && !has_heading) {
        return;
    }
    let (first, last) = (piece.samples[0].xy_m, piece.samples[piece.samples.len() - 1].xy_m);
    let travel = [last[0] - first[0], last[1] - first[1]];
    for sample in &mut piece.samples {
        let heading = if sample.heading[0].is_nan() { travel } else { sample.heading };
        let norm = libm::hypot(heading[0], heading[1]);
        if norm > 0.0 {
            let by = to_centre_m(reference, [heading[0] / norm, heading[1] / norm], of.length_m, of.width_m, y_sign);
            sample.xy_m = [sample.xy_m[0] + by[0], sample.xy_m[1] + by[1]];
        }
    }
}

/// The lines of the backward and forward carriageway, and whether each piece drives forward.
fn road(
    pieces: &[Piece],
    raw: &RawRecording,
    preset: &Preset,
    rate_hz: f64,
) -> Option<([Option<RoadLine>; 2], Vec<bool>)> {
    let displacement = |piece: &Piece| {
        let (a, b) = (piece.samples[0].xy_m, piece.samples[piece.samples.len() - 1].xy_m);
        [b[0] - a[0], b[1] - a[1]]
    };
    let given = |piece: &Piece| raw.vehicles[piece.vehicle].direction;
    let along = match preset.road {
        RoadSource::X => Some([1.0, 0.0]),
        RoadSource::Y => Some([0.0, 1.0]),
        RoadSource::Tracks => None,
    };
    if let Some(along) = along {
        let line = RoadLine::straight([0.0; 2], along);
        let is_forward = |piece: &Piece| given(piece).unwrap_or_else(|| dot(along, displacement(piece))) >= 0.0;
        return Some(([Some(line.reversed()), Some(line)], pieces.iter().map(is_forward).collect()));
    }
    let stride = (FITTED_STEP_S * rate_hz).round().max(1.0) as usize;
    let path = |piece: &Piece| -> Path {
        let last = piece.samples.len() - 1;
        (0..=last).filter(|k| k % stride == 0 || *k == last).map(|k| piece.samples[k].xy_m).collect()
    };
    let size = |piece: &Piece| libm::hypot(displacement(piece)[0], displacement(piece)[1]);
    let longest = pieces.iter().max_by(|a, b| size(a).total_cmp(&size(b)))?;
    if size(longest) < 1.0 {
        return None;
    }
    let first = RoadLine::fit(&[path(longest)])?;
    let gain = |piece: &Piece| {
        let (a, b) = (piece.samples[0].xy_m, piece.samples[piece.samples.len() - 1].xy_m);
        first.project(b, None).s_m - first.project(a, None).s_m
    };
    let mut forward: Vec<bool> =
        pieces.iter().map(|piece| given(piece).unwrap_or_else(|| gain(piece)) >= 0.0).collect();
    // Forward is towards +x, or +y on a road along y.
    let travel = displacement(longest);
    let leads = if travel[0].abs() > 0.2 * travel[1].abs() { travel[0] } else { travel[1] };
    let longest_is_forward = gain(longest) >= 0.0;
    if (leads >= 0.0) != longest_is_forward && raw.vehicles.iter().all(|vehicle| vehicle.direction.is_none()) {
        forward.iter_mut().for_each(|is| *is = !*is);
    }
    let line = |is_forward: bool| {
        let mut here: Vec<&Piece> =
            pieces.iter().zip(&forward).filter(|(_, is)| **is == is_forward).map(|(piece, _)| piece).collect();
        here.sort_by(|a, b| size(b).total_cmp(&size(a)).then(a.vehicle.cmp(&b.vehicle)));
        let of_map = |boundary: &&Path| {
            let ends = boundary.first().zip(boundary.last());
            ends.is_some_and(|(a, b)| {
                (first.project(*b, None).s_m > first.project(*a, None).s_m) == (is_forward == longest_is_forward)
            })
        };
        let boundaries: Vec<Path> = raw.boundaries.iter().filter(of_map).map(|boundary| dense(boundary)).collect();
        if !boundaries.is_empty() && !here.is_empty() {
            return RoadLine::fit(&boundaries);
        }
        // Every n-th of them, from the longest on.
        let every = here.len().div_ceil(FITTED_PATHS).max(1);
        RoadLine::fit(&here.into_iter().step_by(every).map(path).collect::<Vec<_>>())
    };
    let (backward_line, forward_line) = (line(false), line(true));
    let lines = match (backward_line, forward_line) {
        (Some(backward), Some(forward)) if backward.is_straight() && forward.is_straight() => {
            [Some(forward.reversed()), Some(forward)]
        }
        (backward, forward) => [backward, forward],
    };
    Some((lines, forward))
}

/// A polyline with a point per metre.
fn dense(points: &[[f64; 2]]) -> Path {
    let mut path: Path = points.first().copied().into_iter().collect();
    for pair in points.windows(2) {
        let by = [pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]];
        let steps = libm::hypot(by[0], by[1]).ceil().clamp(1.0, 10_000.0) as usize;
        path.extend((1..=steps).map(|k| {
            let part = k as f64 / steps as f64;
            [pair[0][0] + part * by[0], pair[0][1] + part * by[1]]
        }));
    }
    path
}

fn describe_road(about: &mut Understanding, lines: &[Option<RoadLine>; 2], placed: &[Placed]) {
    about.is_straight = lines.iter().flatten().all(RoadLine::is_straight);
    about.min_radius_m = lines.iter().flatten().map(RoadLine::min_radius_m).fold(f64::INFINITY, f64::min);
    let mut ranges = Vec::new();
    let mut ends = [(f64::INFINITY, f64::NEG_INFINITY); 2];
    let mut across = 0_u64;
    for of in placed {
        let (l, h) = of.on.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p.d_m), h.max(p.d_m)));
        let travel = of.on[of.on.len() - 1].s_m - of.on[0].s_m;
        if travel.abs() >= 30.0 || h - l > 15.0 {
            ranges.push(h - l);
            across += u64::from(h - l > 15.0);
        }
        let here = &mut ends[usize::from(of.is_forward)];
        *here = of.on.iter().fold(*here, |(l, h), p| (l.min(p.s_m), h.max(p.s_m)));
    }
    about.across_fraction = across as f64 / ranges.len().max(1) as f64;
    about.wander_m = median(&mut ranges);
    about.length_m = ends.iter().map(|(low, high)| high - low).fold(0.0, f64::max);
}

/// How far to the left of the forward vehicles the oncoming ones are, m; `None` without both.
fn oncoming_left_m(lines: &[Option<RoadLine>; 2], placed: &[Placed]) -> Option<f64> {
    let line = lines[1].as_ref()?;
    let middle = |of: &Placed| line.project(of.piece.samples[of.piece.samples.len() / 2].xy_m, None).d_m;
    let of_side = |is_forward: bool| {
        let mut d: Vec<f64> = placed.iter().filter(|of| of.is_forward == is_forward).take(500).map(middle).collect();
        (d.len() >= 3).then(|| median(&mut d))
    };
    Some(of_side(false)? - of_side(true)?)
}

/// Lateral positions of the lines of a map on a road line.
fn map_lines(line: &RoadLine, boundaries: &[Vec<[f64; 2]>]) -> Vec<f64> {
    let middle = |boundary: &Vec<[f64; 2]>| {
        let on = line.project_all(boundary);
        // Only those along this direction of travel.
        let along = on.last()?.s_m - on.first()?.s_m;
        let mut d: Vec<f64> = on.iter().map(|p| p.d_m).collect();
        let spread =
            d.iter().copied().fold(f64::NEG_INFINITY, f64::max) - d.iter().copied().fold(f64::INFINITY, f64::min);
        (along > 5.0 && spread < 1.5).then(|| median(&mut d))
    };
    let lines = lines_of_map(boundaries.iter().filter_map(middle).collect());
    lines
}

/// Where the file gives the distance from the middle of the lane, it is more exact than the line of the road: d becomes the
/// middle of the named lane plus that distance. Returns the median difference to d from the line.
fn place_by_offset(placed: &mut [Placed], is_forward: bool, lines_m: &[f64]) -> Option<f64> {
    let lanes = Carriageway { name: String::new(), lane_lines_m: lines_m.to_vec() };
    // The lane that a name usually is.
    let mut laterals: Vec<Lateral> = placed
        .iter()
        .filter(|of| of.is_forward == is_forward)
        .flat_map(|of| of.on.iter().zip(&of.piece.samples).map(|(on, sample)| (on.d_m, sample.lane)))
        .filter(|(_, label)| *label != NO_LABEL)
        .collect();
    laterals.sort_by(|a, b| a.1.cmp(&b.1).then(a.0.total_cmp(&b.0)));
    let middles: std::collections::HashMap<u32, f64> = laterals
        .chunk_by(|a, b| a.1 == b.1)
        .filter_map(|group| {
            let lane = lanes.lane(lanes.lane_at(group[group.len() / 2].0)?)?;
            Some((group[0].1, lane.centre_m()))
        })
        .collect();
    let offset = |on: &OnRoad, sample: &RawSample| {
        let middle = middles.get(&sample.lane).filter(|_| sample.lane_offset_m.is_finite())?;
        Some((middle, on.d_m - middle))
    };
    // The side on which offsets are positive follows from the positions.
    let here = || placed.iter().filter(|of| of.is_forward == is_forward);
    let pairs = || here().flat_map(|of| of.on.iter().zip(&of.piece.samples));
    let product: f64 = pairs().filter_map(|(on, sample)| Some(offset(on, sample)?.1 * sample.lane_offset_m)).sum();
    let sign = if product < 0.0 { -1.0 } else { 1.0 };
    let differences =
        pairs().filter_map(|(on, sample)| Some((offset(on, sample)?.1 - sign * sample.lane_offset_m).abs()));
    let difference = median(&mut differences.collect::<Vec<_>>());
    // Offsets that do not fit the positions are something else.
    if difference.is_nan() || difference > 0.5 {
        return Some(difference).filter(|difference| !difference.is_nan());
    }
    for of in placed.iter_mut().filter(|of| of.is_forward == is_forward) {
        // Whole tracks only, so that d does not jump.
        let all: Option<Vec<f64>> = of
            .on
            .iter()
            .zip(&of.piece.samples)
            .map(|(on, sample)| offset(on, sample).map(|(middle, _)| middle + sign * sample.lane_offset_m))
            .collect();
        let steady = |d: &Vec<f64>| d.windows(2).all(|pair| (pair[1] - pair[0]).abs() < 0.5);
        if let Some(d) = all.filter(steady) {
            of.on.iter_mut().zip(d).for_each(|(on, d_m)| on.d_m = d_m);
        }
    }
    Some(difference)
}

/// Moves the backward carriageway sideways if it does not lie to the left of the forward one, as highD's image wants it.
fn order_sideways(carriageways: &mut [Carriageway], placed: &mut [Placed]) {
    let [backward, forward] = carriageways else { return };
    // In the image, y = d of the upper lanes and −d of the lower ones.
    let last_upper = backward.lane_lines_m[0];
    let first_lower = -forward.lane_lines_m[0];
    if last_upper <= first_lower {
        return;
    }
    let by = last_upper - first_lower + 4.0;
    backward.lane_lines_m.iter_mut().for_each(|line| *line -= by);
    for of in placed.iter_mut().filter(|of| !of.is_forward) {
        of.on.iter_mut().for_each(|p| p.d_m -= by);
    }
}

/// The numbers of the pieces: that of the file for the first piece of a vehicle with one, free numbers for the others.
fn ids(placed: &[Placed], vehicles: &[RawVehicle]) -> Vec<u32> {
    let own = |key: &str| key.parse::<u32>().ok().filter(|id| *id < u32::MAX / 2 && id.to_string() == key);
    let all_numbers = vehicles.iter().all(|vehicle| own(&vehicle.key).is_some());
    let mut next = if all_numbers { vehicles.iter().filter_map(|v| own(&v.key)).max().unwrap_or(0) } else { 0 };
    let mut seen = vec![false; vehicles.len()];
    let mut fresh = || {
        next += 1;
        next
    };
    placed
        .iter()
        .map(|of| {
            let is_first = !std::mem::replace(&mut seen[of.piece.vehicle], true);
            match own(&vehicles[of.piece.vehicle].key) {
                Some(id) if all_numbers && is_first => id,
                _ => fresh(),
            }
        })
        .collect()
}

/// Whether every sample has the value.
fn whole(samples: &[RawSample], of: impl Fn(&RawSample) -> f64) -> Option<Vec<f64>> {
    let values: Vec<f64> = samples.iter().map(of).collect();
    values.iter().all(|value| value.is_finite()).then_some(values)
}

fn track(
    of: &Placed,
    id: u32,
    vehicle: &Sized,
    carriageway: usize,
    lanes: &Carriageway,
    (rate_hz, smoothing_s): (f64, Option<f64>),
    about: &mut Understanding,
) -> Track {
    let samples = &of.piece.samples;
    let tangents: Vec<[f64; 2]> = of.on.iter().map(|p| p.tangent).collect();
    let component = |value: fn(&RawSample) -> [f64; 2], part: fn([f64; 2], [f64; 2]) -> f64| {
        let values = samples.iter().zip(&tangents).map(|(sample, tangent)| part(*tangent, value(sample)));
        let values: Vec<f64> = values.collect();
        values.iter().all(|value| value.is_finite()).then_some(values)
    };
    let mut s_m: Vec<f64> = of.on.iter().map(|p| p.s_m).collect();
    let mut d_m: Vec<f64> = of.on.iter().map(|p| p.d_m).collect();
    let given_s = whole(samples, |sample| sample.along_mps[0])
        .or_else(|| component(|sample| sample.velocity_mps, dot))
        .or_else(|| whole(samples, |sample| sample.speed_mps));
    let given_d =
        whole(samples, |sample| sample.along_mps[1]).or_else(|| component(|sample| sample.velocity_mps, cross));
    let given_a = whole(samples, |sample| sample.acceleration_mps2)
        .or_else(|| component(|sample| sample.acceleration_xy_mps2, dot));
    about.note_speeds(&s_m, given_s.as_deref(), &d_m, given_d.as_deref(), rate_hz);
    let (mut v_s_mps, v_d_mps, a_s_mps2) = match smoothing_s {
        Some(window_s) => {
            let window = (window_s * rate_hz).round() as usize;
            let [s, v, a] = savitzky_golay(&s_m, window, rate_hz);
            let [d, vd, _] = savitzky_golay(&d_m, window, rate_hz);
            (s_m, d_m) = (s, d);
            (v, vd, a)
        }
        None => {
            about.derived_speeds |= given_s.is_none();
            about.derived_lateral |= given_d.is_none();
            about.derived_accelerations |= given_a.is_none();
            let v_s = given_s.unwrap_or_else(|| central(&s_m, rate_hz));
            let v_d = given_d.unwrap_or_else(|| central(&d_m, rate_hz));
            let a_s = given_a.unwrap_or_else(|| central(&v_s, rate_hz));
            (v_s, v_d, a_s)
        }
    };
    let slow = v_s_mps.iter().filter(|v| **v < 0.0).count() as u64;
    let backwards = v_s_mps.iter().filter(|v| **v < NOISE_MPS).count();
    about.noise_speeds += slow - backwards as u64;
    if 20 * backwards > v_s_mps.len() {
        about.exclude(id, Exclusion::Backwards);
    }
    v_s_mps.iter_mut().for_each(|v| *v = v.max(0.0));
    let lane = d_m.iter().map(|d| lanes.lane_at(*d).map_or(NO_LANE, |lane| lane as u16)).collect();
    Track {
        id,
        class: vehicle.class,
        length_m: vehicle.length_m,
        width_m: vehicle.width_m,
        carriageway,
        first_frame: of.piece.first_frame,
        s_m,
        d_m,
        v_s_mps,
        v_d_mps,
        a_s_mps2,
        lane,
    }
}

/// Fraction of the samples whose named lane is not the one that their position is in.
fn label_mismatch(placed: &[Placed], carriageways: &[Carriageway], index: [usize; 2]) -> Option<f64> {
    use std::collections::BTreeMap;
    // Which lane a name usually is.
    let mut counts: BTreeMap<(usize, u32), BTreeMap<Option<usize>, u64>> = BTreeMap::new();
    for of in placed {
        let Some(lanes) = carriageways.get(index[usize::from(of.is_forward)]) else { continue };
        for (on, sample) in of.on.iter().zip(&of.piece.samples).filter(|(_, sample)| sample.lane != NO_LABEL) {
            *counts
                .entry((usize::from(of.is_forward), sample.lane))
                .or_default()
                .entry(lanes.lane_at(on.d_m))
                .or_default() += 1;
        }
    }
    let (mut all, mut fitting) = (0, 0);
    for of_name in counts.values() {
        all += of_name.values().sum::<u64>();
        fitting += of_name.values().copied().max().unwrap_or(0);
    }
    (all > 0).then(|| 1.0 - fitting as f64 / all as f64)
}

/// Median cosine between headings and motion, and the sign with which headings follow lateral motion.
fn heading_facts(placed: &[Placed], rate_hz: f64) -> Option<(f64, f64)> {
    let stride = rate_hz.round().max(1.0) as usize;
    let mut cosines = Vec::new();
    let (mut product, mut of_motion, mut of_heading) = (0.0, 0.0, 0.0);
    for of in placed {
        for k in (stride..of.on.len()).step_by(stride) {
            let (before, now) = (&of.piece.samples[k - stride], &of.piece.samples[k]);
            let motion = [now.xy_m[0] - before.xy_m[0], now.xy_m[1] - before.xy_m[1]];
            let size = libm::hypot(motion[0], motion[1]);
            let middle = &of.piece.samples[k - stride / 2];
            if size < 3.0 || !middle.heading[0].is_finite() {
                continue;
            }
            let motion = [motion[0] / size, motion[1] / size];
            cosines.push(dot(motion, middle.heading));
            let tangent = of.on[k - stride / 2].tangent;
            let (a, b) = (cross(tangent, motion), cross(tangent, middle.heading));
            (product, of_motion, of_heading) = (product + a * b, of_motion + a * a, of_heading + b * b);
        }
    }
    let strength = (of_motion * of_heading).sqrt();
    (cosines.len() >= 20).then(|| (median(&mut cosines), if strength > 0.0 { product / strength } else { 0.0 }))
}
