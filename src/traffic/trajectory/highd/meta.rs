//! The two small files of a recording: `recordingMeta` (frame rate, lane lines) and `tracksMeta`
//! (size, class and direction of each vehicle).

use super::format::{FRAME_RATES_HZ, LANE_LINES_LIMIT, RECORDING_META_HEADER, TRACKS_META_HEADER};
use super::frame::{Direction, LaneNumbers};
use super::inventory::HighdFiles;
use crate::trajectory::csv_table::{CsvColumn, CsvTable, FileChecksum, quoted};
use crate::trajectory::{Carriageway, Track, VehicleClass, number};
use lanesweep_model::plausibility::{Doubts, HELP, Quantity};
use lanesweep_support::{Error, Place, Result};

/// Content of `recordingMeta`.
pub(super) struct RecordingMeta {
    pub frame_rate_hz: f64,
    pub lane_numbers: LaneNumbers,
    /// The carriageways with lane lines, at most two.
    pub carriageways: Vec<Carriageway>,
    /// The recording is synthetic.
    pub synthetic: bool,
    pub checksum: FileChecksum,
    /// Line number of these values.
    place: Place,
}

impl RecordingMeta {
    /// Index of a direction's carriageway; `None` without lane lines.
    fn carriageway(&self, direction: Direction) -> Option<usize> {
        self.carriageways.iter().position(|carriageway| carriageway.name == direction.name())
    }
}

/// Content of `tracksMeta` for one vehicle.
pub(super) struct VehicleMeta {
    /// Its track, which begins without samples.
    pub track: Track,
    /// Sum of its last accelerations, at most those of a second, m/s².
    pub last_second_mps2: f64,
    pub direction: Direction,
    /// Required number of lines in `tracks`, if given.
    pub samples: Option<u64>,
    /// Its first frame, if given.
    pub first_frame: Option<i64>,
}

/// Reads `recordingMeta`.
pub(super) fn read_recording_meta(files: &HighdFiles, doubts: &mut Doubts) -> Result<RecordingMeta> {
    let mut table = CsvTable::open(&files.recording_meta, RECORDING_META_HEADER)?;
    let columns = ["frameRate", Direction::Upper.markings_column(), Direction::Lower.markings_column()];
    let [frame_rate, upper_column, lower_column] = table.columns(columns)?;
    let synthetic_column = table.optional_column("synthetic")?;
    if !table.next_row()? {
        let problem = "the file has no line after the header; expected one that describes the recording";
        return Err(Error::input(table.file_place(), problem, "copy or export the file again"));
    }
    let place = table.place();
    let frame_rate_hz = frames_per_second(&table, frame_rate)?;
    let upper = markings(&table, upper_column)?;
    let lower = markings(&table, lower_column)?;
    let synthetic = synthetic_column.map_or(Ok(false), |column| yes_or_no(&table, column))?;
    if upper.is_empty() && lower.is_empty() {
        let problem =
            "the lane lines are missing, here and in `lowerLaneMarkings`; expected at least two in one of them";
        return Err(table.bad(upper_column, problem, MARKINGS_HELP));
    }
    if let (Some(last_upper), Some(first_lower)) = (upper.last(), lower.first())
        && last_upper > first_lower
    {
        let order = format!("begin at {first_lower}, above the last of the upper ones at {last_upper}");
        let help = "y points down: the upper lane lines must have the smaller values";
        return Err(table.bad(lower_column, format!("the lower lane lines {order}"), help));
    }
    check_plausible(&table, frame_rate, Quantity::Rate, frame_rate_hz, doubts)?;
    for (lines, column) in [(&upper, upper_column), (&lower, lower_column)] {
        lines
            .array_windows()
            .try_for_each(|[a, b]| check_plausible(&table, column, Quantity::LaneWidth, b - a, doubts))?;
    }
    if table.next_row()? {
        let problem = "a second line; expected one line for this recording";
        return Err(Error::input(table.place(), problem, "keep the line of this recording and remove the others"));
    }
    let lane_numbers = LaneNumbers { lines: [upper.len(), lower.len()] };
    let carriageways = [(Direction::Upper, upper), (Direction::Lower, lower)]
        .into_iter()
        .filter(|(_, lines)| !lines.is_empty())
        .map(|(direction, lines)| carriageway(direction, &lines))
        .collect();
    Ok(RecordingMeta { frame_rate_hz, lane_numbers, carriageways, synthetic, checksum: table.finish()?, place })
}

