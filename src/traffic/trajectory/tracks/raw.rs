//! What a track file says: vehicles with samples in SI units and right-handed axes, before any road is known.

use std::borrow::Cow;
use std::collections::HashMap;

use super::TrackFile;
use super::apart::apart;
use super::preset::{Axes, HeadingOrigin, MetaFile, Preset};
use super::roles::{ColumnName, Role};
use super::rows::{Columns, Rows, SampleRow};
use super::samples::{
    AT, CLASS, DIRECTION, HEADING_X, HEADING_Y, LANE, LANE_OFFSET, LENGTH, OTHER_CLOCK, SPEED, Samples, UNKNOWN, WIDTH,
    X, Y, Y_ACCELERATION, Y_SPEED, number,
};
use super::times::TIME_OF_DAY;
use crate::trajectory::csv_table::FileChecksum;
use lanesweep_support::input_file::packed_or_not;
use lanesweep_support::plain_text::nearest;
use lanesweep_support::{Error, Place, Result};

/// Maximum number of names of lanes, and of classes, of a recording; more are none.
const MAX_NAMES: usize = 65_536;
/// Maximum numbers of lines that spreadsheets hold; they cut longer files.
const SPREADSHEET_LINES: [u64; 2] = [65_536, 1_048_576];
/// Times of day that fall by more begin again at midnight, s.
const HALF_A_DAY_S: f64 = 43_200.0;

/// One vehicle.
#[derive(Debug, Clone, Default)]
pub(super) struct RawVehicle {
    /// Its id in the file.
    pub key: String,
    pub samples: Samples,
}

/// One recording.
#[derive(Debug, Clone, Default)]
pub(super) struct RawRecording {
    pub id: String,
    pub vehicles: Vec<RawVehicle>,
    /// Names of lanes.
    pub lanes: Vec<String>,
    /// Names of classes.
    pub classes: Vec<String>,
    /// Whether times are frames.
    pub has_frames: bool,
    pub frame_rate_hz: Option<f64>,
    /// Samples without a position.
    pub incomplete: u64,
    pub synthetic: bool,
    /// What was assumed of it.
    pub notes: Vec<String>,
    /// What the columns of its file are taken for.
    pub columns: String,
    /// Its file and the meta files.
    pub checksums: Vec<FileChecksum>,
}

/// Reads a table of samples with its meta files.
///
/// # Errors
/// Those of the files, with the place of a bad value.
pub(super) fn read_table(file: &TrackFile, preset: &Preset) -> Result<Vec<RawRecording>> {
    let rows = Rows::open(&file.path)?;
    let columns = Columns::of(&preset.columns, &rows.header, &preset.none);
    check_columns(&rows, &columns, preset)?;
    // Times tell the rate too.
    let has_frames = columns.has(Role::Frame)
        && (preset.frame_rate_hz.is_some() || preset.recording.is_some() || !columns.has(Role::Time));
    let mut collecting = Collecting { axes: preset.axes, id: file.id.clone(), has_frames, ..Collecting::default() };
    let mut lines = 1;
    let checksum = rows.each(&columns, |row| {
        lines += 1;
        collecting.add(row)
    })?;
    let mut recordings = collecting.recordings;
    if let Some(last) = recordings.last_mut().filter(|_| SPREADSHEET_LINES.contains(&lines)) {
        last.notes.push(format!(
            "the file has {lines} lines, as many as a spreadsheet can hold: rows may be missing at its end; export it without one"
        ));
    }
    recordings.retain(|recording| !recording.vehicles.is_empty());
    recordings.iter_mut().flat_map(|of| &mut of.vehicles).for_each(|vehicle| vehicle.samples.shrink());
    let mut checksums = vec![checksum];
    checksums.extend(add_frame_rate(file, preset, &mut recordings)?);
    let mut recordings = apart(recordings, preset);
    checksums.extend(add_vehicle_facts(file, preset, &mut recordings)?);
    for recording in &mut recordings {
        (recording.columns, recording.checksums) = (columns.describe(), checksums.clone());
    }
    Ok(recordings)
}

