//! Reads one recording's three files into the internal model, in one pass, from the needed columns only.

use super::format::{FRAME_LIMIT, TRACKS_HEADER};
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
    let meta = meta::read_recording_meta(files, &mut doubts)?;
    let (mut vehicles, tracks_meta_checksum) = meta::read_tracks_meta(files, &meta, &mut doubts)?;
    let mut table = CsvTable::open(&files.tracks, TRACKS_HEADER)?;
    let columns = TrackColumns::of(&table)?;
    let odd_size = read_tracks(&mut table, &columns, &meta, &mut vehicles, &mut doubts)?;
    let mut notes = Vec::new();
    if columns.lane.is_none() {
        notes.push("the column `laneId` is absent: lanes follow from positions and lane lines".to_owned());
    }
    if vehicles.iter().any(|vehicle| vehicle.samples.is_none()) {
        notes.push("the tracksMeta file has no `numFrames`: a truncated tracks file cannot be detected".to_owned());
    }
    notes.extend(odd_size.into_iter().chain(doubts.sentences()));
    let checksum_sha256 = vec![table.finish()?, tracks_meta_checksum, meta.checksum];
    let recording = Recording {
        id: files.id.clone(),
        frame_rate_hz: meta.frame_rate_hz,
        carriageways: meta.carriageways,
        tracks: vehicles.into_iter().map(|vehicle| vehicle.track).filter(|track| !track.is_empty()).collect(),
        synthetic: meta.synthetic || made_up(folder_of(&files.recording_meta)).is_some(),
    };
    let (vehicle_names, understanding) = Default::default();
    Ok(Loaded { recording, checksum_sha256, notes, vehicle_names, file_frames: None, understanding })
}