fn check_plausible(
    table: &CsvTable,
    column: CsvColumn,
    quantity: Quantity,
    value: f64,
    doubts: &mut Doubts,
) -> Result<()> {
    let judged = doubts.check(quantity, value, || table.field(column).to_string());
    judged.map_err(|problem| table.bad(column, problem, HELP.as_str()))
}

fn yes_or_no(table: &CsvTable, column: CsvColumn) -> Result<bool> {
    match table.text(column)?.to_ascii_lowercase().as_str() {
        "1" | "true" | "yes" => Ok(true),
        "" | "0" | "false" | "no" => Ok(false),
        _ => Err(table.bad(column, format!("{} is neither 1 nor 0", table.shown(column)), "write 1 or 0")),
    }
}

fn frames_per_second(table: &CsvTable, column: CsvColumn) -> Result<f64> {
    let frame_rate_hz = table.real(column)?;
    if FRAME_RATES_HZ.contains(&frame_rate_hz) {
        return Ok(frame_rate_hz);
    }
    let (found, min, max) = (table.shown(column), FRAME_RATES_HZ.start(), FRAME_RATES_HZ.end());
    let problem = format!("{found} is not a frame rate; expected between {min} and {max} frames per second");
    Err(table.bad(column, problem, "give the number of frames per second (highD: 25)"))
}

/// Lane lines of the image, from top to bottom, as a carriageway.
fn carriageway(direction: Direction, lines_y: &[f64]) -> Carriageway {
    let mut lane_lines_m: Vec<f64> = lines_y.iter().map(|&y| direction.leftward(y)).collect();
    // Leftmost first, so in reverse order of the image for travel against x.
    if direction == Direction::Upper {
        lane_lines_m.reverse();
    }
    Carriageway { name: direction.name().to_owned(), lane_lines_m }
}

const MARKINGS_HELP: &str =
    "give the y of the lane lines in metres from top to bottom, separated by semicolons, such as 8.51;12.59;16.43";

/// The lane lines of one cell, from top to bottom; none for an empty cell.
fn markings(table: &CsvTable, column: CsvColumn) -> Result<Vec<f64>> {
    let text = table.text(column)?;
    if text.is_empty() {
        return Ok(Vec::new());
    }
    let bad = |problem: String| table.bad(column, problem, MARKINGS_HELP);
    let mut lines: Vec<f64> = Vec::new();
    for part in text.trim_end_matches(';').split(';') {
        let line = number::real(part.as_bytes())
            .filter(|line| line.abs() <= number::REAL_LIMIT)
            .ok_or_else(|| bad(format!("the lane line {} is not a finite number", quoted(part))))?;
        if let Some(&above) = lines.last()
            && line <= above
        {
            return Err(bad(format!("the lane lines do not ascend: {line} comes after {above}")));
        }
        lines.push(line);
    }
    if lines.len() < 2 || lines.len() > LANE_LINES_LIMIT {
        let count = lines.len();
        return Err(bad(format!("{count} lane line(s); expected 2 to {LANE_LINES_LIMIT}, or none without traffic")));
    }
    Ok(lines)
}

/// Reads `tracksMeta`: the vehicles, ascending by id.
pub(super) fn read_tracks_meta(
    files: &HighdFiles,
    recording: &RecordingMeta,
    doubts: &mut Doubts,
) -> Result<(Vec<VehicleMeta>, FileChecksum)> {
    let mut table = CsvTable::open(&files.tracks_meta, TRACKS_META_HEADER)?;
    let columns = MetaColumns::of(&table)?;
    let mut vehicles: Vec<(VehicleMeta, Place)> = Vec::new();
    while table.next_row()? {
        let vehicle = columns.vehicle(&table, recording)?;
        let ([_, length, width, ..], Track { length_m, width_m, .. }) = (columns.needed, &vehicle.track);
        check_plausible(&table, length, Quantity::Length, *length_m, doubts)?;
        check_plausible(&table, width, Quantity::Width, *width_m, doubts)?;
        doubts.check_shape(*length_m, *width_m, || table.field(length).to_string());
        vehicles.push((vehicle, table.place()));
    }
    if vehicles.is_empty() {
        return Err(no_vehicle(&table));
    }
    // Stable, so that the error names the later one of two lines with one id.
    vehicles.sort_by_key(|(vehicle, _)| vehicle.track.id);
    if let Some([_, (vehicle, place)]) = vehicles.array_windows().find(|[(a, _), (b, _)]| a.track.id == b.track.id) {
        let problem = "an earlier line has the same id; expected one line per vehicle";
        let help = "remove the surplus line, or give the vehicle its own id in both files";
        return Err(Error::input(
            place.clone().column("id").of(format!("vehicle {}", vehicle.track.id)),
            problem,
            help,
        ));
    }
    Ok((vehicles.into_iter().map(|(vehicle, _)| vehicle).collect(), table.finish()?))
}

