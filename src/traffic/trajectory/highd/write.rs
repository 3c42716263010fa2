//! Writes a recording as the three highD files with every column of the format. Neighbours, headways and sight
//! distances are computed; [`RecordingInfo`] has the other missing values.

use std::fs;
use std::path::Path;

use super::format::{RECORDING_META_HEADER, TRACKS_HEADER, TRACKS_META_HEADER};
use super::frame::Direction;
use super::inventory::HighdFiles;
use super::neighbours::{Around, NOBODY, neighbours};
use super::writable::ImageLayout;
use crate::support::atomic_file::{AtomicFile, StagedFile};
use crate::traffic::trajectory::number::{Precision, push_integer};
use crate::traffic::trajectory::{Recording, Track, VehicleClass};
use crate::{Error, Place, Result};

/// Metadata of a recording for its files. The texts must not contain commas, quotation marks or line ends.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordingInfo {
    /// Number of the location.
    pub location_id: u32,
    /// Speed limit, m/s; `None` without limit.
    pub speed_limit_mps: Option<f64>,
    /// Month and year as highD writes them.
    pub month: String,
    /// Day of the week, three letters.
    pub week_day: String,
    /// Time of day of the first frame, hours and minutes.
    pub start_time: String,
    /// Decimals of the measured values. Computed columns always have two.
    pub precision: Precision,
}

impl Default for RecordingInfo {
    fn default() -> Self {
        RecordingInfo {
            location_id: 1,
            speed_limit_mps: None,
            month: "1.2024".to_owned(),
            week_day: "Mon".to_owned(),
            start_time: "00:00".to_owned(),
            precision: Precision::default(),
        }
    }
}

/// Writes a recording into `dir` (made if it is not there) as `NN_tracks.csv`, `NN_tracksMeta.csv` and
/// `NN_recordingMeta.csv` with NN the recording's id, in place of files of these names.
///
/// [`read`](super::read) returns the recording rounded to the decimals of `info.precision`, and bit for bit after
/// [`quantize`](super::quantize). All three files are complete before the first gets its name.
///
/// `dhw` is the gap from bumper to bumper (never negative), `thw` = dhw / speed, `ttc` = dhw / closing
/// speed (negative where the gap opens); all 0 without a preceding vehicle.
///
/// # Errors
/// If the format cannot hold the recording (carriageways other than `1` and `2`, unsorted vehicles, values
/// that are not finite, …) or the system refuses to write.
pub fn write(dir: &Path, recording: &Recording, info: &RecordingInfo) -> Result<()> {
    let staged = stage(dir, recording, info)?;
    // The main file of an older recording with the same name is removed first, and the new one is written last. A
    // crash in between leaves a visibly incomplete recording, never a mixture.
    let tracks = HighdFiles::named(dir, &recording.id).tracks;
    if tracks.exists() {
        fs::remove_file(&tracks).map_err(|source| Error::io(&tracks, "replace", source))?;
    }
    staged.into_iter().try_for_each(StagedFile::publish)
}

/// The three complete temporary files of a recording; that of the tracks comes last.
///
/// # Errors
/// As [`write`](fn@write).
pub fn stage(dir: &Path, recording: &Recording, info: &RecordingInfo) -> Result<[StagedFile; 3]> {
    let layout = ImageLayout::of(recording, info.precision)?;
    check_texts(info)?;
    fs::create_dir_all(dir).map_err(|source| Error::io(dir, "create the folder", source))?;
    let files = HighdFiles::named(dir, &recording.id);
    let writer = Writer { recording, layout, info, extent: Extent::of(recording) };
    let (tracks, summaries) = writer.tracks(&files.tracks)?;
    let tracks_meta = writer.tracks_meta(&files.tracks_meta, &summaries)?;
    let recording_meta = writer.recording_meta(&files.recording_meta, &summaries)?;
    Ok([recording_meta, tracks_meta, tracks])
}

