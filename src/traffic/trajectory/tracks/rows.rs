//! Rows of track files: delimited text, Parquet, XML and JSON give the same cells. A row is one sample, or one vehicle
//! whose cells are lists.

use std::borrow::Cow;
use std::cell::Cell;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::markup::{each_element, json_rows};
use super::preset::{FileFormat, Preset};
use super::roles::{ColumnName, Role};
use crate::support::table::{Cell as TableCell, TableFormat, TableReader};
use crate::traffic::trajectory::csv_table::{CsvColumn, CsvFormat, CsvTable, FileChecksum};
use crate::traffic::trajectory::number;
use crate::{Error, Place, Result};

/// Rows of an XML file whose attributes are its columns.
const XML_HEADER_ROWS: usize = 1000;
/// Columns by role: position in the rows, and the factor to SI units.
#[derive(Debug, Clone)]
pub(super) struct Columns {
    at: [Option<(usize, f64)>; Role::ALL.len()],
    names: Vec<String>,
    /// The preset names a unit of times that is a number: no text is a time.
    has_time_unit: bool,
    /// What times were found to be, where no unit tells.
    found_time: Cell<Option<FoundTime>>,
    none: Vec<String>,
    /// Those that are numbers, so that few numbers need be compared as texts.
    none_numbers: Vec<f64>,
}

/// What times without a unit are, by their size or their text, in words after the name of the column.
pub(super) type FoundTime = &'static str;
/// `08:15:30.25`: it begins again at midnight.
pub(super) const TIME_OF_DAY: FoundTime = "time of day";
const DATES: FoundTime = "dates";

/// What a time of this size is, and its factor to seconds; `None` for seconds. No recording is from the year 5138 or later.
fn unit_of_time(value: f64) -> Option<(FoundTime, f64)> {
    match value.abs() {
        1e11..1e14 => Some(("ms since 1970", 1e-3)),
        1e14..1e17 => Some(("µs since 1970", 1e-6)),
        1e17..1e19 => Some(("ns since 1970", 1e-9)),
        _ => None,
    }
}

/// Seconds of a text, and what it is.
fn time_of_text(text: &str) -> Option<(FoundTime, f64)> {
    let text = text.replace(',', ".");
    if let Some(seconds) = seconds_of_date(&text) {
        return Some((DATES, seconds));
    }
    let parts: Option<Vec<f64>> =
        text.split(':').map(|part| part.parse().ok().filter(|value: &f64| *value >= 0.0)).collect();
    // SUMO writes `0:08:15:30.25`, with days.
    let (found, [days, hours, minutes, seconds]) = match parts?[..] {
        [hours, minutes, seconds] => (TIME_OF_DAY, [0.0, hours, minutes, seconds]),
        [days, hours, minutes, seconds] => ("days:hours:minutes:seconds", [days, hours, minutes, seconds]),
        _ => return None,
    };
    let is_usual = hours.fract() == 0.0 && minutes.fract() == 0.0 && hours < 24.0 && minutes < 60.0 && seconds < 61.0;
    let of_day = 3600.0 * hours + 60.0 * minutes + seconds;
    is_usual.then_some((found, 86_400.0 * days + of_day))
}

impl Columns {
    /// Finds the columns in a header; absent ones are left out.
    pub(super) fn of(named: &BTreeMap<Role, ColumnName>, header: &[String], none: &[String]) -> Columns {
        let mut at = [None; Role::ALL.len()];
        let mut has_time_unit = false;
        let names = named.values().flat_map(ColumnName::names);
        let mut by_letters: HashMap<String, Option<usize>> = names.map(|name| (letters(name), None)).collect();
        let mut column_letters = String::new();
        for (at, column) in header.iter().enumerate() {
            column_letters.clear();
            column_letters.extend(each_letter(column));
            if let Some(position @ None) = by_letters.get_mut(&column_letters) {
                *position = Some(at);
            }
        }
        for (role, column) in named {
            let place = column.names().iter().find_map(|name| by_letters[&letters(name)]);
            at[*role as usize] = place.zip(column.factor(*role));
            has_time_unit |= *role == Role::Time
                && (column.unit().is_some_and(|unit| unit != "date") || column.factor(*role) != Some(1.0));
        }
        let none_numbers = none.iter().filter_map(|text| text.parse().ok()).collect();
        let found_time = Cell::new(None);
        Columns { at, names: header.to_vec(), has_time_unit, found_time, none: none.to_vec(), none_numbers }
    }

