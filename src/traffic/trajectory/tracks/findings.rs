//! What contradicts itself in a recording: units, axes, motion.

use super::offsets::{slope_within, way};
use super::preset::{Preset, Side};
use super::road::{median, range};
use super::understanding::{Understanding, lengths_m, median_of};
use crate::trajectory::motion::impossible;
use crate::trajectory::{Carriageway, NO_LANE, Recording, Track, VehicleClass};
use lanesweep_model::plausibility::{Doubts, Implausible, NOISE_MPS, Quantity};
use lanesweep_support::readable::{count, significant, value};

/// Positions and speeds that differ by more than this fraction do not belong together.
const MAX_SPEED_DIFFERENCE: f64 = 0.05;
/// Good data differ by less.
const USUAL_DIFFERENCE: f64 = 0.02;
/// Speeds that are later than positions by more than this are not theirs, s.
const MAX_DELAY_S: f64 = 0.2;
/// A speed that positions tell to vary by more is not constant, m/s.
const MAX_RANGE_MPS: f64 = 2.0;
/// Fraction of vehicles that cross the road by more than the distance (m) from which on it is no motorway.
const MAX_ACROSS: f64 = 0.15;
const ACROSS_M: f64 = 15.0;
/// Vehicles that are farther apart than this, and than anyone drives, may be in two places, m.
const MIN_APART_M: f64 = 100.0;
/// What goes farther back along the road drives backwards, m.
const MAX_BACKWARD_M: f64 = 5.0;
/// So many samples have the extreme acceleration, and their speeds change by so much more (m/s²), where it was clipped.
const MIN_CLIPPED: usize = 20;
const MIN_BEYOND_MPS2: f64 = 0.2;
/// A raster of positions that is larger, and a larger fraction of the step from sample to sample, is coarse, m.
const MIN_RASTER_M: f64 = 0.2;
const MAX_RASTER: f64 = 0.25;
/// Widths of the lanes of motorways, m.
const USUAL_LANES_M: std::ops::RangeInclusive<f64> = 2.7..=4.6;
/// Fewer vehicles prove nothing.
pub(super) const MIN_VEHICLES: usize = 5;

/// Distance over integrated speed that a wrong unit gives, and what it means.
const MISTAKEN: [(f64, &str); 6] = [
    (1.0 / 3.6, "the speeds look like km/h: add `unit = \"km/h\"`"),
    (3.280_84, "the positions look like feet: add `unit = \"ft\"`"),
    (0.3048, "the speeds look like ft/s: add `unit = \"ft/s\"`"),
    (0.447_04, "the speeds look like mph: add `unit = \"mph\"`"),
    (1.466_67, "the positions look like feet and the speeds like mph"),
    (0.01, "the positions look like metres, not centimetres"),
];

impl Understanding {
    /// Tells the shape of the road, and finds tracks that do not follow one.
    pub(super) fn check_road(&mut self, recording: &Recording) {
        let (mut ranges, mut along, mut across) = (Vec::new(), Vec::new(), 0);
        for track in &recording.tracks {
            let (left, right) = range(track.d_m.iter().copied());
            along.push((track.carriageway, range(track.s_m.iter().copied())));
            if (track.s_m[track.len() - 1] - track.s_m[0]).abs() >= 30.0 || right - left > ACROSS_M {
                ranges.push(right - left);
                across += usize::from(right - left > ACROSS_M);
            }
        }
        along.sort_by(|(a, (from, _)), (b, (of, _))| a.cmp(b).then(from.total_cmp(of)));
        let longest_m = along.iter().map(|(_, (low, high))| high - low).fold(MIN_APART_M, f64::max);
        let mut length_m = 0.0_f64;
        for of in along.chunk_by(|a, b| a.0 == b.0) {
            let mut reached_m = of[0].1.1;
            for (before, (_, (low_m, high_m))) in of.iter().enumerate() {
                if low_m - reached_m > longest_m && before.min(of.len() - before) >= MIN_VEHICLES {
                    let [from, to] = [reached_m, *low_m].map(|end_m| significant(end_m, 4));
                    self.warn(format!(
                        "no vehicle drives between {from} and {to} m along the road: if these are two places, give each its own file, or name it in a column `recording`"
                    ));
                }
                reached_m = reached_m.max(*high_m);
            }
            length_m = length_m.max(reached_m - of[0].1.0);
        }
        let across = across as f64 / ranges.len().max(1) as f64;
        let shape = if self.seen.is_curved { "curved" } else { "straight" };
        let (length, wander) = (significant(length_m, 4), significant(median(&mut ranges), 2));
        self.fact("road", format!("{shape}, {length} m in view; vehicles wander by {wander} m (0.1 to 0.6 is usual)"));
        if across > MAX_ACROSS {
            let percent = significant(100.0 * across, 2);
            self.refuse(format!(
                "{percent} % of the vehicles cross the road by more than {ACROSS_M} m: this is no motorway, or vehicles of several roads are in one file"
            ));
        }
    }

