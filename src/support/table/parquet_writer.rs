//! Rows as Apache Parquet: zstd, row groups of a fixed number of rows, units and descriptions with every column.
//!
//! The same rows give the same bytes, independent of how they were computed: batches have a fixed number of rows, and
//! no time or machine is recorded.

use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::arrow::ArrowRows;
use super::{Cell, Column, ColumnKind, TableMetadata};
use crate::atomic_file::AtomicFile;
use crate::{Error, Result};

/// Number of rows encoded together.
const BATCH_ROWS: usize = 8 << 10;
/// Number of rows in a row group; the writer holds one encoded group in memory.
const GROUP_ROWS: usize = 128 << 10;
/// Number of rows encoded together if they have series of some kilobytes each.
const SERIES_BATCH_ROWS: usize = 64;
const SERIES_GROUP_ROWS: usize = 512;

/// A Parquet file being written.
pub(super) struct ParquetFile {
    path: PathBuf,
    rows: ArrowRows,
    batch_rows: usize,
    writer: ArrowWriter<AtomicFile>,
}

impl ParquetFile {
    pub(super) fn create(path: &Path, columns: &[Column], facts: &TableMetadata) -> Result<ParquetFile> {
        let has_series = columns.iter().any(|column| column.kind == ColumnKind::Series);
        let (batch_rows, group_rows) =
            if has_series { (SERIES_BATCH_ROWS, SERIES_GROUP_ROWS) } else { (BATCH_ROWS, GROUP_ROWS) };
        // Arrow's readers show the metadata in its schema; other readers show those in the footer.
        let words = key_values(columns, facts);
        let pairs = words.iter().map(|word| (word.key.clone(), word.value.clone().unwrap_or_default()));
        let pairs: HashMap<String, String> = pairs.collect();
        let rows = ArrowRows::new(columns, pairs);
        let level = ZstdLevel::try_new(3).map_err(|e| Error::Internal(format!("Parquet: {e}")))?;
        let properties = WriterProperties::builder()
            .set_compression(Compression::ZSTD(level))
            .set_created_by(format!("lanesweep {}", env!("CARGO_PKG_VERSION")))
            .set_max_row_group_row_count(Some(group_rows))
            .set_statistics_enabled(EnabledStatistics::Chunk)
            .set_key_value_metadata(Some(words))
            .build();
        let file = AtomicFile::create(path)?;
        let writer = ArrowWriter::try_new(file, rows.schema(), Some(properties)).map_err(|e| failed(path, e))?;
        Ok(ParquetFile { path: path.to_path_buf(), rows, batch_rows, writer })
    }

    /// Appends a row. The caller has checked that the cells match the columns.
    pub(super) fn row(&mut self, row: &[Cell]) -> Result<()> {
        self.rows.row(row)?;
        if self.rows.count == self.batch_rows { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<()> {
        self.writer.write(&self.rows.batch()?).map_err(|e| failed(&self.path, e))
    }

    /// Completes the file under its hidden name.
    pub(super) fn finish(mut self) -> Result<AtomicFile> {
        if self.rows.count > 0 {
            self.flush()?;
        }
        self.writer.into_inner().map_err(|e| failed(&self.path, e))
    }
}

/// Returns the system's error if there is one.
fn failed(path: &Path, error: ParquetError) -> Error {
    match error {
        ParquetError::External(source) => match source.downcast::<std::io::Error>() {
            Ok(source) => Error::io(path, "write", *source),
            Err(other) => Error::Internal(format!("Parquet: {other}")),
        },
        other => Error::Internal(format!("Parquet: {other}")),
    }
}

/// Metadata for the footer. The descriptions of the columns are repeated there as JSON, because not every reader shows
/// those that Arrow stores with a column.
fn key_values(columns: &[Column], facts: &TableMetadata) -> Vec<KeyValue> {
    let words: Vec<serde_json::Value> = columns
        .iter()
        .map(|c| serde_json::json!({"name": c.name, "type": c.kind.name(), "unit": c.unit, "description": c.description}))
        .collect();
    let pairs = [
        ("version", Some(env!("CARGO_PKG_VERSION").to_owned())),
        ("table", Some(facts.table.to_owned())),
        ("profile", facts.profile.clone()),
        ("plan_sha256", facts.plan_sha256.clone()),
        ("synthetic", facts.synthetic.then(|| "true".to_owned())),
        ("columns", Some(serde_json::Value::from(words).to_string())),
    ];
    let known = |(key, value): (_, Option<String>)| Some(KeyValue::new(format!("lanesweep.{key}"), value?));
    pairs.into_iter().filter_map(known).collect()
}