    /// What times without a unit were found to be.
    pub(super) fn found_time(&self) -> Option<FoundTime> {
        self.found_time.get()
    }

    /// Whether a number with this text stands for no value: `-1.0` is a number where `-1` does.
    fn is_none_number(&self, value: f64, text: impl FnOnce() -> String) -> bool {
        self.none_numbers.contains(&value) && self.is_none(&text())
    }

    /// A number of the file in SI units.
    fn si(&self, value: f64, role: Role, place: &dyn Fn() -> Place) -> Result<Option<f64>> {
        let Some((_, factor)) = self.at[role as usize] else { return Ok(None) };
        if value.is_nan() {
            return Ok(None);
        }
        let found = if role == Role::Time && !self.has_time_unit { unit_of_time(value) } else { None };
        if let Some((found, _)) = found {
            self.found_time.set(Some(found));
        }
        let scaled = value * found.map_or(factor, |(_, factor)| factor);
        // Derived values stay finite in this range.
        if scaled.abs() <= number::REAL_LIMIT {
            Ok(Some(scaled))
        } else {
            Err(bad(place(), &value.to_string(), "a number below 10¹² in SI units"))
        }
    }

    pub(super) fn has(&self, role: Role) -> bool {
        self.at[role as usize].is_some()
    }

    /// The name of a role's column.
    pub(super) fn name(&self, role: Role) -> &str {
        self.at[role as usize].map_or(role.key(), |(at, _)| &self.names[at])
    }

    fn is_none(&self, text: &str) -> bool {
        text.is_empty() || self.none.iter().any(|none| none == text)
    }
}

/// A name without what does not count in it: case, blanks, `_` and `-`.
pub(super) fn letters(text: &str) -> String {
    each_letter(text).collect()
}

fn each_letter(text: &str) -> impl Iterator<Item = char> {
    text.chars().filter(|c| !matches!(c, ' ' | '_' | '-')).flat_map(char::to_lowercase)
}

/// One sample of one vehicle.
pub(super) trait SampleRow {
    /// The number of a column in SI units; `None` if the column or the value is absent.
    fn number(&self, role: Role) -> Result<Option<f64>>;
    /// The text of a column.
    fn text(&self, role: Role) -> Result<Option<Cow<'_, str>>>;
    /// Whether it is this one, which an earlier row has.
    fn is_text(&self, role: Role, known: &str) -> Result<bool> {
        Ok(self.text(role)?.is_some_and(|text| text == known))
    }
    /// The place of a value.
    fn place(&self, role: Role) -> Place;
}

/// A file of rows.
pub(super) struct Rows {
    path: PathBuf,
    header: Vec<String>,
    source: RowSource,
}

enum RowSource {
    Csv(Box<CsvTable>),
    Parquet(Box<TableReader>),
    Xml(String),
    Json(Vec<serde_json::Map<String, Value>>),
}