    /// Compares speeds with positions, and accelerations with speeds.
    pub(super) fn check_speeds(&mut self, recording: &Recording) {
        let seen = &mut self.seen;
        let mut is_off = false;
        if !seen.ratios.is_empty() && seen.ratios.len() >= MIN_VEHICLES.min(recording.tracks.len()) {
            let (ratio, error) = median_and_error(&mut seen.ratios);
            seen.has_wrong_ratio = (ratio - 1.0).abs() > MAX_SPEED_DIFFERENCE;
            is_off = seen.has_wrong_ratio || (ratio - 1.0).abs() > USUAL_DIFFERENCE + 4.0 * error;
            let near = |(factor, _): &&(f64, &str)| (ratio / factor - 1.0).abs() < 0.06;
            // A rate that the times give is right.
            let by_rate = match seen.rate_is_of_times {
                true => String::new(),
                false => format!(" and frame rate: {} Hz would fit", significant(recording.frame_rate_hz / ratio, 3)),
            };
            let named = MISTAKEN.iter().find(near).map(|(_, why)| (*why).to_owned());
            let why = named.unwrap_or_else(|| format!("check units{by_rate}"));
            let (times, error) = (significant(ratio, 4), significant(error, 1));
            self.fact("distance", format!("{times} times as far as the speeds tell (median, ± {error})"));
            if is_off {
                let text = format!("vehicles move {times} ± {error} times as far as their speeds tell: {why}");
                self.find(self.seen.has_wrong_ratio, text);
            }
        }
        if !self.seen.has_wrong_ratio {
            self.check_groups(recording);
        }
        let (delay, told) = (self.seen.delay, self.seen.acceleration);
        for (of, name) in delay.into_iter().zip(["speeds", "lateral speeds"]) {
            let is_late = of.slope().abs() > MAX_DELAY_S.max(4.0 * of.slope_error());
            if is_late && !is_off && of.of_derived > 0.01 * of.count {
                let by_s = significant(of.slope(), 2);
                self.warn(format!(
                    "{name} are {by_s} s late against positions: rows are shifted, or filters delay them"
                ));
            }
        }
        // Below 0.1 m/s in a second there is nothing to compare.
        if told.count > 50.0 && told.of_given.max(told.of_derived) > 0.01 * told.count {
            let size = libm::sqrt(told.of_given / told.of_derived.max(1e-12));
            let (times, offset) = (significant(told.slope(), 2), significant(told.difference / told.count, 2));
            self.fact(
                "peaks",
                format!("accelerations are {times} times the changes of speed, {offset} m/s² off on average"),
            );
            if told.is_opposite() || !(0.4..=2.5).contains(&size) {
                let (size, sign) = (significant(size, 2), if told.product < 0.0 { "other" } else { "same" });
                self.refuse(format!(
                    "accelerations do not fit the changes of speed ({size} times as large, of the {sign} sign): check their unit and sign"
                ));
            } else if !(0.75..=1.25).contains(&told.slope()) {
                self.warn(format!(
                    "accelerations are {times} times the changes of speed (0.75 to 1.25 is usual): check whether they are missing for some vehicles, for braking, or have another sign in one direction; without the column they follow from speeds"
                ));
            }
        }
    }