/// The error for a table without lines.
pub(super) fn no_vehicle(table: &CsvTable) -> Error {
    let problem = "the recording has no vehicle: no line follows the header";
    let help = "remove the three files of this recording from the folder, or copy them again";
    Error::input(table.file_place(), problem, help)
}

struct MetaColumns {
    /// `id`, length, width, `class`, `drivingDirection`.
    needed: [CsvColumn; 5],
    samples: Option<CsvColumn>,
    first_and_last_frame: Option<(CsvColumn, CsvColumn)>,
}

impl MetaColumns {
    fn of(table: &CsvTable) -> Result<Self> {
        Ok(MetaColumns {
            // The box belongs to the image: its width is the vehicle's length.
            needed: table.columns(["id", "width", "height", "class", "drivingDirection"])?,
            samples: table.optional_column("numFrames")?,
            first_and_last_frame: table.optional_column("initialFrame")?.zip(table.optional_column("finalFrame")?),
        })
    }

    fn vehicle(&self, table: &CsvTable, recording: &RecordingMeta) -> Result<VehicleMeta> {
        let [id_column, length, width, class_column, direction_column] = self.needed;
        let id = table.integer(id_column)?;
        let id = u32::try_from(id).map_err(|_| {
            table.bad(id_column, format!("{id} is not a vehicle id; expected 0 to {}", u32::MAX), "correct the id")
        })?;
        let number = table.integer(direction_column)?;
        let direction = Direction::BOTH.into_iter().find(|of| *of as i64 + 1 == number).ok_or_else(|| {
            let found = table.shown(direction_column);
            let problem = format!("{found} is not a driving direction; expected 1 (upper lanes) or 2 (lower lanes)");
            table.bad(direction_column, problem, "correct the value")
        })?;
        let carriageway = recording.carriageway(direction).ok_or_else(|| {
            let place = recording.place.clone().column(direction.markings_column());
            let driven = format!("vehicle {id} drives in direction {}", direction.name());
            Error::input(place, format!("the lane lines are missing, but {driven}"), MARKINGS_HELP)
        })?;
        let class = class(table, class_column)?;
        let (length_m, width_m) = (table.positive(length)?, table.positive(width)?);
        Ok(VehicleMeta {
            track: Track { id, class, length_m, width_m, carriageway, ..Track::default() },
            last_second_mps2: 0.0,
            direction,
            samples: self.samples(table)?,
            first_frame: self.first_and_last_frame.map(|(first, _)| table.integer(first)).transpose()?,
        })
    }

    /// Number of lines of the vehicle in `tracks`: as given, or from its first and last frame.
    fn samples(&self, table: &CsvTable) -> Result<Option<u64>> {
        let (column, count) = match (self.samples, self.first_and_last_frame) {
            (Some(column), _) => (column, table.integer(column)?),
            (None, Some((first, last))) => {
                (last, table.integer(last)?.saturating_sub(table.integer(first)?).saturating_add(1))
            }
            (None, None) => return Ok(None),
        };
        let bad = |_| table.bad(column, format!("{count} frames; expected no negative number"), "correct the value");
        u64::try_from(count).map(Some).map_err(bad)
    }
}

/// highD has `Car` and `Truck`; names of related formats are accepted too.
fn class(table: &CsvTable, column: CsvColumn) -> Result<VehicleClass> {
    match table.text(column)?.to_ascii_lowercase().as_str() {
        "car" | "van" | "motorcycle" => Ok(VehicleClass::Car),
        "truck" | "bus" | "trailer" => Ok(VehicleClass::Truck),
        _ => {
            let found = table.shown(column);
            let problem = format!("{found} is not a known class of vehicle; expected `Car` or `Truck`");
            Err(table.bad(column, problem, "write `Car` or `Truck`"))
        }
    }
}
