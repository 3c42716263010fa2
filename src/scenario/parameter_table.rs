//! Concrete cases in a table, one per row, with the names of `simulate`'s flags as columns. Their motions are sampled
//! to obtain scenarios.

use serde_json::{Map, Value};

use super::case_parameters::{CaseParameters, DURATIONS_S};
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
    ("models", ""),
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

/// Default vehicle sizes, m: those of all shipped profiles.
const LENGTH_M: f64 = 4.3;
const WIDTH_M: f64 = 1.9;
/// Default samples per second.
const RATE_HZ: f64 = 25.0;
/// Default minimum duration of a scenario, s.
const MIN_DEFAULT_DURATION_S: f64 = 1.0;
/// Minimum and maximum samples per second.
const RATES_HZ: (f64, f64) = (1.0, 1000.0);
/// Maximum number of samples for all scenarios of a table, plus an allowance per row, so that a small table cannot
/// demand unlimited memory.
const MAX_SAMPLES: f64 = (2 << 20) as f64;
const MAX_SAMPLES_PER_ROW: f64 = 128.0;

/// A row's number, and its fields or its error.
type NumberedRow = (u64, Result<Map<String, Value>>);

/// A row of parameters: names without units as keys, numbers in the units of [`COLUMNS`].
pub(crate) struct ParameterRows {
    table: TableReader,
    chosen: Vec<Chosen>,
}

impl ParameterRows {
    /// # Errors
    /// As [`choose`], for every unknown column.
    pub fn new(mut table: TableReader) -> Result<ParameterRows> {
        let known = COLUMNS.map(|(name, unit)| Named { name: name.to_owned(), unit });
        let chosen = choose(&mut table, &known, |at| at, false)?;
        Ok(ParameterRows { table, chosen })
    }

    /// Returns the next row or its error; empty fields are skipped.
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
            let (min, max) = RATES_HZ;
            if key == "rate" && !value.as_f64().is_some_and(|rate_hz| (min..=max).contains(&rate_hz)) {
                let help = format!("give a number of at least {min} and at most {max}");
                return Err(Error::input(
                    self.table.place(row, None).column(&column.column),
                    format!("{value} cannot be used"),
                    help,
                ));
            }
            map.insert(key.to_owned(), value);
        }
        Ok(map)
    }

    /// The place of a row's values.
    pub fn row_place(&self, row: u64) -> RowPlace {
        let column = |column: &Chosen| (COLUMNS[column.field].0, column.column.clone());
        RowPlace {
            row: self.table.place(row, None),
            columns: self.chosen.iter().map(column).collect(),
            replaced: Vec::new(),
        }
    }
}

/// The place of a row's values: file, line, and the columns as the file names them.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct RowPlace {
    row: Place,
    columns: Vec<(&'static str, String)>,
    /// Columns whose values have been replaced.
    replaced: Vec<&'static str>,
}

impl RowPlace {
    /// The place of a value.
    fn of(&self, key: &str) -> Place {
        let column = self.columns.iter().find(|(known, _)| *known == key).map_or(key, |(_, column)| column);
        self.row.clone().column(column)
    }

    /// The place of a value, with the scenario that the row became.
    fn of_scenario(&self, key: &str, item: &str) -> Place {
        let place = self.of(key);
        // For Parquet, the item names the row.
        let item = place.item.as_ref().map_or(item.to_owned(), |row| format!("{row}, {item}"));
        place.of(item)
    }

    /// The same without columns whose values are replaced.
    pub fn without(mut self, keys: &[&'static str]) -> RowPlace {
        self.replaced.extend(keys);
        self
    }

    /// Adds file, row and column to an error about a value.
    pub fn locate(&self, error: Error) -> Error {
        match error {
            Error::Usage { place, problem, help } => match &place.item {
                Some(key) if !self.replaced.contains(&key.as_str()) => Error::input(self.of(key), problem, help),
                _ => Error::Usage { place, problem, help },
            },
            other => other,
        }
    }
}

/// The case parameters of a row.
fn parameters(row: &Map<String, Value>) -> Result<CaseParameters> {
    serde_json::from_value(Value::Object(row.clone())).map_err(|e| Error::Internal(format!("a row of a table: {e}")))
}

/// Reads every row as a scenario.
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
        let at = rows.row_place(row);
        let place = |key: &str| at.of(key).to_string();
        let scenario = map.and_then(|map| {
            of_row(&map, count + 1, &mut samples, &mut doubts, &place).map_err(|error| at.locate(error))
        });
        match scenario {
            Err(error) => found.refuse(error),
            Ok(scenario) => {
                found.add_doubts(doubts);
                let item = name(&scenario.id);
                found.take(scenario, row, rows.table.word(), |field| at.of_scenario(key_of(field), &item));
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
    let mut parameters = parameters(map)?;
    parameters.settle(doubts, place);
    let plain = parameters.plain_case(LENGTH_M, WIDTH_M)?;
    let case = plain.case(DURATIONS_S.1)?;
    let rate_hz = map.get("rate").and_then(Value::as_f64).unwrap_or(RATE_HZ);
    let duration_s = plain.duration_s.unwrap_or(case.horizon_s.max(MIN_DEFAULT_DURATION_S));
    let of_headway = parameters.thw.map(|thw_s| thw_s * plain.ego_speed_mps);
    let of_gap = parameters.gap.filter(|_| plain.ego_speed_mps > 0.0).map(|gap_m| gap_m / plain.ego_speed_mps);
    let (gap0, thw0) = (parameters.gap.or(of_headway), parameters.thw.or(of_gap));
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
        replays: Vec::new(),
    })
}

/// Speed at a time, m/s.
fn speed_at(speed: &Speed, time_s: f64) -> f64 {
    match speed {
        Speed::Kinematic { initial_mps, acceleration_mps2, until_s } => {
            (initial_mps + acceleration_mps2 * time_s.min(*until_s)).max(0.0)
        }
        Speed::Sampled(series) => series.last().copied().unwrap_or(0.0),
    }
}

/// Lateral position at a time, m, positive on the side that the vehicle comes from or leaves to.
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
