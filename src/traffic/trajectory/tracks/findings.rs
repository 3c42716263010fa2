//! What contradicts itself in a recording: units, axes, boxes, quality.

use super::preset::{Preset, Side};
use super::road::{median, range};
use super::understanding::{Finding, TIMES, Understanding};
use crate::support::plausibility::{Doubts, Implausible, Limits, NOISE_MPS, Quantity};
use crate::support::readable::{count, significant, value};
use crate::traffic::trajectory::motion::{Impossible, JUMP_ACROSS_M, JUMP_ALONG_M, impossible, jumps};
use crate::traffic::trajectory::overlap::overlaps;
use crate::traffic::trajectory::{NO_LANE, Recording, Track, VehicleClass};

/// Positions and speeds that differ by more than this fraction do not belong together.
const MAX_SPEED_DIFFERENCE: f64 = 0.05;
/// Good data differ by less.
const USUAL_SPEED_DIFFERENCE: f64 = 0.02;
/// Accelerations that differ from the changes of speed by more, as a fraction and on average (m/s²), decide what is mined.
const USUAL_ACCELERATION_DIFFERENCE: f64 = 0.25;
const USUAL_ACCELERATION_OFFSET_MPS2: f64 = 0.2;
/// Cars whose median is shorter, and lanes that are narrower, are rather a mistake, m.
const SHORT_CAR_M: f64 = 3.3;
const NARROW_LANE_M: f64 = 2.6;
/// A speed that positions tell to vary by more is not constant, m/s.
const MAX_RANGE_MPS: f64 = 2.0;
/// Fraction of vehicles that overlap from which on sizes or reference point are wrong.
const MAX_OVERLAPPING: f64 = 0.1;
/// Fraction of vehicles that cross the road from which on it is no motorway.
const MAX_ACROSS: f64 = 0.15;
/// Every 25th sample of lorries, and of cars: from so many on, their lanes are compared.
const MIN_SAMPLES: usize = 20;
/// Fewer vehicles prove nothing.
const MIN_VEHICLES: usize = 5;

/// Factors that a wrong unit or frame rate would give: positions over speeds, and what it would mean.
const MISTAKEN: [(f64, &str); 10] = [
    (1.0 / 3.6, "the speeds look like km/h: add `unit = \"km/h\"`"),
    (3.6, "the speeds look as if divided by 3.6 twice: they are m/s already"),
    (3.280_84, "the positions look like feet: add `unit = \"ft\"`"),
    (0.3048, "the speeds look like ft/s: add `unit = \"ft/s\"`"),
    (0.447_04, "the speeds look like mph: add `unit = \"mph\"`"),
    (2.236_94, "the speeds look as if they were converted from mph twice"),
    (1.466_67, "the positions look like feet and the speeds like mph"),
    (25.0 / 30.0, "the frame rate looks like 30 instead of 25"),
    (1.2, "the frame rate looks like 25 instead of 30"),
    (0.01, "the positions look like metres, not centimetres"),
];

impl Understanding {
    pub(super) fn find(&mut self, is_grave: bool, text: impl Into<String>) {
        self.findings.push(Finding { is_grave, text: text.into() });
    }

    /// Finds what makes the tracks unusable.
    pub(super) fn refuse(&mut self, text: impl Into<String>) {
        self.find(true, text);
    }

    /// Finds what is strange in tracks that can be used.
    pub(super) fn warn(&mut self, text: impl Into<String>) {
        self.find(false, text);
    }