fn check_columns(rows: &Rows, columns: &Columns, preset: &Preset) -> Result<()> {
    let is_needed = |role: Role, column: &ColumnName| match role {
        Role::Vehicle | Role::X | Role::Y => true,
        Role::Frame => !columns.has(Role::Time),
        Role::Time => !columns.has(Role::Frame),
        Role::Length | Role::Width if preset.sizes_from.is_some() => true,
        // The names of a shipped preset may be absent in older files, and of several names the user knows that too.
        _ => preset.is_own && column.names.len() == 1,
    };
    let missing = preset.columns.iter().find(|(role, column)| !columns.has(**role) && is_needed(**role, column));
    let Some((role, column)) = missing else { return Ok(()) };
    let near = column.names.first().and_then(|name| nearest(name, rows.header.iter().map(String::as_str), 0.6));
    let near = near.filter(|_| preset.sizes_from.is_none());
    let near = near.map_or(String::new(), |near| format!("; did you mean `{near}`?"));
    let (name, key, names) = (&preset.name, role.key(), column.names.join("` or `"));
    let problem = format!("preset {name} takes `{key}` from the column `{names}`, which is not there{near}");
    let help = match &preset.sizes_from {
        Some(code) => format!("make a table with it in Python: {code}"),
        None => "correct the name in the preset, or remove the line; or use another preset".to_owned(),
    };
    Err(Error::input(rows.header_place(), problem, help))
}

/// Numbers that a sample takes from its row as they are, in the order of its columns from [`SPEED`] on.
#[rustfmt::skip]
const NUMBERS: [Role; 8] = [
    Role::Speed, Role::XSpeed, Role::YSpeed, Role::ForwardSpeed, Role::LeftwardSpeed, Role::Acceleration, Role::XAcceleration,
    Role::YAcceleration,
];

#[derive(Default)]
struct Collecting {
    axes: Axes,
    /// Name of the file's recording, before names in it.
    id: String,
    /// Times are frames.
    has_frames: bool,
    recordings: Vec<RawRecording>,
    /// By the name of the recording in the file.
    of_name: HashMap<String, usize>,
    /// By recording and id in the file.
    vehicles: Vec<HashMap<String, usize>>,
    /// Numbers of the names of lanes and classes, by recording.
    names: HashMap<(usize, Role, String), usize>,
}

