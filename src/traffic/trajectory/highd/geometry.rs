//! Checks vehicle positions against lanes and boxes. A mirrored axis or another reference point leaves every number
//! plausible by itself, but not in combination. One frame per second is checked.

use super::frame::Direction;
use crate::support::plausibility::Implausible;
use crate::traffic::trajectory::overlap::{each_second, overlaps};
use crate::traffic::trajectory::{Recording, Track};
use crate::{Error, Place, Result};

/// So far beyond its lane a centre counts as misplaced, m: in lane changes `laneId` may change a little late.
const MARGIN_M: f64 = 0.5;
/// Fewer vehicles prove nothing.
const MIN_VEHICLES: usize = 5;
/// From this median on, centres do not lie in the middle of their lanes; in parts of half a width. An edge that is taken
/// for the centre, or the other way round, makes it 1.
const MAX_OFFSET: f64 = 0.6;
/// Lateral motion below this is noise, m/s, root mean square.
const MIN_LATERAL_MPS: f64 = 0.02;

const HELP: &str = "look at y (it points down; x and y are the left and upper edge of the box in the image), at the lane \
                    markings of the recording, `laneId` and the sizes: one of them does not fit the others; option \
                    `accept_implausible` uses them as they are";

/// Readings of y that would explain misplaced vehicles: the centre of the box in the image, from the centre as it was
/// read and the vehicle's width; `road` has the smallest and largest lane line.
type Reading = (&'static str, fn(f64, f64, (f64, f64)) -> f64);
const READINGS: [Reading; 5] = [
    ("y is mirrored: with -y they are in their lanes", |y, _, _| -y),
    ("y is mirrored: with -y they are in their lanes", |y, width, _| width - y),
    ("y is mirrored: measured from the other side of the road they are in their lanes", |y, _, road| {
        road.0 + road.1 - y
    }),
    ("y is the lower edge of the box: as such they are in their lanes", |y, width, _| y - width),
    ("y is the centre of the box: as such they are in their lanes", |y, width, _| y - width / 2.0),
];

/// Compares positions with lanes, lateral speeds and other boxes; gives warnings.
///
/// # Errors
/// [`Error::Input`] naming vehicle and frame where most vehicles are beside their lanes, are off the middle of their lanes
/// by half a width, or move against their lateral speeds, unless implausible values are accepted: then these are warnings.
pub(super) fn check(recording: &Recording, place: &Place, implausible: Implausible) -> Result<Vec<String>> {
    let mut notes = Vec::new();
    for (column, found) in
        [("y", misplaced(recording)), ("y", off_centre(recording)), ("yVelocity", against(recording))]
    {
        let Some(Finding { vehicle, problem, is_general }) = found else { continue };
        if is_general && implausible == Implausible::Refused {
            return Err(Error::input(place.clone().column(column).of(format!("vehicle {vehicle}")), problem, HELP));
        }
        notes.push(problem);
    }
    notes.extend(overlapping(recording));
    Ok(notes)
}

struct Finding {
    vehicle: u32,
    problem: String,
    /// It applies to most vehicles.
    is_general: bool,
}

fn direction(recording: &Recording, track: &Track) -> Direction {
    let name = &recording.carriageways[track.carriageway].name;
    if *name == Direction::Upper.name() { Direction::Upper } else { Direction::Lower }
}

/// Distance of a lateral position beyond the vehicle's lane, or beyond its carriageway if it has no lane, m.
fn beyond_m(recording: &Recording, track: &Track, sample: usize, d_m: f64) -> f64 {
    let carriageway = &recording.carriageways[track.carriageway];
    let lines = &carriageway.lane_lines_m;
    let (left_m, right_m) = match carriageway.lane(track.lane[sample].into()) {
        Some(lane) => (lane.left_m, lane.right_m),
        None => (lines[0], lines[lines.len() - 1]),
    };
    (d_m - left_m).max(right_m - d_m)
}

/// The first misplaced sample of a vehicle that is misplaced most of the time.
fn first_misplaced(recording: &Recording, track: &Track, d_of: &dyn Fn(f64) -> f64) -> Option<usize> {
    let mut samples = 0;
    let mut beyond = each_second(recording, track).inspect(|_| samples += 1);
    let is_beyond = |sample: &usize| beyond_m(recording, track, *sample, d_of(track.d_m[*sample])) > MARGIN_M;
    let first = beyond.find(is_beyond);
    let more = beyond.filter(is_beyond).count();
    first.filter(|_| 2 * (more + 1) > samples)
}

/// Vehicles that are not in the lane of their `laneId`, or beside the road.
fn misplaced(recording: &Recording) -> Option<Finding> {
    let judged = recording.tracks.iter().filter(|track| each_second(recording, track).next().is_some());
    let mut found = judged.clone().filter_map(|track| Some((track, first_misplaced(recording, track, &|d_m| d_m)?)));
    let (track, sample) = found.next()?;
    let (count, all) = (1 + found.count(), judged.clone().count());
    let is_general = 2 * count > all && all >= MIN_VEHICLES;
    let lines = recording.carriageways.iter().flat_map(|carriageway| {
        let sign = if carriageway.name == Direction::Upper.name() { 1.0 } else { -1.0 };
        carriageway.lane_lines_m.iter().map(move |line| sign * line)
    });
    let road = lines.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), y| (low.min(y), high.max(y)));
    let explains = |reading: &&Reading| {
        let left = judged.clone().filter(|track| {
            // Down the image is to the left of travel in the upper lanes, and to the right in the lower ones.
            let direction = direction(recording, track);
            let d_of = |d_m: f64| direction.leftward((reading.1)(direction.leftward(d_m), track.width_m, road));
            first_misplaced(recording, track, &d_of).is_some()
        });
        10 * left.count() <= all
    };
    let why = match READINGS.iter().find(explains) {
        Some((words, _)) if is_general => format!("; {words}"),
        _ => String::new(),
    };
    let frame = track.first_frame + sample as i64;
    let beyond_m = beyond_m(recording, track, sample, track.d_m[sample]);
    let problem = format!(
        "{count} of {all} vehicles are mostly outside the lane that `laneId` and lane lines give them; the first is vehicle \
         {} at frame {frame}, by {beyond_m:.2} m{why}",
        track.id
    );
    Some(Finding { vehicle: track.id, problem, is_general })
}

