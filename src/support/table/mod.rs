//! Tables: rows of named, typed columns with units, in files whose format follows from the file name's ending.
//!
//! This module holds the formats (CSV, JSON Lines, Apache Parquet, Arrow in memory), the columns, and the [`Table`] in memory with its
//! renderings for terminals, pages and documents. It also holds the writer, which streams rows to an atomic file, and
//! the reader of other programs' tables. The meaning of rows is defined elsewhere: lanes and samples in
//! the report, scenarios in `scenario`. `docs/src/tables.md` documents the columns; a test compares it
//! with the written files.

#[cfg(feature = "arrow")]
mod arrow;
mod column;
mod csv_reader;
mod memory;
mod names;
#[cfg(feature = "parquet")]
mod parquet_reader;
#[cfg(feature = "parquet")]
mod parquet_writer;
mod reader;
mod writer;

#[cfg(feature = "arrow")]
pub use arrow::ArrowRows;
pub use column::{Cell, Column, ColumnKind, Digits, Row, TableMetadata, TableRows};
pub use csv_reader::{delimiter_of, has_decimal_commas};
pub use memory::{CellValue, NamedValue, NumberText, Table, TableOf, WIDTH};
pub use names::{NameUnit, Named, Resolved, nearest, resolve};
#[cfg(feature = "parquet")]
pub use parquet_reader::is_panic_caught;
pub use reader::TableReader;
pub use writer::{TableWriter, json_number, json_value, text_of_cell};

use std::path::Path;

use crate::{Error, Place, Result};

/// Always false: without Parquet no reader here panics. See the function of this name with the feature.
#[cfg(not(feature = "parquet"))]
pub fn is_panic_caught() -> bool {
    false
}

/// A format of tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TableFormat {
    /// Comma-separated values with a header: `.csv`.
    Csv,
    /// One JSON object a line: `.jsonl`, also `.json` and `.ndjson`.
    JsonLines,
    /// Apache Parquet: `.parquet`.
    Parquet,
}

impl TableFormat {
    /// All formats, for tables of lanes and samples; CSV is the default for names without an ending.
    pub const EVERY: [TableFormat; 3] = [TableFormat::Csv, TableFormat::JsonLines, TableFormat::Parquet];

    /// Endings of names, the usual one first.
    fn endings(self) -> &'static [&'static str] {
        match self {
            TableFormat::Csv => &["csv"],
            TableFormat::JsonLines => &["jsonl", "json", "ndjson"],
            TableFormat::Parquet => &["parquet"],
        }
    }

    /// The format of a file, among the usable ones. A name without an ending has the first of them. Another ending is
    /// refused, so that no table has the name of another format.
    ///
    /// # Errors
    /// [`Error::Usage`] that names `what` (a flag), the file and the known endings, or says that the program was built
    /// without Parquet.
    pub fn of(path: &Path, usable: &[TableFormat], what: &str) -> Result<TableFormat> {
        let Some(ending) = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase()) else {
            return Ok(usable.first().copied().unwrap_or(TableFormat::Csv));
        };
        let place = || Place::item(format!("{what} {}", path.display()));
        match usable.iter().find(|format| format.endings().contains(&ending.as_str())) {
            #[cfg(not(feature = "parquet"))]
            Some(TableFormat::Parquet) => Err(Error::usage(
                place(),
                "this program was built without Parquet",
                "use another format, or build it with the feature `parquet`",
            )),
            Some(format) => Ok(*format),
            None => {
                let known: Vec<String> = usable.iter().map(|format| format!(".{}", format.endings()[0])).collect();
                let help = format!("use a name that ends in {}", or_list(&known));
                Err(Error::usage(place(), format!("`.{ending}` is no format of tables here"), help))
            }
        }
    }
}

fn or_list(words: &[String]) -> String {
    match words {
        [first @ .., last] if !first.is_empty() => format!("{} or {last}", first.join(", ")),
        _ => words.concat(),
    }
}