impl Collecting {
    fn add(&mut self, row: &SampleRow) -> Result<()> {
        let missing = |role: Role| Error::input(row.place(role), "there is no value", "fill it in, or remove the row");
        let recording = self.recording(row);
        let vehicle = match row.text(Role::Vehicle) {
            Some(key) => self.vehicle(recording, &key),
            // Tables of time steps have a row for a step without vehicles.
            None if row.number(Role::X)?.is_none() && row.number(Role::Y)?.is_none() => return Ok(()),
            None => return Err(missing(Role::Vehicle)),
        };
        let [clock, other_clock] = if self.has_frames { [Role::Frame, Role::Time] } else { [Role::Time, Role::Frame] };
        let y_sign = self.axes.y_sign();
        let number = |role| row.number(role).map(|value| value.unwrap_or(f64::NAN));
        let mut sample = UNKNOWN;
        sample[AT] = row.number(clock)?.ok_or_else(|| missing(clock))?;
        (sample[X], sample[Y]) = (number(Role::X)?, y_sign * number(Role::Y)?);
        if sample[X].is_nan() || sample[Y].is_nan() {
            self.recordings[recording].incomplete += 1;
            return Ok(());
        }
        if let Some(angle) = row.number(Role::Heading)? {
            let (sin, cos) = (libm::sin(angle), libm::cos(angle));
            (sample[HEADING_X], sample[HEADING_Y]) = match self.axes.heading {
                HeadingOrigin::FromX => (cos, y_sign * sin),
                HeadingOrigin::FromNorth => (sin, y_sign * cos),
            };
        }
        for (column, role) in (SPEED..).zip(NUMBERS) {
            sample[column] = number(role)?;
        }
        sample[LANE_OFFSET] = number(Role::LaneOffset)?;
        sample[Y_SPEED] *= y_sign;
        sample[Y_ACCELERATION] *= y_sign;
        // Only numbers of the file are compared with one another: a text counts as no value.
        sample[OTHER_CLOCK] = row.number(other_clock).ok().flatten().unwrap_or(f64::NAN);
        for (column, role) in [(LENGTH, Role::Length), (WIDTH, Role::Width)] {
            sample[column] = row.number(role)?.filter(|size| *size > 0.0).unwrap_or(f64::NAN);
        }
        sample[LANE] = self.name(row, Role::Lane, LANE, (recording, vehicle));
        sample[CLASS] = self.name(row, Role::Class, CLASS, (recording, vehicle));
        sample[DIRECTION] = number(Role::Direction)?;
        let of = &mut self.recordings[recording].vehicles[vehicle];
        if row.columns.found_time() == Some(TIME_OF_DAY)
            && of.samples.len().checked_sub(1).is_some_and(|last| of.samples.of(AT, last) - sample[AT] > HALF_A_DAY_S)
        {
            let problem = "the times of day of this vehicle begin again: the recording goes past midnight";
            let help = "write dates (2024-10-07 00:00:00.05), or seconds";
            return Err(Error::input(row.place(clock).of(format!("vehicle {}", of.key)), problem, help));
        }
        of.samples.push(&sample);
        Ok(())
    }

    fn recording(&mut self, row: &SampleRow) -> usize {
        let name = row.text(Role::Recording).unwrap_or_default();
        if let Some(&at) = self.of_name.get(name.as_ref()) {
            return at;
        }
        let id = if name.is_empty() { self.id.clone() } else { format!("{}-{name}", self.id) };
        let id = id.replace(['/', '\\', ' '], "-");
        self.recordings.push(RawRecording { id, has_frames: self.has_frames, ..RawRecording::default() });
        self.vehicles.push(HashMap::new());
        self.of_name.insert(name.into_owned(), self.recordings.len() - 1);
        self.recordings.len() - 1
    }

    fn vehicle(&mut self, recording: usize, key: &str) -> usize {
        if let Some(&at) = self.vehicles[recording].get(key) {
            return at;
        }
        let of = &mut self.recordings[recording].vehicles;
        of.push(RawVehicle { key: key.to_owned(), ..RawVehicle::default() });
        self.vehicles[recording].insert(key.to_owned(), of.len() - 1);
        of.len() - 1
    }

    /// The number of the name of a lane or class, often that of the vehicle's last row.
    fn name(&mut self, row: &SampleRow, role: Role, column: usize, (recording, vehicle): (usize, usize)) -> f64 {
        let of = &mut self.recordings[recording];
        let list = if role == Role::Lane { &mut of.lanes } else { &mut of.classes };
        let samples = &of.vehicles[vehicle].samples;
        let last = samples.len().checked_sub(1).map_or(f64::NAN, |last| samples.of(column, last));
        if number(last).is_some_and(|last| row.is_text(role, &list[last as usize])) {
            return last;
        }
        let Some(text) = row.text(role) else { return f64::NAN };
        let at = *self.names.entry((recording, role, text.into_owned())).or_insert_with_key(|(.., text)| {
            if list.len() < MAX_NAMES {
                list.push(text.clone());
                return list.len() - 1;
            }
            MAX_NAMES
        });
        if at < MAX_NAMES { at as f64 } else { f64::NAN }
    }
}

