//! Rows of a Parquet file that any program may have written. A few rows at a time are in memory; panics of
//! the decoder on damaged files become errors about the file.

use std::cell::Cell;
use std::fs::File;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use arrow_array::cast::AsArray;
use arrow_array::types::{
    Decimal128Type, Decimal256Type, Float16Type, Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type,
    UInt8Type, UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{Array, ArrayRef, RecordBatch, StructArray};
use arrow_schema::{DataType, Field};
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{
    ArrowReaderMetadata, ArrowReaderOptions, ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder,
};
use parquet::basic::Compression;
use serde_json::Value;

use super::Row;
use crate::support::input_file;
use crate::{Error, Place, Result};

/// Rows decoded together.
const BATCH_ROWS: usize = 64;
/// Maximum length of a series: eleven hours at 25 Hz.
const MAX_SERIES: usize = 1 << 20;
/// Maximum length of a text, bytes: every row may repeat it.
const MAX_TEXT: usize = 1 << 16;

pub(super) struct ParquetRows {
    path: PathBuf,
    file: File,
    metadata: ArrowReaderMetadata,
    /// Position of each column: field of the root, and field of the record there.
    leaves: Vec<(usize, Option<usize>)>,
    /// Names as in the file's header, for messages.
    names: Vec<String>,
    wanted: Vec<usize>,
    reader: Option<ParquetRecordBatchReader>,
    batch: Vec<Leaf>,
    batch_rows: usize,
    at: usize,
    number: u64,
}

/// A column of a batch; a value is also null if its record is.
struct Leaf {
    record: Option<ArrayRef>,
    values: ArrayRef,
}

thread_local! {
    /// Whether a panic of this thread will be caught here.
    static IS_CAUGHT: Cell<bool> = const { Cell::new(false) };
}

/// Whether a panic of this thread, which decodes a damaged Parquet file, becomes an error about that file. A program's
/// panic hook (`std::panic::set_hook`) can then suppress its message. The library sets no hook.
pub fn is_panic_caught() -> bool {
    IS_CAUGHT.get()
}

/// Runs the decoder. Damage that makes it panic becomes an error about the file.
fn guarded<T, E: std::fmt::Display>(path: &Path, work: impl FnOnce() -> std::result::Result<T, E>) -> Result<T> {
    IS_CAUGHT.set(true);
    let result = catch_unwind(AssertUnwindSafe(work));
    IS_CAUGHT.set(false);
    match result {
        Ok(result) => result.map_err(|problem| damaged(path, problem)),
        Err(_) => Err(damaged(path, "its content contradicts itself")),
    }
}

fn damaged(path: &Path, problem: impl std::fmt::Display) -> Error {
    let problem = format!("not a Parquet file that can be read: {problem}");
    Error::input(Place::file(path), problem, "write the file again, or use JSON Lines or CSV")
}

impl ParquetRows {
    pub(super) fn open(path: &Path) -> Result<(Vec<String>, ParquetRows)> {
        let file = input_file::open(path)?;
        // Use only Parquet's own types and ignore the Arrow schema of another program.
        let options = ArrowReaderOptions::new().with_skip_arrow_metadata(true);
        let metadata = guarded(path, || ArrowReaderMetadata::load(&file, options))?;
        let (mut names, mut leaves) = (Vec::new(), Vec::new());
        for (root, field) in metadata.schema().fields().iter().enumerate() {
            match field.data_type() {
                DataType::Struct(fields) => {
                    for (at, inner) in fields.iter().enumerate() {
                        names.push(format!("{}.{}", field.name(), inner.name()));
                        leaves.push((root, Some(at)));
                    }
                }
                _ => {
                    names.push(field.name().clone());
                    leaves.push((root, None));
                }
            }
        }
        let rows = ParquetRows {
            path: path.to_path_buf(),
            file,
            metadata,
            leaves,
            names: names.clone(),
            wanted: Vec::new(),
            reader: None,
            batch: Vec::new(),
            batch_rows: 0,
            at: 0,
            number: 0,
        };
        Ok((names, rows))
    }

    pub(super) fn want(&mut self, columns: &[usize]) -> Result<()> {
        for &column in columns {
            let data_type = self.data_type(column);
            if !is_readable(&data_type) {
                let place = Place::file(&self.path).column(&self.names[column]);
                let problem = format!("holds values of the type {data_type}");
                return Err(Error::input(place, problem, "expected numbers, texts, truth values or lists of numbers"));
            }
        }
        self.wanted = columns.to_vec();
        let parquet = self.metadata.metadata();
        let roots: Vec<usize> = columns.iter().map(|&column| self.leaves[column].0).collect();
        let mask = ProjectionMask::roots(self.metadata.parquet_schema(), roots);
        let chunks = || {
            let included = |(at, chunk)| mask.leaf_included(at).then_some(chunk);
            parquet.row_groups().iter().flat_map(move |group| group.columns().iter().enumerate().filter_map(included))
        };
        let codec = |chunk: &&parquet::file::metadata::ColumnChunkMetaData| {
            !matches!(chunk.compression(), Compression::UNCOMPRESSED | Compression::SNAPPY | Compression::ZSTD(_))
        };
        if let Some(chunk) = chunks().find(codec) {
            let problem = format!("compressed with {}; expected zstd, snappy or none", chunk.compression());
            return Err(Error::input(Place::file(&self.path), problem, "write it again with compression=\"zstd\""));
        }
        let file = self.file.try_clone().map_err(|e| Error::io(&self.path, "read", e))?;
        let builder = ParquetRecordBatchReaderBuilder::new_with_metadata(file, self.metadata.clone());
        let builder = builder.with_projection(mask).with_batch_size(BATCH_ROWS);
        self.reader = Some(guarded(&self.path, || builder.build())?);
        Ok(())
    }

    fn data_type(&self, column: usize) -> DataType {
        let (root, inner) = self.leaves[column];
        let field: &Field = self.metadata.schema().field(root);
        match (field.data_type(), inner) {
            (DataType::Struct(fields), Some(at)) => fields[at].data_type().clone(),
            (other, _) => other.clone(),
        }
    }

    pub(super) fn next_row(&mut self) -> Result<Option<Row>> {
        while self.at == self.batch_rows {
            let Some(reader) = &mut self.reader else { return Ok(None) };
            let next = guarded(&self.path, || reader.next().transpose())?;
            let Some(batch) = next else { return Ok(None) };
            self.batch = guarded(&self.path, || self.leaves_of(&batch))?;
            (self.batch_rows, self.at) = (batch.num_rows(), 0);
        }
        let at = self.at;
        let batch = &self.batch;
        let values = guarded(&self.path, || batch.iter().map(|leaf| value(leaf, at)).collect())?;
        self.at += 1;
        self.number += 1;
        Ok(Some(Row { number: self.number, values }))
    }

    /// The requested columns of a batch.
    fn leaves_of(&self, batch: &RecordBatch) -> std::result::Result<Vec<Leaf>, String> {
        let leaf = |&column: &usize| {
            let (root, inner) = self.leaves[column];
            // The batch has the requested fields of the root, in the order of the file.
            let before = |&&other: &&usize| self.leaves[other].0 < root;
            let mut roots: Vec<usize> = self.wanted.iter().filter(before).map(|&other| self.leaves[other].0).collect();
            roots.sort_unstable();
            roots.dedup();
            let array = batch.columns().get(roots.len()).ok_or("a column is missing")?;
            let (record, values) = match inner {
                None => (None, array.clone()),
                Some(at) => {
                    let record = array.as_any().downcast_ref::<StructArray>().ok_or("a record is none")?;
                    (Some(array.clone()), record.column(at).clone())
                }
            };
            if !is_readable(values.data_type()) {
                return Err("a column changes its type".to_owned());
            }
            Ok(Leaf { record, values })
        };
        self.wanted.iter().map(leaf).collect()
    }
}

fn is_number(of: &DataType) -> bool {
    of.is_integer() || of.is_floating() || matches!(of, DataType::Decimal128(..) | DataType::Decimal256(..))
}

/// Whether values of this type can be read. Arrow's own types (dictionaries, large lists) do not occur, because the
/// Arrow metadata is skipped.
fn is_readable(of: &DataType) -> bool {
    match of {
        DataType::Utf8 | DataType::Boolean | DataType::Null => true,
        DataType::List(item) => item.data_type() == &DataType::Null || is_number(item.data_type()),
        other => is_number(other),
    }
}

/// A value of a leaf; NaN and infinity become null, because JSON lacks them.
fn value(leaf: &Leaf, at: usize) -> std::result::Result<Value, String> {
    let array = &leaf.values;
    if leaf.record.as_ref().is_some_and(|record| record.is_null(at)) || array.is_null(at) {
        return Ok(Value::Null);
    }
    macro_rules! number {
        ($of:ident as $to:ty) => {
            Value::from(<$to>::from(array.as_primitive::<$of>().value(at)))
        };
    }
    Ok(match array.data_type() {
        DataType::Utf8 => match array.as_string::<i32>().value(at) {
            text if text.len() > MAX_TEXT => {
                return Err(format!("a text has {} bytes; at most {MAX_TEXT} can be read", text.len()));
            }
            text => Value::from(text),
        },
        DataType::Boolean => Value::from(array.as_boolean().value(at)),
        DataType::Int8 => number!(Int8Type as i64),
        DataType::Int16 => number!(Int16Type as i64),
        DataType::Int32 => number!(Int32Type as i64),
        DataType::Int64 => number!(Int64Type as i64),
        DataType::UInt8 => number!(UInt8Type as i64),
        DataType::UInt16 => number!(UInt16Type as i64),
        DataType::UInt32 => number!(UInt32Type as i64),
        DataType::UInt64 => {
            i64::try_from(array.as_primitive::<UInt64Type>().value(at)).map_or(Value::Null, Value::from)
        }
        DataType::Float16 => number!(Float16Type as f64),
        DataType::Float32 => number!(Float32Type as f64),
        DataType::Float64 => number!(Float64Type as f64),
        DataType::Decimal128(_, scale) => {
            Value::from(array.as_primitive::<Decimal128Type>().value(at) as f64 / 10f64.powi(i32::from(*scale)))
        }
        DataType::Decimal256(_, scale) => {
            let digits = array.as_primitive::<Decimal256Type>().value(at).to_string();
            let value = digits.parse::<f64>().map_err(|e| e.to_string())?;
            Value::from(value / 10f64.powi(i32::from(*scale)))
        }
        DataType::List(_) => {
            let items = array.as_list::<i32>().value(at);
            if items.len() > MAX_SERIES {
                return Err(format!("a series has {} values; at most {MAX_SERIES} can be read", items.len()));
            }
            let items = Leaf { record: None, values: items };
            Value::Array((0..items.values.len()).map(|at| value(&items, at)).collect::<std::result::Result<_, _>>()?)
        }
        _ => Value::Null,
    })
}
