//! Writes a table row by row to an atomic file.
//!
//! **CSV.** A spreadsheet treats a field that begins with `=`, `+`, `-` or `@` as a formula, and ids may come from
//! anybody. Such a text gets a leading apostrophe, which our readers remove. Numbers are unchanged.
//!
//! **JSON Lines.** JSON lacks NaN and infinity: NaN means a missing value and becomes null; infinity becomes the text `Infinity`.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::path::Path;

use serde_json::Value;

#[cfg(feature = "parquet")]
use super::parquet_writer::ParquetFile;
use super::{Cell, Column, ColumnKind, TableFormat, TableMetadata};
use crate::atomic_file::{AtomicFile, StagedFile};
use crate::{Error, Result};

/// A table being written. Memory does not grow with the number of rows. Dropping it before [`TableWriter::finish`]
/// removes the file.
pub struct TableWriter {
    columns: Vec<Column>,
    out: Out,
}

/// Appends a row to a text.
type AppendRow = fn(&mut String, &[Column], &[Cell]);

enum Out {
    /// With a buffer for the row.
    Text(AtomicFile, AppendRow, String),
    #[cfg(feature = "parquet")]
    Parquet(Box<ParquetFile>),
}

impl TableWriter {
    /// Creates a table; an existing file of that name stays until [`TableWriter::finish`].
    ///
    /// # Errors
    /// [`Error::Io`] if the folder cannot be written to; as [`TableFormat::of`] without the feature `parquet`.
    pub fn create(
        path: &Path,
        format: TableFormat,
        columns: Vec<Column>,
        facts: &TableMetadata,
    ) -> Result<TableWriter> {
        #[cfg(not(feature = "parquet"))]
        let _ = facts;
        let out = match format {
            TableFormat::Csv => {
                let mut file = AtomicFile::create(path)?;
                file.append(csv_header(&columns).as_bytes())?;
                Out::Text(file, append_csv, String::new())
            }
            TableFormat::JsonLines => Out::Text(AtomicFile::create(path)?, append_json, String::new()),
            #[cfg(feature = "parquet")]
            TableFormat::Parquet => Out::Parquet(Box::new(ParquetFile::create(path, &columns, facts)?)),
            #[cfg(not(feature = "parquet"))]
            TableFormat::Parquet => {
                TableFormat::of(path, &[TableFormat::Parquet], "table")?;
                return Err(Error::Internal("Parquet was chosen, but not built".to_owned()));
            }
        };
        Ok(TableWriter { columns, out })
    }

    /// Appends a row: one field per column, each of the column's type.
    ///
    /// # Errors
    /// [`Error::Io`], for instance if the disk is full; [`Error::Internal`] for fields that do not match the columns.
    pub fn row(&mut self, row: &[Cell]) -> Result<()> {
        if row.len() != self.columns.len() || !self.columns.iter().zip(row).all(|(c, cell)| fits(c.kind, cell)) {
            return Err(Error::Internal(format!("a row does not fit its table: {row:?}")));
        }
        match &mut self.out {
            Out::Text(file, append, text) => {
                text.clear();
                append(text, &self.columns, row);
                file.append(text.as_bytes())
            }
            #[cfg(feature = "parquet")]
            Out::Parquet(file) => file.row(row),
        }
    }

    /// Syncs the table to disk and renames it to its final name.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn finish(self) -> Result<()> {
        self.stage()?.publish()
    }

    /// Syncs the table to disk under its hidden name.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn stage(self) -> Result<StagedFile> {
        #[cfg_attr(
            not(feature = "parquet"),
            expect(clippy::infallible_destructuring_match, reason = "without Parquet a table is text")
        )]
        let file = match self.out {
            Out::Text(file, ..) => file,
            #[cfg(feature = "parquet")]
            Out::Parquet(file) => file.finish()?,
        };
        file.stage()
    }
}

fn fits(kind: ColumnKind, cell: &Cell) -> bool {
    match cell {
        Cell::Null => true,
        Cell::Text(_) => matches!(kind, ColumnKind::Text | ColumnKind::Name),
        Cell::Flag(_) => kind == ColumnKind::Flag,
        Cell::Whole(_) => kind == ColumnKind::Whole,
        Cell::Number(_) => matches!(kind, ColumnKind::Binary32 | ColumnKind::Binary64),
        Cell::Series(_) => kind == ColumnKind::Series,
        Cell::Wholes(_) => kind == ColumnKind::Wholes,
    }
}