    /// Compares speeds with positions of each direction and class, of which another's may hide what is wrong.
    fn check_groups(&mut self, recording: &Recording) {
        let groups = (0..recording.carriageways.len()).map(|at| (Some(at), None));
        let groups = groups.chain([VehicleClass::Car, VehicleClass::Truck].map(|class| (None, Some(class))));
        for (carriageway, class) in groups {
            let is_in = |of: &&Track| {
                carriageway.is_none_or(|at| of.carriageway == at) && class.is_none_or(|class| of.class == class)
            };
            let ratio = |of: &Track| {
                let driven_m =
                    of.v_s_mps.windows(2).map(|v| 0.5 * (v[0] + v[1])).sum::<f64>() / recording.frame_rate_hz;
                (driven_m > 20.0).then(|| (of.s_m[of.len() - 1] - of.s_m[0]) / driven_m)
            };
            let mut ratios: Vec<f64> = recording.tracks.iter().filter(is_in).filter_map(ratio).collect();
            if ratios.len() < MIN_VEHICLES {
                continue;
            }
            let (ratio, error) = median_and_error(&mut ratios);
            if (ratio - 1.0).abs() > MAX_SPEED_DIFFERENCE + 4.0 * error {
                let who = match (carriageway, class) {
                    (Some(at), _) => way(&recording.carriageways[at]),
                    (_, Some(VehicleClass::Truck)) => "lorries",
                    _ => "cars",
                };
                let times = significant(ratio, 3);
                self.warn(format!("{who}: vehicles move {times} times as far as their speeds tell: the speeds of some vehicles have another unit or scale"));
            }
        }
    }

    /// Finds values that are implausible or impossible: half of the vehicles with one is a unit, not an odd vehicle.
    pub(super) fn check_units(&mut self, recording: &Recording) {
        let [length_m, width_m] = [median_of(recording, |of| of.length_m), median_of(recording, |of| of.width_m)]
            .map(|of| significant(of, 3));
        if 2 * recording.tracks.iter().filter(|of| of.width_m > of.length_m).count() > recording.tracks.len() {
            self.refuse(format!(
                "vehicles are {length_m} m long and {width_m} m wide (medians): the columns for length and width are swapped"
            ));
            return;
        }
        // Refused: what is beyond the physical range is grave.
        let mut doubts = Doubts::new(Implausible::Refused);
        let mut grave = None;
        let mut check = |quantity: Quantity, value: f64, place: String| {
            if let Err(problem) = doubts.check(quantity, value, || place.clone()) {
                grave.get_or_insert(format!("{place}: {problem}"));
            }
        };
        type Value = fn(&Track) -> f64;
        let of_vehicles: [(Quantity, Value); 3] = [
            (Quantity::Speed, |of| of.v_s_mps.iter().map(|v| v.max(0.0)).sum::<f64>() / of.len() as f64),
            (Quantity::Length, |of| of.length_m),
            (Quantity::Width, |of| of.width_m),
        ];
        for (quantity, of) in of_vehicles {
            recording.tracks.iter().for_each(|track| check(quantity, of(track), format!("vehicle {}", track.id)));
        }
        let mut widths_m: Vec<f64> = recording.carriageways.iter().flat_map(Carriageway::widths_m).collect();
        widths_m.iter().for_each(|width_m| check(Quantity::LaneWidth, *width_m, "a lane".to_owned()));
        check(Quantity::Rate, recording.frame_rate_hz, "frame rate".to_owned());
        for of in &recording.tracks {
            doubts.check_shape(of.length_m, of.width_m, || format!("vehicle {}", of.id));
        }
        grave.into_iter().for_each(|first| self.refuse(first));
        // A wrong ratio names the unit already.
        let is_named = self.seen.has_wrong_ratio;
        for (quantity, of) in of_vehicles.into_iter().filter(|_| !is_named) {
            let middle = median_of(recording, of);
            if !quantity.is_plausible(middle) {
                self.refuse(format!("the median vehicle: {}", quantity.describe(middle)));
            }
        }
        self.check_sizes(recording);
        let length_of = |class: VehicleClass| {
            let mut lengths_m = lengths_m(recording, class);
            (lengths_m.len() >= MIN_VEHICLES).then(|| median(&mut lengths_m))
        };
        if let Some((car_m, lorry_m)) = length_of(VehicleClass::Car).zip(length_of(VehicleClass::Truck))
            && lorry_m <= car_m
        {
            let (car_m, lorry_m) = (significant(car_m, 3), significant(lorry_m, 3));
            self.warn(format!(
                "lorries of {lorry_m} m are not longer than cars of {car_m} m: check classes and lengths"
            ));
        }
        let lane_m = median(&mut widths_m);
        if Quantity::LaneWidth.is_plausible(lane_m) && !USUAL_LANES_M.contains(&lane_m) {
            let (lane_m, (least, most)) = (significant(lane_m, 3), (USUAL_LANES_M.start(), USUAL_LANES_M.end()));
            self.warn(format!(
                "lanes are {lane_m} m wide (median; {least} to {most} is usual): check the scale of positions, which Web Mercator stretches by the inverse cosine of the latitude"
            ));
        }
        let is_no_lane = |width_m| !Quantity::LaneWidth.is_plausible(width_m);
        if recording.carriageways.iter().any(|of| of.widths_m().all(is_no_lane)) {
            self.refuse("no lane has a plausible width: check the unit of y, and what `lane` means");
        }
        let lanes = || recording.tracks.iter().flat_map(|track| &track.lane);
        if 2 * lanes().filter(|lane| **lane == NO_LANE).count() > lanes().count() {
            self.refuse("vehicles are mostly in no lane: check the axes, and the lanes in the file");
        }
        let mut off = recording.tracks.iter().filter(|track| track.lane.iter().all(|lane| *lane == NO_LANE));
        if let Some(first) = off.next() {
            let number = 1 + off.count();
            self.warn(format!("{number} vehicle(s) are in no lane at any time, the first is vehicle {}", first.id));
        }
        // The reader of highD's format says the same, with its line.
        let kind = |text: &str| text.split(',').next().map(str::to_owned);
        let is_new = |text: &String| self.findings.iter().all(|known| kind(&known.text) != kind(text));
        let new: Vec<String> = doubts.sentences().into_iter().filter(is_new).collect();
        new.into_iter().for_each(|text| self.warn(text));
    }

