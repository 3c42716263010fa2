//! Reads other programs' tables row by row.

use std::path::{Path, PathBuf};

use super::csv_reader::CsvRows;
#[cfg(feature = "parquet")]
use super::parquet_reader::ParquetRows;
use super::{TableFormat, TableRows};
use crate::plain_text::cut_names;
use crate::{Error, Place, Result};

/// A table being read.
pub struct TableReader {
    path: PathBuf,
    columns: Vec<String>,
    /// Rows are lines of a text.
    is_text: bool,
    /// The rows.
    pub rows: Box<dyn TableRows>,
}

impl TableReader {
    /// Opens a table and reads its column names.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] if it is not a regular file with a table, or its header or footer is damaged.
    pub fn open(path: &Path, format: TableFormat) -> Result<TableReader> {
        let (columns, rows): (_, Box<dyn TableRows>) = match format {
            TableFormat::Csv => CsvRows::open(path).map(|(columns, rows)| (columns, Box::new(rows) as _))?,
            #[cfg(feature = "parquet")]
            TableFormat::Parquet => ParquetRows::open(path).map(|(columns, rows)| (columns, Box::new(rows) as _))?,
            _ => return Err(Error::Internal(format!("{} cannot be read as a table", path.display()))),
        };
        Ok(TableReader { path: path.to_path_buf(), columns, is_text: format == TableFormat::Csv, rows })
    }

    /// Column names as in the file.
    pub fn columns(&self) -> &[String] {
        &self.columns
    }

    /// The place of the file.
    pub fn file(&self) -> Place {
        Place::file(&self.path)
    }

    /// Names the columns that nothing reads.
    pub fn tell_unused(&self, columns: &[&str]) {
        if !columns.is_empty() {
            tracing::warn!("{}: these columns are not used: {}", self.file(), cut_names(&columns.join(", ")));
        }
    }

    /// The place of the header, for errors about columns.
    pub fn header(&self) -> Place {
        if self.is_text { self.file().row(1) } else { self.file() }
    }

    /// The word for counting rows.
    pub fn word(&self) -> &'static str {
        if self.is_text { "line" } else { "row" }
    }

    /// The place of a row, with its item if known.
    pub fn place(&self, number: u64, item: Option<String>) -> Place {
        match (self.is_text, item) {
            (true, None) => self.file().row(number),
            (true, Some(item)) => self.file().row(number).of(item),
            (false, None) => self.file().of(format!("row {number}")),
            (false, Some(item)) => self.file().of(format!("row {number}, {item}")),
        }
    }
}
