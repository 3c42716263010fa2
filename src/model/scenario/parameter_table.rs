//! Concrete cases in a table, one per row, with the names of `simulate`'s flags as columns. Their motions are sampled
//! to obtain scenarios.

use serde_json::Value;

use super::case_parameters::{CaseParameters, NamedNumber};
use super::case_quantity::{CaseNumber, CaseQuantity, KMH, NUMBERS};
use super::check::{DURATIONS_S, name};
use super::columns::{Chosen, HELP, choose};
use super::found::{ScenarioFile, ScenariosRead};
use super::table_reader::refuse_tracks;
use super::units::{Written, si};
use super::{Category, Ego, Lateral, Other, PlainCase, Scenario, Speed};
use crate::plausibility::{Doubts, HELP as IMPLAUSIBLE, Implausible, Quantity};
use lanesweep_support::error::{Error, Place, Result};
use lanesweep_support::readable;
use lanesweep_support::table::{Named, Row, TableReader};

/// Columns that are texts; those of the numbers of a case follow, then [`RATE`].
const TEXTS: [&str; 3] = ["id", "category", "models"];
const RATE: &str = "rate";

/// All columns, in the order of [`Chosen::field`].
fn columns() -> Vec<Named> {
    let plain = |name: &str, unit| Named { name: name.to_owned(), unit, needs_unit: false };
    let texts = TEXTS.map(|name| plain(name, ""));
    texts.into_iter().chain(NUMBERS.iter().map(CaseNumber::named)).chain([plain(RATE, "Hz")]).collect()
}

/// The key of a column.
fn key(field: usize) -> &'static str {
    let number = || NUMBERS.get(field - TEXTS.len()).map(|number| number.key);
    TEXTS.get(field).copied().or_else(number).unwrap_or(RATE)
}

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

/// A row of a table of cases.
#[derive(Debug, Clone, Default)]
pub struct CaseRow {
    /// Its key.
    pub id: Option<String>,
    /// Driver models, as `--models` lists them.
    pub models: Option<String>,
    /// The numbers of the case.
    pub parameters: CaseParameters,
    /// Samples per second, for a scenario made of it.
    rate_hz: Option<f64>,
}

/// A row's number, and its fields or its error, which names the place.
type NumberedRow = (u64, Result<CaseRow>);

/// The rows of a table of cases.
pub struct ParameterRows {
    table: TableReader,
    chosen: Vec<Chosen>,
    /// Speeds so far, by [`CaseQuantity`].
    speeds: [Speeds; NUMBERS.len()],
}

/// Speeds of a column: minimum, second largest, and maximum with its row, m/s.
type Speeds = (f64, f64, f64, u64);

/// Speed from which a single one of a column is compared with the others, m/s: 180 km/h.
const MIN_ODD_MPS: f64 = 50.0;

impl ParameterRows {
    /// # Errors
    /// As `choose`, for every unknown column.
    pub fn new(mut table: TableReader) -> Result<ParameterRows> {
        refuse_tracks(&table)?;
        let chosen = choose(&mut table, &columns(), |at| at, false)?;
        Ok(ParameterRows { table, chosen, speeds: [(f64::INFINITY, 0.0, 0.0, 0); NUMBERS.len()] })
    }

    /// Warnings about the columns of the rows so far.
    pub fn notes(&self) -> Vec<String> {
        let sentence = |(number, &(min, second, max, row)): (&CaseNumber, &Speeds)| {
            // The others are like it in km/h, and it exceeds them all by half.
            let is_odd = max >= MIN_ODD_MPS && max > 1.5 * second && (min..=second).contains(&(max / KMH));
            let (place, [max, second, other]) =
                (self.row_place(row).of(number.key), [max, second, max / KMH].map(readable::value));
            let text = format!("{place}: {max} m/s, but the others are up to {second} m/s: in km/h it is {other} m/s");
            (is_odd && number.needs_unit()).then_some(text)
        };
        NUMBERS.iter().zip(&self.speeds).filter_map(sentence).collect()
    }

    /// Returns the next row or its error; empty fields are skipped. A row with too many or too few fields is one error,
    /// and the next rows follow.
    ///
    /// # Errors
    /// As [`TableRows::next_row`](lanesweep_support::table::TableRows::next_row).
    pub fn next_row(&mut self) -> Result<Option<NumberedRow>> {
        match self.table.rows.next_row() {
            Ok(row) => Ok(row.map(|row| (row.number, self.typed(row)))),
            Err(Error::Input { place, problem, help }) if place.row.is_some() => {
                Ok(place.row.map(|row| (row, Err(Error::Input { place, problem, help }))))
            }
            Err(error) => Err(error),
        }
    }

    fn typed(&mut self, Row { number: row, values }: Row) -> Result<CaseRow> {
        let mut case = CaseRow::default();
        for (column, value) in self.chosen.iter().zip(values).filter(|(_, value)| !value.is_null()) {
            case.set(column, &value).map_err(|error| self.row_place(row).locate(error))?;
        }
        for ((min, second, max, at), mps) in self.speeds.iter_mut().zip(case.parameters.numbers) {
            let Some(mps) = mps else { continue };
            (*min, *second) = (min.min(mps), second.max(mps.min(*max)));
            if mps > *max {
                (*max, *at) = (mps, row);
            }
        }
        Ok(case)
    }

    /// The word for counting rows.
    pub fn word(&self) -> &'static str {
        self.table.word()
    }

    /// The place of a row's values.
    pub fn row_place(&self, row: u64) -> RowPlace {
        let column = |column: &Chosen| (key(column.field), column.column.clone());
        RowPlace {
            row: self.table.place(row, None),
            columns: self.chosen.iter().map(column).collect(),
            replaced: Vec::new(),
        }
    }
}

