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
use crate::trajectory::tracks::{central, range};
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
    let extent_m = range(recording.tracks.iter().flat_map(|track| {
        let (direction, half_m) = (layout.directions[track.carriageway], 0.5 * track.length_m);
        track.s_m.iter().map(move |s_m| direction.forward(*s_m)).flat_map(move |at_m| [at_m - half_m, at_m + half_m])
    }));
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
        line.integers([track.first_frame + sample as i64, i64::from(track.id)]);
        let (to_left, to_right) = (direction.forward(s_m) - self.extent_m.0, self.extent_m.1 - direction.forward(s_m));
        let (front, back) = match direction {
            Direction::Upper => (to_left, to_right),
            Direction::Lower => (to_right, to_left),
        };
        // What is undefined is 0, as in highD without a preceding vehicle.
        let [dhw_m, thw_s, ttc_s, ahead_mps] = headways.unwrap_or_default();
        let defined = |value: f64| if value.is_finite() { value } else { 0.0 };
        line.numbers([
            // The box belongs to the image: its width is the vehicle's length, rounded as a reader sees it.
            direction.x_of(s_m, rounded(track.length_m)),
            direction.y_of(d_m, rounded(track.width_m)),
            track.length_m,
            track.width_m,
            direction.forward(track.v_s_mps[sample]),
            direction.leftward(track.v_d_mps[sample]),
            direction.forward(track.a_s_mps2[sample]),
            direction.leftward(leftward_mps2),
            front,
            back,
            dhw_m,
            defined(thw_s),
            defined(ttc_s),
            direction.forward(ahead_mps),
        ]);
        let id = |index: u32| self.recording.tracks.get(index as usize).map_or(0, |other| i64::from(other.id));
        line.integers(around.map(id));
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
            line.numbers([track.length_m, track.width_m]);
            line.integers([track.first_frame, track.last_frame(), track.len() as i64]);
            line.text(match track.class {
                VehicleClass::Car => "Car",
                VehicleClass::Truck => "Truck",
            });
            line.text(self.direction(track).name());
            let (slowest_mps, fastest_mps) = range(track.v_s_mps.iter().map(|speed| speed.abs()));
            let mean_mps = track.v_s_mps.iter().map(|speed| speed.abs()).sum::<f64>() / track.len() as f64;
            line.numbers([driven_m(track), slowest_mps, fastest_mps, mean_mps]);
            line.numbers(minima.map(|min| if min.is_finite() { min } else { -1.0 }));
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
        line.numbers([-1.0]);
        // Month, day of the week, and time of day.
        ["1.2024", "Mon", "00:00"].into_iter().for_each(|text| line.text(text));
        let driven_s = tracks.iter().map(|track| frames(track.first_frame, track.last_frame())).sum();
        line.numbers([frames(first, last), tracks.iter().map(driven_m).sum(), driven_s]);
        line.integers([tracks.len(), tracks.len() - trucks, trucks].map(|count| count as i64));
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

    fn numbers<const N: usize>(&mut self, values: [f64; N]) {
        values.into_iter().for_each(|value| push_hundredths(self.field(), value));
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

    fn integers<const N: usize>(&mut self, values: [i64; N]) {
        values.into_iter().for_each(|value| self.integer(value));
    }

    fn integer(&mut self, value: i64) {
        push_integer(self.field(), value);
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
