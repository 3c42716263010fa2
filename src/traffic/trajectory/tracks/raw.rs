//! What a track file says: vehicles with samples in SI units and right-handed axes, before any road is known.

use std::collections::HashMap;

use super::apart::apart;
use super::preset::{HeadingOrigin, MetaFile, Preset, Side};
use super::roles::{ColumnName, Role};
use super::rows::{Columns, Rows, SampleRow, TIME_OF_DAY};
use super::samples::Samples;
use super::{TrackFile, sumo};
use crate::support::input_file::packed_or_not;
use crate::support::plain_text::nearest;
use crate::traffic::trajectory::csv_table::FileChecksum;
use crate::{Error, Place, Result};

/// No lane is named.
pub(super) const NO_LABEL: u32 = u32::MAX;
/// Maximum number of lane names of a file; more are no names of lanes.
const MAX_LABELS: usize = 65_536;
/// Times of day that fall by more begin again at midnight, s.
const HALF_A_DAY_S: f64 = 43_200.0;

/// One sample. NaN: not in the file.
#[derive(Debug, Clone, Copy)]
pub(super) struct RawSample {
    /// Frame number, or time in s.
    pub at: f64,
    /// Position of the reference point, m; y to the left of x.
    pub xy_m: [f64; 2],
    /// Direction of the vehicle's front.
    pub heading: [f64; 2],
    /// Magnitude of the velocity, m/s.
    pub speed_mps: f64,
    /// Velocity in the axes of the file, m/s.
    pub velocity_mps: [f64; 2],
    /// Velocity forward and to the left along the road, m/s.
    pub along_mps: [f64; 2],
    /// Acceleration forward, m/s².
    pub acceleration_mps2: f64,
    /// Acceleration in the axes of the file, m/s².
    pub acceleration_xy_mps2: [f64; 2],
    /// Index of the lane's name, or [`NO_LABEL`].
    pub lane: u32,
    /// Distance from the middle of the lane, m.
    pub lane_offset_m: f64,
    /// The time, s, where `at` counts frames; the frame where it is a time.
    pub other_clock: f64,
    /// Length, width, class and direction in its row: index in the lists of the vehicle + 1, or 0.
    pub facts: [u16; 4],
}

/// One vehicle.
#[derive(Debug, Clone, Default)]
pub(super) struct RawVehicle {
    /// Its id in the file.
    pub key: String,
    pub class: Option<String>,
    /// The classes in its rows; each change is one more.
    pub classes: Vec<String>,
    /// The lengths and widths that it has, m; each change is one more.
    pub lengths_m: Vec<f64>,
    pub widths_m: Vec<f64>,
    /// Sign of the travel along the road.
    pub direction: Option<f64>,
    pub samples: Samples,
}

/// Adds a value to a list of changes; returns its index + 1.
fn changed<T, V: PartialEq<T> + Into<T>>(list: &mut Vec<T>, value: V) -> u16 {
    if list.last().is_none_or(|last| value != *last) {
        list.push(value.into());
    }
    u16::try_from(list.len()).unwrap_or(u16::MAX)
}

/// The value of a list of changes that a row has.
fn in_row<T: Clone>(list: &[T], fact: u16) -> Option<T> {
    list.get(usize::from(fact).checked_sub(1)?).cloned()
}

impl RawVehicle {
    /// Lengths and widths of some of its samples, m; all of them if these have none in their rows.
    pub(super) fn sizes_m(&self, samples: &Samples) -> [Vec<f64>; 2] {
        let of = |fact: usize, list: &[f64]| {
            let in_rows = || (0..samples.len()).filter_map(|k| in_row(list, samples.fact(fact, k)));
            let mut sizes: Vec<f64> = if list.len() > 1 { in_rows().collect() } else { Vec::new() };
            sizes.dedup();
            if sizes.is_empty() { list.to_vec() } else { sizes }
        };
        [of(0, &self.lengths_m), of(1, &self.widths_m)]
    }

    /// Class of some of its samples: that in the row of the first, unless a type or a meta file gives another name.
    pub(super) fn class_of(&self, samples: &Samples) -> Option<String> {
        let in_rows = self.classes.len() > 1
            && !samples.is_empty()
            && self.classes.iter().any(|of| Some(of) == self.class.as_ref());
        let class = if in_rows { in_row(&self.classes, samples.fact(2, 0)) } else { None };
        class.or_else(|| self.class.clone())
    }