impl Rows {
    /// Opens a file and finds its columns.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] if it is no file of this format.
    pub(super) fn open(path: &Path, format: FileFormat, rows: Option<&str>, delimiter: Option<char>) -> Result<Rows> {
        let (header, source) = match format {
            FileFormat::Csv => {
                let delimiter = delimiter.and_then(|c| u8::try_from(c).ok());
                let table = CsvTable::open(path, CsvFormat { name: "expected", header: "", delimiter })?;
                (table.header().to_vec(), RowSource::Csv(Box::new(table)))
            }
            FileFormat::Parquet => {
                let reader = TableReader::open(path, parquet(path)?)?;
                (reader.columns().to_vec(), RowSource::Parquet(Box::new(reader)))
            }
            FileFormat::Xml => {
                let row = rows.unwrap_or("vehicle").to_owned();
                let (mut header, mut known) = (Vec::new(), HashSet::new());
                let mut seen = 0;
                each_element(path, &row, &mut |names, _| {
                    let new = names.iter().filter(|(name, _)| known.insert(name.clone()));
                    header.extend(new.map(|(name, _)| name.clone()));
                    seen += 1;
                    Ok(seen < XML_HEADER_ROWS)
                })?;
                (header, RowSource::Xml(row))
            }
            FileFormat::Json => {
                let list = json_rows(path, rows)?;
                let mut known = HashSet::new();
                let names = list.iter().take(100).flat_map(|row| row.keys());
                let header = names.filter(|name| known.insert(name.as_str())).cloned().collect();
                (header, RowSource::Json(list))
            }
            FileFormat::Commonroad => {
                return Err(Error::Internal(format!("{} is not a table of rows", path.display())));
            }
        };
        let rows = Rows { path: path.to_path_buf(), header, source };
        let mut seen = HashSet::new();
        // Unnamed columns are never read.
        if let Some(twice) = rows.header.iter().find(|name| !name.is_empty() && !seen.insert(name.as_str())) {
            let problem = format!("two columns are named `{twice}`: nothing tells which one is meant");
            return Err(Error::input(rows.header_place(), problem, "rename one of them, or remove it"));
        }
        Ok(rows)
    }

    /// Opens the track file of a preset.
    pub(super) fn of_preset(path: &Path, preset: &Preset) -> Result<Rows> {
        Rows::open(path, preset.format, preset.rows.as_deref(), preset.delimiter)
    }

    /// Column names.
    pub(super) fn header(&self) -> &[String] {
        &self.header
    }

    /// The place of the header.
    pub(super) fn header_place(&self) -> Place {
        match self.source {
            RowSource::Csv(_) => Place::file(&self.path).row(1),
            _ => Place::file(&self.path),
        }
    }

    /// Gives every sample of the file to `each`. Returns the checksum and the number of rows.
    ///
    /// # Errors
    /// Those of the file and of `each`.
    pub(super) fn each(
        self,
        columns: &Columns,
        each: &mut dyn FnMut(&dyn SampleRow) -> Result<()>,
    ) -> Result<(FileChecksum, u64)> {
        let mut rows = 0;
        match self.source {
            RowSource::Csv(mut table) => {
                while table.next_row()? {
                    each(&CsvRow { table: &table, columns })?;
                }
                rows = table.rows();
                return Ok((table.finish()?, rows));
            }
            RowSource::Parquet(mut reader) => {
                // Roles share no column, but two may name the same one.
                let mut wanted: Vec<usize> = columns.at.iter().flatten().map(|(at, _)| *at).collect();
                wanted.sort_unstable();
                wanted.dedup();
                reader.rows.want(&wanted)?;
                let mut columns = Cow::Borrowed(columns);
                if let Some((at, _)) = columns.at[Role::Time as usize]
                    && reader.rows.has_instants(at)
                {
                    columns.found_time.set(Some(DATES));
                    columns.to_mut().at[Role::Time as usize] = Some((at, 1.0));
                }
                let columns = columns.as_ref();
                if !reader.rows.has_lists() {
                    let mut order = vec![0; self.header.len()];
                    wanted.iter().enumerate().for_each(|(position, at)| order[*at] = position);
                    while reader.rows.step()? {
                        rows += 1;
                        each(&TableRow { reader: &reader, row: rows, columns, order: &order })?;
                    }
                }
                // Without lists, this is behind the last row.
                while let Some(row) = reader.rows.next_row()? {
                    rows += 1;
                    let mut cells = vec![&Value::Null; self.header.len()];
                    wanted.iter().zip(&row.values).for_each(|(at, value)| cells[*at] = value);
                    each_sample(&cells, columns, &|| reader.place(row.number, None), each)?;
                }
            }
            RowSource::Json(list) => {
                for row in list {
                    rows += 1;
                    let cells: Vec<&Value> =
                        self.header.iter().map(|name| row.get(name).unwrap_or(&Value::Null)).collect();
                    let place = || Place::file(&self.path).of(format!("vehicle {rows} of the list"));
                    each_sample(&cells, columns, &place, each)?;
                }
            }
            RowSource::Xml(row) => {
                let index: BTreeMap<&str, usize> =
                    self.header.iter().enumerate().map(|(at, name)| (name.as_str(), at)).collect();
                each_element(&self.path, &row, &mut |attributes, place| {
                    rows += 1;
                    let mut cells = vec![&Value::Null; self.header.len()];
                    for (name, value) in attributes {
                        if let Some(at) = index.get(name.as_str()) {
                            cells[*at] = value;
                        }
                    }
                    each(&CellRow { cells: &cells, sample: 0, columns, place })?;
                    Ok(true)
                })?;
            }
        }
        Ok((FileChecksum::of(&self.path)?, rows))
    }
}

