//! Tables: rows of named, typed columns with units, in files whose format their name's ending chooses.
//!
//! Here live the formats (CSV, JSON Lines, Apache Parquet), the columns, the writer that streams rows to a file which
//! is there whole or not at all, and the reader of tables that other programs made. Here lives nothing about what the
//! rows mean: lanes and samples are [`crate::report`]'s, scenarios [`crate::scenario`]'s. `docs/src/tables.md` tells
//! users the columns; a test compares it with what is written.

mod column;
mod csv_reader;
mod format;
mod jsonl;
mod names;
#[cfg(feature = "parquet")]
mod parquet_pages;
#[cfg(feature = "parquet")]
mod parquet_reader;
#[cfg(feature = "parquet")]
mod parquet_writer;
mod reader;
mod writer;

pub use column::{Cell, Column, Kind};
pub use format::TableFormat;
pub(crate) use names::{Named, Resolved, nearest, resolve};
pub(crate) use reader::{Row, TableReader};
pub(crate) use writer::quoted;
pub use writer::{TableFacts, TableWriter};