    /// Some of its samples as a vehicle of their own, with the sizes, class and direction in their rows.
    pub(super) fn part(&self, samples: Samples) -> RawVehicle {
        let [lengths_m, widths_m] = self.sizes_m(&samples);
        let first = |fact: usize| if samples.is_empty() { 0 } else { samples.fact(fact, 0) };
        let (class, direction) = (in_row(&self.classes, first(2)), in_row(&[-1.0, 1.0], first(3)));
        RawVehicle {
            key: self.key.clone(),
            class,
            classes: self.classes.clone(),
            lengths_m,
            widths_m,
            direction,
            samples,
        }
    }

    /// Takes the sizes that it lacks from another source.
    pub(super) fn complete_sizes(&mut self, known: &RawVehicle) {
        for (own, known) in [(&mut self.lengths_m, &known.lengths_m), (&mut self.widths_m, &known.widths_m)] {
            if own.is_empty() {
                own.clone_from(known);
            }
        }
    }
}

/// One recording.
#[derive(Debug, Clone, Default)]
pub(super) struct RawRecording {
    pub id: String,
    pub vehicles: Vec<RawVehicle>,
    /// Names of lanes.
    pub lanes: Vec<String>,
    /// Whether `at` counts frames.
    pub has_frames: bool,
    pub frame_rate_hz: Option<f64>,
    /// Samples without a position.
    pub incomplete: u64,
    /// Lines of the lanes, from a map: points in the axes of the file, by boundary.
    pub boundaries: Vec<Vec<[f64; 2]>>,
    pub synthetic: bool,
    /// What was assumed of it.
    pub notes: Vec<String>,
}

/// The recordings of a file.
#[derive(Debug)]
pub(super) struct RawFile {
    pub recordings: Vec<RawRecording>,
    pub checksums: Vec<FileChecksum>,
    pub rows: u64,
    /// Roles that the file has, with their columns.
    pub roles: Vec<(Role, String)>,
    /// Columns without a role.
    pub unused: Vec<String>,
}

/// Reads a table of samples with its meta files.
///
/// # Errors
/// Those of the files, with the place of a bad value.
pub(super) fn read_table(file: &TrackFile, preset: &Preset) -> Result<RawFile> {
    let rows = Rows::of_preset(&file.path, preset)?;
    let columns = Columns::of(&preset.columns, rows.header(), &preset.none);
    check_columns(&rows, &columns, preset)?;
    let mut roles: Vec<(Role, String)> = Role::ALL
        .into_iter()
        .filter(|role| columns.has(*role))
        .map(|role| (role, columns.name(role).to_owned()))
        .collect();
    let is_used = |name: &&String| roles.iter().any(|(_, used)| used == *name);
    let unused = rows.header().iter().filter(|name| !is_used(name)).cloned().collect();
    let mut collecting = Collecting::new(&file.id, preset, &columns);
    let (checksum, count) = rows.each(&columns, &mut |row| collecting.add(row))?;
    let mut recordings = collecting.recordings;
    recordings.retain(|recording| !recording.vehicles.is_empty());
    if let Some(found) = columns.found_time() {
        roles.iter_mut().filter(|(role, _)| *role == Role::Time).for_each(|(_, name)| *name += &format!(" ({found})"));
    }
    recordings.iter_mut().flat_map(|of| &mut of.vehicles).for_each(|vehicle| vehicle.samples.shrink());
    let mut checksums = vec![checksum];
    checksums.extend(add_frame_rate(file, preset, &mut recordings)?);
    let mut recordings = apart(recordings, preset);
    checksums.extend(add_vehicle_facts(file, preset, &mut recordings)?);
    if let Some(patterns) = &preset.types_file {
        checksums.extend(sumo::add_facts(file, patterns.names(), preset, &mut recordings)?);
    }
    Ok(RawFile { recordings, checksums, rows: count, roles, unused })
}

