//! What a track file says: vehicles with samples in SI units and right-handed axes, before any road is known.

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
    pub class: Option<String>,
    /// The lengths and widths that it has, m; each change is one more.
    pub sizes_m: [Vec<f64>; 2],
    /// Sign of the travel along the road.
    pub direction: Option<f64>,
    pub samples: Samples,
}

impl RawVehicle {
    /// A vehicle with the sizes, and the class and direction of its first row.
    fn of_rows(key: String, samples: Samples, classes: &[String]) -> RawVehicle {
        let class = class_of_first(&samples, classes).cloned();
        let direction = Some(samples.of(DIRECTION, 0)).filter(|sign| !sign.is_nan());
        let sizes_m = [LENGTH, WIDTH].map(|column| samples.changes(column));
        RawVehicle { key, class, sizes_m, direction, samples }
    }

    /// Lengths and widths of some of its samples, m; all of them if these have none in their rows.
    pub(super) fn sizes_m(&self, samples: &Samples) -> [Vec<f64>; 2] {
        std::array::from_fn(|at| {
            let all = &self.sizes_m[at];
            let own = if all.len() > 1 { samples.changes([LENGTH, WIDTH][at]) } else { Vec::new() };
            if own.is_empty() { all.clone() } else { own }
        })
    }

    /// Class of some of its samples: that of the first.
    pub(super) fn class_of<'a>(&'a self, samples: &Samples, classes: &'a [String]) -> &'a str {
        class_of_first(samples, classes).or(self.class.as_ref()).map_or("", String::as_str)
    }

    /// Some of its samples as a vehicle of their own.
    pub(super) fn part(&self, samples: Samples, classes: &[String]) -> RawVehicle {
        let sizes_m = self.sizes_m(&samples);
        RawVehicle { sizes_m, ..RawVehicle::of_rows(self.key.clone(), samples, classes) }
    }
}

fn class_of_first<'a>(samples: &Samples, classes: &'a [String]) -> Option<&'a String> {
    classes.get(number(samples.of(CLASS, 0))? as usize)
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
}

/// A file, and its meta files.
pub(super) struct FileFacts {
    pub checksums: Vec<FileChecksum>,
    /// Roles that the file has, with their columns.
    pub roles: Vec<(Role, String)>,
    /// Columns without a role.
    pub unused: Vec<String>,
}

/// Reads a table of samples with its meta files.
///
/// # Errors
/// Those of the files, with the place of a bad value.
pub(super) fn read_table(file: &TrackFile, preset: &Preset) -> Result<(Vec<RawRecording>, FileFacts)> {
    let rows = Rows::open(&file.path)?;
    let columns = Columns::of(&preset.columns, rows.header(), &preset.none);
    check_columns(&rows, &columns, preset)?;
    let present = Role::ALL.into_iter().filter(|role| columns.has(*role));
    let mut roles: Vec<(Role, String)> = present.map(|role| (role, columns.name(role).to_owned())).collect();
    let is_used = |name: &&String| roles.iter().any(|(_, used)| used == *name);
    let unused = rows.header().iter().filter(|name| !is_used(name)).cloned().collect();
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
    if let Some(found) = columns.found_time() {
        roles.iter_mut().filter(|(role, _)| *role == Role::Time).for_each(|(_, name)| *name += &format!(" ({found})"));
    }
    for RawRecording { vehicles, classes, .. } in &mut recordings {
        for vehicle in vehicles {
            let RawVehicle { key, mut samples, .. } = std::mem::take(vehicle);
            samples.shrink();
            *vehicle = RawVehicle::of_rows(key, samples, classes);
        }
    }
    let mut checksums = vec![checksum];
    checksums.extend(add_frame_rate(file, preset, &mut recordings)?);
    let mut recordings = apart(recordings, preset);
    checksums.extend(add_vehicle_facts(file, preset, &mut recordings)?);
    Ok((recordings, FileFacts { checksums, roles, unused }))
}

fn check_columns(rows: &Rows, columns: &Columns, preset: &Preset) -> Result<()> {
    let is_needed = |role: Role, column: &ColumnName| match role {
        Role::Vehicle | Role::X | Role::Y => true,
        Role::Frame => !columns.has(Role::Time),
        Role::Time => !columns.has(Role::Frame),
        Role::Length | Role::Width if preset.sizes_from.is_some() => true,
        // The names of a shipped preset may be absent in older files, and of several names the user knows that too.
        _ => preset.is_own && column.names().len() == 1,
    };
    let missing = preset.columns.iter().find(|(role, column)| !columns.has(**role) && is_needed(**role, column));
    let Some((role, column)) = missing else { return Ok(()) };
    let near = column.names().first().and_then(|name| nearest(name, rows.header().iter().map(String::as_str), 0.6));
    let near = near.filter(|_| preset.sizes_from.is_none());
    let near = near.map_or(String::new(), |near| format!("; did you mean `{near}`?"));
    let (name, key, names) = (&preset.name, role.key(), column.names().join("` or `"));
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
    let columns = Columns::of(&meta.columns, rows.header(), &preset.none);
    rows.each(&columns, each)
}

/// Adds classes, sizes and directions of the vehicles from their own file.
fn add_vehicle_facts(
    file: &TrackFile,
    preset: &Preset,
    recordings: &mut [RawRecording],
) -> Result<Option<FileChecksum>> {
    let Some(meta) = &preset.vehicles else { return Ok(None) };
    let mut facts: HashMap<String, RawVehicle> = HashMap::new();
    let checksum = read_meta(file, meta, preset, |row| {
        let Some(key) = row.text(Role::Vehicle) else { return Ok(()) };
        let size = |role| Ok(row.number(role)?.filter(|size| *size > 0.0).into_iter().collect());
        let vehicle = RawVehicle {
            key: key.to_string(),
            class: row.text(Role::Class).map(|class| class.into_owned()),
            sizes_m: [size(Role::Length)?, size(Role::Width)?],
            direction: row.number(Role::Direction)?,
            ..RawVehicle::default()
        };
        facts.insert(vehicle.key.clone(), vehicle);
        Ok(())
    })?;
    // Programs write `00001`, `1` and `1.0` for one number.
    let number = |key: &str| key.parse::<f64>().ok().filter(|number| number.fract() == 0.0).map(f64::to_bits);
    let by_number: HashMap<u64, &RawVehicle> = facts.iter().filter_map(|(key, of)| Some((number(key)?, of))).collect();
    for recording in recordings {
        let mut unknown: Vec<&str> = Vec::new();
        for vehicle in &mut recording.vehicles {
            let known = facts.get(&vehicle.key).or_else(|| by_number.get(&number(&vehicle.key)?).copied());
            let Some(known) = known else {
                unknown.push(&vehicle.key);
                continue;
            };
            vehicle.class = vehicle.class.take().or_else(|| known.class.clone());
            vehicle.direction = vehicle.direction.or(known.direction);
            for (own, known) in vehicle.sizes_m.iter_mut().zip(&known.sizes_m).filter(|(own, _)| own.is_empty()) {
                own.clone_from(known);
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
