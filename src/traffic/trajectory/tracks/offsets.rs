//! Boxes: their sizes, and where they are: on each other, beside the middle of their lane, beside the lane lines of the file.

use std::collections::{BTreeMap, BTreeSet, HashSet};

use super::findings::MIN_VEHICLES;
use super::lanes::BY_WIDTH;
use super::road::{median, range};
use super::understanding::{Understanding, lengths_m};
use crate::trajectory::motion::{JUMP_ACROSS_M, JUMP_ALONG_M, jumps};
use crate::trajectory::{Carriageway, Recording, Track, VehicleClass};
use lanesweep_support::readable::significant;

/// Fraction of vehicles that overlap from which on sizes or reference point are wrong.
const MAX_OVERLAPPING: f64 = 0.1;
/// Offsets from the middle of the lane of so many half widths are those of an edge, which gives 1.
const MIN_EDGE: f64 = 0.6;
/// Distance of a lane line from the middle between the vehicles of its lanes from which on it is not where they see it, m.
const MAX_LINE_OFF_M: f64 = 0.45;
/// Fraction of the vehicles in a part of a recording without another part's vehicle within this distance across the road, m.
const MAX_ALONE: f64 = 0.4;
const BESIDE_M: f64 = 0.5;

impl Understanding {
    /// Finds lengths that end at one value.
    pub(super) fn check_sizes(&mut self, recording: &Recording) {
        let mut lengths = lengths_m(recording, VehicleClass::Truck);
        lengths.sort_by(f64::total_cmp);
        let longest_m = lengths.last().copied().unwrap_or(0.0);
        let others = lengths.iter().filter(|length_m| **length_m < longest_m).count();
        let distinct = lengths.chunk_by(|a, b| a == b).count();
        // Simulated lorries have a few lengths, measured ones many, of which the largest is one's alone.
        if lengths.len() - others > others.max(MIN_VEHICLES) && distinct > 2 {
            self.warn(format!(
                "most lorries are {} m long, and none is longer: were lengths cut off there?",
                significant(longest_m, 3)
            ));
        }
    }

    /// Compares where vehicles drive across the road in the parts of a recording.
    pub(super) fn check_parts(&mut self, recording: &Recording) {
        for (at, carriageway) in recording.carriageways.iter().enumerate() {
            let of = recording.tracks.iter().filter(|of| of.carriageway == at);
            let mut of: Vec<(i64, f64)> =
                of.map(|of| (of.first_frame, of.d_m.iter().sum::<f64>() / of.len() as f64)).collect();
            of.sort_by_key(|(first_frame, _)| *first_frame);
            let changed = |parts: &usize| {
                let (before, after) = of.split_at(parts * of.len() / 8);
                // Vehicles beside hardly any of the other part.
                let alone = |of: &[(i64, f64)], others: &[(i64, f64)]| {
                    let mut sorted: Vec<f64> = others.iter().map(|(_, d_m)| *d_m).collect();
                    sorted.sort_by(f64::total_cmp);
                    let below = |d_m: f64| sorted.partition_point(|other| *other < d_m);
                    // Vehicles that change lanes are between them on average.
                    let is_alone = |d_m: f64| 33 * (below(d_m + BESIDE_M) - below(d_m - BESIDE_M)) < others.len();
                    let number = of.iter().filter(|(_, d_m)| is_alone(*d_m)).count();
                    // Few others are not on every lane.
                    others.len() >= 4 * MIN_VEHICLES
                        && number >= MIN_VEHICLES
                        && number as f64 > MAX_ALONE * of.len() as f64
                };
                alone(before, after) || alone(after, before)
            };
            if let Some(parts) = (1..8).find(changed) {
                let (way, frame) = (way(carriageway), of[parts * of.len() / 8].0);
                self.warn(format!("{way}: vehicles drive elsewhere across the road after frame {frame} or soon: if these are two places, or the camera moved, give each part its own file, or name it in a column `recording`"));
            }
        }
    }