/// Gives the rows of a meta file beside a track file to `each`. Returns its checksum.
fn read_meta(
    file: &TrackFile,
    meta: &MetaFile,
    preset: &Preset,
    each: impl FnMut(&SampleRow) -> Result<()>,
) -> Result<FileChecksum> {
    let beside = packed_or_not(file.path.with_file_name(meta.file.replace('*', &file.id)));
    if !beside.exists() {
        let problem = format!("preset {} names this file, which is not there", preset.name);
        return Err(Error::input(Place::file(&beside), problem, "add it, or use a preset without it"));
    }
    let rows = Rows::open(&beside)?;
    let columns = Columns::of(&meta.columns, &rows.header, &preset.none);
    rows.each(&columns, each)
}

/// Adds classes, sizes and directions of the vehicles from their own file.
fn add_vehicle_facts(
    file: &TrackFile,
    preset: &Preset,
    recordings: &mut [RawRecording],
) -> Result<Option<FileChecksum>> {
    let Some(meta) = &preset.vehicles else { return Ok(None) };
    type Facts = (Option<String>, [(usize, Option<f64>); 3]);
    let mut facts: HashMap<String, Facts> = HashMap::new();
    let checksum = read_meta(file, meta, preset, |row| {
        let Some(key) = row.text(Role::Vehicle) else { return Ok(()) };
        let [length, width] =
            [row.number(Role::Length)?, row.number(Role::Width)?].map(|size| size.filter(|size| *size > 0.0));
        let numbers = [(LENGTH, length), (WIDTH, width), (DIRECTION, row.number(Role::Direction)?)];
        facts.insert(key.into_owned(), (row.text(Role::Class).map(Cow::into_owned), numbers));
        Ok(())
    })?;
    // Programs write `00001`, `1` and `1.0` for one number.
    let number = |key: &str| key.parse::<f64>().ok().filter(|number| number.fract() == 0.0).map(f64::to_bits);
    let by_number: HashMap<u64, &Facts> = facts.iter().filter_map(|(key, of)| Some((number(key)?, of))).collect();
    for recording in recordings {
        let mut unknown: Vec<&str> = Vec::new();
        let places = recording.classes.iter().cloned().enumerate().map(|(at, class)| (class, at));
        let mut places: HashMap<String, usize> = places.collect();
        for RawVehicle { key, samples } in &mut recording.vehicles {
            let known = facts.get(key).or_else(|| by_number.get(&number(key)?).copied());
            let Some((class, numbers)) = known else {
                unknown.push(key);
                continue;
            };
            let classes = &mut recording.classes;
            let class = class.as_ref().map(|class| {
                let at = *places.entry(class.clone()).or_insert_with(|| {
                    classes.push(class.clone());
                    classes.len() - 1
                });
                at as f64
            });
            for (column, value) in numbers.iter().copied().chain([(CLASS, class)]) {
                value.into_iter().for_each(|value| samples.fill(column, value));
            }
        }
        if let Some(first) = unknown.first() {
            let number = unknown.len();
            recording
                .notes
                .push(format!("{number} vehicles have no row in {}, the first is vehicle {first}", checksum.file));
        }
    }
    Ok(Some(checksum))
}

/// Adds the frame rate from the file about the recording.
fn add_frame_rate(file: &TrackFile, preset: &Preset, recordings: &mut [RawRecording]) -> Result<Option<FileChecksum>> {
    let Some(meta) = &preset.recording else { return Ok(None) };
    let mut rate = None;
    let checksum = read_meta(file, meta, preset, |row| {
        let Some(found) = row.number(Role::FrameRate)? else { return Ok(()) };
        if !(0.1..=1e4).contains(&found) {
            let problem = format!("{found} is not a frame rate");
            return Err(Error::input(row.place(Role::FrameRate), problem, "give the number of frames per second"));
        }
        rate = Some(found);
        Ok(())
    })?;
    recordings.iter_mut().for_each(|recording| recording.frame_rate_hz = rate);
    Ok(Some(checksum))
}
