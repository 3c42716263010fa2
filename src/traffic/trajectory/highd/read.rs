//! Reads one recording's three files into the internal model, in one pass, from the needed columns only.

use std::collections::BTreeMap;
use std::path::Path;

use super::format::{FRAME_LIMIT, TRACKS_HEADER, csv_format};
use super::inventory::{HighdFiles, made_up};
use super::meta::{self, RecordingMeta, VehicleMeta};
use crate::trajectory::csv_table::{CsvColumn, CsvTable};
use crate::trajectory::{Loaded, NO_LANE, Recording, Track, number};
use lanesweep_model::plausibility::{Doubts, HELP, Implausible, Quantity};
use lanesweep_support::atomic_file::folder_of;
use lanesweep_support::{Error, Result};

/// Like [`read_checked`], but accepts implausible values.
///
/// # Errors
/// Those of [`read_checked`].
pub fn read(files: &HighdFiles) -> Result<Loaded> {
    read_checked(files, Implausible::Accepted)
}

/// Reads one recording. Each file is read once, from start to end.
///
/// The lines of `tracks` may be grouped by vehicle or by frame; each vehicle's frames must ascend by
/// one. Sizes come from `tracksMeta`; velocities and accelerations are the given ones; lanes come from
/// `laneId` or, where that column is absent, from position and lane lines.
///
/// # Errors
/// Any violation of the format, with file, line and column or vehicle.
pub fn read_checked(files: &HighdFiles, implausible: Implausible) -> Result<Loaded> {
    let mut doubts = Doubts::new(implausible);
    let recording_meta = meta::read_recording_meta(files, &mut doubts)?;
    let (vehicles, tracks_meta_checksum) = meta::read_tracks_meta(files, &recording_meta, &mut doubts)?;
    let mut table = CsvTable::open(&files.tracks, csv_format(TRACKS_HEADER))?;
    let columns = TrackColumns::of(&table)?;
    let reserve = can_hold(&files.tracks, &vehicles);
    let empty = vehicles.iter().map(|vehicle| empty_track(vehicle, reserve)).collect();
    let (tracks, odd_size) = read_tracks(&mut table, &columns, &recording_meta, &vehicles, empty, &mut doubts)?;
    let mut notes = notes(&columns, &vehicles);
    notes.extend(odd_size);
    notes.extend(doubts.sentences());
    let checksum_sha256 = vec![table.finish()?, tracks_meta_checksum, recording_meta.checksum];
    let recording = Recording {
        id: files.id.clone(),
        frame_rate_hz: recording_meta.frame_rate_hz,
        carriageways: recording_meta.carriageways,
        tracks,
        synthetic: recording_meta.synthetic || made_up(folder_of(&files.recording_meta)).is_some(),
    };
    Ok(Loaded { recording, checksum_sha256, notes, vehicle_names: BTreeMap::new(), file_frames: None })
}

struct TrackColumns {
    frame: CsvColumn,
    id: CsvColumn,
    x: CsvColumn,
    y: CsvColumn,
    velocity_x: CsvColumn,
    velocity_y: CsvColumn,
    acceleration_x: CsvColumn,
    lane: Option<CsvColumn>,
    /// Length and width, as tracksMeta has them.
    sizes: Option<[CsvColumn; 2]>,
}

impl TrackColumns {
    fn of(table: &CsvTable) -> Result<Self> {
        let lane = match table.optional_column("laneId")? {
            // The geometry replaces an absent column, but not a misspelt one.
            None if table.similar_name("laneId").is_some() => Some(table.column("laneId")?),
            lane => lane,
        };
        Ok(TrackColumns {
            frame: table.column("frame")?,
            id: table.column("id")?,
            x: table.column("x")?,
            y: table.column("y")?,
            velocity_x: table.column("xVelocity")?,
            velocity_y: table.column("yVelocity")?,
            acceleration_x: table.column("xAcceleration")?,
            lane,
            sizes: table.optional_column("width")?.zip(table.optional_column("height")?).map(<[CsvColumn; 2]>::from),
        })
    }
}