    pub(super) fn check_units(&mut self, recording: &Recording) {
        if self.ratios.len() >= MIN_VEHICLES.min(recording.tracks.len()) && !self.ratios.is_empty() {
            let ratio = median(&mut self.ratios);
            self.positions_over_speeds = Some(ratio);
            let times = significant(ratio, 3);
            if (ratio - 1.0).abs() > MAX_SPEED_DIFFERENCE {
                // A rate that the times give is right.
                let rate = |why: &str| why.starts_with("the frame rate");
                let near = |(factor, why): &&(f64, &str)| {
                    (ratio / factor - 1.0).abs() < 0.06 && !(rate(why) && self.rate_source == TIMES)
                };
                let why = MISTAKEN.iter().find(near).map_or("check units and frame rate", |(_, why)| why);
                self.refuse(format!("vehicles move {times} times as far as their speeds tell: {why}"));
            } else if (ratio - 1.0).abs() > USUAL_SPEED_DIFFERENCE {
                let why = "distances or speeds are wrong";
                self.warn(format!("vehicles move {times} times as far as their speeds tell: {why}"));
            }
        }
        let told = self.acceleration;
        // Below 0.1 m/s in a second there is nothing to compare.
        if told.count > 50.0 && told.of_given.max(told.of_derived) > 0.01 * told.count {
            let size = libm::sqrt(told.of_given / told.of_derived.max(1e-12));
            if told.is_opposite() || !(0.4..=2.5).contains(&size) {
                self.refuse(format!(
                    "accelerations do not fit the changes of speed (they are {} times as large, {}): check their unit and sign",
                    significant(size, 2),
                    if told.product < 0.0 { "of the other sign" } else { "of the same sign" }
                ));
            } else if (told.slope() - 1.0).abs() > USUAL_ACCELERATION_DIFFERENCE + 4.0 * told.slope_error() {
                self.warn(format!(
                    "accelerations are {} times the changes of speed; leader decelerations are kept for the peaks of the former",
                    significant(told.slope(), 2)
                ));
            }
            let offset_mps2 = told.difference / told.count;
            if offset_mps2.abs() > USUAL_ACCELERATION_OFFSET_MPS2 {
                self.warn(format!(
                    "accelerations are {} m/s² {} the changes of speed on average; leader decelerations are kept for the peaks of the former",
                    significant(offset_mps2.abs(), 2),
                    if offset_mps2 < 0.0 { "below" } else { "above" }
                ));
            }
        }
        let mean = |track: &Track| track.v_s_mps.iter().map(|v| v.max(0.0)).sum::<f64>() / track.len() as f64;
        // Refused: what is beyond the physical range is grave.
        let mut doubts = Doubts::new(Implausible::Refused);
        let mut grave: Vec<String> = Vec::new();
        let mut check = |quantity: Quantity, value: f64, place: String| {
            if let Err(problem) = doubts.check(quantity, value, || place.clone()) {
                grave.push(format!("{place}: {problem}"));
            }
        };
        for track in &recording.tracks {
            check(Quantity::Speed, mean(track), format!("vehicle {}, mean speed", track.id));
            check(Quantity::Length, track.length_m, format!("vehicle {}", track.id));
            check(Quantity::Width, track.width_m, format!("vehicle {}", track.id));
        }
        for of in &self.carriageways {
            for width_m in of.lane_width_m {
                check(Quantity::LaneWidth, width_m, format!("carriageway {}", of.name));
            }
        }
        check(Quantity::Rate, self.rate_hz, "frame rate".to_owned());
        // Half of the vehicles beyond what is plausible is a unit, not an odd vehicle.
        let general = |quantity: Quantity, of: &dyn Fn(&Track) -> f64| {
            let (Limits { name, unit, mistaken, .. }, mut values) =
                (quantity.limits(), recording.tracks.iter().map(of).collect::<Vec<f64>>());
            let middle = median(&mut values);
            let hint = mistaken.iter().find(|(_, factor)| quantity.is_plausible(middle / factor));
            let hint = hint.map_or(String::new(), |(unit, _)| format!(": it looks like {unit}"));
            let text = || format!("the median {name} is {} {unit}{hint}", significant(middle, 3));
            (!quantity.is_plausible(middle)).then(text)
        };
        let general = [
            general(Quantity::Speed, &mean),
            general(Quantity::Length, &|track| track.length_m),
            general(Quantity::Width, &|track| track.width_m),
        ];
        if let Some(first) = grave.first() {
            let more = if grave.len() > 1 { format!(" ({} more such)", grave.len() - 1) } else { String::new() };
            self.refuse(format!("{first}{more}"));
        }
        // A wrong ratio names the unit already.
        if self.positions_over_speeds.is_none_or(|ratio| (ratio - 1.0).abs() <= MAX_SPEED_DIFFERENCE) {
            general.into_iter().flatten().for_each(|text| self.refuse(text));
        }
        let narrow =
            self.carriageways.iter().any(|of| of.lane_width_m.iter().all(|w| !Quantity::LaneWidth.is_plausible(*w)));
        if narrow {
            self.refuse("no lane has a plausible width: check the unit of y, and what `lane` means");
        }
        let lanes = || recording.tracks.iter().flat_map(|track| &track.lane);
        if 2 * lanes().filter(|lane| **lane == NO_LANE).count() > lanes().count() {
            self.refuse("vehicles are mostly in no lane: check the axes, and the lanes in the file");
        }
        let mut cars_m: Vec<f64> =
            recording.tracks.iter().filter(|of| of.class == VehicleClass::Car).map(|of| of.length_m).collect();
        let car_m = median(&mut cars_m);
        if car_m < SHORT_CAR_M {
            let car_m = significant(car_m, 3);
            self.warn(format!("half of the cars are shorter than {car_m} m: check `length` and its unit"));
        }
        let widths = self.carriageways.iter().flat_map(|of| of.lane_width_m);
        let narrowest = widths.fold(f64::INFINITY, f64::min);
        if !narrow && narrowest < NARROW_LANE_M {
            self.warn(format!("lanes of {} m are narrow: check the unit of y", significant(narrowest, 3)));
        }
        let long =
            recording.tracks.iter().filter(|track| track.class == VehicleClass::Car && track.length_m >= 9.0).count();
        if long > 0 && !self.classes.is_empty() {
            self.warn(format!("{long} vehicle(s) of 9 m and longer are cars by their class: see `classes`"));
        }
        doubts.sentences().into_iter().for_each(|text| self.warn(text));
        if self.length_m < 50.0 {
            let length_m = significant(self.length_m, 3);
            self.warn(format!("only {length_m} m of road are in view: check the unit of x and y"));
        }
    }

