//! The two small files of a recording: `recordingMeta` (frame rate, lane lines) and `tracksMeta`
//! (size, class and direction of each vehicle).

use super::columns::{Column, FileChecksum, Table};
use super::frame::{Direction, LaneNumbers};
use super::inventory::HighdFiles;
use crate::trajectory::{Carriageway, VehicleClass};
use crate::{Error, Result};

/// Frame rates outside this are mistakes (a period instead of a rate, for one), and the counts that
/// follow from them would not fit anywhere.
const FRAME_RATES_HZ: std::ops::RangeInclusive<f64> = 0.01..=10_000.0;

/// What `recordingMeta` says.
pub(super) struct RecordingMeta {
    pub frame_rate_hz: f64,
    pub lane_numbers: LaneNumbers,
    /// Those of the two carriageways that have lane lines.
    pub carriageways: Vec<Carriageway>,
    pub checksum: FileChecksum,
}

impl RecordingMeta {
    /// Index of a direction's carriageway; `None` without lane lines.
    pub fn carriageway(&self, direction: Direction) -> Option<usize> {
        let name = direction.number().to_string();
        self.carriageways.iter().position(|carriageway| carriageway.name == name)
    }
}

/// What `tracksMeta` says about one vehicle.
pub(super) struct Vehicle {
    pub id: u32,
    pub class: VehicleClass,
    pub length_m: f64,
    pub width_m: f64,
    pub direction: Direction,
    pub carriageway: usize,
    /// Number of lines it must have in `tracks`, where the file says so.
    pub samples: Option<u64>,
}

/// Reads `recordingMeta`.
pub(super) fn read_recording_meta(files: &HighdFiles) -> Result<RecordingMeta> {
    let mut table = Table::open(&files.recording_meta)?;
    let frame_rate = table.column("frameRate")?;
    let columns =
        [table.column(Direction::Upper.markings_column())?, table.column(Direction::Lower.markings_column())?];
    if !table.next_row()? {
        return Err(Error::input(
            table.file_place(),
            "the file has a header and no line; expected one line that describes the recording",
            "copy or export the file again",
        ));
    }
    let frame_rate_hz = table.positive(frame_rate)?;
    if !FRAME_RATES_HZ.contains(&frame_rate_hz) {
        return Err(table.bad(
            frame_rate,
            format!("{frame_rate_hz} frames per second is out of the range 0.01 to 10000"),
            "give the number of frames per second (highD: 25)",
        ));
    }
    let [upper, lower] = [markings(&table, columns[0])?, markings(&table, columns[1])?];
    if upper.is_empty() && lower.is_empty() {
        return Err(table.bad(
            columns[0],
            "neither this column nor `lowerLaneMarkings` holds lane lines; expected at least two in one of them",
            MARKINGS_HELP,
        ));
    }
    if let (Some(last_upper), Some(first_lower)) = (upper.last(), lower.first())
        && last_upper > first_lower
    {
        return Err(table.bad(
            columns[1],
            format!("the lower lane lines begin at {first_lower}, above the end of the upper ones at {last_upper}"),
            "y points down: the upper lane lines must have the smaller values",
        ));
    }
    if table.next_row()? {
        return Err(Error::input(
            table.place(),
            "a second line; expected only one, for this recording",
            "keep the line of this recording and remove the others",
        ));
    }
    let lane_numbers = LaneNumbers { upper_lines: upper.len(), lower_lines: lower.len() };
    let carriageways = [(Direction::Upper, upper), (Direction::Lower, lower)]
        .into_iter()
        .filter(|(_, lines)| !lines.is_empty())
        .map(|(direction, lines)| carriageway(direction, &lines))
        .collect();
    Ok(RecordingMeta { frame_rate_hz, lane_numbers, carriageways, checksum: table.finish() })
}

/// Lane lines of the image, from top to bottom, as a carriageway.
pub(super) fn carriageway(direction: Direction, lines_y: &[f64]) -> Carriageway {
    let mut lane_lines_m: Vec<f64> = lines_y.iter().map(|&y| direction.leftward(y)).collect();
    // Leftmost first: against the order of the image where the travel is against x.
    if direction == Direction::Upper {
        lane_lines_m.reverse();
    }
    Carriageway { name: direction.number().to_string(), lane_lines_m }
}

const MARKINGS_HELP: &str = "give the y of the lane lines from top to bottom, separated by `;`: 8.51;12.59;16.43";

