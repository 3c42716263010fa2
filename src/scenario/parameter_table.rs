//! Concrete cases in a table, one a row, with the names of `simulate`'s flags as columns; made into scenarios by
//! sampling their motions.

use serde_json::{Map, Value};

use super::case_parameters::{CaseParameters, at_least};
use super::check::name;
use super::columns::{Chosen, HELP, choose, number};
use super::found::{ScenarioFile, ScenariosRead};
use super::{Category, Ego, Lateral, Other, PlainCase, Scenario, Side, Speed};
use crate::support::error::{Error, Place, Result};
use crate::support::plausibility::{Doubts, Implausible};
use crate::support::table::{Named, Row, TableReader};

/// Columns and their units.
const COLUMNS: [(&str, &str); 17] = [
    ("id", ""),
    ("category", ""),
    ("model", ""),
    ("ego_speed", "m/s"),
    ("speed", "m/s"),
    ("gap", "m"),
    ("thw", "s"),
    ("lateral_speed", "m/s"),
    ("lateral_distance", "m"),
    ("acceleration", "m/s²"),
    ("end_speed", "m/s"),
    ("ahead_speed", "m/s"),
    ("ahead_gap", "m"),
    ("length", "m"),
    ("width", "m"),
    ("duration", "s"),
    ("rate", "Hz"),
];

/// Default sizes of vehicles: those of all profiles that come with the program, m.
const LENGTH_M: f64 = 4.3;
const WIDTH_M: f64 = 1.9;
/// Default samples per second.
const RATE_HZ: f64 = 25.0;
/// Default minimum duration of a scenario, s.
const MIN_DEFAULT_DURATION_S: f64 = 1.0;
/// Maximum duration, s: the time cap of the paper's profile.
const MAX_CASE_DURATION_S: f64 = 120.0;
/// Samples of all scenarios of a table, and more for each of its rows, so that a small table cannot demand any memory.
const MAX_SAMPLES: f64 = (2 << 20) as f64;
const MAX_SAMPLES_PER_ROW: f64 = 128.0;

/// A row's number, and its fields or what is wrong with them.
type NumberedRow = (u64, Result<Map<String, Value>>);

/// A row of parameters: names without units as keys, numbers in the units of [`COLUMNS`].
pub(crate) struct ParameterRows {
    table: TableReader,
    chosen: Vec<Chosen>,
}

impl ParameterRows {
    /// # Errors
    /// As [`choose`], for every column that is not known.
    pub fn new(mut table: TableReader) -> Result<ParameterRows> {
        let known = COLUMNS.map(|(name, unit)| Named { name: name.to_owned(), unit });
        let chosen = choose(&mut table, &known, |at| at, false)?;
        Ok(ParameterRows { table, chosen })
    }

    /// The next row, or what is wrong with it; fields that are empty are left out.
    ///
    /// # Errors
    /// As [`TableReader::next_row`].
    pub fn next_row(&mut self) -> Result<Option<NumberedRow>> {
        let Some(row) = self.table.next_row()? else { return Ok(None) };
        Ok(Some((row.number, self.typed(row))))
    }

    fn typed(&self, Row { number: row, values }: Row) -> Result<Map<String, Value>> {
        let mut map = Map::new();
        for (column, value) in self.chosen.iter().zip(values) {
            let (key, unit) = COLUMNS[column.field];
            let value = match (unit, value) {
                (_, Value::Null) => continue,
                ("", Value::Number(number)) => Value::from(number.to_string()),
                ("", value) => value,
                (_, value) => number(value, column.divisor),
            };
            let (is_right, expected) =
                if unit.is_empty() { (value.is_string(), "a text") } else { (value.is_number(), "a number") };
            if !is_right {
                let problem = format!("is {value}; expected {expected}");
                return Err(Error::input(self.table.place(row, None).column(&column.column), problem, HELP));
            }
            map.insert(key.to_owned(), value);
        }
        Ok(map)
    }