fn check_columns(rows: &Rows, columns: &Columns, preset: &Preset) -> Result<()> {
    if let Some(role) =
        [Role::X, Role::Y].into_iter().find(|role| columns.has(*role) && is_geographic(columns.name(*role)))
    {
        let problem = "the column is a longitude or latitude; positions are in metres in a plane";
        return Err(Error::input(rows.header_place().column(columns.name(role)), problem, PROJECT));
    }
    let is_needed = |role: Role, column: &ColumnName| match role {
        Role::Vehicle | Role::X | Role::Y => true,
        Role::Frame => !columns.has(Role::Time),
        Role::Time => !columns.has(Role::Frame),
        // The names of a shipped preset may be absent in older files, and of several names the user knows that too.
        _ => preset.is_own && column.names().len() == 1,
    };
    let missing = preset.columns.iter().find(|(role, column)| !columns.has(**role) && is_needed(**role, column));
    let Some((role, column)) = missing else { return Ok(()) };
    let header: Vec<String> = rows.header().iter().take(30).map(|name| format!("`{name}`")).collect();
    let near = column.names().first().and_then(|name| nearest(name, rows.header().iter().map(String::as_str), 0.6));
    let near = near.map_or(String::new(), |near| format!("; did you mean `{near}`?"));
    Err(Error::input(
        rows.header_place(),
        format!(
            "preset {} takes `{}` from the column `{}`, which is not there{near}; the header has {}",
            preset.name,
            role.key(),
            column.names().join("` or `"),
            header.join(", ")
        ),
        "correct the name in the preset, or remove the line; or use another preset",
    ))
}

struct Collecting<'a> {
    preset: &'a Preset,
    columns: &'a Columns,
    id: &'a str,
    recordings: Vec<RawRecording>,
    /// By the name of the recording in the file.
    of_name: HashMap<String, usize>,
    vehicles: HashMap<(usize, String), usize>,
    labels: HashMap<(usize, String), u32>,
    last: (usize, usize),
    /// By recording, the vehicle that came after each vehicle: it often does so again at the next time.
    next: Vec<Vec<usize>>,
    has_frames: bool,
    other_clock: Role,
    y_sign: f64,
}

impl<'a> Collecting<'a> {
    fn new(id: &'a str, preset: &'a Preset, columns: &'a Columns) -> Self {
        // Times tell the rate too.
        let has_frames = columns.has(Role::Frame)
            && (preset.frame_rate_hz.is_some() || preset.recording.is_some() || !columns.has(Role::Time));
        Collecting {
            preset,
            columns,
            id,
            recordings: Vec::new(),
            of_name: HashMap::new(),
            vehicles: HashMap::new(),
            labels: HashMap::new(),
            last: (usize::MAX, usize::MAX),
            next: Vec::new(),
            has_frames,
            other_clock: if has_frames { Role::Time } else { Role::Frame },
            y_sign: if preset.axes.y == Side::Right { -1.0 } else { 1.0 },
        }
    }

    fn add(&mut self, row: &dyn SampleRow) -> Result<()> {
        let missing = |role: Role| Error::input(row.place(role), "there is no value", "fill it in, or remove the row");
        let recording = self.recording(row)?;
        let vehicle = match self.expected_vehicle(recording, row)? {
            Some(vehicle) => vehicle,
            None => match row.text(Role::Vehicle)? {
                Some(key) => self.vehicle(recording, &key),
                // Tables of time steps have a row for a step without vehicles.
                None if row.number(Role::X)?.is_none() && row.number(Role::Y)?.is_none() => return Ok(()),
                None => return Err(missing(Role::Vehicle)),
            },
        };
        let time = if self.has_frames { Role::Frame } else { Role::Time };
        let at = row.number(time)?.ok_or_else(|| missing(time))?;
        let number = |role| row.number(role).map(|value| value.unwrap_or(f64::NAN));
        let xy_m = [number(Role::X)?, self.y_sign * number(Role::Y)?];
        if xy_m.iter().any(|value| value.is_nan()) {
            self.recordings[recording].incomplete += 1;
            return Ok(());
        }
        let heading = match row.number(Role::Heading)? {
            None => [f64::NAN; 2],
            Some(angle) => {
                let (sin, cos) = (libm::sin(angle), libm::cos(angle));
                match self.preset.axes.heading {
                    HeadingOrigin::FromX => [cos, self.y_sign * sin],
                    HeadingOrigin::FromNorth => [sin, self.y_sign * cos],
                }
            }
        };
        let mut sample = RawSample {
            at,
            xy_m,
            heading,
            speed_mps: number(Role::Speed)?,
            velocity_mps: [number(Role::XSpeed)?, self.y_sign * number(Role::YSpeed)?],
            along_mps: [number(Role::ForwardSpeed)?, number(Role::LeftwardSpeed)?],
            acceleration_mps2: number(Role::Acceleration)?,
            acceleration_xy_mps2: [number(Role::XAcceleration)?, self.y_sign * number(Role::YAcceleration)?],
            lane_offset_m: number(Role::LaneOffset)?,
            // Only numbers of the file are compared with one another: a text counts as no value.
            other_clock: row.number(self.other_clock).ok().flatten().unwrap_or(f64::NAN),
            ..RawSample::unknown()
        };
        let of = &self.recordings[recording];
        let before = &of.vehicles[vehicle].samples;
        let lane_before = before.len().checked_sub(1).map_or(NO_LABEL, |last| before.lane(last));
        if lane_before != NO_LABEL && row.is_text(Role::Lane, &of.lanes[lane_before as usize])? {
            sample.lane = lane_before;
        } else if let Some(lane) = row.text(Role::Lane)? {
            sample.lane = self.label(recording, &lane);
        }
        let of = &mut self.recordings[recording].vehicles[vehicle];
        if let Some(last) = of.samples.len().checked_sub(1)
            && self.columns.found_time() == Some(TIME_OF_DAY)
            && of.samples.at(last) - at > HALF_A_DAY_S
        {
            let problem = "the times of day of this vehicle begin again: the recording goes past midnight";
            let help = "write dates (2024-10-07 00:00:00.05), or seconds";
            return Err(Error::input(row.place(time).of(format!("vehicle {}", of.key)), problem, help));
        }
        for (fact, role, sizes) in [(0, Role::Length, &mut of.lengths_m), (1, Role::Width, &mut of.widths_m)] {
            if let Some(size) = row.number(role)?.filter(|size| *size > 0.0) {
                sample.facts[fact] = changed(sizes, size);
            }
        }
        let is_same_class = of.classes.last().map(|class| row.is_text(Role::Class, class)).transpose()?;
        sample.facts[2] = match is_same_class {
            Some(true) => u16::try_from(of.classes.len()).unwrap_or(u16::MAX),
            _ => row.text(Role::Class)?.map_or(0, |class| changed(&mut of.classes, class.as_ref())),
        };
        let direction = row.number(Role::Direction)?;
        sample.facts[3] = direction.map_or(0, |sign| 1 + u16::from(sign >= 0.0));
        if of.samples.is_empty() {
            of.class = in_row(&of.classes, sample.facts[2]);
            of.direction = direction;
        }
        of.samples.push(&sample);
        Ok(())
    }

