//! Writing a table row by row to a file that is there whole or not at all.

use std::fmt::Write as _;
use std::path::Path;

#[cfg(feature = "parquet")]
use super::parquet_writer::ParquetFile;
use super::spreadsheet::csv_field;
use super::{Cell, Column, ColumnKind, TableFormat, TableMetadata, jsonl};
use crate::support::atomic_file::{AtomicFile, StagedFile};
use crate::{Error, Result};

/// A table that is being written. Memory does not grow with its rows. Dropped before [`TableWriter::finish`], it leaves
/// nothing behind.
pub struct TableWriter {
    columns: Vec<Column>,
    out: Out,
}

enum Out {
    /// With a buffer for the row.
    Csv(AtomicFile, String),
    JsonLines(AtomicFile, String),
    #[cfg(feature = "parquet")]
    Parquet(Box<ParquetFile>),
}

impl TableWriter {
    /// Begins a table; what is there under that name stays until [`TableWriter::finish`].
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
                let names: Vec<String> = columns.iter().map(|column| csv_field(&column.name)).collect();
                file.append(format!("{}\n", names.join(",")).as_bytes())?;
                Out::Csv(file, String::new())
            }
            TableFormat::JsonLines => Out::JsonLines(AtomicFile::create(path)?, String::new()),
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

    /// Appends a row: one field per column, each of the column's kind.
    ///
    /// # Errors
    /// [`Error::Io`], a full disk for instance; [`Error::Internal`] for fields that do not fit the columns.
    pub fn row(&mut self, row: &[Cell]) -> Result<()> {
        if row.len() != self.columns.len() || !self.columns.iter().zip(row).all(|(c, cell)| fits(c.kind, cell)) {
            return Err(Error::Internal(format!("a row does not fit its table: {row:?}")));
        }
        match &mut self.out {
            Out::Csv(file, text) => {
                text.clear();
                append_csv(text, &self.columns, row);
                file.append(text.as_bytes())
            }
            Out::JsonLines(file, text) => {
                text.clear();
                jsonl::append(text, &self.columns, row);
                file.append(text.as_bytes())
            }
            #[cfg(feature = "parquet")]
            Out::Parquet(file) => file.row(row),
        }
    }

    /// Brings the table to the disk and gives it its name.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn finish(self) -> Result<()> {
        self.stage()?.publish()
    }

    /// Brings the table to the disk, still without its name.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn stage(self) -> Result<StagedFile> {
        let file = match self.out {
            Out::Csv(file, _) | Out::JsonLines(file, _) => file,
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
        Cell::Number(_) | Cell::Decimal(_) => matches!(kind, ColumnKind::Binary32 | ColumnKind::Binary64),
        Cell::Series(_) => kind == ColumnKind::Series,
        Cell::Wholes(_) => kind == ColumnKind::Wholes,
    }
}

/// A row as CSV. Numbers have as many digits as they need in their arithmetic.
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
            Cell::Decimal(number) => write!(text, "{number:?}"),
            Cell::Series(series) => write!(text, "{}", joined(series)),
            Cell::Wholes(numbers) => write!(text, "{}", joined(numbers)),
        };
    }
    text.push('\n');
}

fn joined<T: ToString>(values: &[T]) -> String {
    values.iter().map(T::to_string).collect::<Vec<_>>().join(" ")
}