    /// An error about a value, with file, row and column.
    pub fn at_row(&self, row: u64, error: Error) -> Error {
        let Error::Usage { place, problem, help } = error else { return error };
        Error::input(self.place(row, &place.item.unwrap_or_default(), None), problem, help)
    }

    /// A value of a row, with its column as the file names it.
    fn place(&self, row: u64, key: &str, item: Option<String>) -> Place {
        let is = |column: &&Chosen| COLUMNS[column.field].0 == key;
        let column = self.chosen.iter().find(is).map_or(key, |column| &column.column);
        self.table.place(row, item).column(column)
    }
}

/// Every row as a scenario.
pub(super) fn read(table: TableReader, implausible: Implausible) -> Result<ScenarioFile> {
    let header = table.header();
    let mut rows = ParameterRows::new(table)?;
    if rows.chosen.iter().all(|column| COLUMNS[column.field].0 != "category") {
        return Err(Error::input(header, "no column `category`: this is not a table of scenarios", HELP));
    }
    let mut found = ScenariosRead::new(implausible, "rename one of the two; rows of one scenario must be adjacent");
    let mut samples = 0.0;
    while let Some((row, map)) = rows.next_row()? {
        let count = found.count();
        if samples > MAX_SAMPLES + MAX_SAMPLES_PER_ROW * count as f64 {
            let problem = format!("the scenarios above have {samples} samples, too many for this number of rows");
            let help = "give shorter scenarios (`duration_s`) or a lower `rate_hz`, or make several tables";
            return Err(Error::input(rows.table.place(row, None).column("duration_s"), problem, help));
        }
        let mut doubts = found.doubts();
        let place = |key: &str| rows.place(row, key, None).to_string();
        let scenario = map.and_then(|map| {
            of_row(&map, count + 1, &mut samples, &mut doubts, &place).map_err(|error| rows.at_row(row, error))
        });
        match scenario {
            Err(error) => found.refuse(error),
            Ok(scenario) => {
                found.add_doubts(doubts);
                let item = Some(name(&scenario.id));
                found.take(scenario, row, rows.table.word(), |field| rows.place(row, key_of(field), item.clone()));
            }
        }
    }
    found.finish(header, HELP)
}

/// The column that a field of the scenario comes from.
fn key_of(field: &str) -> &str {
    match field.split('[').next().unwrap_or(field) {
        "ego.v0" => "ego_speed",
        "target.v" if field.ends_with("[0]") => "speed",
        "target.v" => "acceleration",
        "target.y" => "lateral_speed",
        "lead.v" => "ahead_speed",
        "ego.length" | "target.length" | "lead.length" => "length",
        "ego.width" | "target.width" | "lead.width" => "width",
        "gap0" => "gap",
        "thw0" => "thw",
        "D" => "ahead_gap",
        "fps" => "rate",
        other => other,
    }
}