    /// Finds boxes that overlap or are beside the middle of their lanes, and small jumps.
    pub(super) fn check_boxes(&mut self, recording: &Recording) {
        let (pairs, first, coupled) = overlaps(recording);
        let involved: HashSet<usize> = pairs.iter().flat_map(|(a, b)| [*a, *b]).collect();
        let is_grave = involved.len() as f64 > MAX_OVERLAPPING * recording.tracks.len() as f64;
        let what = format!(
            "pair(s) of vehicles overlap, the first are {first}: check sizes and `reference` (centre, front, rear, corner)"
        );
        self.find_of(pairs.len() as u64, is_grave && involved.len() >= MIN_VEHICLES, &what);
        if let Some((a, b)) = coupled.first().map(|(a, b)| (recording.tracks[*a].id, recording.tracks[*b].id)) {
            let what = format!(
                "pair(s) of vehicles drive less than 1 m apart at one distance for 5 s and longer, the first are vehicles {a} and {b}: join them if they are tractor and trailer, else one leads the other"
            );
            self.warn_of(coupled.len() as u64, &what);
        }
        let (mut by_lane, mut by_class) = (Vec::new(), Vec::new());
        for (at, of) in recording.carriageways.iter().enumerate() {
            let mut offsets = self.offsets(recording, at);
            // Lines that follow from positions are amid them, whatever the point.
            if self.seen.lane_sources.get(at).is_none_or(|source| *source == BY_WIDTH) {
                self.check_lines(of, &offsets);
            }
            by_class.extend(slope_within(&mut offsets, 0.02));
            offsets.iter_mut().for_each(|of| of.2 /= 2);
            by_lane.extend(slope_within(&mut offsets, 0.08));
        }
        let is_edge = |(slope, error): &(f64, f64)| (MIN_EDGE..1.6).contains(&slope.abs()) && slope.abs() > 4.0 * error;
        // Lorries may keep to the right in every direction; an edge in the image is on the other side in the other direction.
        let is_turned = matches!(by_lane[..], [(a, _), (b, _)] if a * b < 0.0);
        let found = if is_turned && by_lane.iter().all(is_edge) { by_lane } else { by_class };
        if let Some((slope, error)) = found.first().filter(|_| found.iter().all(is_edge)) {
            let (slope, error) = (significant(slope.abs(), 2), significant(*error, 1));
            self.refuse(format!(
                "the wider a vehicle, the farther it is beside the middle of its lane: by {slope} ± {error} m for each metre of half its width, where an edge or a corner of the box gives 1, see `reference`"
            ));
        }
        let jumping = recording.tracks.iter().filter(|track| jumps(track, recording.frame_rate_hz)).count();
        let what = format!("tracks jump by more than {JUMP_ALONG_M} m along or {JUMP_ACROSS_M} m across the road");
        self.warn_of(jumping as u64, &what);
    }

    /// Finds lane lines of the file that are not where vehicles see them, by the offsets of those that keep their lanes.
    fn check_lines(&mut self, lanes: &Carriageway, offsets: &[(f64, f64, u16)]) {
        let way = way(lanes);
        let shift = median(&mut offsets.iter().map(|(half_m, mean_m, _)| mean_m / half_m).collect::<Vec<f64>>());
        if shift.abs() >= MIN_EDGE && offsets.len() >= MIN_VEHICLES {
            let (shift, side) = (significant(shift.abs(), 2), if shift > 0.0 { "left" } else { "right" });
            // Bands of a width may begin elsewhere.
            self.find(self.seen.lane_sources.is_empty(), format!(
                "{way}: half of the vehicles are at least {shift} half widths to the {side} of the middle of their lanes, so that boxes cross lane lines: y is that of another point of the box, or the lane lines are shifted"
            ));
            return;
        }
        // Where the vehicles of a lane are on average.
        let middle = |lane: usize| {
            let of = offsets.iter().filter(|of| usize::from(of.2 / 2) == lane).map(|of| of.1);
            let (mean_m, error_m) = mean_and_error(of)?;
            Some((lanes.lane(lane)?.centre_m() + mean_m, error_m))
        };
        for line in 1..lanes.lane_count() {
            let Some(((left_m, a), (right_m, b))) = middle(line - 1).zip(middle(line)) else { continue };
            let (line_m, error_m) = (lanes.lane_lines_m[line], 0.5 * libm::hypot(a, b));
            let off_m = line_m - 0.5 * (left_m + right_m);
            if off_m.abs() > MAX_LINE_OFF_M + 4.0 * error_m {
                let y_m = if lanes.name == "2" { -line_m } else { line_m };
                self.warn(format!(
                    "{way}: the lane marking at y = {y_m:.2} m is {:.2} ± {error_m:.2} m from the middle between the vehicles of its lanes: check the lane markings, which decide when a lane change begins",
                    off_m.abs()
                ));
            }
        }
    }

