//! What the reader understood of a file, and what contradicts itself in it.

use std::collections::BTreeMap;

use serde::Serialize;

use super::boxes::begins_so;
use super::lanes::LaneSource;
use super::preset::{Preset, Reference};
use super::raw::RawRecording;
use super::road::{median, range};
use crate::support::readable::{count, significant, value};
use crate::traffic::trajectory::{Noise, Recording, Track, VehicleClass};

/// The source of a frame rate that times gave.
pub(super) const TIMES: &str = "times";

/// Something that is strange in a file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// The tracks cannot be used as they are.
    pub is_grave: bool,
    /// What is strange, and what to do.
    pub text: String,
}

/// Lanes of one direction of travel.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct UnderstoodCarriageway {
    /// Name: 2 towards +x, 1 against it.
    pub name: String,
    /// Number of lanes.
    pub lanes: usize,
    /// Smallest and largest lane width, m.
    pub lane_width_m: [f64; 2],
    /// Where the lanes come from.
    pub source: &'static str,
    /// Tracks on it.
    pub tracks: usize,
}

impl UnderstoodCarriageway {
    /// The direction of travel in words.
    pub fn way(&self) -> &'static str {
        if self.name == "2" { "forward" } else { "backward" }
    }

    pub(super) fn of(name: &str, lines_m: &[f64], source: LaneSource, tracks: usize) -> Self {
        let widths = || lines_m.windows(2).map(|pair| pair[0] - pair[1]);
        UnderstoodCarriageway {
            name: name.to_owned(),
            lanes: lines_m.len() - 1,
            lane_width_m: [widths().fold(f64::INFINITY, f64::min), widths().fold(0.0, f64::max)],
            source: match source {
                LaneSource::Names => "the names of lanes in the file",
                LaneSource::Bands => "bands of the width in the preset",
                LaneSource::Positions => "where vehicles drive",
                LaneSource::Map => "the boundaries in the file",
                LaneSource::Lines => "the lane lines in the file",
            },
            tracks,
        }
    }
}

