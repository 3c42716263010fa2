//! Writes a recording as the three highD files with every column of the format. Neighbours, headways and sight
//! distances are computed; what a recording does not tell has a constant value.

use std::fs;
use std::path::Path;

use super::format::{RECORDING_META_HEADER, TRACKS_HEADER, TRACKS_META_HEADER};
use super::frame::Direction;
use super::inventory::HighdFiles;
use super::neighbours::{Around, neighbours};
use super::writable::ImageLayout;
use crate::trajectory::number::{push_hundredths, push_integer, rounded};
use crate::trajectory::tracks::central;
use crate::trajectory::{Recording, Track, VehicleClass};
use lanesweep_support::atomic_file::{AtomicFile, StagedFile};
use lanesweep_support::{Error, Result};

/// Writes a recording into `dir` (made if it is not there) as `NN_tracks.csv`, `NN_tracksMeta.csv` and
/// `NN_recordingMeta.csv` with NN the recording's id, in place of files of these names.
///
/// [`read`](super::read) returns the recording rounded to hundredths, and bit for bit after
/// [`quantize`](super::quantize). All three files are complete before the first gets its name.
///
/// `dhw` is the gap from bumper to bumper (never negative), `thw` = dhw / speed, `ttc` = dhw / closing
/// speed (negative where the gap opens); all 0 without a preceding vehicle.
///
/// # Errors
/// If the format cannot hold the recording (carriageways other than `1` and `2`, unsorted vehicles, values
/// that are not finite, …) or the system refuses to write.
pub fn write(dir: &Path, recording: &Recording) -> Result<()> {
    let staged = stage(dir, recording)?;
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
pub fn stage(dir: &Path, recording: &Recording) -> Result<[StagedFile; 3]> {
    let layout = ImageLayout::of(recording)?;
    fs::create_dir_all(dir).map_err(|source| Error::io(dir, "create the folder", source))?;
    let files = HighdFiles::named(dir, &recording.id);
    let mut extent_m = (f64::INFINITY, f64::NEG_INFINITY);
    for track in &recording.tracks {
        for centre_m in track.s_m.iter().map(|s_m| layout.directions[track.carriageway].forward(*s_m)) {
            let half_m = 0.5 * track.length_m;
            extent_m = (extent_m.0.min(centre_m - half_m), extent_m.1.max(centre_m + half_m));
        }
    }
    let writer = Writer { recording, layout, extent_m };
    let (tracks, minima) = writer.tracks(&files.tracks)?;
    let tracks_meta = writer.tracks_meta(&files.tracks_meta, &minima)?;
    let recording_meta = writer.recording_meta(&files.recording_meta)?;
    Ok([recording_meta, tracks_meta, tracks])
}

struct Writer<'a> {
    recording: &'a Recording,
    layout: ImageLayout,
    /// Left and right end of the image that the boxes of all vehicles cover, m.
    extent_m: (f64, f64),
}

/// Gap to the vehicle ahead, m, time headway, s, time to collision, s, and that vehicle's speed, m/s. Infinite at a standstill or
/// at equal speeds; `None` without a vehicle ahead.
type Headways = Option<[f64; 4]>;

/// Minimum dhw, thw and positive ttc of one vehicle; infinite if it never follows another.
type Minima = [f64; 3];