fn check_texts(info: &RecordingInfo) -> Result<()> {
    for text in [&info.month, &info.week_day, &info.start_time] {
        if text.contains([',', '"', '\n', '\r']) {
            return Err(Error::input(
                Place::item("recording info"),
                format!("`{}` cannot be written into a comma-separated file", text.escape_debug()),
                "use a text without commas, quotation marks and line ends",
            ));
        }
    }
    Ok(())
}

struct Writer<'a> {
    recording: &'a Recording,
    layout: ImageLayout,
    info: &'a RecordingInfo,
    extent: Extent,
}

/// The range of the image that the boxes of all vehicles cover, m.
struct Extent {
    left: f64,
    right: f64,
}

impl Extent {
    fn of(recording: &Recording) -> Self {
        let mut extent = Extent { left: f64::INFINITY, right: f64::NEG_INFINITY };
        for track in &recording.tracks {
            let upper = recording.carriageways[track.carriageway].name == Direction::Upper.name();
            for &s in &track.s_m {
                let centre = if upper { -s } else { s };
                extent.left = extent.left.min(centre - 0.5 * track.length_m);
                extent.right = extent.right.max(centre + 0.5 * track.length_m);
            }
        }
        extent
    }
}

/// Headways of one instant. Undefined ones are written as 0, as in highD without a preceding vehicle.
#[derive(Default)]
struct Headways {
    dhw_m: f64,
    /// `None` at a standstill.
    thw_s: Option<f64>,
    /// `None` at equal speeds.
    ttc_s: Option<f64>,
    preceding_v_s_mps: f64,
}

/// Minimum headways of one vehicle; `None` if it never follows another.
#[derive(Default, Clone)]
struct Summary {
    min_dhw_m: Option<f64>,
    min_thw_s: Option<f64>,
    min_ttc_s: Option<f64>,
}

impl Summary {
    fn add(&mut self, headways: &Headways) {
        let lower = |min: &mut Option<f64>, value: f64| *min = Some(min.map_or(value, |min| min.min(value)));
        lower(&mut self.min_dhw_m, headways.dhw_m);
        headways.thw_s.into_iter().for_each(|thw_s| lower(&mut self.min_thw_s, thw_s));
        headways.ttc_s.into_iter().filter(|ttc_s| *ttc_s > 0.0).for_each(|ttc_s| lower(&mut self.min_ttc_s, ttc_s));
    }
}