/// What was understood of one recording.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Understanding {
    /// Name of the recording.
    pub recording: String,
    /// Frames per second.
    pub rate_hz: f64,
    /// Where the rate comes from.
    pub rate_source: String,
    /// Meaning and name of the columns that are used.
    pub columns: Vec<(&'static str, String)>,
    /// Columns that are not used.
    pub unused: Vec<String>,
    /// Point of the vehicle that positions are taken for.
    pub reference: Reference,
    /// Texts of classes in the file, with their numbers of vehicles.
    pub classes: Vec<(String, u64)>,
    /// Tracks of cars and of lorries.
    pub cars: u64,
    /// Tracks of lorries.
    pub trucks: u64,
    /// Samples of all tracks.
    pub samples: u64,
    /// Time of all tracks, h.
    pub hours: f64,
    /// Distance of all tracks, km.
    pub km: f64,
    /// The road is a straight line.
    pub is_straight: bool,
    /// Length of the road in view, m.
    pub length_m: f64,
    /// Smallest radius of curvature, m; null for a straight road.
    pub min_radius_m: f64,
    /// Median over the tracks of the range of their lateral positions, m: lane keeping and the error of the road line.
    pub wander_m: f64,
    /// The directions of travel.
    pub carriageways: Vec<UnderstoodCarriageway>,
    /// Tracks whose speeds follow from positions: where one sample has none.
    pub derived_speeds: u64,
    /// Tracks whose lateral speeds follow from positions.
    pub derived_lateral: u64,
    /// Tracks whose accelerations follow from speeds.
    pub derived_accelerations: u64,
    /// Standard deviation of the noise of speeds while they change, m/s.
    pub speed_noise_mps: f64,
    /// The same of accelerations, m/s².
    pub acceleration_noise_mps2: f64,
    /// The same of positions along the road, m.
    pub position_noise_m: f64,
    /// The same of positions across the road, m.
    pub lateral_noise_m: f64,
    /// Positions over integrated speeds; 1 if they fit together.
    pub positions_over_speeds: Option<f64>,
    /// Vehicles left out because of their class.
    pub ignored: u64,
    /// Vehicles without a size in the file.
    pub assumed_sizes: u64,
    /// Vehicles whose size varies by more than a tenth.
    pub changing_sizes: u64,
    /// Rows without a position.
    pub incomplete: u64,
    /// Rows with the vehicle and time of another row.
    pub duplicates: u64,
    /// Those of them that name another position.
    pub conflicts: u64,
    /// Pieces of tracks that were too short.
    pub short_pieces: u64,
    /// Tracks beyond one per vehicle, because of gaps.
    pub split_tracks: u64,
    /// Steps that no vehicle makes, where tracks were split.
    pub jumps: u64,
    /// Samples that were interpolated.
    pub interpolated: u64,
    /// Speeds below 0, counted as 0.
    pub noise_speeds: u64,
    /// The lowest of them, m/s.
    pub lowest_noise_mps: f64,
    /// Names in the file of the vehicles that have another number.
    pub vehicle_names: BTreeMap<u32, String>,
    /// The frame of the file at frame 0 of the recording, and frames of the file per frame; null if it has none that fit its times.
    pub file_frames: Option<[i64; 2]>,
    /// Vehicles left out as doubtful.
    pub excluded: u64,
    /// What is strange.
    pub findings: Vec<Finding>,
    /// Fraction of the samples whose named lane is not where they are.
    pub label_mismatch: Option<f64>,
    /// Median difference between positions in the lane as the file gives them and those from the line of the road, m.
    pub lane_offset_error_m: Option<f64>,
    #[serde(skip)]
    pub(super) off_raster_frames: f64,
    #[serde(skip)]
    pub(super) across_fraction: f64,
    #[serde(skip)]
    pub(super) heading_facts: Option<(f64, Comparison)>,
    /// Lateral position of the oncoming traffic seen from the forward one, m.
    #[serde(skip)]
    pub(super) oncoming_left_m: Option<f64>,
    /// Vehicles that drive backwards.
    #[serde(skip)]
    pub(super) backwards: Vec<u32>,
    /// Vehicles that overlap others, or whose position jumps.
    #[serde(skip)]
    pub(super) doubtful: Vec<u32>,
    #[serde(skip)]
    pub(super) ratios: Vec<f64>,
    /// Given lateral speeds over derived ones.
    #[serde(skip)]
    pub(super) lateral: Comparison,
    /// Given accelerations over a second over the changes of speed.
    #[serde(skip)]
    pub(super) acceleration: Comparison,
}

/// Pairs of what should be equal: Σ of the products and of the squares.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Comparison {
    pub product: f64,
    pub of_given: f64,
    pub of_derived: f64,
    /// Σ of the given values minus the derived ones.
    pub difference: f64,
    pub count: f64,
}

impl Comparison {
    pub(super) fn add(&mut self, given: f64, derived: f64) {
        self.product += given * derived;
        self.of_given += given * given;
        self.of_derived += derived * derived;
        self.difference += given - derived;
        self.count += 1.0;
    }

    /// Standard error of the slope.
    pub(super) fn slope_error(&self) -> f64 {
        let residual = (self.of_given - self.slope() * self.product).max(0.0) / (self.count - 1.0).max(1.0);
        (residual / self.of_derived).sqrt()
    }

    /// Whether the given values have the other sign: their slope over the derived ones is below 0 by four standard errors.
    pub(super) fn is_opposite(&self) -> bool {
        self.count > 1.0 && self.slope() < -4.0 * self.slope_error()
    }

    /// Slope of the given values over the derived ones: 1 if they are equal, -1 if one is mirrored, 0 if one is noise.
    pub(super) fn slope(&self) -> f64 {
        if self.of_derived > 0.0 { self.product / self.of_derived } else { 0.0 }
    }

