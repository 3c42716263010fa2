//! From what a file says to a [`Recording`]: pieces on the road, lanes, speeds.

use std::collections::{BTreeMap, HashSet};

use super::boxes::{Sized, centre, is_ignored, sized};
use super::directions::{Placed, describe_road, oncoming_left_m, road};
use super::lanes::{LaneSource, Lateral, lane_lines, lines_of_map};
use super::pieces::{Piece, pieces};
use super::preset::{Preset, Reference, Side};
use super::raw::{NO_LABEL, RawRecording, RawSample, RawVehicle};
use super::road::{OnRoad, Path, RoadLine, cross, d_range, dot, median};
use super::roles::Role;
use super::samples::Samples;
use super::smooth::{central, savitzky_golay};
use super::understanding::{Comparison, Understanding, UnderstoodCarriageway};
use crate::traffic::trajectory::{Carriageway, NO_LANE, Recording, Track};
use crate::{Error, Place, Result};

impl Placed {
    /// Directions of the road at its samples. They are computed again, because memory would hold two numbers a sample.
    fn tangents(&self, lines: &[Option<RoadLine>; 2]) -> Vec<[f64; 2]> {
        lines[usize::from(self.is_forward)].as_ref().map_or(Vec::new(), |line| line.directions(&path(&self.piece)))
    }
}

fn path(piece: &Piece) -> Path {
    (0..piece.samples.len()).map(|k| piece.samples.xy_m(k)).collect()
}

/// The recording, and what was understood.
pub(super) fn assemble(
    mut raw: RawRecording,
    preset: &Preset,
    file: (&[(Role, String)], &[String]),
    place: &Place,
) -> Result<(Recording, Understanding)> {
    let (roles, unused) = file;
    let mut about = Understanding::new(&raw.id, raw.incomplete);
    about.columns = roles.iter().map(|(role, column)| (role.key(), column.clone())).collect();
    about.unused = unused.to_vec();
    about.reference = preset.reference;
    about.note_classes(&raw, preset);
    std::mem::take(&mut raw.notes).into_iter().for_each(|note| about.warn(note));
    let before = raw.vehicles.len();
    raw.vehicles.retain(|vehicle| !is_ignored(vehicle, preset));
    about.ignored = (before - raw.vehicles.len()) as u64;
    let (rate_hz, pieces) = pieces(&mut raw, preset, &mut about, place)?;
    let boxes: Vec<Sized> = pieces.iter().map(|piece| sized(piece, &raw.vehicles[piece.vehicle], preset)).collect();
    about.assumed_sizes = boxes.iter().filter(|of| of.is_assumed).count() as u64;
    about.changing_sizes = boxes.iter().filter(|of| of.changes).count() as u64;
    let has = |wanted: Role| roles.iter().any(|(role, _)| *role == wanted);
    let has_heading = has(Role::Heading);
    let y_sign = if preset.axes.y == Side::Right { -1.0 } else { 1.0 };
    let mut pieces = pieces;
    for (piece, of) in pieces.iter_mut().zip(&boxes) {
        centre(piece, of, preset.reference, has_heading, y_sign);
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
        .zip(boxes)
        .zip(forward)
        .map(|((piece, sized), is_forward)| {
            let mut on =
                lines[usize::from(is_forward)].as_ref().map_or(Vec::new(), |line| line.project_all(&path(&piece)));
            let by_m = shift_along * sized.length_m;
            on.iter_mut().for_each(|p| p.s_m += by_m);
            Placed { piece, sized, is_forward, on }
        })
        // A direction in which nothing moves has no line.
        .filter(|of| !of.on.is_empty())
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
            .flat_map(|of| (0..of.on.len()).step_by(stride).map(|k| (of.on[k].d_m, of.piece.samples.lane(k))))
            .collect();
        let of_map = lines[side].as_ref().map(|line| map_lines(line, &raw.boundaries)).unwrap_or_default();
        let found = match of_map.len() {
            2.. => Some((of_map, LaneSource::Map)).filter(|_| !laterals.is_empty()),
            _ => lane_lines(&laterals, preset.lanes.width_m),
        };
        let Some((lane_lines_m, source)) = found else { continue };
        if source == LaneSource::Names && has(Role::LaneOffset) {
            about.lane_offset_error_m =
                place_by_offset(&mut placed, side == 1, &lane_lines_m).or(about.lane_offset_error_m);
        }
        index[side] = carriageways.len();
        about.carriageways.push(UnderstoodCarriageway::of(name, &lane_lines_m, source, tracks));
        carriageways.push(Carriageway { name: name.to_owned(), lane_lines_m });
    }
    order_sideways(&mut carriageways, &mut placed);
    let ids = ids(&placed, &raw.vehicles);
    about.vehicle_names = names_in_file(&ids, &placed, &raw.vehicles);
    about.file_frames = file_frames(&placed, raw.has_frames);
    let mut tracks: Vec<Track> = Vec::with_capacity(placed.len());
    about.label_mismatch = label_mismatch(&placed, &carriageways, index);
    about.heading_facts = if has_heading { heading_facts(&placed, &lines, rate_hz) } else { None };
    // Each gives its memory to its track.
    for (of, id) in placed.into_iter().zip(ids) {
        let carriageway = index[usize::from(of.is_forward)];
        let Some(lanes) = carriageways.get(carriageway) else { continue };
        let of = (of.tangents(&lines), of);
        tracks.push(track(of, id, carriageway, lanes, (rate_hz, preset.smoothing_s), &mut about));
    }
    tracks.sort_by_key(|track| track.id);
    let recording = Recording { id: raw.id, frame_rate_hz: rate_hz, carriageways, tracks, synthetic: raw.synthetic };
    let recording = about.judge(recording, preset);
    if recording.tracks.is_empty() {
        let why = about.findings.iter().map(|finding| finding.text.as_str()).collect::<Vec<_>>().join("; ");
        let problem = format!("no vehicle is left: {why}");
        return Err(Error::input(place.clone(), problem, "correct the file, or its preset"));
    }
    Ok((recording, about))
}