#[cfg(feature = "parquet")]
fn parquet(_: &Path) -> Result<TableFormat> {
    Ok(TableFormat::Parquet)
}

#[cfg(not(feature = "parquet"))]
fn parquet(path: &Path) -> Result<TableFormat> {
    Err(Error::usage(
        Place::file(path),
        "this build reads no Parquet",
        "build it with the feature `parquet`, or convert the file to CSV",
    ))
}

/// A number in SI units of a text; `;` joins several values, of which the first counts.
fn number_of(text: &[u8], role: Role, columns: &Columns, place: &dyn Fn() -> Place) -> Result<Option<f64>> {
    let first = text.split(|&byte| byte == b';').next().unwrap_or_default().trim_ascii();
    let found = number::real(first);
    if let Some(value) = found.filter(|value| value.is_finite()) {
        let is_none = columns.is_none_number(value, || String::from_utf8_lossy(first).into_owned());
        return if is_none { Ok(None) } else { columns.si(value, role, place) };
    }
    let shown = String::from_utf8_lossy(first);
    if columns.is_none(&shown) || found.is_some_and(f64::is_nan) {
        return Ok(None);
    }
    if role == Role::Time && !columns.has_time_unit {
        let (found, seconds) = time_of_text(&shown).ok_or_else(|| bad(place(), &shown, A_TIME))?;
        columns.found_time.set(Some(found));
        return Ok(Some(seconds));
    }
    let expected = match shown.contains(',') {
        true => {
            "a finite number with a decimal point (decimal commas are read if most numbers have them, and semicolons or tabs separate)"
        }
        false => "a finite number",
    };
    Err(bad(place(), &shown, expected))
}

const A_TIME: &str = "a time: seconds, or a text such as 2024-10-07 06:00:00.05, 06:00:00.05 or 0:06:00:00.05";

fn bad(place: Place, found: &str, expected: &str) -> Error {
    let shown: String = found.chars().take(40).flat_map(char::escape_debug).collect();
    Error::input(place, format!("`{shown}` is not {expected}"), "correct the value, or name it in `none` of the preset")
}

struct CsvRow<'a> {
    table: &'a CsvTable,
    columns: &'a Columns,
}

impl CsvRow<'_> {
    fn bytes(&self, role: Role) -> Option<&[u8]> {
        self.columns.at[role as usize].map(|(at, _)| self.table.bytes(CsvColumn(at)))
    }
}

impl SampleRow for CsvRow<'_> {
    #[inline]
    fn number(&self, role: Role) -> Result<Option<f64>> {
        let Some(bytes) = self.bytes(role) else { return Ok(None) };
        if self.table.has_decimal_commas() && !bytes.contains(&b':') {
            let shown = String::from_utf8_lossy(bytes);
            // It separates thousands, or another program wrote this number.
            if shown.contains('.') && !self.columns.is_none(shown.trim()) {
                return Err(bad(
                    self.place(role),
                    &shown,
                    "a number with a decimal comma, as others of this file have",
                ));
            }
            return number_of(shown.replace(',', ".").as_bytes(), role, self.columns, &|| self.place(role));
        }
        number_of(bytes, role, self.columns, &|| self.place(role))
    }

    fn text(&self, role: Role) -> Result<Option<Cow<'_, str>>> {
        let Some(bytes) = self.bytes(role) else { return Ok(None) };
        let text = String::from_utf8_lossy(bytes.split(|&byte| byte == b';').next().unwrap_or_default().trim_ascii());
        Ok(Some(text).filter(|text| !self.columns.is_none(text)))
    }

    fn place(&self, role: Role) -> Place {
        self.table.place().column(self.columns.name(role))
    }
}

