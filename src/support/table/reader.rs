//! Reads other programs' tables row by row.

use std::path::{Path, PathBuf};

use super::{Cell, Row};

use super::TableFormat;
use super::csv_reader::CsvRows;
#[cfg(feature = "parquet")]
use super::parquet_reader::ParquetRows;
use crate::{Error, Place, Result};

/// A table being read.
pub struct TableReader {
    path: PathBuf,
    columns: Vec<String>,
    rows: Rows,
}

enum Rows {
    Csv(Box<CsvRows>),
    #[cfg(feature = "parquet")]
    Parquet(Box<ParquetRows>),
}

impl TableReader {
    /// Opens a table and reads its column names; fields of records become columns named `record_field`.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] if it is not a regular file with a table, or its header or footer is damaged.
    pub fn open(path: &Path, format: TableFormat) -> Result<TableReader> {
        let (columns, rows) = match format {
            TableFormat::Csv => {
                let (columns, rows) = CsvRows::open(path)?;
                (columns, Rows::Csv(Box::new(rows)))
            }
            #[cfg(feature = "parquet")]
            TableFormat::Parquet => {
                let (columns, rows) = ParquetRows::open(path)?;
                (columns, Rows::Parquet(Box::new(rows)))
            }
            _ => return Err(Error::Internal(format!("{} cannot be read as a table", path.display()))),
        };
        Ok(TableReader { path: path.to_path_buf(), columns, rows })
    }

    /// Column names as in the file.
    pub fn columns(&self) -> &[String] {
        &self.columns
    }

    /// Selects the columns, in the order in which rows have them. Call it before the first row.
    ///
    /// # Errors
    /// [`Error::Input`] if a selected column has an unsupported type, or its pages claim more than the file can hold.
    pub fn want(&mut self, columns: &[usize]) -> Result<()> {
        match &mut self.rows {
            Rows::Csv(rows) => {
                rows.want(columns);
                Ok(())
            }
            #[cfg(feature = "parquet")]
            Rows::Parquet(rows) => rows.want(columns),
        }
    }

    /// Returns the next row; `None` after the last.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] for damaged data.
    pub fn next_row(&mut self) -> Result<Option<Row>> {
        match &mut self.rows {
            Rows::Csv(rows) => rows.next_row(),
            #[cfg(feature = "parquet")]
            Rows::Parquet(rows) => rows.next_row(),
        }
    }

    /// Advances to the next row, whose values [`TableReader::cell`] gives; false after the last.
    ///
    /// # Errors
    /// As [`TableReader::next_row`].
    pub fn step(&mut self) -> Result<bool> {
        match &mut self.rows {
            Rows::Csv(rows) => rows.step(),
            #[cfg(feature = "parquet")]
            Rows::Parquet(rows) => rows.step(),
        }
    }

    /// The value of a selected column, by its position in the selection, after [`TableReader::step`]; null for a list.
    pub fn cell(&self, wanted: usize) -> Cell<'_> {
        match &self.rows {
            Rows::Csv(rows) => rows.cell(wanted),
            #[cfg(feature = "parquet")]
            Rows::Parquet(rows) => rows.cell(wanted),
        }
    }

    /// Whether a selected column has lists.
    pub fn has_lists(&self) -> bool {
        match &self.rows {
            Rows::Csv(_) => false,
            #[cfg(feature = "parquet")]
            Rows::Parquet(rows) => rows.has_lists(),
        }
    }

    /// Whether a column has instants, which are numbers in seconds since 1970.
    #[cfg_attr(not(feature = "parquet"), expect(unused_variables, reason = "CSV has texts"))]
    pub fn has_instants(&self, column: usize) -> bool {
        match &self.rows {
            Rows::Csv(_) => false,
            #[cfg(feature = "parquet")]
            Rows::Parquet(rows) => rows.has_instants(column),
        }
    }

    /// The place of the file.
    pub fn file(&self) -> Place {
        Place::file(&self.path)
    }

    /// The place of the header, for errors about columns.
    pub fn header(&self) -> Place {
        match &self.rows {
            Rows::Csv(_) => self.file().row(1),
            #[cfg(feature = "parquet")]
            Rows::Parquet(_) => self.file(),
        }
    }

    /// The word for counting rows.
    pub fn word(&self) -> &'static str {
        match &self.rows {
            Rows::Csv(_) => "line",
            #[cfg(feature = "parquet")]
            Rows::Parquet(_) => "row",
        }
    }

    /// The place of a row, with its item if known.
    pub fn place(&self, number: u64, item: Option<String>) -> Place {
        match &self.rows {
            Rows::Csv(_) => item.map_or(self.file().row(number), |item| self.file().row(number).of(item)),
            #[cfg(feature = "parquet")]
            Rows::Parquet(_) => {
                self.file().of(item.map_or(format!("row {number}"), |item| format!("row {number}, {item}")))
            }
        }
    }
}