    /// Finds single samples that cannot be, and speeds that do not change.
    pub(super) fn check_motion(&mut self, recording: &Recording) {
        if self.seen.has_wrong_ratio {
            return;
        }
        let constant = |track: &&Track| track.v_s_mps.iter().all(|v| (v - track.v_s_mps[0]).abs() < 1e-9);
        let constant: Vec<&Track> = recording.tracks.iter().filter(constant).collect();
        let varies = |track: &&&Track| speed_range_mps(track, recording.frame_rate_hz) > MAX_RANGE_MPS;
        let contradicted = constant.iter().filter(varies).count();
        if contradicted > 0 && 20 * contradicted >= constant.len() && 10 * constant.len() >= 9 * recording.tracks.len()
        {
            self.refuse(format!(
                "the speed of a vehicle does not change, although {contradicted} move at speeds that differ by more than \
                 {MAX_RANGE_MPS} m/s: it is one speed per vehicle; leave out the column, so that speeds follow from positions"
            ));
        } else if let Some((vehicles, first)) = impossible(recording) {
            self.refuse(format!(
                "{vehicles} vehicle(s) have samples that cannot be, the first is {first}; correct them, name the text that stands for no value in `none`, leave out the column, or smooth the positions (`smoothing_s`)"
            ));
        }
    }