    /// Correlation about 0.
    pub(super) fn correlation(&self) -> f64 {
        let strength = (self.of_given * self.of_derived).sqrt();
        if strength > 0.0 { self.product / strength } else { 0.0 }
    }
}

impl Understanding {
    pub(super) fn new(recording: &str, incomplete: u64) -> Self {
        Understanding { recording: recording.to_owned(), incomplete, ..Understanding::default() }
    }

    /// Compares given accelerations with the changes of given speeds over a second.
    pub(super) fn note_accelerations(&mut self, v_mps: &[f64], a_mps2: &[f64], rate_hz: f64) {
        let reach = rate_hz.round().max(1.0) as usize;
        for k in (reach..v_mps.len()).step_by(reach) {
            let told: f64 = a_mps2[k - reach..k].iter().sum::<f64>() / rate_hz;
            let change = v_mps[k] - v_mps[k - reach];
            self.acceleration.add(told, change);
        }
    }

    /// The same checks of a recording that another reader gave, with its notes.
    pub fn of_recording(recording: Recording, notes: Vec<String>) -> (Understanding, Recording) {
        let mut about = Understanding::new(&recording.id, 0);
        about.rate_hz = recording.frame_rate_hz;
        about.rate_source = "meta file".to_owned();
        about.is_straight = true;
        about.min_radius_m = f64::INFINITY;
        let mut ranges = Vec::new();
        let mut ends = vec![(f64::INFINITY, f64::NEG_INFINITY); recording.carriageways.len()];
        for track in &recording.tracks {
            let across = range(track.d_m.iter().copied());
            ranges.push(across.1 - across.0);
            let along = range(track.s_m.iter().copied());
            let here = &mut ends[track.carriageway];
            *here = (here.0.min(along.0), here.1.max(along.1));
            let (v_s, v_d) = (Some(&track.v_s_mps[..]), Some(&track.v_d_mps[..]));
            about.note_speeds(&track.s_m, v_s, &track.d_m, v_d, recording.frame_rate_hz);
        }
        about.wander_m = median(&mut ranges);
        about.length_m = ends.iter().map(|(low, high)| high - low).fold(0.0, f64::max);
        for (index, carriageway) in recording.carriageways.iter().enumerate() {
            let tracks = recording.tracks.iter().filter(|track| track.carriageway == index).count();
            let (name, lines_m) = (&carriageway.name, &carriageway.lane_lines_m);
            about.carriageways.push(UnderstoodCarriageway::of(name, lines_m, LaneSource::Lines, tracks));
        }
        let recording = about.judge(recording, &Preset::default());
        for note in notes {
            // The checks above say these too.
            let is_said = about.findings.iter().any(|finding| finding.text.contains(&note));
            if !is_said && !note.contains("overlap") && !note.contains("jump by") {
                about.warn(note);
            }
        }
        (about, recording)
    }

    /// Counts the classes, and finds words of the preset that no class begins with.
    pub(super) fn note_classes(&mut self, raw: &RawRecording, preset: &Preset) {
        let mut classes: BTreeMap<&str, u64> = BTreeMap::new();
        for class in raw.vehicles.iter().filter_map(|vehicle| vehicle.class.as_deref()) {
            *classes.entry(class).or_default() += 1;
        }
        let begins = |word: &String| classes.keys().any(|class| begins_so(class, std::slice::from_ref(word)));
        let without = preset.classes.truck.iter().filter(|word| preset.is_own && !begins(word));
        let without: Vec<String> = without.map(|word| format!("`{word}`")).collect();
        if !without.is_empty() && !classes.is_empty() {
            self.warn(format!("no class begins with {}, which the preset takes for lorries", without.join(", ")));
        }
        self.classes = classes.into_iter().map(|(class, number)| (class.to_owned(), number)).collect();
    }

