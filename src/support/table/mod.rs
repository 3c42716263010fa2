//! Tables: rows of named, typed columns with units, in files whose format their name's ending chooses.
//!
//! Here live the formats (CSV, JSON Lines, Apache Parquet), the columns, the [`Table`] in memory with its renderings for
//! terminals, pages and documents, the writer that streams rows to a file which
//! is there whole or not at all, and the reader of tables that other programs made. Here lives nothing about what the
//! rows mean: lanes and samples are [`crate::report`]'s, scenarios [`crate::scenario`]'s. `docs/src/tables.md` tells
//! users the columns; a test compares it with what is written.

mod column;
mod csv_reader;
mod format;
mod jsonl;
mod memory;
mod names;
#[cfg(feature = "parquet")]
mod parquet_pages;
#[cfg(feature = "parquet")]
mod parquet_reader;
#[cfg(feature = "parquet")]
mod parquet_writer;
mod reader;
mod spreadsheet;
mod text;
mod writer;

pub(crate) use column::Row;
pub use column::{Cell, Column, ColumnKind, Digits, TableMetadata};
pub use format::TableFormat;
pub use memory::{CellValue, NumberText, Table, TableOf};
pub(crate) use names::{Named, Resolved, nearest, resolve};
#[cfg(feature = "parquet")]
pub use parquet_reader::is_panic_caught;
pub(crate) use reader::TableReader;
pub(crate) use spreadsheet::{csv_field, text_of_cell};
pub(crate) use text::WIDTH;
pub use writer::TableWriter;

/// No reader here panics without Parquet; see the function of this name with it.
#[cfg(not(feature = "parquet"))]
pub fn is_panic_caught() -> bool {
    false
}