    /// Finds vehicles that drive backwards; the others' speeds below 0 are noise.
    pub(super) fn note_backwards(&mut self, recording: &Recording) {
        for track in &recording.tracks {
            let backwards = track.v_s_mps.iter().filter(|v| **v < NOISE_MPS).count();
            if 20 * backwards > track.len() {
                self.backwards.push(track.id);
                continue;
            }
            let below = track.v_s_mps.iter().filter(|v| **v < 0.0);
            self.noise_speeds += below.clone().count() as u64;
            self.lowest_noise_mps = below.fold(self.lowest_noise_mps, |lowest, v| lowest.min(*v));
        }
    }

    pub(super) fn check_motion(&mut self, recording: &Recording) {
        // A wrong ratio names the unit already.
        if self.positions_over_speeds.is_some_and(|ratio| (ratio - 1.0).abs() > MAX_SPEED_DIFFERENCE) {
            return;
        }
        let constant = |track: &&Track| track.v_s_mps.iter().all(|v| (v - track.v_s_mps[0]).abs() < 1e-9);
        let constant: Vec<&Track> = recording.tracks.iter().filter(constant).collect();
        let contradicted = constant.iter().filter(|track| speed_range_mps(track, self.rate_hz) > MAX_RANGE_MPS).count();
        if contradicted > 0 && 20 * contradicted >= constant.len() && 10 * constant.len() >= 9 * recording.tracks.len()
        {
            self.refuse(format!(
                "the speed of a vehicle does not change, although {contradicted} move at speeds that differ by more than \
                 {MAX_RANGE_MPS} m/s: it is one speed per vehicle; leave out the column, so that speeds follow from positions"
            ));
            return;
        }
        if let Some(Impossible { vehicles, first: (vehicle, frame), is_speed, problem }) = impossible(recording) {
            let help = match is_speed {
                true if self.derived_speeds == recording.tracks.len() as u64 => {
                    "correct the positions, or smooth them (`smoothing_s`)"
                }
                true => "name the text that stands for no value in `none`, or leave out the column of speeds",
                false => "correct the values, or derive them from smoothed positions (`smoothing_s`)",
            };
            self.refuse(format!(
                "{vehicles} vehicle(s) have samples that cannot be, the first is vehicle {vehicle} at frame {frame}: {problem}; {help}"
            ));
        }
    }