impl TrackColumns {
    /// The error for a vehicle that has another size in this line than in tracksMeta.
    fn other_size(&self, table: &CsvTable, vehicle: &VehicleMeta) -> Option<Error> {
        let sizes @ [column, _] = self.sizes?;
        let [length_m, width_m] = sizes.map(|column| number::real(table.bytes(column)));
        let [length_m, width_m] = [length_m?, width_m?];
        let off_m = (length_m - vehicle.length_m).abs().max((width_m - vehicle.width_m).abs());
        (off_m > SAME_SIZE_M).then(|| {
            let problem = format!("vehicle {} is {length_m} m × {width_m} m here, {} m × {} m in the tracksMeta file", vehicle.id, vehicle.length_m, vehicle.width_m);
            table.bad(column, problem, "correct the file in which rows have the sizes of other vehicles, or leave out `width` and `height` here")
        })
    }
}

/// Fills the empty tracks, one per vehicle, and returns those with samples, ascending by id, and a note about vehicles of
/// another size than in tracksMeta. If these are half of them, its rows are those of other vehicles.
fn read_tracks(
    table: &mut CsvTable,
    columns: &TrackColumns,
    meta: &RecordingMeta,
    vehicles: &[VehicleMeta],
    mut tracks: Vec<Track>,
    doubts: &mut Doubts,
) -> Result<(Vec<Track>, Option<String>)> {
    // Sums of the accelerations over each vehicle's last second, because single samples are noisy.
    let mut sums_mps2 = vec![0.0; vehicles.len()];
    let (mut at, mut odd_sizes) = (0, 0);
    let mut odd_size = None;
    while table.next_row()? {
        at = find_vehicle(table, columns.id, vehicles, at)?;
        if tracks[at].is_empty()
            && let Some(error) = columns.other_size(table, &vehicles[at])
        {
            odd_sizes += 1;
            odd_size.get_or_insert(error);
        }
        add_sample(table, columns, meta, &vehicles[at], &mut tracks[at], doubts)?;
        check_sample(table, columns, &tracks[at], meta.frame_rate_hz, &mut sums_mps2[at], doubts)?;
    }
    check_counts(table, vehicles, &tracks)?;
    tracks.retain(|track| !track.is_empty());
    if tracks.is_empty() {
        return Err(meta::no_vehicle(table));
    }
    match odd_size {
        Some(error) if 2 * odd_sizes > tracks.len() => Err(error),
        odd_size => {
            Ok((tracks, odd_size.map(|first| format!("{odd_sizes} vehicle(s) have two sizes, the first: {first}"))))
        }
    }
}

/// Is the tracks file large enough for all samples that the meta file claims? A damaged meta file can claim any
/// number.
fn can_hold(tracks: &Path, vehicles: &[VehicleMeta]) -> bool {
    let announced = vehicles.iter().fold(0_u64, |sum, vehicle| sum.saturating_add(vehicle.samples.unwrap_or(0)));
    let bytes = std::fs::metadata(tracks).map_or(0, |file| file.len());
    announced <= bytes / MIN_ROW_BYTES
}

/// A track without samples; `reserve` allocates memory for the claimed ones.
fn empty_track(vehicle: &VehicleMeta, reserve: bool) -> Track {
    let samples = if reserve { vehicle.samples.unwrap_or(0) as usize } else { 0 };
    Track {
        id: vehicle.id,
        class: vehicle.class,
        length_m: vehicle.length_m,
        width_m: vehicle.width_m,
        carriageway: vehicle.carriageway,
        first_frame: 0,
        s_m: Vec::with_capacity(samples),
        d_m: Vec::with_capacity(samples),
        v_s_mps: Vec::with_capacity(samples),
        v_d_mps: Vec::with_capacity(samples),
        a_s_mps2: Vec::with_capacity(samples),
        lane: Vec::with_capacity(samples),
    }
}

