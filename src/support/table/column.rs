//! What a column is and what a field of it holds.

use std::borrow::Cow;

use serde_json::Value;

use crate::support::readable;

/// How the values of a column are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColumnKind {
    /// Text that mostly differs between rows.
    Text,
    /// One of few texts: Parquet keeps each once.
    Name,
    /// Yes or no; in CSV 1 and 0.
    Flag,
    /// A whole number of 64 bits.
    Whole,
    /// A number of the lane arithmetic, binary32.
    Binary32,
    /// A number in binary64.
    Binary64,
    /// Numbers over the instants of a scenario, binary64.
    Series,
    /// Whole numbers in a row.
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

/// A column of a table that is written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Name.
    pub name: Cow<'static, str>,
    /// Type.
    pub kind: ColumnKind,
    /// Unit: `m`, `m/s`, `s`, …; `1` for numbers without one; empty for columns that are not numbers.
    pub unit: Cow<'static, str>,
    /// One sentence, with when a field is empty.
    pub description: Cow<'static, str>,
    /// How people read its numbers; files have every digit.
    pub digits: Digits,
    /// What people read where there is none.
    pub null: &'static str,
}

/// How many digits of a number people read.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Digits {
    /// Four significant ones at most, without idle zeros.
    #[default]
    Readable,
    /// So many significant ones, with idle zeros.
    Significant(usize),
    /// So many after the point.
    Fixed(usize),
    /// The same with a sign, of a difference.
    Signed(usize),
}

impl Digits {
    /// A number as people read it.
    pub fn text(self, number: f64) -> String {
        match self {
            Digits::Readable => readable::value(number),
            Digits::Significant(digits) => readable::significant(number, digits),
            Digits::Fixed(digits) => format!("{number:.digits$}"),
            Digits::Signed(digits) => format!("{number:+.digits$}"),
        }
    }
}

impl Column {
    /// A column of a table that is written to files.
    pub fn new<T: Into<Cow<'static, str>>>(name: T, kind: ColumnKind, unit: T, description: T) -> Column {
        Column { kind, unit: unit.into(), description: description.into(), ..Column::from(name) }
    }

    /// The same column with numbers of so many digits.
    pub fn digits(self, digits: Digits) -> Column {
        Column { digits, ..self }
    }

    /// The same column with a mark for what there is not.
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
    /// Did not happen, or does not exist: null in Parquet and JSON Lines, empty in CSV.
    Null,
    /// Of [`ColumnKind::Text`] and [`ColumnKind::Name`].
    Text(Cow<'a, str>),
    /// Of [`ColumnKind::Flag`].
    Flag(bool),
    /// Of [`ColumnKind::Whole`].
    Whole(i64),
    /// Of [`ColumnKind::Binary32`] (which it has to fit) and [`ColumnKind::Binary64`].
    Number(f64),
    /// As `Number`, but 2 is `2.0` in CSV.
    Decimal(f64),
    /// Of [`ColumnKind::Series`].
    Series(Cow<'a, [f64]>),
    /// Of [`ColumnKind::Wholes`].
    Wholes(Cow<'a, [i64]>),
}

impl<'a> Cell<'a> {
    /// A text that is there.
    pub fn text(text: impl Into<Cow<'a, str>>) -> Cell<'a> {
        Cell::Text(text.into())
    }

    /// A number, or null.
    pub fn number(value: Option<f64>) -> Cell<'a> {
        value.map_or(Cell::Null, Cell::Number)
    }
}

/// What a file says of its table; only Parquet has a place for it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct TableMetadata {
    /// Kind of rows: `lanes`, `samples`, `scenarios`.
    pub table: &'static str,
    /// Name of the profile, where lanes were run.
    pub profile: Option<String>,
    /// SHA-256 of the plan of lanes, where there is one.
    pub plan_sha256: Option<String>,
    /// Known to be made up by the program: no statement about real traffic.
    pub synthetic: bool,
}

/// A row; one value per column that was asked for. CSV has texts only; a field that is empty is null.
pub(crate) struct Row {
    /// CSV: line of the file, counted from 1 with the header; Parquet: row, counted from 1.
    pub number: u64,
    pub values: Vec<Value>,
}