    pub(super) fn check_axes(&mut self, recording: &Recording, preset: &Preset) {
        if self.lateral.correlation() < -0.5 && self.lateral.is_opposite() && recording.tracks.len() >= MIN_VEHICLES {
            self.refuse("vehicles move across the road against their lateral speeds: y, or the lateral speed, is mirrored; see `axes.y`");
        }
        if let Some((cosine, lateral)) = self.heading_facts {
            if cosine < 0.9 {
                self.refuse(format!(
                    "headings and motion differ (median cosine {}): check the unit of the heading, and `axes.heading` (from-x or from-north)",
                    significant(cosine, 2)
                ));
            } else if lateral.slope() < -0.3 && lateral.correlation() < -0.3 && lateral.is_opposite() {
                self.refuse(
                    "headings turn against the motion across the road: y, or the heading, is mirrored; see `axes.y`",
                );
            }
        }
        if self.across_fraction > MAX_ACROSS {
            self.refuse(format!(
                "{} % of the vehicles cross the road by more than 15 m: this is no motorway, or vehicles of several roads are in one file",
                significant(100.0 * self.across_fraction, 2)
            ));
        }
        let keeps = if preset.traffic == Side::Left { "left" } else { "right" };
        if let Some(oncoming) = self.oncoming_left_m {
            let is_left_hand = oncoming < 0.0;
            if is_left_hand != (preset.traffic == Side::Left) {
                self.refuse(format!(
                    "oncoming vehicles are on the {} of the vehicles, which does not fit traffic on the {keeps}: y is mirrored (`axes.y`), or set `traffic = \"{}\"`",
                    if is_left_hand { "right" } else { "left" },
                    if is_left_hand { "left" } else { "right" },
                ));
            }
        } else {
            self.check_slow_side(recording, preset, keeps);
        }
        if let Some(difference) = self.lane_offset_error_m.filter(|difference| *difference > 0.5) {
            let by = significant(difference, 2);
            self.warn(format!("offsets in the lane differ from the positions by {by} m (median) and are not used"));
        }
        if let Some(mismatch) = self.label_mismatch.filter(|mismatch| *mismatch > 0.05) {
            let percent = significant(100.0 * mismatch, 2);
            let text =
                format!("{percent} % of the samples are not where the name of their lane says; positions decide");
            self.find(mismatch > 0.2, text);
        }
    }

    /// Lorries drive on the slow side.
    fn check_slow_side(&mut self, recording: &Recording, preset: &Preset, keeps: &str) {
        // Mean over the vehicles, and the square of its standard error.
        let mean_lane = |class: VehicleClass| {
            let known = |track: &&Track| track.class == class && track.lane.iter().any(|lane| *lane != NO_LANE);
            let of_vehicle = |track: &Track| {
                let lanes = track.lane.iter().filter(|lane| **lane != NO_LANE);
                lanes.clone().map(|lane| f64::from(*lane)).sum::<f64>() / lanes.count() as f64
            };
            let tracks: Vec<&Track> = recording.tracks.iter().filter(known).collect();
            let lanes: Vec<f64> = tracks.iter().map(|track| of_vehicle(track)).collect();
            let mean = lanes.iter().sum::<f64>() / lanes.len() as f64;
            let spread = lanes.iter().map(|lane| (lane - mean) * (lane - mean)).sum::<f64>();
            let samples = tracks.iter().map(|track| track.len().div_ceil(25)).sum::<usize>();
            let error = if lanes.len() < MIN_VEHICLES {
                f64::INFINITY
            } else {
                spread / (lanes.len() * (lanes.len() - 1)) as f64
            };
            (samples >= MIN_SAMPLES).then_some((mean, error))
        };
        let (Some((cars, of_cars)), Some((trucks, of_trucks))) =
            (mean_lane(VehicleClass::Car), mean_lane(VehicleClass::Truck))
        else {
            if self.carriageways.iter().any(|of| of.lanes > 1) {
                self.warn("one direction of travel and few lorries: nothing tells whether y is mirrored");
            }
            return;
        };
        // Lane 0 is the leftmost.
        let slow_is_right = trucks > cars;
        let by = (trucks - cars).abs();
        if by > 0.15 && slow_is_right == (preset.traffic == Side::Left) {
            let is_certain = by > 4.0 * (of_cars + of_trucks).sqrt();
            self.find(is_certain, format!(
                "{} drive in the lanes on the {}, which does not fit traffic on the {keeps}: y is mirrored (`axes.y`), or set `traffic`{}",
                if is_certain { "lorries" } else { "few lorries" },
                if slow_is_right { "right" } else { "left" },
                if is_certain { "" } else { ", or this is chance" }
            ));
        }
    }