/// Lateral positions of the lines of a map on a road line.
fn map_lines(line: &RoadLine, boundaries: &[Vec<[f64; 2]>]) -> Vec<f64> {
    let middle = |boundary: &Vec<[f64; 2]>| {
        let on = line.project_all(boundary);
        // Only those along this direction of travel.
        let along = on.last()?.s_m - on.first()?.s_m;
        let mut d: Vec<f64> = on.iter().map(|p| p.d_m).collect();
        (along > 5.0 && d_range(&on) < 1.5).then(|| median(&mut d))
    };
    lines_of_map(boundaries.iter().filter_map(middle).collect())
}

/// Where the file gives the distance from the middle of the lane, it is more exact than the line of the road: d becomes the
/// middle of the named lane plus that distance. Returns the median difference to d from the line.
fn place_by_offset(placed: &mut [Placed], is_forward: bool, lines_m: &[f64]) -> Option<f64> {
    let lanes = Carriageway { name: String::new(), lane_lines_m: lines_m.to_vec() };
    // The lane that a name usually is.
    let mut laterals: Vec<Lateral> = placed
        .iter()
        .filter(|of| of.is_forward == is_forward)
        .flat_map(|of| of.on.iter().zip(of.piece.samples.iter()).map(|(on, sample)| (on.d_m, sample.lane)))
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
    let offset = |on: &OnRoad, sample: RawSample| {
        let middle = middles.get(&sample.lane).filter(|_| sample.lane_offset_m.is_finite())?;
        Some((middle, on.d_m - middle))
    };
    // The side on which offsets are positive follows from the positions.
    let here = || placed.iter().filter(|of| of.is_forward == is_forward);
    let pairs = || here().flat_map(|of| of.on.iter().zip(of.piece.samples.iter()));
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
            .zip(of.piece.samples.iter())
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
    let mut seen = HashSet::new();
    let mut fresh = || {
        next += 1;
        next
    };
    placed
        .iter()
        .map(|of| match own(&vehicles[of.piece.vehicle].key) {
            Some(id) if all_numbers && seen.insert(id) => id,
            _ => fresh(),
        })
        .collect()
}