    /// Half the width of each vehicle that keeps its lane, its mean offset to the left of the lane's middle, m, and its lane and
    /// class. Tells the offsets by class.
    fn offsets(&mut self, recording: &Recording, carriageway: usize) -> Vec<(f64, f64, u16)> {
        let lanes = &recording.carriageways[carriageway];
        let offset = |track: &Track| {
            let lane = track.lane[0];
            let is_kept = track.carriageway == carriageway && track.lane.iter().all(|of| *of == lane);
            let centre_m = lanes.lane(usize::from(lane)).filter(|_| is_kept)?.centre_m();
            let mean_m = track.d_m.iter().sum::<f64>() / track.len() as f64 - centre_m;
            Some((track.width_m / 2.0, mean_m, 2 * lane + u16::from(track.class == VehicleClass::Truck)))
        };
        let all: Vec<(f64, f64, u16)> = recording.tracks.iter().filter_map(offset).collect();
        let mean = |(is_truck, class): (u16, &str)| {
            let (mean_m, error_m) = mean_and_error(all.iter().filter(|of| of.2 % 2 == is_truck).map(|of| of.1))?;
            Some(format!("{class} {mean_m:.2} ± {error_m:.2} m"))
        };
        let means: Vec<String> = [(0, "cars"), (1, "lorries")].into_iter().filter_map(mean).collect();
        // Lines that follow from positions lie amid cars and lorries; the difference holds whatever the lines are.
        let mut by_class: Vec<_> = all.iter().map(|of| (f64::from(of.2 % 2), of.1, of.2 / 2)).collect();
        let beside = slope_within(&mut by_class, 0.08).map_or(String::new(), |(by_m, error_m)| {
            format!("; lorries {by_m:.2} ± {error_m:.2} m to the left of the cars of their lane")
        });
        if !means.is_empty() {
            let (way, means) = (way(lanes), means.join(", "));
            self.fact("offsets", format!("{way}: {means} to the left of the middle of their lanes{beside}"));
        }
        all
    }
}

/// Overlap of two boxes that rounding and noise may cause, m.
const OVERLAP_M: f64 = 0.2;
/// Nobody drives as near to a vehicle ahead, or keeps the distance as exactly, for so long at such a speed: m, m, s, m/s.
const COUPLED_M: f64 = 1.0;
const MAX_PLAY_M: f64 = 0.3;
const MIN_COUPLED_S: usize = 5;
const MIN_SPEED_MPS: f64 = 5.0;

/// Pairs of vehicles, as indices into the tracks, the smaller first.
type Pairs = BTreeSet<(usize, usize)>;

