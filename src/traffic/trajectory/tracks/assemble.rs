//! From what a file says to a [`Recording`]: pieces on the road, lanes, speeds.

use std::collections::{BTreeMap, HashMap, HashSet};

use super::boxes::{begins_so, centre, is_ignored};
use super::directions::{Placed, oncoming_left_m, road};
use super::lanes::{BY_NAME, Lateral, lane_lines};
use super::pieces::{Piece, pieces};
use super::preset::Preset;
use super::raw::{RawRecording, RawVehicle};
use super::road::{Path, RoadLine, cross, dot, median};
use super::samples::{
    ACCELERATION, AT, FORWARD_SPEED, HEADING_X, HEADING_Y, LANE_OFFSET, LEFTWARD_SPEED, OTHER_CLOCK, SPEED, Sample,
    Samples, X, X_ACCELERATION, X_SPEED, Y, Y_ACCELERATION, Y_SPEED,
};
use super::smooth::{central, savitzky_golay};
use super::understanding::{Comparison, Understanding};
use crate::trajectory::{Carriageway, Loaded, NO_LANE, Recording, Track};
use lanesweep_support::{Error, Place, Result};

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
pub(super) fn assemble(mut raw: RawRecording, preset: &Preset, place: &Place) -> Result<Loaded> {
    let mut about = Understanding::new(&raw.id);
    about.fact("columns", std::mem::take(&mut raw.columns));
    about.fact("reference", format!("{:?}, as the preset says or assumes", preset.reference).to_lowercase());
    describe_classes(&mut about, &raw, preset);
    std::mem::take(&mut raw.notes).into_iter().for_each(|note| about.warn(note));
    about.warn_of(raw.incomplete, "rows have no position and are left out");
    let before = raw.vehicles.len();
    raw.vehicles.retain(|vehicle| !is_ignored(&vehicle.samples, &raw.classes, preset));
    about.warn_of((before - raw.vehicles.len()) as u64, "vehicles are left out because of their class");
    let (rate_hz, mut pieces) = pieces(&mut raw, preset, &mut about, place)?;
    match (pieces.iter().filter(|of| of.sized.is_assumed).count() as u64, &preset.sizes_from) {
        (0, _) => (),
        (assumed, Some(help)) => about.refuse(format!("{assumed} vehicles have no size: make the table by {help}")),
        (assumed, None) => about.warn_of(assumed, "vehicles have no size in the file; usual ones take its place"),
    }
    let longest = pieces.iter().map(Piece::travel_m).max_by(|a, b| dot(*a, *a).total_cmp(&dot(*b, *b)));
    let travel = longest.unwrap_or_default();
    let left: Vec<f64> = pieces.iter_mut().map(|piece| centre(piece, preset, travel)).collect();
    let (lines, forward) = road(&pieces, preset, rate_hz).ok_or_else(|| {
        Error::input(place.clone(), "no vehicle moves, so the road is unknown", "check x and y and their units")
    })?;
    let placed = pieces.into_iter().zip(left).zip(forward).filter_map(|((piece, left), is_forward)| {
        // A direction in which nothing moves has no line.
        let mut on = lines[usize::from(is_forward)].as_ref()?.project_all(&path(&piece));
        on.iter_mut().for_each(|p| p.s_m += left * piece.sized.length_m);
        Some(Placed { piece, is_forward, on })
    });
    let mut placed: Vec<Placed> = placed.collect();
    about.seen.is_curved = !lines.iter().flatten().all(RoadLine::is_straight);
    about.seen.oncoming_left_m = oncoming_left_m(&lines, &placed);
    let mut carriageways: Vec<Carriageway> = Vec::new();
    let mut index = [usize::MAX; 2];
    for (side, name) in [(0, "1"), (1, "2")] {
        let here = || placed.iter().filter(|of| usize::from(of.is_forward) == side);
        let stride = rate_hz.round().max(1.0) as usize;
        let laterals: Vec<Lateral> = here()
            .flat_map(|of| (0..of.on.len()).step_by(stride).map(|k| (of.on[k].d_m, of.piece.samples.lane(k))))
            .collect();
        let Some((lane_lines_m, source)) = lane_lines(&laterals, preset.lanes.width_m) else { continue };
        if source == BY_NAME {
            let difference = place_by_offset(&mut placed, side == 1, &lane_lines_m);
            about.seen.lane_offset_error_m = difference.or(about.seen.lane_offset_error_m);
        }
        index[side] = carriageways.len();
        about.seen.lane_sources.push(source);
        carriageways.push(Carriageway { name: name.to_owned(), lane_lines_m });
    }
    order_sideways(&mut carriageways, &mut placed);
    let ids = ids(&placed, &raw.vehicles);
    let keys = placed.iter().map(|of| raw.vehicles[of.piece.vehicle].key.clone());
    let vehicle_names: BTreeMap<u32, String> =
        ids.iter().copied().zip(keys).filter(|(id, key)| *key != id.to_string()).collect();
    if !vehicle_names.is_empty() {
        about.warn("vehicles have other numbers than in the file: their ids are no small whole numbers, or a track was split; the ids of scenarios keep the file's");
    }
    let file_frames = file_frames(&placed, raw.has_frames);
    about.seen.label_mismatch = label_mismatch(&placed, &carriageways, index);
    about.seen.heading = compare_headings(&placed, &lines, rate_hz);
    let mut tracks: Vec<Track> = Vec::with_capacity(placed.len());
    // Each gives its memory to its track.
    for (of, id) in placed.into_iter().zip(ids) {
        let carriageway = index[usize::from(of.is_forward)];
        let Some(lanes) = carriageways.get(carriageway) else { continue };
        let of = (of.tangents(&lines), of);
        tracks.push(track(of, id, carriageway, lanes, (rate_hz, preset.smoothing_s), &mut about));
    }
    tracks.sort_by_key(|track| track.id);
    let mut recording =
        Recording { id: raw.id, frame_rate_hz: rate_hz, carriageways, tracks, synthetic: raw.synthetic };
    about.judge(&mut recording, preset, place)?;
    let (checksum_sha256, notes) = (raw.checksums, Vec::new());
    Ok(Loaded { recording, checksum_sha256, notes, vehicle_names, file_frames, understanding: about })
}