/// Boxes that cross the lane lines because another point of them was taken for their edge.
fn off_centre(recording: &Recording) -> Option<Finding> {
    let offset = |track: &Track| {
        let carriageway = &recording.carriageways[track.carriageway];
        let offsets = each_second(recording, track).filter_map(|sample| {
            let lane = carriageway.lane(track.lane[sample].into())?;
            Some(direction(recording, track).leftward(track.d_m[sample] - lane.centre_m()))
        });
        let (sum, count) = offsets.fold((0.0, 0), |(sum, count), offset_m| (sum + offset_m, count + 1));
        (count > 0).then(|| sum / f64::from(count) / (track.width_m / 2.0))
    };
    let mut offsets: Vec<(f64, &Track)> =
        recording.tracks.iter().filter_map(|track| Some((offset(track)?, track))).collect();
    offsets.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (median, track) = *offsets.get(offsets.len() / 2)?;
    if median.abs() < MAX_OFFSET || offsets.len() < MIN_VEHICLES {
        return None;
    }
    let is = match median {
        ..0.0 => "above the box",
        0.0..1.5 => "the centre of the box, not its upper edge",
        _ => "the lower edge of the box, not the upper one",
    };
    let problem = format!(
        "half of the {} vehicles are at least {:.2} m beside the middle of their lanes, on one side of the image, so that \
         boxes cross lane lines; such is vehicle {} at frame {}: y seems to be {is}",
        offsets.len(),
        median.abs() * track.width_m / 2.0,
        track.id,
        track.first_frame
    );
    Some(Finding { vehicle: track.id, problem, is_general: true })
}

/// Lateral speeds that contradict the change of the positions.
fn against(recording: &Recording) -> Option<Finding> {
    let (mut cross_sum, mut change_sum, mut speed_sum, mut samples) = (0.0, 0.0, 0.0, 0_u32);
    let mut strongest: Option<(f64, &Track, usize)> = None;
    for track in &recording.tracks {
        for k in each_second(recording, track).filter(|k| (1..track.len() - 1).contains(k)) {
            let change_mps = (track.d_m[k + 1] - track.d_m[k - 1]) * recording.frame_rate_hz / 2.0;
            let speed_mps = track.v_d_mps[k];
            (cross_sum, change_sum, speed_sum) = (
                cross_sum + change_mps * speed_mps,
                change_sum + change_mps * change_mps,
                speed_sum + speed_mps * speed_mps,
            );
            samples += 1;
            if strongest.is_none_or(|(min, ..)| change_mps * speed_mps < min) {
                strongest = Some((change_mps * speed_mps, track, k));
            }
        }
    }
    let (_, track, k) = strongest?;
    let noise = f64::from(samples) * MIN_LATERAL_MPS * MIN_LATERAL_MPS;
    if change_sum < noise
        || speed_sum < noise
        || cross_sum >= -0.5 * (change_sum * speed_sum).sqrt()
        || recording.tracks.len() < MIN_VEHICLES
    {
        return None;
    }
    let problem = format!(
        "vehicles move across the road against their `yVelocity`; the clearest is vehicle {} at frame {}: y or yVelocity is \
         mirrored",
        track.id,
        track.first_frame + k as i64
    );
    Some(Finding { vehicle: track.id, problem, is_general: true })
}

/// Boxes that overlap.
fn overlapping(recording: &Recording) -> Option<String> {
    let found = overlaps(recording)?;
    Some(format!(
        "{} pair(s) of vehicles overlap, the first are {}: check sizes and reference point (x and y are the left and \
         upper edge of the box in the image)",
        found.pairs.len(),
        found.first
    ))
}
