//! What the reader understood of a file, a line per fact, and what contradicts itself in it.

use serde::Serialize;

use super::offsets::way;
use super::preset::Preset;
use super::road::median;
use crate::trajectory::{Loaded, Noise, Recording, Track, VehicleClass};
use lanesweep_support::readable::{count, significant};
use lanesweep_support::{Error, Place, Result};

/// So far beyond the lane of its `laneId` a centre counts as misplaced, m: in lane changes `laneId` may change a little late.
const MARGIN_M: f64 = 0.5;

/// Something that is strange in a file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// The tracks cannot be used as they are.
    pub is_grave: bool,
    /// What is strange, and what to do.
    pub text: String,
}

/// What was understood of one recording.
#[derive(Debug, Default, Serialize)]
pub struct Understanding {
    /// Name of the recording.
    pub recording: String,
    /// Facts: a name and what it is.
    pub facts: Vec<(&'static str, String)>,
    /// What is strange.
    pub findings: Vec<Finding>,
    #[serde(skip)]
    pub(super) seen: Seen,
}

/// What tells whether a recording fits together.
#[derive(Debug, Default)]
pub(super) struct Seen {
    /// The road is no straight line.
    pub is_curved: bool,
    /// Where the lane lines come from, by carriageway.
    pub lane_sources: Vec<&'static str>,
    /// The frame rate is that of the times.
    pub rate_is_of_times: bool,
    /// Tracks whose speeds, lateral speeds and accelerations the file lacks, if only in one sample.
    pub derived: [u64; 3],
    /// Distance over integrated speed, of each track.
    pub ratios: Vec<f64>,
    /// Speeds and positions do not belong together, which names the unit that is wrong.
    pub has_wrong_ratio: bool,
    /// Derived speeds minus given ones, and the accelerations of the given ones: the slope is by how much they are late, s.
    /// Along and across the road.
    pub delay: [Comparison; 2],
    /// Given lateral speeds and derived ones.
    pub lateral: Comparison,
    /// Given accelerations over a second and the changes of speed.
    pub acceleration: Comparison,
    /// Median cosine between heading and motion, and both across the road.
    pub heading: Option<(f64, Comparison)>,
    /// Lateral position of the oncoming traffic seen from the forward one, m.
    pub oncoming_left_m: Option<f64>,
    /// Fraction of the samples whose named lane is not where they are.
    pub label_mismatch: Option<f64>,
    /// Vehicle and frame of the first of them, where `laneId` decides.
    pub first_misplaced: Option<(u32, i64)>,
    /// Median difference between positions in the lane as the file gives them and those from the line of the road, m.
    pub lane_offset_error_m: Option<f64>,
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
    pub(super) fn new(recording: &str) -> Self {
        Understanding { recording: recording.to_owned(), ..Understanding::default() }
    }

    /// The same checks of a recording in highD's format.
    ///
    /// # Errors
    /// [`Error::Input`] if no vehicle is left.
    pub(in crate::trajectory) fn of_highd(mut loaded: Loaded, place: &Place) -> Result<Loaded> {
        let recording = &loaded.recording;
        let mut about = Understanding::new(&recording.id);
        std::mem::take(&mut loaded.notes).into_iter().for_each(|note| about.warn(note));
        let rate_hz = recording.frame_rate_hz;
        about.fact("rate", format!("{rate_hz} Hz, from the meta file"));
        let (mut samples, mut misplaced, mut centres_m) = (0, 0, [Vec::new(), Vec::new()]);
        for track in &recording.tracks {
            about.note_speeds((&track.s_m, Some(&track.v_s_mps)), (&track.d_m, Some(&track.v_d_mps)), rate_hz);
            about.note_accelerations(&track.v_s_mps, &track.a_s_mps2, rate_hz);
            let of = &recording.carriageways[track.carriageway];
            centres_m[usize::from(of.name == "2")].push(track.d_m[track.len() / 2]);
            for (k, d_m) in track.d_m.iter().enumerate() {
                let Some(lane) = of.lane(track.lane[k].into()) else { continue };
                samples += 1;
                if (d_m - lane.left_m).max(lane.right_m - d_m) > MARGIN_M {
                    misplaced += 1;
                    about.seen.first_misplaced.get_or_insert((track.id, track.first_frame + k as i64));
                }
            }
        }
        about.seen.label_mismatch = Some(f64::from(misplaced) / f64::from(samples.max(1)));
        let [backward_m, forward_m] = centres_m.each_mut().map(|of| median(of));
        about.seen.oncoming_left_m = Some(-backward_m - forward_m).filter(|left_m| !left_m.is_nan());
        about.judge(&mut loaded.recording, &Preset::default(), place)?;
        Ok(Loaded { understanding: about, ..loaded })
    }

    pub(super) fn fact(&mut self, name: &'static str, text: impl Into<String>) {
        self.facts.push((name, text.into()));
    }