/// Tells what classes are taken for.
fn describe_classes(about: &mut Understanding, raw: &RawRecording, preset: &Preset) {
    let mut classes: BTreeMap<&str, u64> = BTreeMap::new();
    for class in raw.vehicles.iter().filter_map(|vehicle| vehicle.samples.class(&raw.classes)) {
        *classes.entry(class).or_default() += 1;
    }
    if !classes.is_empty() {
        let of = classes.iter().take(12).map(|(class, number)| {
            let lorries = if begins_so(class, &preset.classes.truck) { " (lorries)" } else { "" };
            format!("{number} {class}{lorries}")
        });
        about.fact("classes", of.collect::<Vec<String>>().join(", "));
    }
}

/// Where the file gives the distance from the middle of the lane, it is more exact than the line of the road: d becomes the
/// middle of the named lane plus that distance. Returns the median difference to d from the line.
fn place_by_offset(placed: &mut [Placed], is_forward: bool, lines_m: &[f64]) -> Option<f64> {
    if !placed.iter().any(|of| of.piece.samples.has(LANE_OFFSET)) {
        return None;
    }
    let lanes = Carriageway { name: String::new(), lane_lines_m: lines_m.to_vec() };
    // The lane that a name usually is.
    let mut laterals: Vec<Lateral> = placed
        .iter()
        .filter(|of| of.is_forward == is_forward)
        .flat_map(|of| of.on.iter().enumerate().map(|(k, on)| (on.d_m, of.piece.samples.lane(k))))
        .filter(|(_, name)| name.is_some())
        .collect();
    laterals.sort_by(|a, b| a.1.cmp(&b.1).then(a.0.total_cmp(&b.0)));
    let middles: HashMap<Option<u32>, f64> = laterals
        .chunk_by(|a, b| a.1 == b.1)
        .filter_map(|group| {
            let lane = lanes.lane(lanes.lane_at(group[group.len() / 2].0)?)?;
            Some((group[0].1, lane.centre_m()))
        })
        .collect();
    // The middle of the lane, and the offsets from it that the file and the position give.
    let offsets = |of: &Placed, k: usize| {
        let given = Some(of.piece.samples.of(LANE_OFFSET, k)).filter(|offset| offset.is_finite())?;
        let middle = middles.get(&of.piece.samples.lane(k))?;
        Some((*middle, given, of.on[k].d_m - middle))
    };
    // The side on which offsets are positive follows from the positions.
    let here = placed.iter().filter(|of| of.is_forward == is_forward);
    let pairs = here.flat_map(|of| (0..of.on.len()).filter_map(|k| offsets(of, k)));
    let product: f64 = pairs.clone().map(|(_, given, told)| told * given).sum();
    let sign = if product < 0.0 { -1.0 } else { 1.0 };
    let difference = median(&mut pairs.map(|(_, given, told)| (told - sign * given).abs()).collect::<Vec<_>>());
    // Offsets that do not fit the positions are something else.
    if difference.is_nan() || difference > 0.5 {
        return Some(difference).filter(|difference| !difference.is_nan());
    }
    for of in placed.iter_mut().filter(|of| of.is_forward == is_forward) {
        // Whole tracks only, so that d does not jump.
        let all = (0..of.on.len()).map(|k| offsets(of, k).map(|(middle, given, _)| middle + sign * given));
        let all: Option<Vec<f64>> = all.collect();
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
    let own = |of: &RawVehicle| of.key.parse::<u32>().ok().filter(|id| *id < u32::MAX / 2 && id.to_string() == of.key);
    let own: Vec<u32> = vehicles.iter().map(own).collect::<Option<_>>().unwrap_or_default();
    let mut last = own.iter().copied().max().unwrap_or(0);
    let mut seen = HashSet::new();
    let id = |of: &Placed| match own.get(of.piece.vehicle) {
        Some(id) if seen.insert(id) => *id,
        _ => {
            last += 1;
            last
        }
    };
    placed.iter().map(id).collect()
}

/// Frames of the file as those of the recording: that of its frame 0, and frames per frame. `None` if the file has no frames, or
/// they do not fit its times.
fn file_frames(placed: &[Placed], has_frames: bool) -> Option<[i64; 2]> {
    let of = |samples: &Samples, k: usize| samples.of(if has_frames { AT } else { OTHER_CLOCK }, k);
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

/// A column, if every sample has its value.
fn whole(samples: &[Sample], column: usize) -> Option<Vec<f64>> {
    let values = samples.iter().map(|sample| sample[column]);
    values.clone().all(f64::is_finite).then(|| values.collect())
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
    let component = |[x, y]: [usize; 2], part: fn([f64; 2], [f64; 2]) -> f64| {
        let values = samples.iter().zip(&tangents).map(|(sample, tangent)| part(*tangent, [sample[x], sample[y]]));
        values.clone().all(f64::is_finite).then(|| values.collect())
    };
    let mut s_m: Vec<f64> = of.on.iter().map(|p| p.s_m).collect();
    let mut d_m: Vec<f64> = of.on.iter().map(|p| p.d_m).collect();
    let velocity = [X_SPEED, Y_SPEED];
    let given_s =
        whole(&samples, FORWARD_SPEED).or_else(|| component(velocity, dot)).or_else(|| whole(&samples, SPEED));
    let given_d: Option<Vec<f64>> = whole(&samples, LEFTWARD_SPEED).or_else(|| component(velocity, cross));
    let given_a = whole(&samples, ACCELERATION).or_else(|| component([X_ACCELERATION, Y_ACCELERATION], dot));
    // On a curve, the points of the line are metres apart: derivatives of the positions in the plane are smoother.
    let is_straight = tangents.windows(2).all(|pair| pair[0] == pair[1]);
    let in_plane = |derive: &dyn Fn(&[f64]) -> Vec<f64>| -> Vec<f64> {
        let of_axis = |axis: usize| derive(&samples.iter().map(|sample| sample[axis]).collect::<Vec<f64>>());
        tangents.iter().zip(of_axis(X).into_iter().zip(of_axis(Y))).map(|(t, (x, y))| dot(*t, [x, y])).collect()
    };
    if let (Some(v), Some(a), None) = (&given_s, &given_a, smoothing_s) {
        about.note_accelerations(v, a, rate_hz);
    }
    about.note_speeds((&s_m, given_s.as_ref()), (&d_m, given_d.as_ref()), rate_hz);
    let lacks = [given_s.is_none(), given_d.is_none(), given_a.is_none()].map(|is| is || smoothing_s.is_some());
    about.seen.derived.iter_mut().zip(lacks).for_each(|(count, is)| *count += u64::from(is));
    let (v_s_mps, v_d_mps, a_s_mps2) = match smoothing_s {
        Some(window_s) => {
            let window = (window_s * rate_hz).round() as usize;
            let [s, mut v, mut a] = savitzky_golay(&s_m, window, rate_hz);
            if !is_straight {
                [v, a] = [1, 2].map(|order| in_plane(&|x| savitzky_golay(x, window, rate_hz)[order].clone()));
            }
            let [d, vd, _] = savitzky_golay(&d_m, window, rate_hz);
            (s_m, d_m) = (s, d);
            (v, vd, a)
        }
        None => {
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
        class: of.piece.sized.class,
        length_m: of.piece.sized.length_m,
        width_m: of.piece.sized.width_m,
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
    let mut counts: BTreeMap<(bool, u32), BTreeMap<Option<usize>, u64>> = BTreeMap::new();
    for of in placed {
        let Some(lanes) = carriageways.get(index[usize::from(of.is_forward)]) else { continue };
        for (k, on) in of.on.iter().enumerate() {
            if let Some(name) = of.piece.samples.lane(k) {
                *counts.entry((of.is_forward, name)).or_default().entry(lanes.lane_at(on.d_m)).or_default() += 1;
            }
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
fn compare_headings(placed: &[Placed], lines: &[Option<RoadLine>; 2], rate_hz: f64) -> Option<(f64, Comparison)> {
    let stride = rate_hz.round().max(1.0) as usize;
    let mut cosines = Vec::new();
    let mut across = Comparison::default();
    for of in placed.iter().filter(|of| of.piece.samples.has(HEADING_X)) {
        let (samples, tangents) = (&of.piece.samples, of.tangents(lines));
        for k in (stride..of.on.len()).step_by(stride) {
            let (before, now) = (samples.xy_m(k - stride), samples.xy_m(k));
            let motion = [now[0] - before[0], now[1] - before[1]];
            let size = libm::hypot(motion[0], motion[1]);
            let heading = [HEADING_X, HEADING_Y].map(|column| samples.of(column, k - stride / 2));
            if size < 3.0 || !heading[0].is_finite() {
                continue;
            }
            let motion = [motion[0] / size, motion[1] / size];
            cosines.push(dot(motion, heading));
            let tangent = tangents[k - stride / 2];
            across.add(cross(tangent, heading), cross(tangent, motion));
        }
    }
    (cosines.len() >= 20).then(|| (median(&mut cosines), across))
}
