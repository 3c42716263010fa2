//! Rows of a track file: delimited text and Parquet give the same fields, with a row per vehicle and time.

use std::borrow::Cow;
use std::cell::Cell;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Path, PathBuf};

use super::is_parquet;
use super::roles::{ColumnName, Role};
use super::times::{FoundTime, time_of_text, unit_of_time};
use crate::trajectory::csv_table::{CsvTable, FileChecksum};
use crate::trajectory::number;
use lanesweep_support::table::{Cell as TableCell, TableFormat, TableReader};
use lanesweep_support::{Error, Place, Result};

/// Columns by role: position in the rows, and the factor to SI units.
#[derive(Debug)]
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

impl Columns {
    /// Finds the columns in a header; absent ones are left out.
    pub(super) fn of(named: &BTreeMap<Role, ColumnName>, header: &[String], none: &[String]) -> Columns {
        let mut positions: HashMap<String, usize> = HashMap::new();
        let wanted: HashSet<String> = named.values().flat_map(|of| &of.names).map(|name| letters(name)).collect();
        let mut name = String::new();
        for (at, column) in header.iter().enumerate() {
            name.clear();
            name.extend(each_letter(column));
            if wanted.contains(&name) {
                positions.entry(name.clone()).or_insert(at);
            }
        }
        let mut at = [None; Role::ALL.len()];
        for (role, column) in named {
            let position = column.names.iter().find_map(|name| positions.get(&letters(name)));
            at[*role as usize] = position.copied().zip(column.factor(*role));
        }
        let mut has_time_unit = named.get(&Role::Time).is_some_and(|time| {
            time.unit.as_deref().is_some_and(|unit| unit != "date") || time.factor(Role::Time) != Some(1.0)
        });
        // INTERACTION's time has its unit in its name.
        let in_ms = header.iter().position(|column| letters(column) == "timestampms");
        if at[Role::Time as usize].is_none() && in_ms.is_some() && named.contains_key(&Role::Time) {
            (at[Role::Time as usize], has_time_unit) = (in_ms.map(|position| (position, 1e-3)), true);
        }
        let none_numbers = none.iter().filter_map(|text| text.parse().ok()).collect();
        let (names, none) = (header.to_vec(), none.to_vec());
        Columns { at, names, has_time_unit, found_time: Cell::new(None), none, none_numbers }
    }

    /// What times without a unit were found to be.
    pub(super) fn found_time(&self) -> Option<FoundTime> {
        self.found_time.get()
    }

    /// The columns with their roles, and those that are not used, in words.
    pub(super) fn describe(&self) -> String {
        let present = || Role::ALL.into_iter().filter(|role| self.has(*role));
        let of = |role: Role| {
            let (key, name) = (role.key(), self.name(role));
            match self.found_time().filter(|_| role == Role::Time) {
                Some(found) => format!("{key} = {name} ({found})"),
                None if key == name => name.to_owned(),
                None => format!("{key} = {name}"),
            }
        };
        let used = present().map(of).collect::<Vec<_>>().join(", ");
        let is_unused = |name: &&String| present().all(|role| self.name(role) != *name);
        let unused: Vec<&str> = self.names.iter().filter(is_unused).map(String::as_str).collect();
        if unused.is_empty() { used } else { format!("{used}; not used: {}", unused.join(", ")) }
    }

    pub(super) fn has(&self, role: Role) -> bool {
        self.at[role as usize].is_some()
    }

    /// The name of a role's column.
    pub(super) fn name(&self, role: Role) -> &str {
        self.at[role as usize].map_or(role.key(), |(at, _)| &self.names[at])
    }

    /// A number of the file in SI units; `text` is its text.
    fn si(&self, value: f64, role: Role, text: impl Fn() -> String, place: impl Fn() -> Place) -> Result<Option<f64>> {
        let Some((_, factor)) = self.at[role as usize] else { return Ok(None) };
        // `-1.0` is a number where `-1` stands for no value.
        if value.is_nan() || (self.none_numbers.contains(&value) && self.is_none(&text())) {
            return Ok(None);
        }
        let found = if role == Role::Time && !self.has_time_unit { unit_of_time(value) } else { None };
        if let Some((found, _)) = found {
            self.found_time.set(Some(found));
        }
        let scaled = value * found.map_or(factor, |(_, factor)| factor);
        // Derived values stay finite in this range.
        if scaled.abs() <= number::REAL_LIMIT {
            return Ok(Some(scaled));
        }
        Err(bad(place(), &value.to_string(), "a number below 10¹² in SI units"))
    }