impl Writer<'_> {
    fn direction(&self, track: &Track) -> Direction {
        self.layout.directions[track.carriageway]
    }

    fn tracks(&self, path: &Path) -> Result<(StagedFile, Vec<Summary>)> {
        let mut file = begun(path, TRACKS_HEADER)?;
        let around = neighbours(self.recording);
        let mut summaries = vec![Summary::default(); self.recording.tracks.len()];
        let mut line = CsvLine::new(self.info.precision);
        for ((track, around), summary) in self.recording.tracks.iter().zip(&around).zip(&mut summaries) {
            for (sample, around) in around.iter().enumerate() {
                let headways = self.headways(track, sample, around);
                if around.preceding != NOBODY {
                    summary.add(&headways);
                }
                self.track_line(&mut line, track, sample, around, &headways);
                file.append(line.end())?;
            }
        }
        Ok((file.stage()?, summaries))
    }

    fn track_line(&self, line: &mut CsvLine, track: &Track, sample: usize, around: &Around, headways: &Headways) {
        let direction = self.direction(track);
        let (s_m, d_m) = (track.s_m[sample], track.d_m[sample]);
        line.integer(track.first_frame + sample as i64);
        line.integer(i64::from(track.id));
        // The box belongs to the image: its width is the vehicle's length, rounded as a reader sees it.
        let length_m = self.info.precision.rounded(track.length_m);
        let width_m = self.info.precision.rounded(track.width_m);
        line.measured(direction.x_of(s_m, length_m));
        line.measured(direction.y_of(d_m, width_m));
        line.measured(track.length_m);
        line.measured(track.width_m);
        line.measured(direction.forward(track.v_s_mps[sample]));
        line.measured(direction.leftward(track.v_d_mps[sample]));
        line.measured(direction.forward(track.a_s_mps2[sample]));
        line.computed(direction.leftward(self.leftward_acceleration(track, sample)));
        let (to_left, to_right) =
            (direction.forward(s_m) - self.extent.left, self.extent.right - direction.forward(s_m));
        let (front, back) = match direction {
            Direction::Upper => (to_left, to_right),
            Direction::Lower => (to_right, to_left),
        };
        line.computed(front);
        line.computed(back);
        line.computed(headways.dhw_m);
        line.computed(headways.thw_s.unwrap_or(0.0));
        line.computed(headways.ttc_s.unwrap_or(0.0));
        line.computed(direction.forward(headways.preceding_v_s_mps));
        let (left, right) = (around.left, around.right);
        for index in [around.preceding, around.following]
            .into_iter()
            .chain([left.preceding, left.alongside, left.following])
            .chain([right.preceding, right.alongside, right.following])
        {
            line.integer(self.recording.tracks.get(index as usize).map_or(0, |other| i64::from(other.id)));
        }
        line.integer(self.layout.lane_id(direction, track.lane[sample], d_m));
    }

    /// Slope of the lateral speed between the neighbouring samples, m/s².
    fn leftward_acceleration(&self, track: &Track, sample: usize) -> f64 {
        let (from, to) = (sample.saturating_sub(1), (sample + 1).min(track.len() - 1));
        if from == to {
            return 0.0;
        }
        (track.v_d_mps[to] - track.v_d_mps[from]) * self.recording.frame_rate_hz / (to - from) as f64
    }

    fn headways(&self, track: &Track, sample: usize, around: &Around) -> Headways {
        let Some(ahead) = self.recording.tracks.get(around.preceding as usize) else { return Headways::default() };
        let Some(ahead_sample) = ahead.index_of(track.first_frame + sample as i64) else { return Headways::default() };
        let (speed, ahead_speed) = (track.v_s_mps[sample], ahead.v_s_mps[ahead_sample]);
        let between_centres_m = ahead.s_m[ahead_sample] - track.s_m[sample];
        let dhw_m = (between_centres_m - 0.5 * (ahead.length_m + track.length_m)).max(0.0);
        let closing = speed - ahead_speed;
        let over = |speed: f64| (speed.abs() > STANDSTILL_MPS).then(|| dhw_m / speed);
        let (thw_s, ttc_s) = (over(speed.abs()), over(closing));
        Headways { dhw_m, thw_s, ttc_s, preceding_v_s_mps: ahead_speed }
    }

    fn tracks_meta(&self, path: &Path, summaries: &[Summary]) -> Result<StagedFile> {
        let mut file = begun(path, TRACKS_META_HEADER)?;
        let mut line = CsvLine::new(self.info.precision);
        for (track, summary) in self.recording.tracks.iter().zip(summaries) {
            line.integer(i64::from(track.id));
            line.measured(track.length_m);
            line.measured(track.width_m);
            line.integer(track.first_frame);
            line.integer(track.last_frame());
            line.integer(track.len() as i64);
            line.text(match track.class {
                VehicleClass::Car => "Car",
                VehicleClass::Truck => "Truck",
            });
            line.text(self.direction(track).name());
            line.computed(driven_m(track));
            let speeds = || track.v_s_mps.iter().map(|speed| speed.abs());
            line.computed(speeds().fold(f64::INFINITY, f64::min));
            line.computed(speeds().fold(0.0, f64::max));
            line.computed(speeds().sum::<f64>() / track.len() as f64);
            for min in [summary.min_dhw_m, summary.min_thw_s, summary.min_ttc_s] {
                line.computed(min.unwrap_or(-1.0));
            }
            line.integer(track.lane.array_windows().filter(|[before, after]| before != after).count() as i64);
            file.append(line.end())?;
        }
        file.stage()
    }

    fn recording_meta(&self, path: &Path, summaries: &[Summary]) -> Result<StagedFile> {
        let Recording { id, frame_rate_hz, tracks, .. } = self.recording;
        let frames = |first: i64, last: i64| (last - first + 1) as f64 / frame_rate_hz;
        let first = tracks.iter().map(|track| track.first_frame).min().unwrap_or(0);
        let last = tracks.iter().map(Track::last_frame).max().unwrap_or(0);
        let trucks = tracks.iter().filter(|track| track.class == VehicleClass::Truck).count();
        let mut line = CsvLine::new(self.info.precision);
        // The format's id is a number; the file name identifies the recording.
        line.integer(id.parse::<u32>().map_or(1, i64::from));
        line.text(&frame_rate_hz.to_string());
        line.integer(i64::from(self.info.location_id));
        line.computed(self.info.speed_limit_mps.unwrap_or(-1.0));
        line.text(&self.info.month);
        line.text(&self.info.week_day);
        line.text(&self.info.start_time);
        line.computed(frames(first, last));
        line.computed(tracks.iter().map(driven_m).sum());
        line.computed(tracks.iter().map(|track| frames(track.first_frame, track.last_frame())).sum());
        line.integer(summaries.len() as i64);
        line.integer((tracks.len() - trucks) as i64);
        line.integer(trucks as i64);
        line.measured_list(&self.layout.upper_y);
        line.measured_list(&self.layout.lower_y);
        let mut header = RECORDING_META_HEADER.trim_end_matches(",synthetic");
        if self.recording.synthetic {
            header = RECORDING_META_HEADER;
            line.text("1");
        }
        let mut file = begun(path, header)?;
        file.append(line.end())?;
        file.stage()
    }
}