    /// Finds accelerations that end at a value beyond which the speeds beside them change, and coarse positions.
    pub(super) fn check_resolution(&mut self, recording: &Recording) {
        let rate_hz = recording.frame_rate_hz;
        let inner = || recording.tracks.iter().flat_map(|of| (1..of.len().max(2) - 1).map(move |k| (of, k)));
        for sign in [1.0, -1.0] {
            let extreme = inner().map(|(of, k)| sign * of.a_s_mps2[k]).fold(0.0, f64::max);
            let at = inner().filter(|(of, k)| sign * of.a_s_mps2[*k] == extreme);
            let told: Vec<f64> =
                at.map(|(of, k)| sign * (of.v_s_mps[k + 1] - of.v_s_mps[k - 1]) * rate_hz / 2.0).collect();
            let told_mps2 = told.iter().sum::<f64>() / told.len() as f64;
            if told.len() >= MIN_CLIPPED && told_mps2 > extreme + MIN_BEYOND_MPS2 {
                let (side, number) = (if sign > 0.0 { "above" } else { "below" }, count(told.len()));
                let [extreme, told] = [extreme, told_mps2].map(|value| significant(sign * value, 2));
                self.warn(format!("no acceleration is {side} {extreme} m/s², which {number} samples have, although their speeds change by {told} m/s² on average: they were clipped; without the column they follow from speeds"));
            }
        }
        let coarse: Vec<f64> = recording.tracks.iter().filter_map(coarse_raster_m).collect();
        if 2 * coarse.len() > recording.tracks.len() {
            let raster = significant(median(&mut { coarse }), 3);
            self.warn(format!("positions along the road are multiples of {raster} m, which is coarse for {} samples per second: gaps, and speeds from positions, are as coarse", value(rate_hz)));
        }
    }

    pub(super) fn check_axes(&mut self, recording: &Recording, preset: &Preset) {
        let seen = &self.seen;
        let (lateral, heading) = (seen.lateral, seen.heading);
        if lateral.correlation() < -0.5 && lateral.is_opposite() && recording.tracks.len() >= MIN_VEHICLES {
            self.refuse("vehicles move across the road against their lateral speeds: y, or the lateral speed, is mirrored; see `axes.y`");
        }
        // Noise makes both slopes smaller: what is beyond 1 is a scale.
        let scale = lateral.product / lateral.of_given.max(1e-12);
        let by = if lateral.slope() > 1.0 { 1.0 / lateral.slope() } else { scale };
        if lateral.correlation() > 0.5 && (by - 1.0).abs() > MAX_SPEED_DIFFERENCE && (by > 1.0 || lateral.slope() > 1.0)
        {
            let times = significant(by, 3);
            self.warn(format!(
                "vehicles move {times} times as far across the road as their lateral speeds tell: check the unit of y and the width of lanes"
            ));
        }
        match heading {
            Some((cosine, _)) if cosine < 0.9 => {
                let cosine = significant(cosine, 2);
                self.refuse(format!("headings and motion differ (median cosine {cosine}): check the unit of the heading, and `axes.heading` (from-x or from-north)"));
            }
            Some((_, across)) if across.slope() < -0.3 && across.correlation() < -0.3 && across.is_opposite() => {
                let text =
                    "headings turn against the motion across the road: y, or the heading, is mirrored; see `axes.y`";
                self.refuse(text);
            }
            _ => (),
        }
        let is_left = preset.traffic == Side::Left;
        match self.seen.oncoming_left_m {
            Some(oncoming_m) if (oncoming_m < 0.0) != is_left => {
                let [is, set] = if is_left { ["left", "right"] } else { ["right", "left"] };
                self.refuse(format!(
                    "oncoming vehicles are on the {is} of the vehicles, which does not fit `traffic`: y is mirrored (`axes.y`), or set `traffic = \"{set}\"`"
                ));
            }
            Some(_) => (),
            None => self.check_slow_side(recording, is_left),
        }
        if let Some(by_m) = self.seen.lane_offset_error_m {
            let used = if by_m > 0.5 { ": not used" } else { "" };
            self.fact("in the lane", format!("{} m (median) from the line of the road{used}", significant(by_m, 2)));
        }
        if let Some(mismatch) = self.seen.label_mismatch.filter(|mismatch| *mismatch > 0.05) {
            let percent = significant(100.0 * mismatch, 2);
            let decides = match self.seen.first_misplaced {
                Some((vehicle, frame)) => format!("the first is vehicle {vehicle} at frame {frame}; `laneId` decides"),
                None => "positions decide".to_owned(),
            };
            let text = format!("{percent} % of the samples are not where the name of their lane says; {decides}");
            self.find(mismatch > 0.2 && recording.tracks.len() >= MIN_VEHICLES, text);
        }
    }