/// A row of a table with a type for every column.
struct TableRow<'a> {
    reader: &'a TableReader,
    row: u64,
    columns: &'a Columns,
    /// Position of each column in the selection.
    order: &'a [usize],
}

impl TableRow<'_> {
    fn cell(&self, role: Role) -> TableCell<'_> {
        self.columns.at[role as usize].map_or(TableCell::Null, |(at, _)| self.reader.rows.cell(self.order[at]))
    }
}

impl SampleRow for TableRow<'_> {
    fn number(&self, role: Role) -> Result<Option<f64>> {
        let place = || self.place(role);
        match self.cell(role) {
            TableCell::Number(value) if self.columns.is_none_number(value, || Value::from(value).to_string()) => {
                Ok(None)
            }
            TableCell::Whole(value) if self.columns.is_none_number(value as f64, || value.to_string()) => Ok(None),
            TableCell::Number(value) => self.columns.si(value, role, &place),
            TableCell::Whole(value) => self.columns.si(value as f64, role, &place),
            TableCell::Text(text) => number_of(text.as_bytes(), role, self.columns, &place),
            TableCell::Flag(value) => Ok(Some(f64::from(u8::from(value)))),
            _ => Ok(None),
        }
    }

    fn text(&self, role: Role) -> Result<Option<Cow<'_, str>>> {
        let text = match self.cell(role) {
            TableCell::Text(Cow::Borrowed(text)) => Cow::Borrowed(text.trim()),
            TableCell::Text(text) => text,
            TableCell::Whole(value) => Cow::Owned(value.to_string()),
            TableCell::Number(value) if !value.is_nan() => Cow::Owned(Value::from(value).to_string()),
            TableCell::Flag(value) => Cow::Owned(value.to_string()),
            _ => return Ok(None),
        };
        Ok(Some(text).filter(|text| !self.columns.is_none(text)))
    }

    fn is_text(&self, role: Role, known: &str) -> Result<bool> {
        // Without a new text for each row.
        match self.cell(role) {
            TableCell::Whole(value) => Ok(known.parse() == Ok(value)),
            _ => Ok(self.text(role)?.is_some_and(|text| text == known)),
        }
    }

    fn place(&self, role: Role) -> Place {
        self.reader.place(self.row, None).column(self.columns.name(role))
    }
}

/// A sample of a row whose cells may be lists.
struct CellRow<'a> {
    cells: &'a [&'a Value],
    sample: usize,
    columns: &'a Columns,
    place: &'a dyn Fn() -> Place,
}

impl CellRow<'_> {
    fn value(&self, role: Role) -> Option<&Value> {
        let (at, _) = self.columns.at[role as usize]?;
        match self.cells[at] {
            Value::Array(list) => list.get(self.sample),
            value => Some(value),
        }
    }
}

impl SampleRow for CellRow<'_> {
    fn number(&self, role: Role) -> Result<Option<f64>> {
        match self.value(role) {
            None | Some(Value::Null) => Ok(None),
            Some(Value::Number(number)) => {
                let value = number.as_f64().unwrap_or(f64::NAN);
                let is_none = self.columns.is_none_number(value, || number.to_string());
                if is_none { Ok(None) } else { self.columns.si(value, role, &|| self.place(role)) }
            }
            Some(Value::String(text)) => number_of(text.as_bytes(), role, self.columns, &|| self.place(role)),
            Some(Value::Bool(value)) => Ok(Some(f64::from(u8::from(*value)))),
            Some(other) => Err(bad(self.place(role), &other.to_string(), "a number")),
        }
    }

    fn text(&self, role: Role) -> Result<Option<Cow<'_, str>>> {
        let text = match self.value(role) {
            None | Some(Value::Null) => return Ok(None),
            Some(Value::String(text)) => Cow::Borrowed(text.trim()),
            Some(other) => Cow::Owned(other.to_string()),
        };
        Ok(Some(text).filter(|text| !self.columns.is_none(text)))
    }

    fn place(&self, role: Role) -> Place {
        (self.place)().column(self.columns.name(role))
    }
}