/// The names of vehicles that the file names otherwise, by their numbers.
fn names_in_file(ids: &[u32], placed: &[Placed], vehicles: &[RawVehicle]) -> BTreeMap<u32, String> {
    let key = |of: &Placed| vehicles[of.piece.vehicle].key.clone();
    ids.iter().zip(placed).map(|(id, of)| (*id, key(of))).filter(|(id, key)| *key != id.to_string()).collect()
}

/// Frames of the file as those of the recording: that of its frame 0, and frames per frame. `None` if the file has no frames, or
/// they do not fit its times.
fn file_frames(placed: &[Placed], has_frames: bool) -> Option<[i64; 2]> {
    let of = |samples: &Samples, k: usize| if has_frames { samples.at(k) } else { samples.other_clock(k) };
    let longest = &placed.iter().max_by_key(|of| of.piece.samples.len())?.piece;
    let last = longest.samples.len().checked_sub(1)?;
    let first = of(&longest.samples, 0);
    let per_frame = ((of(&longest.samples, last) - first) / last as f64).round();
    let zero = (first - per_frame * longest.first_frame as f64).round();
    let fits = |of_track: &Placed| {
        let piece = &of_track.piece;
        let expected = |k: usize| zero + per_frame * (piece.first_frame + k as i64) as f64;
        (0..piece.samples.len()).all(|k| (of(&piece.samples, k) - expected(k)).abs() <= 0.5)
    };
    (per_frame >= 1.0 && placed.iter().all(fits)).then_some([zero as i64, per_frame as i64])
}

/// Whether every sample has the value.
fn whole(samples: &[RawSample], of: impl Fn(&RawSample) -> f64) -> Option<Vec<f64>> {
    let values: Vec<f64> = samples.iter().map(of).collect();
    values.iter().all(|value| value.is_finite()).then_some(values)
}