impl CaseRow {
    /// Sets the value of a column; errors name its key.
    fn set(&mut self, column: &Chosen, value: &Value) -> Result<()> {
        let key = key(column.field);
        let wrong = |problem: String, help: String| Err(Error::usage(Place::item(key), problem, help));
        let written = match value {
            Value::String(text) => Some(Written::Text(text)),
            value => value.as_f64().map(Written::Number),
        };
        match (TEXTS.contains(&key), value, written) {
            (true, Value::String(_) | Value::Number(_), _) => {
                let text = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
                *match key {
                    "id" => &mut self.id,
                    "models" => &mut self.models,
                    _ => &mut self.parameters.category,
                } = Some(text);
            }
            (false, _, Some(written)) if key == RATE => {
                let (min, max) = RATES_HZ;
                match si(written, "Hz", column.unit) {
                    Ok(rate_hz) if (min..=max).contains(&rate_hz) => self.rate_hz = Some(rate_hz),
                    Ok(rate_hz) => {
                        let help = format!("give a number of at least {min} and at most {max}");
                        return wrong(format!("{rate_hz} cannot be used"), help);
                    }
                    Err(unusable) => return wrong(unusable.problem.clone(), unusable.help(key)),
                }
            }
            (false, _, Some(written)) => {
                NamedNumber::at(column.field - TEXTS.len(), column.unit).set(&mut self.parameters, written)?;
            }
            (is_text, ..) => {
                let expected = if is_text { "a text" } else { "a number" };
                return wrong(format!("is {value}; expected {expected}"), HELP.to_owned());
            }
        }
        Ok(())
    }
}

/// The place of a row's values: file, line, and the columns as the file names them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RowPlace {
    row: Place,
    columns: Vec<(&'static str, String)>,
    /// Columns whose values have been replaced.
    replaced: Vec<&'static str>,
}

impl RowPlace {
    /// The place of a value.
    pub fn of(&self, key: &str) -> Place {
        if self.replaced.contains(&key) {
            return Place::item(key);
        }
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

/// Reads every row as a scenario.
pub(super) fn read(table: TableReader, implausible: Implausible) -> Result<ScenarioFile> {
    let header = table.header();
    let mut rows = ParameterRows::new(table)?;
    if rows.chosen.iter().all(|column| key(column.field) != "category") {
        return Err(Error::input(header, "no column `category`: this is not a table of scenarios", HELP));
    }
    let mut found = ScenariosRead::new(implausible, "rename one of the two; rows of one scenario must be adjacent");
    let mut samples = 0.0;
    while let Some((row, case)) = rows.next_row()? {
        let count = found.count();
        if samples > MAX_SAMPLES + MAX_SAMPLES_PER_ROW * count as f64 {
            let problem = format!("the scenarios above have {samples} samples, too many for this number of rows");
            let help = "give shorter scenarios (`duration_s`) or a lower `rate_hz`, or make several tables";
            return Err(Error::input(rows.table.place(row, None).column("duration_s"), problem, help));
        }
        let mut doubts = found.doubts.another();
        let at = rows.row_place(row);
        let place = |key: &str| at.of(key).to_string();
        let scenario = case.and_then(|case| {
            of_row(case, count + 1, &mut samples, &mut doubts, &place).map_err(|error| at.locate(error))
        });
        match scenario {
            Err(error) => found.refuse(error),
            Ok(scenario) => {
                let item = name(&scenario.id);
                let place = |field: &str| at.of_scenario(key_of(field), &item);
                found.take(scenario, Some(doubts), row, rows.table.word(), place);
            }
        }
    }
    let mut file = found.finish(header, HELP)?;
    file.notes.extend(rows.notes());
    Ok(file)
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
    CaseRow { id, mut parameters, rate_hz, .. }: CaseRow,
    row: u64,
    samples: &mut f64,
    doubts: &mut Doubts,
    place: &dyn Fn(&str) -> String,
) -> Result<Scenario> {
    let plain = parameters.checked_case([LENGTH_M, WIDTH_M], DURATIONS_S.1, doubts, place)?;
    let case = plain.case(DURATIONS_S.1)?;
    let rate_hz = rate_hz.unwrap_or(RATE_HZ);
    let is_rate = doubts.check(Quantity::Rate, rate_hz, || place(RATE));
    is_rate.map_err(|problem| Error::usage(Place::item(RATE), problem, IMPLAUSIBLE.as_str()))?;
    let duration_s = plain.duration_s.unwrap_or(case.horizon_s.max(MIN_DEFAULT_DURATION_S));
    let (gap0, thw0) = (parameters[CaseQuantity::Gap], parameters[CaseQuantity::Thw]);
    let of_headway = thw0.map(|thw_s| thw_s * plain.ego_speed_mps);
    let of_gap = gap0.filter(|_| plain.ego_speed_mps > 0.0).map(|gap_m| gap_m / plain.ego_speed_mps);
    let (gap0, thw0) = (gap0.or(of_headway), thw0.or(of_gap));
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
        id: id.unwrap_or_else(|| format!("row-{row}")),
        category,
        frame1: times_s.len() as i64 - 1,
        fps: rate_hz,
        kept: true,
        reason: "parameters".to_owned(),
        ego: Ego { v0: ego_speed_mps, length: plain.ego_length_m, width: plain.ego_width_m },
        lane_width: plain.lane_width_m,
        target,
        lead,
        thw0,
        gap0,
        lead_gap: (category == Category::CutOut).then_some(plain.ahead_gap_m),
        ..Scenario::default()
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
