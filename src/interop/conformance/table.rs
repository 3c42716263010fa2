//! A golden table as text columns, with typed access that names file, line and column.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use crate::support::input_file;
use crate::support::table::text_of_cell;
use crate::{Error, Place, Result};

/// Kind of a table, determined by its columns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TableKind {
    /// Simulated cases of the JRC; the column `scenario` is the category.
    JrcCases,
    /// Function values; the column `fn` is the function.
    Functions,
}

/// A CSV table in memory.
#[derive(Debug, Clone)]
pub struct Table {
    path: PathBuf,
    columns: HashMap<String, usize>,
    rows: Vec<csv::StringRecord>,
}

/// One row of a [`Table`].
#[derive(Debug, Clone, Copy)]
pub struct Row<'a> {
    table: &'a Table,
    index: usize,
}

impl Table {
    /// Reads a whole table; it must have a header and at least one row.
    pub fn read(path: &Path) -> Result<Table> {
        Table::parse(&input_file::read_text(path, input_file::MAX_TABLE_BYTES)?, path)
    }

    /// Parses a table from text; `path` is for messages.
    ///
    /// # Errors
    /// As [`Table::read`].
    pub fn parse(text: &str, path: &Path) -> Result<Table> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.as_bytes());
        let broken = |e: csv::Error| {
            let mut place = Place::file(path);
            place.row = e.position().map(csv::Position::line);
            Error::input(place, e.to_string(), "every row needs as many fields as the header")
        };
        let header = reader.headers().map_err(broken)?.clone();
        let columns = header.iter().enumerate().map(|(i, name)| (name.to_owned(), i)).collect();
        let rows = reader.records().collect::<std::result::Result<Vec<_>, _>>().map_err(broken)?;
        if rows.is_empty() {
            return Err(Error::input(
                Place::file(path),
                "the table has no rows",
                "expected a header line and at least one row",
            ));
        }
        Ok(Table { path: path.to_path_buf(), columns, rows })
    }

    /// Which kind of table it is.
    pub fn kind(&self) -> Result<TableKind> {
        if self.has("fn") {
            Ok(TableKind::Functions)
        } else if self.has("scenario") && self.has("model") {
            Ok(TableKind::JrcCases)
        } else {
            Err(Error::input(
                Place::file(&self.path).row(1),
                "this is no conformance table: neither `scenario` and `model` nor `fn` are among its columns",
                "expected the columns of a JRC case table or of the function table; lanes of the `paper` \
                 profile go with option `scenarios` and option `golden_lanes`",
            ))
        }
    }

    /// Whether a column exists.
    pub fn has(&self, column: &str) -> bool {
        self.columns.contains_key(column)
    }

    /// The rows in the file's order.
    pub fn rows(&self) -> impl Iterator<Item = Row<'_>> {
        (0..self.rows.len()).map(|index| Row { table: self, index })
    }
}

impl<'a> Row<'a> {
    /// The place of a column in this row, for errors; lines count from 1 with the header.
    pub fn place(&self, column: &str) -> Place {
        Place::file(&self.table.path).row(self.index as u64 + 2).column(column)
    }

    /// The text of a column.
    pub fn text(&self, column: &str) -> Result<&'a str> {
        let index = self.table.columns.get(column).ok_or_else(|| {
            Error::input(
                Place::file(&self.table.path).row(1).column(column),
                "the column is missing",
                "compare the header with the published golden tables",
            )
        })?;
        Ok(text_of_cell(self.table.rows[self.index].get(*index).unwrap_or("")))
    }

    /// A required finite number.
    pub fn number(&self, column: &str) -> Result<f64> {
        match self.optional(column)? {
            Some(value) if value.is_finite() => Ok(value),
            Some(value) => Err(Error::input(self.place(column), format!("{value}"), "expected a finite number")),
            None => Err(Error::input(self.place(column), "the field is empty", "expected a number")),
        }
    }

    /// A number of at least 0: a speed, a length, a deceleration.
    pub fn not_negative(&self, column: &str) -> Result<f64> {
        let value = self.number(column)?;
        if (0.0..=1e6).contains(&value) {
            return Ok(value);
        }
        Err(Error::input(self.place(column), format!("{value}"), "expected a number of at least 0 and at most 1e6"))
    }

    /// A number; `None` if the field is empty (the event did not happen).
    pub fn optional(&self, column: &str) -> Result<Option<f64>> {
        let text = self.text(column)?;
        if text.is_empty() {
            return Ok(None);
        }
        text.parse()
            .map(Some)
            .map_err(|_| Error::input(self.place(column), format!("`{text}` is not a number"), "expected a number"))
    }

    /// A flag written as 0 or 1.
    pub fn flag(&self, column: &str) -> Result<bool> {
        match self.text(column)? {
            "0" => Ok(false),
            "1" => Ok(true),
            other => Err(Error::input(self.place(column), format!("`{other}` is no flag"), "expected 0 or 1")),
        }
    }
}