/// The line of column names.
pub(super) fn csv_header(columns: &[Column]) -> String {
    columns.iter().map(|column| csv_field(&column.name)).collect::<Vec<_>>().join(",") + "\n"
}

/// Appends a row as CSV. Numbers have as many digits as needed to read back unchanged in their arithmetic.
pub(super) fn append_csv(text: &mut String, columns: &[Column], row: &[Cell]) {
    for (at, (column, cell)) in columns.iter().zip(row).enumerate() {
        if at > 0 {
            text.push(',');
        }
        // Writing to a string does not fail.
        let _ = match cell {
            Cell::Null => Ok(()),
            Cell::Text(field) => write!(text, "{}", csv_field(field)),
            Cell::Flag(flag) => write!(text, "{}", u8::from(*flag)),
            Cell::Whole(number) => write!(text, "{number}"),
            Cell::Number(number) if column.kind == ColumnKind::Binary32 => write!(text, "{}", *number as f32),
            Cell::Number(number) => write!(text, "{number}"),
            Cell::Series(series) => write!(text, "{}", joined(series)),
            Cell::Wholes(numbers) => write!(text, "{}", joined(numbers)),
        };
    }
    text.push('\n');
}

fn joined<T: ToString>(values: &[T]) -> String {
    values.iter().map(T::to_string).collect::<Vec<_>>().join(" ")
}

/// Characters that begin a formula, directly or (tab, carriage return) after a skipped blank.
const BEGINS_FORMULA: [char; 6] = ['=', '+', '-', '@', '\t', '\r'];

/// Whether a text begins like a formula, after leading apostrophes.
fn begins_formula(text: &str) -> bool {
    text.trim_start_matches('\'').starts_with(BEGINS_FORMULA)
}

/// The text with every piece replaced that is a field for a spreadsheet with another separator than the comma.
fn by_pieces<'a>(text: &'a str, of: impl Fn(&'a str) -> Cow<'a, str>) -> Cow<'a, str> {
    let separators = [';', '\t', '\r', '\n'];
    if text.contains(separators) {
        text.split_inclusive(separators).map(of).collect::<String>().into()
    } else {
        of(text)
    }
}

/// Protects a text so that a spreadsheet shows it and does not compute it: `=1+1` becomes `'=1+1`. Numbers are
/// unchanged.
fn cell_text(text: &str) -> Cow<'_, str> {
    by_pieces(text, |piece| match begins_formula(piece) && piece.parse::<f64>().is_err() {
        true => Cow::Owned(format!("'{piece}")),
        false => Cow::Borrowed(piece),
    })
}

/// Inverse of `cell_text`.
pub fn text_of_cell(field: &str) -> Cow<'_, str> {
    by_pieces(field, |piece| {
        Cow::Borrowed(piece.strip_prefix('\'').filter(|text| begins_formula(text)).unwrap_or(piece))
    })
}

/// A text as a CSV field, quoted if needed.
fn csv_field(text: &str) -> String {
    let field = cell_text(text);
    match field.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", field.replace('"', "\"\"")),
        false => field.into_owned(),
    }
}

/// Appends a row as JSON; fields are in the order of the columns.
fn append_json(line: &mut String, columns: &[Column], row: &[Cell]) {
    for (at, (column, cell)) in columns.iter().zip(row).enumerate() {
        line.push(if at == 0 { '{' } else { ',' });
        line.push_str(&Value::from(column.name.as_ref()).to_string());
        line.push(':');
        line.push_str(&json_value(column.kind, cell).to_string());
    }
    line.push_str("}\n");
}

/// A number as JSON. An infinite one is a text, because a null would vanish from every filter and mean.
pub fn json_number(number: f64) -> Value {
    match number {
        f64::INFINITY => Value::from("Infinity"),
        f64::NEG_INFINITY => Value::from("-Infinity"),
        finite => Value::from(finite),
    }
}

/// Converts a cell to JSON.
pub fn json_value(kind: ColumnKind, cell: &Cell) -> Value {
    match cell {
        Cell::Null => Value::Null,
        Cell::Text(text) => Value::from(text.as_ref()),
        Cell::Flag(flag) => Value::from(*flag),
        Cell::Whole(number) => Value::from(*number),
        // The shortest text that reads back to the same binary32.
        Cell::Number(number) if kind == ColumnKind::Binary32 && number.is_finite() => {
            (*number as f32).to_string().parse::<f64>().map_or(Value::Null, Value::from)
        }
        Cell::Number(number) => json_number(*number),
        Cell::Series(series) => Value::from(series.to_vec()),
        Cell::Wholes(numbers) => Value::from(numbers.to_vec()),
    }
}