/// Finds, once a second, the pairs that overlap, the first of them in words, and the pairs that are one vehicle, such as tractor and
/// trailer.
fn overlaps(recording: &Recording) -> (Pairs, String, Vec<(usize, usize)>) {
    let mut boxes: Vec<(usize, i64, f64, usize, usize)> = Vec::new();
    // The same frames for all tracks.
    let second = recording.frame_rate_hz.round().max(1.0) as usize;
    for (index, track) in recording.tracks.iter().enumerate() {
        let first = (-track.first_frame).rem_euclid(second as i64) as usize;
        let here = |k: usize| (track.carriageway, track.first_frame + k as i64, track.s_m[k], index, k);
        boxes.extend((first..track.len()).step_by(second).map(here));
    }
    boxes.sort_by(|a, b| (a.0, a.1).cmp(&(b.0, b.1)).then(a.2.total_cmp(&b.2)).then(a.3.cmp(&b.3)));
    let reach_m = recording.tracks.iter().map(|track| track.length_m).fold(0.0, f64::max) + COUPLED_M;
    let (mut pairs, mut first) = (Pairs::new(), String::new());
    let mut near_m: BTreeMap<(usize, usize), Vec<f64>> = BTreeMap::new();
    for (at, a) in boxes.iter().enumerate() {
        let near = |b: &&(usize, i64, f64, usize, usize)| (a.0, a.1) == (b.0, b.1) && b.2 - a.2 < reach_m;
        for b in boxes[at + 1..].iter().take_while(near) {
            let (behind, ahead) = (&recording.tracks[a.3], &recording.tracks[b.3]);
            let pair = (a.3.min(b.3), a.3.max(b.3));
            let along_m = (behind.length_m + ahead.length_m) / 2.0 - (b.2 - a.2);
            let across_m = (behind.width_m + ahead.width_m) / 2.0 - (behind.d_m[a.4] - ahead.d_m[b.4]).abs();
            if across_m <= OVERLAP_M {
                continue;
            }
            if along_m > -COUPLED_M && behind.v_s_mps[a.4] > MIN_SPEED_MPS {
                near_m.entry(pair).or_default().push(along_m);
            }
            if along_m > OVERLAP_M {
                if pairs.is_empty() {
                    let (behind, ahead, frame) = (behind.id, ahead.id, a.1);
                    first = format!("vehicles {behind} and {ahead} at frame {frame}, by {along_m:.2} m along the road");
                }
                pairs.insert(pair);
            }
        }
    }
    let is_coupled = |(_, of): &(_, Vec<f64>)| {
        let (low_m, high_m) = range(of.iter().copied());
        of.len() >= MIN_COUPLED_S && high_m - low_m < MAX_PLAY_M
    };
    (pairs, first, near_m.into_iter().filter(is_coupled).map(|(pair, _)| pair).collect())
}

/// The mean of vehicles' values and its standard error; `None` for few.
fn mean_and_error(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let values: Vec<f64> = values.collect();
    let (n, mean) = (values.len() as f64, values.iter().sum::<f64>() / values.len() as f64);
    let squares: f64 = values.iter().map(|value| (value - mean) * (value - mean)).sum();
    (values.len() >= MIN_VEHICLES).then(|| (mean, (squares / (n * (n - 1.0))).sqrt()))
}

/// The direction of a carriageway in words.
pub(super) fn way(of: &Carriageway) -> &'static str {
    if of.name == "2" { "forward" } else { "backward" }
}

/// Slope of the second value over the first within groups, so that the middles of lanes do not matter, and its standard error;
/// `None` for few values, or if the first varies by less than `least`.
pub(super) fn slope_within(pairs: &mut [(f64, f64, u16)], least: f64) -> Option<(f64, f64)> {
    pairs.sort_by(|a, b| a.2.cmp(&b.2).then(a.0.total_cmp(&b.0)).then(a.1.total_cmp(&b.1)));
    let (mut xx, mut xy, mut yy, mut n, mut groups) = (0.0, 0.0, 0.0, 0, 0);
    for group in pairs.chunk_by(|a, b| a.2 == b.2).filter(|group| group.len() >= MIN_VEHICLES) {
        let of = |value: fn(&(f64, f64, u16)) -> f64| group.iter().map(value).sum::<f64>() / group.len() as f64;
        let (x, y) = (of(|p| p.0), of(|p| p.1));
        for (half, offset, _) in group.iter() {
            xx += (half - x) * (half - x);
            xy += (half - x) * (offset - y);
            yy += (offset - y) * (offset - y);
        }
        n += group.len();
        groups += 1;
    }
    let slope = xy / xx;
    let residual = (yy - slope * xy).max(0.0) / (n as f64 - f64::from(groups) - 1.0);
    (n >= 20 && xx / n as f64 > least * least).then(|| (slope, (residual / xx).sqrt()))
}