    /// Lorries drive on the slow side.
    fn check_slow_side(&mut self, recording: &Recording, is_left: bool) {
        let lane = |track: &Track| {
            let lanes = track.lane.iter().filter(|lane| **lane != NO_LANE);
            let mean = lanes.clone().map(|lane| f64::from(*lane)).sum::<f64>() / lanes.count() as f64;
            (!mean.is_nan()).then(|| (f64::from(u8::from(track.class == VehicleClass::Truck)), mean, 0))
        };
        let found = slope_within(&mut recording.tracks.iter().filter_map(lane).collect::<Vec<_>>(), 0.08);
        // Lane 0 is the leftmost.
        match found {
            Some((by, error)) if by.abs() > 0.15 && (by > 0.0) == is_left => {
                let side = if by > 0.0 { "right" } else { "left" };
                self.find(by.abs() > 4.0 * error, format!(
                    "lorries drive in the lanes on the {side}, which does not fit `traffic`: y is mirrored (`axes.y`), or set `traffic`, or they are few"
                ));
            }
            None if recording.carriageways.iter().any(|of| of.lane_count() > 1) => {
                self.warn("one direction of travel and few lorries: nothing tells whether y is mirrored");
            }
            _ => (),
        }
    }

    /// Leaves out vehicles that drive backwards, by their positions or their speeds.
    pub(super) fn leave_out_backwards(&mut self, recording: &mut Recording) {
        let all = recording.tracks.len();
        let slow = |track: &Track| track.v_s_mps.iter().filter(|v| **v < NOISE_MPS).count();
        let is_backward = |of: &Track| of.s_m[of.len() - 1] - of.s_m[0] < -MAX_BACKWARD_M || 20 * slow(of) > of.len();
        let first = recording.tracks.iter().find(|track| is_backward(track)).map_or(0, |track| track.id);
        recording.tracks.retain(|track| !is_backward(track));
        let backwards = all - recording.tracks.len();
        let what = format!(
            "vehicles drive backwards (by more than 5 m, or faster than 0.5 m/s) and are left out, the first is vehicle {first}: check `direction` and the signs of the speeds"
        );
        self.find_of(backwards as u64, 5 * backwards > all, &what);
    }

    /// Sets speeds below 0 to 0: they are noise of vehicles that do not drive backwards.
    pub(super) fn clear_noise(&mut self, recording: &mut Recording) {
        let (mut noise, mut lowest) = (0, 0.0_f64);
        for v in recording.tracks.iter_mut().flat_map(|track| &mut track.v_s_mps) {
            (noise, lowest) = (noise + u64::from(*v < 0.0), lowest.min(*v));
            *v = v.max(0.0);
        }
        self.warn_of(noise, &format!("speeds below 0 count as 0; the lowest is {} m/s", value(lowest)));
    }
}

/// The raster that all steps of a track along the road are multiples of, m; `None` if it is fine against the usual step, or
/// nothing tells it because all steps are equal.
fn coarse_raster_m(track: &Track) -> Option<f64> {
    let mut steps_m: Vec<f64> = track.s_m.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    let (_, high_m) = range(steps_m.iter().copied());
    let raster_m = steps_m.iter().copied().filter(|step_m| *step_m > 1e-6).fold(f64::INFINITY, f64::min);
    let is_on = |step_m: &f64| (step_m / raster_m - (step_m / raster_m).round()).abs() < 1e-6;
    let is_coarse = raster_m > MIN_RASTER_M && raster_m > MAX_RASTER * median(&mut steps_m);
    (is_coarse && high_m > 1.5 * raster_m && steps_m.iter().all(is_on)).then_some(raster_m)
}

/// The median and its standard error, from the quartiles.
fn median_and_error(values: &mut [f64]) -> (f64, f64) {
    values.sort_by(f64::total_cmp);
    let quarter = |part: usize| values[part * (values.len() - 1) / 4];
    (median(&mut values.to_vec()), 0.93 * (quarter(3) - quarter(1)) / (values.len() as f64).sqrt())
}

/// By how much the mean speeds over a second differ along a track, by its positions, m/s.
fn speed_range_mps(track: &Track, rate_hz: f64) -> f64 {
    let second = rate_hz.round().max(1.0) as usize;
    let speeds = (second..track.len()).map(|k| (track.s_m[k] - track.s_m[k - second]) * rate_hz / second as f64);
    let (low, high) = range(speeds);
    high - low
}