fn track(
    (tangents, of): (Vec<[f64; 2]>, Placed),
    id: u32,
    carriageway: usize,
    lanes: &Carriageway,
    (rate_hz, smoothing_s): (f64, Option<f64>),
    about: &mut Understanding,
) -> Track {
    let samples = of.piece.samples.to_vec();
    let component = |value: fn(&RawSample) -> [f64; 2], part: fn([f64; 2], [f64; 2]) -> f64| {
        let values = samples.iter().zip(&tangents).map(|(sample, tangent)| part(*tangent, value(sample)));
        let values: Vec<f64> = values.collect();
        values.iter().all(|value| value.is_finite()).then_some(values)
    };
    let mut s_m: Vec<f64> = of.on.iter().map(|p| p.s_m).collect();
    let mut d_m: Vec<f64> = of.on.iter().map(|p| p.d_m).collect();
    let given_s = whole(&samples, |sample| sample.along_mps[0])
        .or_else(|| component(|sample| sample.velocity_mps, dot))
        .or_else(|| whole(&samples, |sample| sample.speed_mps));
    let given_d =
        whole(&samples, |sample| sample.along_mps[1]).or_else(|| component(|sample| sample.velocity_mps, cross));
    let given_a = whole(&samples, |sample| sample.acceleration_mps2)
        .or_else(|| component(|sample| sample.acceleration_xy_mps2, dot));
    // On a curve, the points of the line are metres apart: derivatives of the positions in the plane are smoother.
    let is_straight = tangents.windows(2).all(|pair| pair[0] == pair[1]);
    let in_plane = |derive: &dyn Fn(&[f64]) -> Vec<f64>| -> Vec<f64> {
        let of_axis = |axis: usize| derive(&samples.iter().map(|sample| sample.xy_m[axis]).collect::<Vec<f64>>());
        tangents.iter().zip(of_axis(0).into_iter().zip(of_axis(1))).map(|(t, (x, y))| dot(*t, [x, y])).collect()
    };
    if let (Some(v), Some(a), None) = (&given_s, &given_a, smoothing_s) {
        about.note_accelerations(v, a, rate_hz);
    }
    about.note_speeds(&s_m, given_s.as_deref(), &d_m, given_d.as_deref(), rate_hz);
    let (v_s_mps, v_d_mps, a_s_mps2) = match smoothing_s {
        Some(window_s) => {
            let window = (window_s * rate_hz).round() as usize;
            let [s, mut v, mut a] = savitzky_golay(&s_m, window, rate_hz);
            if !is_straight {
                [v, a] = [1, 2].map(|order| in_plane(&|x| savitzky_golay(x, window, rate_hz)[order].clone()));
            }
            let [d, vd, _] = savitzky_golay(&d_m, window, rate_hz);
            (s_m, d_m) = (s, d);
            for count in [&mut about.derived_speeds, &mut about.derived_lateral, &mut about.derived_accelerations] {
                *count += 1;
            }
            (v, vd, a)
        }
        None => {
            about.derived_speeds += u64::from(given_s.is_none());
            about.derived_lateral += u64::from(given_d.is_none());
            about.derived_accelerations += u64::from(given_a.is_none());
            let v_s = given_s.unwrap_or_else(|| match is_straight {
                true => central(&s_m, rate_hz),
                false => in_plane(&|x| central(x, rate_hz)),
            });
            let v_d = given_d.unwrap_or_else(|| central(&d_m, rate_hz));
            let a_s = given_a.unwrap_or_else(|| central(&v_s, rate_hz));
            (v_s, v_d, a_s)
        }
    };
    let lane = d_m.iter().map(|d| lanes.lane_at(*d).map_or(NO_LANE, |lane| lane as u16)).collect();
    Track {
        id,
        class: of.sized.class,
        length_m: of.sized.length_m,
        width_m: of.sized.width_m,
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
    // Which lane a name usually is.
    let mut counts: BTreeMap<(usize, u32), BTreeMap<Option<usize>, u64>> = BTreeMap::new();
    for of in placed {
        let Some(lanes) = carriageways.get(index[usize::from(of.is_forward)]) else { continue };
        let named = |k: usize| (&of.on[k], of.piece.samples.lane(k));
        for (on, lane) in (0..of.on.len()).map(named).filter(|(_, lane)| *lane != NO_LABEL) {
            *counts.entry((usize::from(of.is_forward), lane)).or_default().entry(lanes.lane_at(on.d_m)).or_default() +=
                1;
        }
    }
    let (mut all, mut fitting) = (0, 0);
    for of_name in counts.values() {
        all += of_name.values().sum::<u64>();
        fitting += of_name.values().copied().max().unwrap_or(0);
    }
    (all > 0).then(|| 1.0 - fitting as f64 / all as f64)
}

/// Median cosine between headings and motion, and how headings follow the motion across the road.
fn heading_facts(placed: &[Placed], lines: &[Option<RoadLine>; 2], rate_hz: f64) -> Option<(f64, Comparison)> {
    let stride = rate_hz.round().max(1.0) as usize;
    let mut cosines = Vec::new();
    let mut across = Comparison::default();
    for of in placed {
        let (samples, tangents) = (&of.piece.samples, of.tangents(lines));
        for k in (stride..of.on.len()).step_by(stride) {
            let (before, now) = (samples.xy_m(k - stride), samples.xy_m(k));
            let motion = [now[0] - before[0], now[1] - before[1]];
            let size = libm::hypot(motion[0], motion[1]);
            let middle = samples.get(k - stride / 2);
            if size < 3.0 || !middle.heading[0].is_finite() {
                continue;
            }
            let motion = [motion[0] / size, motion[1] / size];
            cosines.push(dot(motion, middle.heading));
            let tangent = tangents[k - stride / 2];
            across.add(cross(tangent, middle.heading), cross(tangent, motion));
        }
    }
    (cosines.len() >= 20).then(|| (median(&mut cosines), across))
}