    fn recording(&mut self, row: &dyn SampleRow) -> Result<usize> {
        let name = row.text(Role::Recording)?.unwrap_or_default();
        if let Some(&at) = self.of_name.get(name.as_ref()) {
            return Ok(at);
        }
        let id = if name.is_empty() { self.id.to_owned() } else { format!("{}-{name}", self.id) };
        let plain = id.replace(['/', '\\', ' '], "-");
        let is_new = |id: &String| self.recordings.iter().all(|other| other.id != *id);
        // `a b` and `a/b` stay apart.
        let numbered = (2..).map(|number| format!("{plain}-{number}"));
        let id = std::iter::once(plain.clone()).chain(numbered).find(is_new).unwrap_or_default();
        self.recordings.push(RawRecording { id, has_frames: self.has_frames, ..RawRecording::default() });
        self.next.push(Vec::new());
        self.of_name.insert(name.into_owned(), self.recordings.len() - 1);
        Ok(self.recordings.len() - 1)
    }

    /// The vehicle of a row, if it is that of the last row or the one that came after it before.
    fn expected_vehicle(&mut self, recording: usize, row: &dyn SampleRow) -> Result<Option<usize>> {
        if self.last.0 != recording {
            return Ok(None);
        }
        let vehicles = &self.recordings[recording].vehicles;
        for vehicle in [self.last.1, self.next[recording][self.last.1]] {
            if row.is_text(Role::Vehicle, &vehicles[vehicle].key)? {
                self.last.1 = vehicle;
                return Ok(Some(vehicle));
            }
        }
        Ok(None)
    }

    fn vehicle(&mut self, recording: usize, key: &str) -> usize {
        let of = &mut self.recordings[recording];
        let next = &mut self.next[recording];
        let at = *self.vehicles.entry((recording, key.to_owned())).or_insert_with(|| {
            of.vehicles.push(RawVehicle { key: key.to_owned(), ..RawVehicle::default() });
            next.push(of.vehicles.len() - 1);
            of.vehicles.len() - 1
        });
        if self.last.0 == recording {
            next[self.last.1] = at;
        }
        self.last = (recording, at);
        at
    }