    /// Compares the given speeds of a track along and across the road with its positions.
    pub(super) fn note_speeds(
        &mut self,
        (s_m, given_s): (&[f64], Option<&Vec<f64>>),
        (d_m, given_d): (&[f64], Option<&Vec<f64>>),
        rate_hz: f64,
    ) {
        if let Some(given) = given_s {
            let driven_m: f64 = given.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]) / rate_hz).sum();
            let moved_m = s_m[s_m.len() - 1] - s_m[0];
            if driven_m.abs().max(moved_m.abs()) > 20.0 {
                self.seen.ratios.push(moved_m / driven_m.abs().max(0.1));
            }
        }
        for (axis, at_m, given, per_s) in [(0, s_m, given_s, 2.0), (1, d_m, given_d, 5.0)] {
            let Some(given) = given else { continue };
            let reach = (rate_hz / per_s).round().max(1.0) as usize;
            let change = |of: &[f64], k: usize| (of[k + reach] - of[k - reach]) * rate_hz / (2 * reach) as f64;
            for k in (reach..at_m.len().saturating_sub(reach)).step_by(reach) {
                let moved_mps = change(at_m, k);
                self.seen.delay[axis].add(moved_mps - given[k], change(given, k));
                if axis == 1 {
                    self.seen.lateral.add(given[k], moved_mps);
                }
            }
        }
    }

    /// Compares given accelerations with the changes of given speeds over a second.
    pub(super) fn note_accelerations(&mut self, v_mps: &[f64], a_mps2: &[f64], rate_hz: f64) {
        let reach = rate_hz.round().max(1.0) as usize;
        for k in (reach..v_mps.len()).step_by(reach) {
            let told: f64 = a_mps2[k - reach..k].iter().sum::<f64>() / rate_hz;
            self.seen.acceleration.add(told, v_mps[k] - v_mps[k - reach]);
        }
    }

    /// Checks the recording against itself. Leaves out vehicles that drive backwards.
    ///
    /// # Errors
    /// [`Error::Input`] if no vehicle is left.
    pub(super) fn judge(&mut self, recording: &mut Recording, preset: &Preset, place: &Place) -> Result<()> {
        self.check_road(recording);
        self.check_speeds(recording);
        self.check_units(recording);
        self.leave_out_backwards(recording);
        self.check_motion(recording);
        self.check_resolution(recording);
        self.check_axes(recording, preset);
        self.check_boxes(recording);
        self.check_parts(recording);
        self.clear_noise(recording);
        for (index, of) in recording.carriageways.iter().enumerate() {
            let widths = of.widths_m().map(|width_m| significant(width_m, 3)).collect::<Vec<_>>().join(" ");
            let source = self.seen.lane_sources.get(index).copied().unwrap_or("the lane lines in the file");
            let (lanes, tracks) =
                (of.lane_count(), recording.tracks.iter().filter(|of| of.carriageway == index).count());
            self.fact("lanes", format!("{}: {lanes} lanes of {widths} m from {source}; {tracks} tracks", way(of)));
        }
        let of_class = |class: VehicleClass, name: &str| {
            let mut lengths_m = lengths_m(recording, class);
            format!("{} {name} of {} m", count(lengths_m.len()), significant(median(&mut lengths_m), 3))
        };
        let (cars, lorries) = (of_class(VehicleClass::Car, "cars"), of_class(VehicleClass::Truck, "lorries"));
        let samples = count(recording.tracks.iter().map(|track| track.len() as u64).sum::<u64>());
        self.fact("vehicles", format!("{cars}, {lorries} (median); {samples} samples"));
        let [speeds, lateral, accelerations] = self.seen.derived;
        let noise = significant(Noise::of(recording).acceleration_mps2, 2);
        self.fact("speeds", format!(
            "{speeds} tracks from positions, {lateral} across the road; {accelerations} accelerations from speeds, noise {noise} m/s²"
        ));
        if recording.tracks.is_empty() {
            let why = self.findings.iter().map(|finding| finding.text.as_str()).collect::<Vec<_>>().join("; ");
            let problem = format!("no vehicle is left: {why}");
            return Err(Error::input(place.clone(), problem, "correct the file, or its preset"));
        }
        Ok(())
    }

    /// Whether the tracks can be used.
    pub fn is_usable(&self) -> bool {
        self.findings.iter().all(|finding| !finding.is_grave)
    }

    pub(super) fn find(&mut self, is_grave: bool, text: impl Into<String>) {
        self.findings.push(Finding { is_grave, text: text.into() });
    }

    /// Finds what makes the tracks unusable.
    pub(super) fn refuse(&mut self, text: impl Into<String>) {
        self.find(true, text);
    }

    /// Finds what is strange in tracks that can be used.
    pub fn warn(&mut self, text: impl Into<String>) {
        self.find(false, text);
    }

    /// Finds so many of something, unless there are none.
    pub(super) fn find_of(&mut self, number: u64, is_grave: bool, what: &str) {
        if number > 0 {
            self.find(is_grave, format!("{} {what}", count(number)));
        }
    }

    pub(super) fn warn_of(&mut self, number: u64, what: &str) {
        self.find_of(number, false, what);
    }
}

/// Lengths of the vehicles of a class, m.
pub(super) fn lengths_m(recording: &Recording, class: VehicleClass) -> Vec<f64> {
    recording.tracks.iter().filter(|track| track.class == class).map(|track| track.length_m).collect()
}

/// Median of a value over the tracks.
pub(super) fn median_of(recording: &Recording, of: impl Fn(&Track) -> f64) -> f64 {
    median(&mut recording.tracks.iter().map(of).collect::<Vec<f64>>())
}