    /// Compares the speeds of a track with its positions.
    pub(super) fn note_speeds(
        &mut self,
        s_m: &[f64],
        given_s: Option<&[f64]>,
        d_m: &[f64],
        given_d: Option<&[f64]>,
        rate_hz: f64,
    ) {
        if let Some(given) = given_s {
            let driven_m: f64 = given.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]) / rate_hz).sum();
            let moved_m = s_m[s_m.len() - 1] - s_m[0];
            if driven_m.abs().max(moved_m.abs()) > 20.0 {
                self.ratios.push(moved_m / driven_m.abs().max(0.1));
            }
        }
        if let Some(given) = given_d {
            let reach = (rate_hz / 5.0).round().max(1.0) as usize;
            for k in (reach..d_m.len().saturating_sub(reach)).step_by(reach) {
                let change = (d_m[k + reach] - d_m[k - reach]) * rate_hz / (2 * reach) as f64;
                self.lateral.add(given[k], change);
            }
        }
    }

    /// Checks the recording against itself, and leaves out what the preset wants left out.
    pub(super) fn judge(&mut self, mut recording: Recording, preset: &Preset) -> Recording {
        self.note_backwards(&recording);
        self.check_units(&recording);
        self.check_motion(&recording);
        self.check_axes(&recording, preset);
        self.check_boxes(&recording);
        self.check_quality(&recording);
        let before = recording.tracks.len();
        let is_out = |track: &Track| {
            self.backwards.contains(&track.id) || preset.exclude_doubtful && self.doubtful.contains(&track.id)
        };
        recording.tracks.retain(|track| !is_out(track));
        recording.tracks.iter_mut().flat_map(|track| &mut track.v_s_mps).for_each(|v| *v = v.max(0.0));
        self.excluded = (before - recording.tracks.len()) as u64;
        self.cars = recording.tracks.iter().filter(|track| track.class == VehicleClass::Car).count() as u64;
        self.trucks = recording.tracks.len() as u64 - self.cars;
        self.samples = recording.tracks.iter().map(|track| track.len() as u64).sum();
        self.hours = self.samples as f64 / recording.frame_rate_hz / 3600.0;
        let moved = |track: &Track| track.s_m[track.len() - 1] - track.s_m[0];
        self.km = recording.tracks.iter().map(moved).sum::<f64>() / 1000.0;
        let noise = Noise::of(&recording);
        (self.speed_noise_mps, self.acceleration_noise_mps2) = (noise.speed_mps, noise.acceleration_mps2);
        (self.position_noise_m, self.lateral_noise_m) = (noise.position_m, noise.lateral_m);
        recording
    }

    /// What was understood, line by line: a name and what it is.
    pub fn lines(&self) -> Vec<(&'static str, String)> {
        let [cars, trucks, samples] = [self.cars, self.trucks, self.samples].map(count);
        let (hours, km) = (significant(self.hours, 3), significant(self.km, 4));
        let mut lines = vec![
            ("rate", format!("{} Hz, from the {}", value(self.rate_hz), self.rate_source)),
            ("vehicles", format!("{cars} cars, {trucks} lorries; {samples} samples, {hours} h, {km} km")),
        ];
        if !self.columns.is_empty() {
            let of = |(role, column): &(&str, String)| {
                if role == column { column.clone() } else { format!("{role} = {column}") }
            };
            let used = self.columns.iter().map(of).collect::<Vec<_>>().join(", ");
            let unused =
                if self.unused.is_empty() { String::new() } else { format!("; not used: {}", self.unused.join(", ")) };
            lines.push(("columns", format!("{used}{unused}")));
            let point = match self.reference {
                Reference::Centre => "centre of the box",
                Reference::Front => "front bumper",
                Reference::Rear => "rear bumper",
                Reference::Corner => "corner of the box",
            };
            lines.push(("reference", format!("{point}, as the preset says or assumes")));
        }
        if !self.classes.is_empty() {
            let of = |(class, number): &(String, u64)| format!("{} {class}", count(*number));
            lines.push(("classes", self.classes.iter().take(12).map(of).collect::<Vec<_>>().join(", ")));
        }
        let shape = if self.is_straight {
            "straight".to_owned()
        } else {
            format!("curved, radius down to {} m", significant(self.min_radius_m, 2))
        };
        let (length, wander) = (significant(self.length_m, 4), significant(self.wander_m, 2));
        let keeping = "around its line (0.1 to 0.6 is lane keeping)";
        let offset = self.lane_offset_error_m.filter(|error| *error <= 0.5).map_or(String::new(), |error| {
            let by = significant(error, 2);
            format!("; positions in the lane are the file's, {by} m (median) from those by the line")
        });
        lines.push(("road", format!("{shape}, {length} m in view; vehicles wander by {wander} m {keeping}{offset}")));
        for of in &self.carriageways {
            let [low, high] = of.lane_width_m;
            let width = if high - low < 0.05 {
                format!("{} m", significant(low, 3))
            } else {
                format!("{} to {} m", significant(low, 3), significant(high, 3))
            };
            let lanes = if of.lanes == 1 { "lane" } else { "lanes" };
            let (way, tracks) = (of.way(), count(of.tracks as u64));
            lines
                .push(("lanes", format!("{way}: {} {lanes} of {width} from {}; {tracks} tracks", of.lanes, of.source)));
        }
        let tracks: u64 = self.carriageways.iter().map(|of| of.tracks as u64).sum();
        let from = |derived: u64, what: &str| match derived {
            0 => "as given".to_owned(),
            some if some < tracks => format!("as given, in {} of {} tracks from {what}", count(some), count(tracks)),
            _ => format!("from {what}"),
        };
        // The rounding of arithmetic is no noise.
        let noise = |deviation: f64| significant(if deviation < 1e-6 { 0.0 } else { deviation }, 2);
        let fit = self.positions_over_speeds.map_or(String::new(), |ratio| {
            let percent = (100.0 * (ratio - 1.0).abs()).max(0.1);
            format!("; positions and speeds agree within {} %", significant(percent, 2))
        });
        lines.push((
            "speeds",
            format!(
                "{}, lateral ones {}, accelerations {}; noise {} m/s and {} m/s²{fit}",
                from(self.derived_speeds, "positions"),
                from(self.derived_lateral, "positions"),
                from(self.derived_accelerations, "speeds"),
                noise(self.speed_noise_mps),
                noise(self.acceleration_noise_mps2)
            ),
        ));
        // A gap is the difference of two positions.
        let errors = [
            ("gap", std::f64::consts::SQRT_2 * self.position_noise_m, "m"),
            ("ego_speed", self.speed_noise_mps, "m/s"),
            ("speed", self.speed_noise_mps, "m/s"),
            ("lateral_distance", self.lateral_noise_m, "m"),
        ];
        let errors = errors.iter().filter(|(_, error, _)| *error >= 1e-6);
        let errors: Vec<String> =
            errors.map(|(name, error, unit)| format!("{name}={}{unit}", significant(*error, 2))).collect();
        if !errors.is_empty() {
            let list = errors.join(",");
            lines.push(("input errors", format!("{list}: this noise; no offset")));
        }
        if self.ignored > 0 || self.excluded > 0 {
            lines.push(("left out", format!("{} by class, {} as doubtful", count(self.ignored), count(self.excluded))));
        }
        lines
    }

    /// Adds notes on tracks that can be used; what is wrong comes first.
    pub fn note(&mut self, notes: Vec<String>) {
        if self.is_usable() {
            notes.into_iter().for_each(|text| self.warn(text));
        }
    }

    /// Whether the tracks can be used.
    pub fn is_usable(&self) -> bool {
        self.findings.iter().all(|finding| !finding.is_grave)
    }
}
