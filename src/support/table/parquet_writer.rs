//! Rows as Apache Parquet: zstd, row groups of a fixed number of rows, units and descriptions with every column.
//!
//! The same rows give the same bytes, independent of how they were computed: batches have a fixed number of rows, and
//! no time or machine is recorded.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow_array::builder::{
    BooleanBuilder, Float32Builder, Float64Builder, Int64Builder, ListBuilder, StringBuilder, StringDictionaryBuilder,
};
use arrow_array::types::Int32Type;
use arrow_array::{ArrayRef, RecordBatch};
use arrow_schema::{ArrowError, DataType, Field, Schema};
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, ZstdLevel};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};

use super::{Cell, Column, ColumnKind, TableMetadata};
use crate::support::atomic_file::AtomicFile;
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
    schema: Arc<Schema>,
    builders: Vec<Builder>,
    batch_rows: usize,
    gathered: usize,
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
        let fields: Vec<Field> = columns.iter().map(field).collect();
        let schema = Arc::new(Schema::new_with_metadata(fields, pairs));
        let level = ZstdLevel::try_new(3).map_err(|e| Error::Internal(format!("Parquet: {e}")))?;
        let properties = WriterProperties::builder()
            .set_compression(Compression::ZSTD(level))
            .set_created_by(format!("lanesweep {}", env!("CARGO_PKG_VERSION")))
            .set_max_row_group_row_count(Some(group_rows))
            .set_statistics_enabled(EnabledStatistics::Chunk)
            .set_key_value_metadata(Some(words))
            .build();
        let file = AtomicFile::create(path)?;
        let writer = ArrowWriter::try_new(file, schema.clone(), Some(properties)).map_err(|e| failed(path, e))?;
        let builders = columns.iter().map(|column| Builder::new(column.kind)).collect();
        Ok(ParquetFile { path: path.to_path_buf(), schema, builders, batch_rows, gathered: 0, writer })
    }

    /// Appends a row. The caller has checked that the cells match the columns.
    pub(super) fn row(&mut self, row: &[Cell]) -> Result<()> {
        for (builder, cell) in self.builders.iter_mut().zip(row) {
            builder.append(cell).map_err(|e| Error::Internal(format!("Parquet: {e}")))?;
        }
        self.gathered += 1;
        if self.gathered == self.batch_rows { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<()> {
        self.gathered = 0;
        let arrays = self.builders.iter_mut().map(Builder::finish).collect();
        let batch =
            RecordBatch::try_new(self.schema.clone(), arrays).map_err(|e| Error::Internal(format!("Parquet: {e}")))?;
        self.writer.write(&batch).map_err(|e| failed(&self.path, e))
    }

    /// Completes the file under its hidden name.
    pub(super) fn finish(mut self) -> Result<AtomicFile> {
        if self.gathered > 0 {
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

fn field(column: &Column) -> Field {
    let data_type = match column.kind {
        ColumnKind::Text => DataType::Utf8,
        ColumnKind::Name => DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8)),
        ColumnKind::Flag => DataType::Boolean,
        ColumnKind::Whole => DataType::Int64,
        ColumnKind::Binary32 => DataType::Float32,
        ColumnKind::Binary64 => DataType::Float64,
        ColumnKind::Series => DataType::List(Arc::new(Field::new_list_field(DataType::Float64, true))),
        ColumnKind::Wholes => DataType::List(Arc::new(Field::new_list_field(DataType::Int64, true))),
    };
    let words = [("unit", &column.unit), ("description", &column.description)];
    let words: HashMap<String, String> =
        words.into_iter().map(|(key, value)| (key.to_owned(), value.to_string())).collect();
    Field::new(column.name.as_ref(), data_type, true).with_metadata(words)
}

/// Metadata for the footer. The descriptions of the columns are repeated there as JSON, because not every reader shows
/// those that Arrow stores with a column.
fn key_values(columns: &[Column], facts: &TableMetadata) -> Vec<KeyValue> {
    let words: Vec<serde_json::Value> = columns
        .iter()
        .map(|c| serde_json::json!({"name": c.name, "type": c.kind.name(), "unit": c.unit, "description": c.description}))
        .collect();
    let mut list = vec![
        KeyValue::new("lanesweep.version".to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
        KeyValue::new("lanesweep.table".to_owned(), facts.table.to_owned()),
    ];
    let mut add = |key: &str, value: Option<String>| {
        list.extend(value.map(|value| KeyValue::new(format!("lanesweep.{key}"), value)));
    };
    add("profile", facts.profile.clone());
    add("plan_sha256", facts.plan_sha256.clone());
    add("synthetic", facts.synthetic.then(|| "true".to_owned()));
    add("columns", Some(serde_json::Value::from(words).to_string()));
    list
}

/// Collects the values of a column.
enum Builder {
    Text(StringBuilder),
    Name(StringDictionaryBuilder<Int32Type>),
    Flag(BooleanBuilder),
    Whole(Int64Builder),
    Binary32(Float32Builder),
    Binary64(Float64Builder),
    Series(ListBuilder<Float64Builder>),
    Wholes(ListBuilder<Int64Builder>),
}

impl Builder {
    fn new(kind: ColumnKind) -> Builder {
        match kind {
            ColumnKind::Text => Builder::Text(StringBuilder::new()),
            ColumnKind::Name => Builder::Name(StringDictionaryBuilder::new()),
            ColumnKind::Flag => Builder::Flag(BooleanBuilder::new()),
            ColumnKind::Whole => Builder::Whole(Int64Builder::new()),
            ColumnKind::Binary32 => Builder::Binary32(Float32Builder::new()),
            ColumnKind::Binary64 => Builder::Binary64(Float64Builder::new()),
            ColumnKind::Series => Builder::Series(ListBuilder::new(Float64Builder::new())),
            ColumnKind::Wholes => Builder::Wholes(ListBuilder::new(Int64Builder::new())),
        }
    }

    /// Appends a cell. A cell of another type becomes null; the caller prevents it.
    fn append(&mut self, cell: &Cell) -> std::result::Result<(), ArrowError> {
        let number = match cell {
            Cell::Number(number) | Cell::Decimal(number) => Some(*number),
            _ => None,
        };
        match (self, cell) {
            (Builder::Text(builder), Cell::Text(text)) => builder.append_value(text),
            (Builder::Text(builder), _) => builder.append_null(),
            (Builder::Name(builder), Cell::Text(text)) => drop(builder.append(text)?),
            (Builder::Name(builder), _) => builder.append_null(),
            (Builder::Flag(builder), Cell::Flag(flag)) => builder.append_value(*flag),
            (Builder::Flag(builder), _) => builder.append_null(),
            (Builder::Whole(builder), Cell::Whole(number)) => builder.append_value(*number),
            (Builder::Whole(builder), _) => builder.append_null(),
            (Builder::Binary32(builder), _) => builder.append_option(number.map(|number| number as f32)),
            (Builder::Binary64(builder), _) => builder.append_option(number),
            (Builder::Series(builder), Cell::Series(series)) => {
                builder.values().append_slice(series);
                builder.append(true);
            }
            (Builder::Series(builder), _) => builder.append(false),
            (Builder::Wholes(builder), Cell::Wholes(numbers)) => {
                builder.values().append_slice(numbers);
                builder.append(true);
            }
            (Builder::Wholes(builder), _) => builder.append(false),
        }
        Ok(())
    }

    fn finish(&mut self) -> ArrayRef {
        match self {
            Builder::Text(builder) => Arc::new(builder.finish()),
            Builder::Name(builder) => Arc::new(builder.finish()),
            Builder::Flag(builder) => Arc::new(builder.finish()),
            Builder::Whole(builder) => Arc::new(builder.finish()),
            Builder::Binary32(builder) => Arc::new(builder.finish()),
            Builder::Binary64(builder) => Arc::new(builder.finish()),
            Builder::Series(builder) => Arc::new(builder.finish()),
            Builder::Wholes(builder) => Arc::new(builder.finish()),
        }
    }
}