    fn is_none(&self, text: &str) -> bool {
        text.is_empty() || self.none.iter().any(|none| none == text)
    }
}

/// A name without what does not count in it: case, blanks, `_` and `-`.
fn letters(text: &str) -> String {
    each_letter(text).collect()
}

fn each_letter(text: &str) -> impl Iterator<Item = char> {
    text.chars().filter(|c| !matches!(c, ' ' | '_' | '-')).flat_map(char::to_lowercase)
}

/// A file of rows.
pub(super) struct Rows {
    path: PathBuf,
    /// Column names.
    pub header: Vec<String>,
    source: RowSource,
}

enum RowSource {
    Text(Box<CsvTable>),
    Parquet(Box<TableReader>),
}

impl Rows {
    /// Opens a file and finds its columns.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] if it is no file of this format, or two columns have one name.
    pub(super) fn open(path: &Path) -> Result<Rows> {
        let (header, source) = match is_parquet(path) {
            true => {
                let reader = TableReader::open(path, TableFormat::of(path, &[TableFormat::Parquet], "tracks")?)?;
                (reader.columns().to_vec(), RowSource::Parquet(Box::new(reader)))
            }
            false => {
                let table = CsvTable::open(path, "")?;
                (table.header.clone(), RowSource::Text(Box::new(table)))
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

    /// The place of the header.
    pub(super) fn header_place(&self) -> Place {
        match self.source {
            RowSource::Text(_) => Place::file(&self.path).row(1),
            RowSource::Parquet(_) => Place::file(&self.path),
        }
    }

    /// Gives every row to `each`. Returns the checksum of the file.
    ///
    /// # Errors
    /// Those of the file and of `each`.
    pub(super) fn each(
        mut self,
        columns: &Columns,
        mut each: impl FnMut(&SampleRow) -> Result<()>,
    ) -> Result<FileChecksum> {
        let mut order = [0; Role::ALL.len()];
        if let RowSource::Parquet(reader) = &mut self.source {
            let wanted: Vec<usize> = columns.at.iter().flatten().map(|(at, _)| *at).collect();
            reader.rows.want(&wanted)?;
            if reader.rows.has_lists() {
                let problem = "the cells of a column are lists; a row is one vehicle at one time";
                let help = "make such a table in Python: `lanesweep.tracks.lists`, or `swiftraj`";
                return Err(Error::input(Place::file(&self.path), problem, help));
            }
            let present = (0..order.len()).filter(|role| columns.at[*role].is_some());
            present.enumerate().for_each(|(position, role)| order[role] = position);
        }
        while self.source.step()? {
            each(&SampleRow { columns, source: &self.source, order: &order })?;
        }
        match self.source {
            RowSource::Text(table) => table.finish(),
            RowSource::Parquet(_) => FileChecksum::of(&self.path),
        }
    }
}

impl RowSource {
    fn step(&mut self) -> Result<bool> {
        match self {
            RowSource::Text(table) => table.next_row(),
            RowSource::Parquet(reader) => reader.rows.step(),
        }
    }
}

/// One sample of one vehicle.
pub(super) struct SampleRow<'a> {
    pub columns: &'a Columns,
    source: &'a RowSource,
    /// Position of each role's column in the selection of a Parquet file.
    order: &'a [usize],
}

impl SampleRow<'_> {
    /// The value of a column; one of several that `;` joins counts, the first.
    fn cell(&self, role: Role) -> TableCell<'_> {
        let Some((at, _)) = self.columns.at[role as usize] else { return TableCell::Null };
        match self.source {
            RowSource::Text(table) => TableCell::Text(String::from_utf8_lossy(first_of(table.bytes(at)))),
            RowSource::Parquet(reader) => match reader.rows.cell(self.order[role as usize]) {
                TableCell::Text(Cow::Borrowed(text)) => TableCell::Text(Cow::Borrowed(text.trim())),
                cell => cell,
            },
        }
    }