/// Index of the present line's vehicle. Lines are grouped by vehicle or by frame, so it is mostly the same or the
/// next one.
fn find_vehicle(table: &CsvTable, column: CsvColumn, vehicles: &[VehicleMeta], before: usize) -> Result<usize> {
    let id = table.integer(column)?;
    let is = |at: usize| vehicles.get(at).is_some_and(|vehicle| i64::from(vehicle.id) == id);
    if let Some(at) = [before, before + 1].into_iter().find(|at| is(*at)) {
        return Ok(at);
    }
    vehicles.binary_search_by_key(&id, |vehicle| i64::from(vehicle.id)).map_err(|_| {
        table.bad(
            column,
            format!("vehicle {id} is not in the tracksMeta file"),
            "add its line there or remove its lines here; check that the files belong to the same recording",
        )
    })
}

fn add_sample(
    table: &CsvTable,
    columns: &TrackColumns,
    meta: &RecordingMeta,
    vehicle: &VehicleMeta,
    track: &mut Track,
    doubts: &mut Doubts,
) -> Result<()> {
    let frame = table.integer(columns.frame)?;
    if track.is_empty() {
        if !(-FRAME_LIMIT..=FRAME_LIMIT).contains(&frame) {
            return Err(table.bad(columns.frame, format!("{frame} is out of range"), "correct the frame number"));
        }
        track.first_frame = frame;
    } else if frame != track.last_frame() + 1 {
        return Err(out_of_step(table, track, frame));
    }
    let direction = vehicle.direction;
    let d_m = direction.d_of(table.real(columns.y)?, vehicle.width_m);
    // All fields are parsed before any is stored, so that the series keep equal lengths.
    let s_m = direction.s_of(table.real(columns.x)?, vehicle.length_m);
    let text = || table.field(columns.velocity_x).to_string();
    let v_s_mps = doubts.speed(direction.forward(table.real(columns.velocity_x)?), text);
    if v_s_mps < 0.0 {
        return Err(table.bad(
            columns.velocity_x,
            format!("{v_s_mps} m/s along its drivingDirection: vehicle {} drives backwards", vehicle.id),
            "correct its sign or drivingDirection, or remove the vehicle (noise above -0.5 m/s counts as 0)",
        ));
    }
    let v_d_mps = direction.leftward(table.real(columns.velocity_y)?);
    let a_s_mps2 = direction.forward(table.real(columns.acceleration_x)?);
    let lane = match columns.lane {
        Some(column) => meta.lane_numbers.lane_of(direction, table.integer(column)?),
        None => meta.carriageways[vehicle.carriageway].lane_at(d_m).map_or(NO_LANE, |lane| lane as u16),
    };
    track.s_m.push(s_m);
    track.d_m.push(d_m);
    track.v_s_mps.push(v_s_mps);
    track.v_d_mps.push(v_d_mps);
    track.a_s_mps2.push(a_s_mps2);
    track.lane.push(lane);
    Ok(())
}

/// Checks the last sample of a track: speed, lateral speed, lateral step over its time, and the mean acceleration over the last
/// second, because single samples are noisy. `sum_mps2` is the sum of the accelerations over that second before the sample.
///
/// # Errors
/// A value outside the physical range, unless such values are accepted.
fn check_sample(
    table: &CsvTable,
    columns: &TrackColumns,
    track: &Track,
    rate_hz: f64,
    sum_mps2: &mut f64,
    doubts: &mut Doubts,
) -> Result<()> {
    let (window, last) = ((rate_hz.round() as usize).max(1), track.len() - 1);
    *sum_mps2 += track.a_s_mps2[last] - last.checked_sub(window).map_or(0.0, |left| track.a_s_mps2[left]);
    let mean_mps2 = if last + 1 >= window { *sum_mps2 / window as f64 } else { 0.0 };
    let step_mps = last.checked_sub(1).map_or(0.0, |before| (track.d_m[last] - track.d_m[before]) * rate_hz);
    let checked = [
        (Quantity::Speed, track.v_s_mps[last], columns.velocity_x),
        (Quantity::LateralSpeed, track.v_d_mps[last], columns.velocity_y),
        (Quantity::LateralSpeed, step_mps, columns.y),
        (Quantity::Acceleration, mean_mps2, columns.acceleration_x),
    ];
    // Nearly every value is plausible.
    for (quantity, value, column) in checked.into_iter().filter(|(quantity, value, _)| !quantity.is_plausible(*value)) {
        let place = || table.field(column).of(format!("vehicle {}", track.id)).to_string();
        doubts.check(quantity, value, place).map_err(|problem| table.bad(column, problem, HELP.as_str()))?;
    }
    Ok(())
}