struct TrackColumns {
    /// `frame`, `id`, `x`, `y`, `xVelocity`, `yVelocity`, `xAcceleration`.
    needed: [CsvColumn; 7],
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
        let needed = table.columns(["frame", "id", "x", "y", "xVelocity", "yVelocity", "xAcceleration"])?;
        let sizes = table.optional_column("width")?.zip(table.optional_column("height")?).map(<[CsvColumn; 2]>::from);
        Ok(TrackColumns { needed, lane, sizes })
    }

    /// The error for a vehicle that has another size in this line than in tracksMeta.
    fn other_size(&self, table: &CsvTable, vehicle: &Track) -> Option<Error> {
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

/// Fills the empty tracks of the vehicles, and returns a note about those of another size than in tracksMeta. If these are half
/// of them, its rows are those of other vehicles.
fn read_tracks(
    table: &mut CsvTable,
    columns: &TrackColumns,
    meta: &RecordingMeta,
    vehicles: &mut [VehicleMeta],
    doubts: &mut Doubts,
) -> Result<Option<String>> {
    let (mut at, mut odd_sizes) = (0, 0);
    let mut odd_size = None;
    while table.next_row()? {
        at = find_vehicle(table, columns.needed[1], vehicles, at)?;
        if vehicles[at].track.is_empty()
            && let Some(error) = columns.other_size(table, &vehicles[at].track)
        {
            odd_sizes += 1;
            odd_size.get_or_insert(error);
        }
        add_sample(table, columns, meta, &mut vehicles[at], doubts)?;
    }
    check_counts(table, vehicles)?;
    let tracks = vehicles.iter().filter(|vehicle| !vehicle.track.is_empty()).count();
    match odd_size {
        _ if tracks == 0 => Err(meta::no_vehicle(table)),
        Some(error) if 2 * odd_sizes > tracks => Err(error),
        odd_size => Ok(odd_size.map(|first| format!("{odd_sizes} vehicle(s) have two sizes, the first: {first}"))),
    }
}

/// Index of the present line's vehicle. Lines are grouped by vehicle or by frame, so it is mostly the same or the
/// next one.
fn find_vehicle(table: &CsvTable, column: CsvColumn, vehicles: &[VehicleMeta], before: usize) -> Result<usize> {
    let id = table.integer(column)?;
    let is = |at: usize| vehicles.get(at).is_some_and(|vehicle| i64::from(vehicle.track.id) == id);
    if let Some(at) = [before, before + 1].into_iter().find(|at| is(*at)) {
        return Ok(at);
    }
    vehicles.binary_search_by_key(&id, |vehicle| i64::from(vehicle.track.id)).map_err(|_| {
        let help = "add its line there or remove its lines here; check that the files belong to the same recording";
        table.bad(column, format!("vehicle {id} is not in the tracksMeta file"), help)
    })
}

/// Adds a sample to its track, and checks speed, lateral speed, lateral step over its time, and the mean acceleration over the last
/// second, because single samples are noisy.
///
/// # Errors
/// A value that is none, or outside the physical range, unless such values are accepted.
fn add_sample(
    table: &CsvTable,
    columns: &TrackColumns,
    meta: &RecordingMeta,
    vehicle: &mut VehicleMeta,
    doubts: &mut Doubts,
) -> Result<()> {
    let [frame_column, _, x, y, v_x, v_y, a_x] = columns.needed;
    let (direction, track) = (vehicle.direction, &mut vehicle.track);
    let frame = table.integer(frame_column)?;
    if track.is_empty() {
        if !(-FRAME_LIMIT..=FRAME_LIMIT).contains(&frame) {
            return Err(table.bad(frame_column, format!("{frame} is out of range"), "correct the frame number"));
        }
        track.first_frame = frame;
    } else if frame != track.last_frame() + 1 {
        return Err(out_of_step(table, track, frame));
    }
    let d_m = direction.d_of(table.real(y)?, track.width_m);
    // All fields are parsed before any is stored, so that the series keep equal lengths.
    let s_m = direction.s_of(table.real(x)?, track.length_m);
    let v_s_mps = doubts.speed(direction.forward(table.real(v_x)?), || table.field(v_x).to_string());
    if v_s_mps < 0.0 {
        let problem = format!("{v_s_mps} m/s along its drivingDirection: vehicle {} drives backwards", track.id);
        let help = "correct its sign or drivingDirection, or remove the vehicle (noise above -0.5 m/s counts as 0)";
        return Err(table.bad(v_x, problem, help));
    }
    let v_d_mps = direction.leftward(table.real(v_y)?);
    let a_s_mps2 = direction.forward(table.real(a_x)?);
    let lane = match columns.lane {
        Some(column) => meta.lane_numbers.lane_of(direction, table.integer(column)?),
        None => meta.carriageways[track.carriageway].lane_at(d_m).map_or(NO_LANE, |lane| lane as u16),
    };
    let step_mps = track.d_m.last().map_or(0.0, |before| (d_m - before) * meta.frame_rate_hz);
    track.s_m.push(s_m);
    track.d_m.push(d_m);
    track.v_s_mps.push(v_s_mps);
    track.v_d_mps.push(v_d_mps);
    track.a_s_mps2.push(a_s_mps2);
    track.lane.push(lane);
    let (window, last) = ((meta.frame_rate_hz.round() as usize).max(1), track.len() - 1);
    vehicle.last_second_mps2 += a_s_mps2 - last.checked_sub(window).map_or(0.0, |left| track.a_s_mps2[left]);
    let mean_mps2 = if last + 1 >= window { vehicle.last_second_mps2 / window as f64 } else { 0.0 };
    let checked = [
        (Quantity::Speed, v_s_mps, v_x),
        (Quantity::LateralSpeed, v_d_mps, v_y),
        (Quantity::LateralSpeed, step_mps, y),
        (Quantity::Acceleration, mean_mps2, a_x),
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
    let order = format!("the frames are out of order: {frame} comes after {last}; expected {}", last + 1);
    let (problem, help) = if (first..=last).contains(&frame) {
        (
            format!("frame {frame} of this vehicle occurs twice"),
            "remove one of the two lines, or give the second vehicle its own id",
        )
    } else if frame < first {
        (order, "sort the lines by id and frame")
    } else {
        let help = "sort the lines by id and frame; if a track has a gap, give each part its own id";
        (format!("a gap, or {order}"), help)
    };
    Error::input(table.place().column("frame").of(format!("vehicle {}", track.id)), problem, help)
}

/// Compares the number of lines per vehicle with the meta file, which detects truncated files, and finds a vehicle whose track is
/// shifted against the others: files may count from another first frame, but all alike.
fn check_counts(table: &CsvTable, vehicles: &[VehicleMeta]) -> Result<()> {
    let bad = |vehicle: &VehicleMeta, problem: String| {
        let place = table.file_place().of(format!("vehicle {}", vehicle.track.id));
        let help = "copy or export the files again; check that the three belong to the same recording";
        Err(Error::input(place, problem, help))
    };
    let found = |vehicle: &VehicleMeta| vehicle.track.len() as u64;
    let is_other = |of: &&VehicleMeta| of.samples.map_or(found(of) == 0, |samples| samples != found(of));
    let mut others = vehicles.iter().filter(is_other);
    if let Some(vehicle) = others.next() {
        let (found, more) = (found(vehicle), others.count());
        let expected = match vehicle.samples {
            Some(samples) => format!("the tracksMeta file claims {samples}"),
            None => "it is in the tracksMeta file".to_owned(),
        };
        let more = if more == 0 { String::new() } else { format!(" ({more} more vehicles do not fit either)") };
        let is_truncated = vehicle.samples.is_none_or(|samples| found < samples);
        let truncated = if is_truncated { ": is the file truncated?" } else { "" };
        return bad(vehicle, format!("the vehicle has {found} frames, but {expected}{more}{truncated}"));
    }
    let shift =
        |of: &VehicleMeta| Some(of.track.first_frame.saturating_sub(of.first_frame?)).filter(|_| !of.track.is_empty());
    let usual = vehicles.iter().find_map(shift);
    let is_shifted = |of: &&VehicleMeta| usual.zip(shift(of)).is_some_and(|(usual, own)| usual != own);
    let Some(vehicle) = vehicles.iter().find(is_shifted) else { return Ok(()) };
    let (found, told) = (vehicle.track.first_frame, vehicle.first_frame.unwrap_or_default());
    let problem = format!("the vehicle begins at frame {found}, but the tracksMeta file says {told}");
    bad(vehicle, problem + ", unlike for the first vehicle")
}

/// Sizes of one vehicle that differ by less are rounded, m.
const SAME_SIZE_M: f64 = 0.1;