fn of_row(
    map: &Map<String, Value>,
    row: u64,
    samples: &mut f64,
    doubts: &mut Doubts,
    place: &dyn Fn(&str) -> String,
) -> Result<Scenario> {
    let text = |key: &str| map.get(key).and_then(Value::as_str).map(str::to_owned);
    let value = |key: &str| map.get(key).and_then(Value::as_f64);
    let mut parameters = CaseParameters {
        category: text("category"),
        ego_speed: value("ego_speed"),
        speed: value("speed"),
        lateral_speed: value("lateral_speed"),
        lateral_distance: value("lateral_distance"),
        acceleration: value("acceleration"),
        end_speed: value("end_speed"),
        ahead_speed: value("ahead_speed"),
        ahead_gap: value("ahead_gap"),
        length: value("length"),
        width: value("width"),
    };
    parameters.settle(doubts, place);
    let plain = parameters.plain_case(LENGTH_M, WIDTH_M)?;
    let case = plain.case(MAX_CASE_DURATION_S)?;
    let in_range = |key: &str, default: f64, least: f64, most: f64| match value(key) {
        None => Ok(default),
        Some(value) if (least..=most).contains(&value) => Ok(value),
        Some(value) => {
            let help = format!("give a number of at least {least} and at most {most}");
            Err(Error::usage(Place::item(key), format!("{value} cannot be used"), help))
        }
    };
    let rate_hz = in_range("rate", RATE_HZ, 1.0, 1000.0)?;
    let duration_s = in_range("duration", case.horizon_s.max(MIN_DEFAULT_DURATION_S), 0.1, MAX_CASE_DURATION_S)?;
    let (gap0, thw0) = match (value("gap"), value("thw")) {
        (Some(_), Some(_)) => {
            return Err(Error::usage(
                Place::item("thw"),
                "both gap and time headway are given",
                "leave one of the two empty",
            ));
        }
        (Some(gap_m), None) => {
            let gap_m = at_least(gap_m, 0.0, "gap")?;
            (Some(gap_m), (plain.ego_speed_mps > 0.0).then(|| gap_m / plain.ego_speed_mps))
        }
        (None, Some(thw_s)) => {
            let thw_s = at_least(thw_s, 0.0, "thw")?;
            (Some(thw_s * plain.ego_speed_mps), Some(thw_s))
        }
        (None, None) => (None, None),
    };
    // Whole steps, so that the last sample is not before the end.
    let count = ((duration_s * rate_hz - 1e-9).ceil() + 1.0).max(2.0);
    *samples += count;
    let times_s: Vec<f64> = (0..count as u64).map(|k| k as f64 / rate_hz).collect();
    let other = |v: Vec<f64>, y: Vec<f64>| Other { length: plain.length_m, width: plain.width_m, v, y };
    let target = other(
        times_s.iter().map(|&t| speed_at(&case.principal.speed, t)).collect(),
        times_s.iter().map(|&t| lateral_at(&case.principal.lateral, t)).collect(),
    );
    let lead = case.ahead.as_ref().map(|ahead| {
        let speeds = times_s.iter().map(|&t| speed_at(&ahead.vehicle.speed, t)).collect();
        other(speeds, vec![0.0; times_s.len()])
    });
    let PlainCase { category, ego_speed_mps, .. } = plain;
    Ok(Scenario {
        id: text("id").unwrap_or_else(|| format!("row-{row}")),
        category,
        recording: String::new(),
        ego_id: 0,
        target_id: 0,
        lead_id: None,
        frame0: 0,
        frame1: times_s.len() as i64 - 1,
        fps: rate_hz,
        kept: true,
        reason: "parameters".to_owned(),
        ego: Ego { v0: ego_speed_mps, length: plain.length_m, width: plain.width_m },
        lane_width: 3.5,
        side: Side::Left,
        target,
        lead,
        thw0,
        gap0,
        lead_gap: (category == Category::CutOut).then_some(plain.ahead_gap_m),
        peak_decel: None,
        truncated_start: None,
        end_cause: None,
        frame_switch: None,
        tag_frames: None,
        synthetic: false,
    })
}

/// m/s.
fn speed_at(speed: &Speed, time_s: f64) -> f64 {
    match speed {
        Speed::Kinematic { initial_mps, acceleration_mps2, until_s } => {
            (initial_mps + acceleration_mps2 * time_s.min(*until_s)).max(0.0)
        }
        Speed::Sampled(series) => series.last().copied().unwrap_or(0.0),
    }
}

/// m, positive on the side that the vehicle comes from or leaves to.
fn lateral_at(lateral: &Lateral, time_s: f64) -> f64 {
    match lateral {
        Lateral::Centred => 0.0,
        Lateral::Kinematic { start_m, rate_mps, end_m } => {
            if time_s * rate_mps.abs() < (end_m - start_m).abs() {
                start_m + rate_mps * time_s
            } else {
                *end_m
            }
        }
        Lateral::Sampled { position_m, .. } => position_m.last().copied().unwrap_or(0.0),
    }
}
