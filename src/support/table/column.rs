//! Columns and the types of their fields.

use std::borrow::Cow;

use serde_json::Value;

use super::json_value;
use crate::{Result, readable};

/// Type of a column's values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColumnKind {
    /// Text that usually differs between rows.
    Text,
    /// One of few texts: Parquet stores each once.
    Name,
    /// A boolean; in CSV 1 and 0.
    Flag,
    /// A 64-bit integer.
    Whole,
    /// A number of the lane arithmetic (binary32).
    Binary32,
    /// A binary64 number.
    Binary64,
    /// Binary64 numbers over the instants of a scenario.
    Series,
    /// A list of integers.
    Wholes,
}

impl ColumnKind {
    /// The type as the chapter on tables names it.
    pub fn name(self) -> &'static str {
        match self {
            ColumnKind::Text => "string",
            ColumnKind::Name => "dictionary",
            ColumnKind::Flag => "bool",
            ColumnKind::Whole => "int64",
            ColumnKind::Binary32 => "float",
            ColumnKind::Binary64 => "double",
            ColumnKind::Series => "list<double>",
            ColumnKind::Wholes => "list<int64>",
        }
    }
}

/// A column of a table to be written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Name.
    pub name: Cow<'static, str>,
    /// Type.
    pub kind: ColumnKind,
    /// Unit: `m`, `m/s`, `s`, …; `1` for numbers without one; empty for columns that are not numbers.
    pub unit: Cow<'static, str>,
    /// One sentence, including when a field is empty.
    pub description: Cow<'static, str>,
    /// Number format for people; files have every digit.
    pub digits: Digits,
    /// Text for people if there is no value.
    pub null: &'static str,
}

/// Number of digits shown to people.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Digits {
    /// At most four significant digits, without trailing zeros.
    #[default]
    Readable,
    /// This many significant digits, with trailing zeros.
    Significant(usize),
    /// This many decimals.
    Fixed(usize),
    /// This many decimals, with a sign, for a difference.
    Signed(usize),
}

impl Digits {
    /// Formats a number for people.
    pub(crate) fn text(self, number: f64) -> String {
        match self {
            Digits::Readable => readable::value(number),
            Digits::Significant(digits) => readable::significant(number, digits),
            Digits::Fixed(digits) => format!("{number:.digits$}"),
            Digits::Signed(digits) => format!("{number:+.digits$}"),
        }
    }
}

impl Column {
    /// A column of a table in files.
    pub fn new<T: Into<Cow<'static, str>>>(name: T, kind: ColumnKind, unit: T, description: T) -> Column {
        Column { kind, unit: unit.into(), description: description.into(), ..Column::from(name) }
    }

    /// Sets the number of digits shown.
    pub fn digits(self, digits: Digits) -> Column {
        Column { digits, ..self }
    }

    /// Sets the text for null.
    pub fn null(self, null: &'static str) -> Column {
        Column { null, ..self }
    }
}

/// A column of a table for people: its type is that of its values.
impl<N: Into<Cow<'static, str>>> From<N> for Column {
    fn from(name: N) -> Column {
        let (unit, description) = (Cow::default(), Cow::default());
        Column { name: name.into(), kind: ColumnKind::Text, unit, description, digits: Digits::default(), null: "" }
    }
}

/// A field of a row.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell<'a> {
    /// Absent or not applicable: null in Parquet and JSON Lines, empty in CSV.
    Null,
    /// For [`ColumnKind::Text`] and [`ColumnKind::Name`].
    Text(Cow<'a, str>),
    /// For [`ColumnKind::Flag`].
    Flag(bool),
    /// For [`ColumnKind::Whole`].
    Whole(i64),
    /// For [`ColumnKind::Binary32`] (the value must fit) and [`ColumnKind::Binary64`].
    Number(f64),
    /// For [`ColumnKind::Series`].
    Series(Cow<'a, [f64]>),
    /// For [`ColumnKind::Wholes`].
    Wholes(Cow<'a, [i64]>),
}

impl<'a> Cell<'a> {
    /// A text cell.
    pub fn text(text: impl Into<Cow<'a, str>>) -> Cell<'a> {
        Cell::Text(text.into())
    }

    /// A number, or null.
    pub fn number(value: Option<f64>) -> Cell<'a> {
        value.map_or(Cell::Null, Cell::Number)
    }
}

/// Metadata of a table in a file; only Parquet stores them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct TableMetadata {
    /// Kind of rows: `lanes`, `samples`, `scenarios`.
    pub table: &'static str,
    /// Name of the profile, if lanes were run.
    pub profile: Option<String>,
    /// SHA-256 of the plan of lanes, if there is one.
    pub plan_sha256: Option<String>,
    /// Known to be synthetic: not a statement about real traffic.
    pub synthetic: bool,
}

/// A row with one value per requested column. CSV values are texts; an empty field is null.
pub struct Row {
    /// CSV: line of the file, counted from 1 with the header; Parquet: row, counted from 1.
    pub number: u64,
    /// One per requested column; NaN and infinity are null, because JSON lacks them.
    pub values: Vec<Value>,
}

/// The rows of a table, of any format.
pub trait TableRows {
    /// Selects the columns, in the order in which rows have them. Call it before the first row.
    ///
    /// # Errors
    /// [`Error::Input`](crate::Error::Input) if a selected column has an unsupported type.
    fn want(&mut self, columns: &[usize]) -> Result<()>;

    /// Advances to the next row, whose values [`TableRows::cell`] gives; false after the last.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io); [`Error::Input`](crate::Error::Input) for damaged data.
    fn step(&mut self) -> Result<bool>;

    /// The number of the row, after [`TableRows::step`].
    fn number(&self) -> u64;

    /// The value of a selected column, by its position in the selection, after [`TableRows::step`].
    fn cell(&self, wanted: usize) -> Cell<'_>;

    /// How many columns are selected.
    fn width(&self) -> usize;

    /// Whether a selected column has lists.
    fn has_lists(&self) -> bool {
        false
    }

    /// Returns the next row; `None` after the last.
    ///
    /// # Errors
    /// As [`TableRows::step`].
    fn next_row(&mut self) -> Result<Option<Row>> {
        let value = |cell: Cell| match cell {
            Cell::Number(number) => Value::from(number),
            cell => json_value(ColumnKind::Binary64, &cell),
        };
        Ok(self
            .step()?
            .then(|| Row { number: self.number(), values: (0..self.width()).map(|at| value(self.cell(at))).collect() }))
    }
}