    fn label(&mut self, recording: usize, lane: &str) -> u32 {
        let of = &mut self.recordings[recording];
        if let Some(last) = of.lanes.last().filter(|last| *last == lane) {
            debug_assert!(!last.is_empty());
            return of.lanes.len() as u32 - 1;
        }
        if let Some(&label) = self.labels.get(&(recording, lane.to_owned())) {
            return label;
        }
        if of.lanes.len() >= MAX_LABELS {
            return NO_LABEL;
        }
        of.lanes.push(lane.to_owned());
        let label = of.lanes.len() as u32 - 1;
        self.labels.insert((recording, lane.to_owned()), label);
        label
    }
}

/// What to do with geographic coordinates.
pub(in crate::traffic::trajectory) const PROJECT: &str =
    "project the positions to metres (UTM, for instance) and name the columns x and y";

/// Whether a name is that of a column of longitudes or latitudes.
pub(in crate::traffic::trajectory) fn is_geographic(name: &str) -> bool {
    let bare = name.split(['(', '[']).next().unwrap_or(name);
    let letters: String = bare.chars().filter(|c| c.is_alphabetic()).flat_map(char::to_lowercase).collect();
    let letters = letters.trim_start_matches("gps").trim_end_matches("deg");
    ["lon", "lng", "long", "longitude", "lat", "latitude"].contains(&letters)
}

/// The meta file beside a track file, if it is there.
fn meta_rows(file: &TrackFile, meta: &MetaFile, preset: &Preset) -> Result<Option<(Rows, Columns)>> {
    let beside = packed_or_not(file.path.with_file_name(meta.file.replace('*', &file.id)));
    if !beside.exists() {
        let problem = format!("preset {} names this file, which is not there", preset.name);
        let missing = || Error::input(Place::file(&beside), problem, "add it, or remove its table from the preset");
        return if preset.is_own { Err(missing()) } else { Ok(None) };
    }
    let rows = Rows::open(&beside, preset.format, None, preset.delimiter)?;
    let columns = Columns::of(&meta.columns, rows.header(), &preset.none);
    Ok(Some((rows, columns)))
}

/// Adds classes, sizes and directions of the vehicles from their own file.
fn add_vehicle_facts(
    file: &TrackFile,
    preset: &Preset,
    recordings: &mut [RawRecording],
) -> Result<Option<FileChecksum>> {
    let Some(meta) = &preset.vehicles else { return Ok(None) };
    let Some((rows, columns)) = meta_rows(file, meta, preset)? else {
        let facts: Vec<&str> =
            meta.columns.keys().filter(|role| **role != Role::Vehicle).map(|role| role.key()).collect();
        let (file, facts) = (meta.file.replace('*', &file.id), facts.join(", "));
        let note = format!("{file} is not beside the tracks: {facts} of the vehicles are not read from it");
        recordings.iter_mut().for_each(|recording| recording.notes.push(note.clone()));
        return Ok(None);
    };
    let mut facts: HashMap<String, RawVehicle> = HashMap::new();
    let (checksum, _) = rows.each(&columns, &mut |row| {
        let Some(key) = row.text(Role::Vehicle)? else { return Ok(()) };
        let sizes =
            |role| -> Result<Vec<f64>> { Ok(row.number(role)?.filter(|size| *size > 0.0).into_iter().collect()) };
        let vehicle = RawVehicle {
            key: key.to_string(),
            class: row.text(Role::Class)?.map(|class| class.into_owned()),
            lengths_m: sizes(Role::Length)?,
            widths_m: sizes(Role::Width)?,
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
            vehicle.complete_sizes(known);
        }
        if let Some(first) = unknown.first() {
            let (number, file) = (unknown.len(), &checksum.file);
            recording.notes.push(format!("{number} vehicles have no row in {file}, the first is vehicle {first}"));
        }
    }
    Ok(Some(checksum))
}

/// Adds the frame rate from the file about the recording.
fn add_frame_rate(file: &TrackFile, preset: &Preset, recordings: &mut [RawRecording]) -> Result<Option<FileChecksum>> {
    let Some(meta) = &preset.recording else { return Ok(None) };
    let Some((rows, columns)) = meta_rows(file, meta, preset)? else { return Ok(None) };
    let mut rate = None;
    let (checksum, _) = rows.each(&columns, &mut |row| {
        if let Some(found) = row.number(Role::FrameRate)? {
            if !(0.1..=1e4).contains(&found) {
                let problem = format!("{found} is not a frame rate");
                return Err(Error::input(row.place(Role::FrameRate), problem, "give the number of frames per second"));
            }
            rate = Some(found);
        }
        Ok(())
    })?;
    recordings.iter_mut().for_each(|recording| recording.frame_rate_hz = rate);
    Ok(Some(checksum))
}