/// Minimum speed of a time headway, m/s.
const STANDSTILL_MPS: f64 = 1e-3;

/// A file with its header.
fn begun(path: &Path, header: &str) -> Result<AtomicFile> {
    let mut file = AtomicFile::create_inside(path)?;
    file.append(format!("{header}\n").as_bytes())?;
    Ok(file)
}

fn driven_m(track: &Track) -> f64 {
    track.s_m.last().zip(track.s_m.first()).map_or(0.0, |(last, first)| (last - first).abs())
}

/// One line of a file, written field by field into a reused buffer.
struct CsvLine {
    bytes: Vec<u8>,
    precision: Precision,
    ended: bool,
}

impl CsvLine {
    fn new(precision: Precision) -> Self {
        CsvLine { bytes: Vec::with_capacity(256), precision, ended: true }
    }

    /// The buffer at the next field.
    fn field(&mut self) -> &mut Vec<u8> {
        if self.ended {
            self.bytes.clear();
            self.ended = false;
        } else {
            self.bytes.push(b',');
        }
        &mut self.bytes
    }

    /// A value that is read back.
    fn measured(&mut self, value: f64) {
        let precision = self.precision;
        precision.push(self.field(), value);
    }

    /// Several values that are read back, in one field.
    fn measured_list(&mut self, values: &[f64]) {
        let precision = self.precision;
        let field = self.field();
        for (at, &value) in values.iter().enumerate() {
            if at > 0 {
                field.push(b';');
            }
            precision.push(field, value);
        }
    }

    /// A value that is not read back.
    fn computed(&mut self, value: f64) {
        Precision::Hundredths.push(self.field(), value);
    }

    fn integer(&mut self, value: i64) {
        let field = self.field();
        if value < 0 {
            field.push(b'-');
        }
        push_integer(field, value.unsigned_abs());
    }

    fn text(&mut self, text: &str) {
        self.field().extend_from_slice(text.as_bytes());
    }

    /// The complete line.
    fn end(&mut self) -> &[u8] {
        self.ended = true;
        self.bytes.push(b'\n');
        &self.bytes
    }
}