/// The error for a frame that is not the one after the vehicle's last.
fn out_of_step(table: &CsvTable, track: &Track, frame: i64) -> Error {
    let (first, last) = (track.first_frame, track.last_frame());
    let (problem, help) = if (first..=last).contains(&frame) {
        (
            format!("frame {frame} of this vehicle occurs twice"),
            "remove one of the two lines, or give the second vehicle its own id",
        )
    } else if frame < first {
        (
            format!("the frames are out of order: {frame} comes after {last}; expected {}", last + 1),
            "sort the lines by id and frame",
        )
    } else {
        (
            format!("a gap, or the frames are out of order: {frame} comes after {last}; expected {}", last + 1),
            "sort the lines by id and frame; if a track has a gap, give each part its own id",
        )
    };
    Error::input(table.place().column("frame").of(format!("vehicle {}", track.id)), problem, help)
}

/// Compares the number of lines per vehicle with the meta file, which detects truncated files.
fn check_counts(table: &CsvTable, vehicles: &[VehicleMeta], tracks: &[Track]) -> Result<()> {
    let mut mismatches = vehicles.iter().zip(tracks).filter(|(vehicle, track)| match vehicle.samples {
        Some(samples) => samples != track.len() as u64,
        None => track.is_empty(),
    });
    let Some((vehicle, track)) = mismatches.next() else { return check_first_frames(table, vehicles, tracks) };
    let (found, more) = (track.len() as u64, mismatches.count());
    let expected = match vehicle.samples {
        Some(samples) => format!("the tracksMeta file claims {samples}"),
        None => "it is in the tracksMeta file".to_owned(),
    };
    let more = if more == 0 { String::new() } else { format!(" ({more} more vehicles do not fit either)") };
    let truncated = if vehicle.samples.is_none_or(|samples| found < samples) { ": is the file truncated?" } else { "" };
    Err(Error::input(
        table.file_place().of(format!("vehicle {}", vehicle.id)),
        format!("the vehicle has {found} frames, but {expected}{more}{truncated}"),
        "copy or export the files again; check that the three belong to the same recording",
    ))
}

/// Finds a vehicle whose track is shifted against the others: files may count from another first frame, but all alike.
fn check_first_frames(table: &CsvTable, vehicles: &[VehicleMeta], tracks: &[Track]) -> Result<()> {
    let shift = |(vehicle, track): (&VehicleMeta, &Track)| {
        Some(track.first_frame.saturating_sub(vehicle.first_frame?)).filter(|_| !track.is_empty())
    };
    let usual = vehicles.iter().zip(tracks).find_map(shift);
    let is_shifted = |of: &(&VehicleMeta, &Track)| usual.zip(shift(*of)).is_some_and(|(usual, own)| usual != own);
    let Some((vehicle, track)) = vehicles.iter().zip(tracks).find(is_shifted) else { return Ok(()) };
    let (found, told) = (track.first_frame, vehicle.first_frame.unwrap_or_default());
    Err(Error::input(
        table.file_place().of(format!("vehicle {}", vehicle.id)),
        format!(
            "the vehicle begins at frame {found}, but the tracksMeta file says {told}, unlike for the first vehicle"
        ),
        "copy or export the files again; check that the three belong to the same recording",
    ))
}

/// Warnings about usable data.
fn notes(columns: &TrackColumns, vehicles: &[VehicleMeta]) -> Vec<String> {
    let mut notes = Vec::new();
    if columns.lane.is_none() {
        notes.push("the column `laneId` is absent: lanes follow from positions and lane lines".to_owned());
    }
    if vehicles.iter().any(|vehicle| vehicle.samples.is_none()) {
        notes.push("the tracksMeta file has no `numFrames`: a truncated tracks file cannot be detected".to_owned());
    }
    notes
}

/// Sizes of one vehicle that differ by less are rounded, m.
const SAME_SIZE_M: f64 = 0.1;

/// Bytes of the shortest line: eight columns of one digit.
const MIN_ROW_BYTES: u64 = 16;