    pub(super) fn check_boxes(&mut self, recording: &Recording) {
        if let Some(found) = overlaps(recording) {
            let mut involved: Vec<usize> = found.pairs.iter().flat_map(|(a, b)| [*a, *b]).collect();
            involved.sort_unstable();
            involved.dedup();
            let fraction = involved.len() as f64 / recording.tracks.len() as f64;
            let is_grave = fraction > MAX_OVERLAPPING && involved.len() >= MIN_VEHICLES;
            self.find(is_grave, format!(
                "{} pairs of vehicles overlap, the first are {}: check sizes and `reference` (centre, front, rear, corner)",
                found.pairs.len(),
                found.first
            ));
            for (a, b) in &found.pairs {
                let shorter = if recording.tracks[*a].len() < recording.tracks[*b].len() { a } else { b };
                self.doubtful.push(recording.tracks[*shorter].id);
            }
        }
        let edge = edge_slope(recording).map(|(slope, error)| (slope.abs(), error)).filter(|(slope, _)| *slope >= 0.6);
        if let Some((slope, error)) = edge {
            let what = "the position is that of an edge or a corner; see `reference`";
            if slope < 1.6 && slope > 4.0 * error {
                let part = significant(slope, 2);
                self.refuse(format!(
                    "wide vehicles are beside the middle of their lanes by {part} of half their width: {what}"
                ));
            } else if slope > 0.6 {
                self.warn(format!("too few vehicles to tell whether {what}"));
            }
        }
        if self.assumed_sizes > 0 {
            let number = count(self.assumed_sizes);
            let instead = "`sizes` of the preset, or usual ones, take its place";
            self.warn(format!("{number} vehicles have no size in the file; {instead}"));
        }
        if self.changing_sizes > 0 {
            let number = count(self.changing_sizes);
            self.warn(format!("the size of {number} vehicles varies by more than a tenth; the median is used"));
        }
    }