impl Writer<'_> {
    fn direction(&self, track: &Track) -> Direction {
        self.layout.directions[track.carriageway]
    }

    fn tracks(&self, path: &Path) -> Result<(StagedFile, Vec<Minima>)> {
        let mut file = begun(path, TRACKS_HEADER)?;
        let around = neighbours(self.recording);
        let mut all_minima = vec![[f64::INFINITY; 3]; self.recording.tracks.len()];
        let mut line = CsvLine::default();
        for ((track, around), minima) in self.recording.tracks.iter().zip(&around).zip(&mut all_minima) {
            let leftward_mps2 = central(&track.v_d_mps, self.recording.frame_rate_hz);
            for (sample, (around, leftward_mps2)) in around.iter().zip(leftward_mps2).enumerate() {
                let headways = self.headways(track, sample, around);
                if let Some([dhw_m, thw_s, ttc_s, _]) = headways {
                    let found = [dhw_m, thw_s, if ttc_s > 0.0 { ttc_s } else { f64::INFINITY }];
                    minima.iter_mut().zip(found).for_each(|(min, value)| *min = min.min(value));
                }
                self.track_line(&mut line, (track, sample), around, headways, leftward_mps2);
                line.end(&mut file)?;
            }
        }
        Ok((file.stage()?, all_minima))
    }

    fn track_line(
        &self,
        line: &mut CsvLine,
        (track, sample): (&Track, usize),
        around: &Around,
        headways: Headways,
        leftward_mps2: f64,
    ) {
        let direction = self.direction(track);
        let (s_m, d_m) = (track.s_m[sample], track.d_m[sample]);
        line.integer(track.first_frame + sample as i64);
        line.integer(i64::from(track.id));
        // The box belongs to the image: its width is the vehicle's length, rounded as a reader sees it.
        line.number(direction.x_of(s_m, rounded(track.length_m)));
        line.number(direction.y_of(d_m, rounded(track.width_m)));
        line.number(track.length_m);
        line.number(track.width_m);
        line.number(direction.forward(track.v_s_mps[sample]));
        line.number(direction.leftward(track.v_d_mps[sample]));
        line.number(direction.forward(track.a_s_mps2[sample]));
        line.number(direction.leftward(leftward_mps2));
        let (to_left, to_right) = (direction.forward(s_m) - self.extent_m.0, self.extent_m.1 - direction.forward(s_m));
        let (front, back) = match direction {
            Direction::Upper => (to_left, to_right),
            Direction::Lower => (to_right, to_left),
        };
        line.number(front);
        line.number(back);
        // What is undefined is 0, as in highD without a preceding vehicle.
        let [dhw_m, thw_s, ttc_s, ahead_mps] = headways.unwrap_or_default();
        let defined = |value: f64| if value.is_finite() { value } else { 0.0 };
        for value in [dhw_m, defined(thw_s), defined(ttc_s), direction.forward(ahead_mps)] {
            line.number(value);
        }
        for index in around {
            line.integer(self.recording.tracks.get(*index as usize).map_or(0, |other| i64::from(other.id)));
        }
        line.integer(self.layout.lane_id(direction, track.lane[sample], d_m));
    }

    fn headways(&self, track: &Track, sample: usize, around: &Around) -> Headways {
        let ahead = self.recording.tracks.get(around[0] as usize)?;
        let ahead_sample = ahead.index_of(track.first_frame + sample as i64)?;
        let (speed, ahead_speed) = (track.v_s_mps[sample], ahead.v_s_mps[ahead_sample]);
        let between_centres_m = ahead.s_m[ahead_sample] - track.s_m[sample];
        let dhw_m = (between_centres_m - 0.5 * (ahead.length_m + track.length_m)).max(0.0);
        let over = |speed: f64| if speed.abs() > STANDSTILL_MPS { dhw_m / speed } else { f64::INFINITY };
        Some([dhw_m, over(speed.abs()), over(speed - ahead_speed), ahead_speed])
    }

    fn tracks_meta(&self, path: &Path, minima: &[Minima]) -> Result<StagedFile> {
        let mut file = begun(path, TRACKS_META_HEADER)?;
        let mut line = CsvLine::default();
        for (track, minima) in self.recording.tracks.iter().zip(minima) {
            line.integer(i64::from(track.id));
            line.number(track.length_m);
            line.number(track.width_m);
            line.integer(track.first_frame);
            line.integer(track.last_frame());
            line.integer(track.len() as i64);
            line.text(match track.class {
                VehicleClass::Car => "Car",
                VehicleClass::Truck => "Truck",
            });
            line.text(self.direction(track).name());
            line.number(driven_m(track));
            let speeds = || track.v_s_mps.iter().map(|speed| speed.abs());
            line.number(speeds().fold(f64::INFINITY, f64::min));
            line.number(speeds().fold(0.0, f64::max));
            line.number(speeds().sum::<f64>() / track.len() as f64);
            minima.iter().for_each(|min| line.number(if min.is_finite() { *min } else { -1.0 }));
            line.integer(track.lane.array_windows().filter(|[before, after]| before != after).count() as i64);
            line.end(&mut file)?;
        }
        file.stage()
    }

    fn recording_meta(&self, path: &Path) -> Result<StagedFile> {
        let Recording { id, frame_rate_hz, tracks, .. } = self.recording;
        let frames = |first: i64, last: i64| (last - first + 1) as f64 / frame_rate_hz;
        let first = tracks.iter().map(|track| track.first_frame).min().unwrap_or(0);
        let last = tracks.iter().map(Track::last_frame).max().unwrap_or(0);
        let trucks = tracks.iter().filter(|track| track.class == VehicleClass::Truck).count();
        let mut line = CsvLine::default();
        // The format's id is a number; the file name identifies the recording.
        line.integer(id.parse::<u32>().map_or(1, i64::from));
        line.text(&frame_rate_hz.to_string());
        // The location, and no speed limit.
        line.integer(1);
        line.number(-1.0);
        // Month, day of the week, and time of day.
        ["1.2024", "Mon", "00:00"].into_iter().for_each(|text| line.text(text));
        line.number(frames(first, last));
        line.number(tracks.iter().map(driven_m).sum());
        line.number(tracks.iter().map(|track| frames(track.first_frame, track.last_frame())).sum());
        line.integer(tracks.len() as i64);
        line.integer((tracks.len() - trucks) as i64);
        line.integer(trucks as i64);
        self.layout.lines_y.iter().for_each(|lines| line.list(lines));
        let mut header = RECORDING_META_HEADER.trim_end_matches(",synthetic");
        if self.recording.synthetic {
            header = RECORDING_META_HEADER;
            line.text("1");
        }
        let mut file = begun(path, header)?;
        line.end(&mut file)?;
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
#[derive(Default)]
struct CsvLine(Vec<u8>);

impl CsvLine {
    /// The buffer at the next field.
    fn field(&mut self) -> &mut Vec<u8> {
        if !self.0.is_empty() {
            self.0.push(b',');
        }
        &mut self.0
    }

    fn number(&mut self, value: f64) {
        push_hundredths(self.field(), value);
    }

    /// Several numbers in one field.
    fn list(&mut self, values: &[f64]) {
        let field = self.field();
        for &value in values {
            push_hundredths(field, value);
            field.push(b';');
        }
        field.pop_if(|last| *last == b';');
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

    /// Appends the complete line to a file, and begins the next one.
    fn end(&mut self, file: &mut AtomicFile) -> Result<()> {
        self.0.push(b'\n');
        file.append(&self.0)?;
        self.0.clear();
        Ok(())
    }
}