    /// The number of a column in SI units; `None` if the column or the value is absent.
    pub(super) fn number(&self, role: Role) -> Result<Option<f64>> {
        let si = |value: f64, text: &dyn Fn() -> String| self.columns.si(value, role, text, || self.place(role));
        // Most values, without a text.
        if let (RowSource::Text(table), Some((at, _))) = (self.source, self.columns.at[role as usize])
            && !table.has_decimal_commas
            && let Some(value) = number::short_decimal(table.bytes(at))
        {
            return si(value, &|| String::from_utf8_lossy(table.bytes(at)).into_owned());
        }
        match self.cell(role) {
            TableCell::Text(text) => self.number_of(&text, role),
            TableCell::Whole(value) => si(value as f64, &|| value.to_string()),
            TableCell::Number(value) => si(value, &|| format!("{value:?}")),
            TableCell::Flag(value) => Ok(Some(f64::from(u8::from(value)))),
            _ => Ok(None),
        }
    }

    /// A number in SI units of a text.
    fn number_of(&self, text: &str, role: Role) -> Result<Option<f64>> {
        let (columns, mut text) = (self.columns, Cow::Borrowed(text));
        if let RowSource::Text(table) = self.source
            && table.has_decimal_commas
            && !text.contains(':')
        {
            // A point separates thousands, or another program wrote this number.
            if text.contains('.') && !columns.is_none(&text) {
                return Err(bad(self.place(role), &text, "a number with a decimal comma, as others of this file have"));
            }
            text = Cow::Owned(text.replace(',', "."));
        }
        let found = number::real(text.as_bytes());
        if let Some(value) = found.filter(|value| value.is_finite()) {
            return columns.si(value, role, || text.to_string(), || self.place(role));
        }
        if columns.is_none(&text) || found.is_some_and(f64::is_nan) {
            return Ok(None);
        }
        if role == Role::Time && !columns.has_time_unit {
            let (found, seconds) = time_of_text(&text).ok_or_else(|| bad(self.place(role), &text, A_TIME))?;
            columns.found_time.set(Some(found));
            return Ok(Some(seconds));
        }
        let expected = if text.contains(',') { A_POINT } else { "a finite number" };
        Err(bad(self.place(role), &text, expected))
    }

    /// The text of a column.
    pub(super) fn text(&self, role: Role) -> Option<Cow<'_, str>> {
        let text = match self.cell(role) {
            TableCell::Text(text) => text,
            TableCell::Whole(value) => Cow::Owned(value.to_string()),
            TableCell::Number(value) if !value.is_nan() => Cow::Owned(format!("{value:?}")),
            TableCell::Flag(value) => Cow::Owned(value.to_string()),
            _ => return None,
        };
        Some(text).filter(|text| !self.columns.is_none(text))
    }

    /// Whether it is this one, which an earlier row has.
    pub(super) fn is_text(&self, role: Role, known: &str) -> bool {
        match self.cell(role) {
            // Without a new text for each row.
            TableCell::Whole(value) => known.parse() == Ok(value),
            _ => self.text(role).is_some_and(|text| text == known),
        }
    }

    /// The place of a value.
    pub(super) fn place(&self, role: Role) -> Place {
        let place = match self.source {
            RowSource::Text(table) => table.place(),
            RowSource::Parquet(reader) => reader.place(reader.rows.number(), None),
        };
        place.column(self.columns.name(role))
    }
}

fn first_of(bytes: &[u8]) -> &[u8] {
    bytes.split(|&byte| byte == b';').next().unwrap_or_default().trim_ascii()
}

const A_TIME: &str = "a time: seconds, or a text such as 2024-10-07 06:00:00.05, 06:00:00.05 or 0:06:00:00.05";
const A_POINT: &str = "a finite number with a decimal point (decimal commas are read if most numbers have them, and \
                       semicolons or tabs separate)";

fn bad(place: Place, found: &str, expected: &str) -> Error {
    let shown: String = found.chars().take(40).flat_map(char::escape_debug).collect();
    Error::input(place, format!("`{shown}` is not {expected}"), "correct the value, or name it in `none` of the preset")
}