    pub(super) fn check_quality(&mut self, recording: &Recording) {
        let is_jumping = |track: &&Track| jumps(track, recording.frame_rate_hz);
        let jumping: Vec<u32> = recording.tracks.iter().filter(is_jumping).map(|track| track.id).collect();
        if let Some(first) = jumping.first() {
            self.warn(format!(
                "{} tracks jump by more than {JUMP_ALONG_M} m along or {JUMP_ACROSS_M} m across the road, the first is vehicle {first}",
                jumping.len()
            ));
            self.doubtful.extend(&jumping);
        }
        let against = |track: &&Track| track.s_m[track.len() - 1] - track.s_m[0] < -5.0;
        let against = recording.tracks.iter().filter(against).count();
        if against > 0 {
            let is_grave = 10 * against > recording.tracks.len();
            let text = format!("{against} vehicle(s) move against their direction of travel: check `direction`");
            self.find(is_grave, text);
        }
        for [a, b] in [["x_speed", "y_speed"], ["y_speed", "x_speed"], ["x_acceleration", "y_acceleration"]] {
            let has = |key: &str| self.columns.iter().any(|(role, _)| *role == key);
            if has(a) && !has(b) {
                self.warn(format!("`{a}` is not used without `{b}`; `speed` is a speed along the road"));
            }
        }
        let backwards = self.backwards.len();
        if backwards > 0 {
            let is_grave = 5 * backwards > recording.tracks.len();
            self.find(is_grave, format!(
                "{backwards} vehicles drive backwards (faster than 0.5 m/s) and are left out: check `direction` and the signs of the speeds"
            ));
        }
        let notes = [
            (self.incomplete, "rows have no position and are left out"),
            (self.duplicates, "rows repeat vehicle and time of another row and are left out"),
            (self.short_pieces, "piece(s) of tracks are too short to be used"),
        ];
        for (number, what) in notes {
            if number > 0 {
                self.warn(format!("{} {what}", count(number)));
            }
        }
        if self.noise_speeds > 0 {
            let (number, lowest) = (count(self.noise_speeds), value(self.lowest_noise_mps));
            self.warn(format!("{number} speeds below 0 count as 0; the lowest is {lowest} m/s"));
        }
        if self.conflicts > 0 {
            let number = count(self.conflicts);
            let help = "check `vehicle` and `time`";
            let text = format!("{number} of these rows name another position; the first row counts: {help}");
            let samples: usize = recording.tracks.iter().map(Track::len).sum();
            self.find(100 * self.conflicts > samples as u64, text);
        }
        if self.interpolated > 0 {
            let why = match self.off_raster_frames > 0.02 {
                true => format!("times are off the raster by up to {} frames", significant(self.off_raster_frames, 2)),
                false => "gaps are filled".to_owned(),
            };
            self.warn(format!("{} samples are of tracks that were interpolated: {why}", count(self.interpolated)));
        }
        if !self.vehicle_names.is_empty() {
            self.warn("vehicles have other numbers than in the file: their ids are no small whole numbers, or a track was split; the ids of scenarios keep the file's");
        }
    }
}

/// By how much the mean speeds over a second differ along a track, by its positions, m/s.
fn speed_range_mps(track: &Track, rate_hz: f64) -> f64 {
    let second = rate_hz.round().max(1.0) as usize;
    let speeds = (second..track.len()).map(|k| (track.s_m[k] - track.s_m[k - second]) * rate_hz / second as f64);
    let (low, high) = range(speeds);
    high - low
}

/// Slope of the mean offset from the lane's middle over half the width, with its standard error, of the carriageway where it
/// is most certain; ±1 if positions are those of an edge.
fn edge_slope(recording: &Recording) -> Option<(f64, f64)> {
    let of = |carriageway: usize| {
        let mut pairs: Vec<(f64, f64, u16)> = Vec::new();
        for track in recording.tracks.iter().filter(|track| track.carriageway == carriageway) {
            let lane = track.lane[0];
            let is_kept = track.lane.iter().all(|l| *l == lane);
            let middle = recording.carriageways[carriageway].lane(usize::from(lane)).filter(|_| is_kept);
            let Some(centre) = middle.map(|lane| lane.centre_m()) else { continue };
            let mean = track.d_m.iter().sum::<f64>() / track.len() as f64 - centre;
            pairs.push((track.width_m / 2.0, mean, lane));
        }
        slope_within(&mut pairs)
    };
    (0..recording.carriageways.len()).filter_map(of).max_by(|a, b| (a.0 / a.1).abs().total_cmp(&(b.0 / b.1).abs()))
}

/// Slope within groups, so that the middles of the lanes do not matter, and its standard error; `None` if the widths hardly
/// vary.
fn slope_within(pairs: &mut [(f64, f64, u16)]) -> Option<(f64, f64)> {
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
    (n >= 20 && xx / n as f64 > 0.08 * 0.08).then(|| (slope, (residual / xx).sqrt()))
}