/// The samples of one row; lists must be equally long.
fn each_sample(
    cells: &[&Value],
    columns: &Columns,
    place: &dyn Fn() -> Place,
    each: &mut dyn FnMut(&dyn SampleRow) -> Result<()>,
) -> Result<()> {
    let list = |role: &Role| match columns.at[*role as usize].map(|(at, _)| cells[at]) {
        Some(Value::Array(list)) => Some((*role, list.len())),
        _ => None,
    };
    let lists: Vec<(Role, usize)> = Role::ALL.iter().filter_map(list).collect();
    let samples = lists.iter().map(|(_, length)| *length).max();
    if let (Some(longest), Some((role, length))) = (samples, lists.iter().find(|(_, length)| Some(*length) != samples))
    {
        return Err(Error::input(
            place().column(columns.name(*role)),
            format!("the list has {length} values, another one of this vehicle {longest}"),
            "give lists of equal length",
        ));
    }
    (0..samples.unwrap_or(1)).try_for_each(|sample| each(&CellRow { cells, sample, columns, place }))
}

/// Seconds since 1970 of `2024-10-07 06:00:00.05+00:00`, with `T` or a blank, with or without an offset.
fn seconds_of_date(text: &str) -> Option<f64> {
    let (date, time) = text.split_once(['T', ' '])?;
    let mut numbers = date.splitn(3, '-').map(|part| part.parse::<i64>().ok());
    let (year, month, day) = (numbers.next()??, numbers.next()??, numbers.next()??);
    if !(1..=12).contains(&month) || !(1..=31).contains(&day) || !(1..=9999).contains(&year) {
        return None;
    }
    let (clock, offset_s) = match time.rfind(['+', '-', 'Z']) {
        Some(at) if time[at..].starts_with('Z') => (&time[..at], 0.0),
        Some(at) => {
            let (hours, minutes) = time[at + 1..].split_once(':').unwrap_or((&time[at + 1..], "0"));
            let offset_s = 3600.0 * hours.parse::<f64>().ok()? + 60.0 * minutes.parse::<f64>().ok()?;
            (&time[..at], if time[at..].starts_with('-') { -offset_s } else { offset_s })
        }
        None => (time, 0.0),
    };
    let mut parts = clock.splitn(3, ':').map(|part| part.parse::<f64>().ok());
    let (hours, minutes, seconds) = (parts.next()??, parts.next()??, parts.next().unwrap_or(Some(0.0))?);
    // Days from civil dates (Hinnant, low-level date algorithms, 2013).
    let shifted = if month <= 2 { year - 1 } else { year };
    let era = shifted.div_euclid(400);
    let of_era = shifted.rem_euclid(400);
    let of_year = (153 * (month + if month > 2 { -3 } else { 9 }) + 2) / 5 + day - 1;
    let days = era * 146_097 + of_era * 365 + of_era / 4 - of_era / 100 + of_year - 719_468;
    let of_day = 3600.0 * hours + 60.0 * minutes + seconds - offset_s;
    of_day.is_finite().then_some(days as f64 * 86_400.0 + of_day)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_become_seconds() {
        assert_eq!(seconds_of_date("1970-01-01T00:00:00Z"), Some(0.0));
        assert_eq!(seconds_of_date("2024-10-07 06:00:00.5+00:00"), Some(1_728_280_800.5));
        assert_eq!(seconds_of_date("2024-10-07 08:00:00.5+02:00"), Some(1_728_280_800.5));
        for wrong in ["2024-10-07", "2024-13-07 06:00:00", "x", "2024-10-07 06", "2024-10-07 a:b:c", "-"] {
            assert_eq!(seconds_of_date(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn names_are_compared_without_case_and_marks() {
        assert!(letters("Vehicle-ID") == letters("vehicle_id") && letters("xloc_kf") == letters("XLoc KF"));
        assert!(letters("vehicle_idx") != letters("vehicle_id"));
    }
}