/// The lane lines of one cell, from top to bottom; none for an empty cell.
fn markings(table: &Table, column: Column) -> Result<Vec<f64>> {
    let text = table.text(column)?;
    if text.is_empty() {
        return Ok(Vec::new());
    }
    let bad = |problem: String| table.bad(column, problem, MARKINGS_HELP);
    let mut lines: Vec<f64> = Vec::new();
    for part in text.trim_end_matches(';').split(';') {
        let line = super::number::real(part.as_bytes()).filter(|line| line.is_finite()).ok_or_else(|| {
            bad(format!("{} holds `{}`, which is not a finite number", table.shown(column), part.escape_debug()))
        })?;
        if let Some(&above) = lines.last()
            && line <= above
        {
            return Err(bad(format!("the lane lines do not ascend: {line} follows {above}")));
        }
        lines.push(line);
    }
    if lines.len() < 2 {
        return Err(bad(format!("{} is one lane line; expected at least two, or none", table.shown(column))));
    }
    if lines.len() > usize::from(u8::MAX) {
        return Err(bad(format!("{} lane lines; expected at most {}", lines.len(), u8::MAX)));
    }
    Ok(lines)
}

/// Reads `tracksMeta`: the vehicles, ascending by id.
pub(super) fn read_tracks_meta(files: &HighdFiles, recording: &RecordingMeta) -> Result<(Vec<Vehicle>, FileChecksum)> {
    let mut table = Table::open(&files.tracks_meta)?;
    let columns = MetaColumns::of(&table)?;
    let mut vehicles: Vec<(u64, Vehicle)> = Vec::new();
    while table.next_row()? {
        let vehicle = columns.vehicle(&table, recording, files)?;
        vehicles.push((table.rows() + 1, vehicle));
    }
    if vehicles.is_empty() {
        return Err(Error::input(
            table.file_place(),
            "the recording has no vehicle: the file has a header and no line",
            "remove the three files of this recording from the folder, or copy them again",
        ));
    }
    vehicles.sort_by_key(|(line, vehicle)| (vehicle.id, *line));
    if let Some(pair) = vehicles.windows(2).find(|pair| pair[0].1.id == pair[1].1.id) {
        return Err(Error::input(
            table.file_place().column("id").of(format!("vehicle {}", pair[0].1.id)),
            "two lines have this id; expected one line per vehicle",
            "remove the surplus line or give the vehicle an id of its own in both files",
        ));
    }
    Ok((vehicles.into_iter().map(|(_, vehicle)| vehicle).collect(), table.finish()))
}

struct MetaColumns {
    id: Column,
    length: Column,
    width: Column,
    class: Column,
    direction: Column,
    samples: Option<Column>,
}

impl MetaColumns {
    fn of(table: &Table) -> Result<Self> {
        Ok(MetaColumns {
            id: table.column("id")?,
            // highD's box is that of the image: its width is the vehicle's length.
            length: table.column("width")?,
            width: table.column("height")?,
            class: table.column("class")?,
            direction: table.column("drivingDirection")?,
            samples: table.optional_column("numFrames")?,
        })
    }

    fn vehicle(&self, table: &Table, recording: &RecordingMeta, files: &HighdFiles) -> Result<Vehicle> {
        let id = table.integer(self.id)?;
        let id = u32::try_from(id).map_err(|_| {
            table.bad(self.id, format!("{id} is out of the range of vehicle ids, 0 to 4294967295"), "correct the id")
        })?;
        let direction = Direction::from_number(table.integer(self.direction)?).ok_or_else(|| {
            table.bad(
                self.direction,
                format!(
                    "{} is no driving direction; expected 1 (upper lanes) or 2 (lower lanes)",
                    table.shown(self.direction)
                ),
                "correct the value",
            )
        })?;
        let carriageway = recording.carriageway(direction).ok_or_else(|| {
            Error::input(
                crate::Place::file(&files.recording_meta).row(2).column(direction.markings_column()),
                format!("the lane lines are missing, but vehicle {id} drives in direction {}", direction.number()),
                MARKINGS_HELP,
            )
        })?;
        let samples = self.samples.map(|column| {
            let count = table.integer(column)?;
            u64::try_from(count).map_err(|_| table.bad(column, format!("{count} is negative"), "correct the value"))
        });
        Ok(Vehicle {
            id,
            class: class(table, self.class)?,
            length_m: table.positive(self.length)?,
            width_m: table.positive(self.width)?,
            direction,
            carriageway,
            samples: samples.transpose()?,
        })
    }
}

/// highD knows `Car` and `Truck`; the names its sibling formats use are understood too.
fn class(table: &Table, column: Column) -> Result<VehicleClass> {
    match table.text(column)?.to_ascii_lowercase().as_str() {
        "car" | "van" | "motorcycle" => Ok(VehicleClass::Car),
        "truck" | "bus" | "trailer" => Ok(VehicleClass::Truck),
        _ => Err(table.bad(
            column,
            format!("{} is no known class of vehicle; expected `Car` or `Truck`", table.shown(column)),
            "write `Car` or `Truck`",
        )),
    }
}
