//! Rows of a Parquet file that any program may have written. A few rows at a time are in memory; panics of
//! the decoder on damaged files become errors about the file.

use std::cell::Cell;
use std::fs::File;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use arrow_array::cast::AsArray;
use arrow_array::types::{
    Decimal128Type, Decimal256Type, Float16Type, Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type,
    TimestampMicrosecondType, TimestampMillisecondType, TimestampNanosecondType, TimestampSecondType, UInt8Type,
    UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{Array, ArrayRef, RecordBatch, StructArray};
use arrow_schema::{DataType, Field, TimeUnit};
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{
    ArrowReaderMetadata, ArrowReaderOptions, ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder,
};
use parquet::basic::Compression;
use serde_json::Value;

use super::{Cell as TableCell, Row, TableRows};
use crate::input_file;
use crate::{Error, Place, Result};

/// Rows decoded together, with and without lists; each may repeat a text of [`MAX_TEXT`].
const BATCH_ROWS: [usize; 2] = [64, 256];
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
    /// The values of common types; null is NaN.
    plain: Plain,
}

/// Values of a column without nulls, or of real numbers with them, so that no value asks for its type.
enum Plain {
    Reals(Vec<f64>),
    Wholes(Vec<i64>),
    Other,
}

impl Leaf {
    fn new(record: Option<ArrayRef>, values: ArrayRef) -> Leaf {
        let mut leaf = Leaf { record, values, plain: Plain::Other };
        let (of, rows) = (leaf.values.data_type(), 0..leaf.values.len());
        let is_usual = leaf.record.is_none() && leaf.values.null_count() == 0;
        leaf.plain = match of {
            // The usual ones at once.
            DataType::Float64 if is_usual => Plain::Reals(leaf.values.as_primitive::<Float64Type>().values().to_vec()),
            DataType::Int64 if is_usual => Plain::Wholes(leaf.values.as_primitive::<Int64Type>().values().to_vec()),
            _ if of.is_floating() || matches!(of, DataType::Timestamp(..)) => {
                let real = |at| if let TableCell::Number(value) = cell(&leaf, at) { value } else { f64::NAN };
                Plain::Reals(rows.map(real).collect())
            }
            _ if of.is_integer() => {
                let whole = |at| if let TableCell::Whole(value) = cell(&leaf, at) { Some(value) } else { None };
                rows.map(whole).collect::<Option<_>>().map_or(Plain::Other, Plain::Wholes)
            }
            _ => Plain::Other,
        };
        leaf
    }

    fn is_null(&self, at: usize) -> bool {
        self.record.as_ref().is_some_and(|record| record.is_null(at)) || self.values.is_null(at)
    }
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

    fn data_type(&self, column: usize) -> DataType {
        let (root, inner) = self.leaves[column];
        let field: &Field = self.metadata.schema().field(root);
        match (field.data_type(), inner) {
            (DataType::Struct(fields), Some(at)) => fields[at].data_type().clone(),
            (other, _) => other.clone(),
        }
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
            Ok(Leaf::new(record, values))
        };
        self.wanted.iter().map(leaf).collect()
    }
}

impl TableRows for ParquetRows {
    fn want(&mut self, columns: &[usize]) -> Result<()> {
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
            use Compression::{GZIP, LZ4, LZ4_RAW, SNAPPY, UNCOMPRESSED, ZSTD};
            !matches!(chunk.compression(), UNCOMPRESSED | SNAPPY | ZSTD(_) | GZIP(_) | LZ4 | LZ4_RAW)
        };
        if let Some(chunk) = chunks().find(codec) {
            let problem = format!("compressed with {}; expected zstd, snappy, gzip, lz4 or none", chunk.compression());
            return Err(Error::input(Place::file(&self.path), problem, "write it again with compression=\"zstd\""));
        }
        let file = self.file.try_clone().map_err(|e| Error::io(&self.path, "read", e))?;
        let builder = ParquetRecordBatchReaderBuilder::new_with_metadata(file, self.metadata.clone());
        let builder = builder.with_projection(mask).with_batch_size(BATCH_ROWS[usize::from(!self.has_lists())]);
        self.reader = Some(guarded(&self.path, || builder.build())?);
        Ok(())
    }

    fn step(&mut self) -> Result<bool> {
        while self.at == self.batch_rows {
            let Some(reader) = &mut self.reader else { return Ok(false) };
            let next = guarded(&self.path, || reader.next().transpose())?;
            let Some(batch) = next else { return Ok(false) };
            self.batch = guarded(&self.path, || self.leaves_of(&batch))?;
            (self.batch_rows, self.at) = (batch.num_rows(), 0);
        }
        self.at += 1;
        self.number += 1;
        Ok(true)
    }

    fn cell(&self, wanted: usize) -> TableCell<'_> {
        let (leaf, at) = (&self.batch[wanted], self.at - 1);
        match &leaf.plain {
            Plain::Reals(values) => TableCell::Number(values[at]),
            Plain::Wholes(values) => TableCell::Whole(values[at]),
            Plain::Other => cell(leaf, at),
        }
    }

    fn next_row(&mut self) -> Result<Option<Row>> {
        if !self.step()? {
            return Ok(None);
        }
        let (batch, at) = (&self.batch, self.at - 1);
        let values = guarded(&self.path, || batch.iter().map(|leaf| value(leaf, at)).collect())?;
        Ok(Some(Row { number: self.number, values }))
    }

    fn has_lists(&self) -> bool {
        self.wanted.iter().any(|&column| matches!(self.data_type(column), DataType::List(_)))
    }

    fn has_instants(&self, column: usize) -> bool {
        matches!(self.data_type(column), DataType::Timestamp(..))
    }
}

fn is_number(of: &DataType) -> bool {
    of.is_integer() || of.is_floating() || matches!(of, DataType::Decimal128(..) | DataType::Decimal256(..))
}

/// Whether values of this type can be read. Arrow's own types (dictionaries, large lists) do not occur, because the
/// Arrow metadata is skipped.
fn is_readable(of: &DataType) -> bool {
    match of {
        DataType::Utf8 | DataType::Boolean | DataType::Null | DataType::Timestamp(..) => true,
        DataType::List(item) => item.data_type() == &DataType::Null || is_number(item.data_type()),
        other => is_number(other),
    }
}

/// A value of a leaf; NaN and infinity become null, because JSON lacks them.
fn value(leaf: &Leaf, at: usize) -> std::result::Result<Value, String> {
    if let DataType::List(_) = leaf.values.data_type()
        && !leaf.is_null(at)
    {
        let items = leaf.values.as_list::<i32>().value(at);
        if items.len() > MAX_SERIES {
            return Err(format!("a series has {} values; at most {MAX_SERIES} can be read", items.len()));
        }
        let items = Leaf { record: None, values: items, plain: Plain::Other };
        return Ok(Value::Array(
            (0..items.values.len()).map(|at| value(&items, at)).collect::<std::result::Result<_, _>>()?,
        ));
    }
    Ok(match cell(leaf, at) {
        TableCell::Text(text) if text.len() > MAX_TEXT => {
            return Err(format!("a text has {} bytes; at most {MAX_TEXT} can be read", text.len()));
        }
        TableCell::Text(text) => Value::from(text),
        TableCell::Flag(value) => Value::from(value),
        TableCell::Whole(value) => Value::from(value),
        TableCell::Number(value) => Value::from(value),
        _ => Value::Null,
    })
}

/// A value of a leaf that has no lists.
fn cell(leaf: &Leaf, at: usize) -> TableCell<'_> {
    let array = &leaf.values;
    if leaf.is_null(at) {
        return TableCell::Null;
    }
    macro_rules! value {
        ($of:ident) => {
            array.as_primitive::<$of>().value(at)
        };
    }
    match array.data_type() {
        DataType::Utf8 => TableCell::Text(array.as_string::<i32>().value(at).into()),
        DataType::Boolean => TableCell::Flag(array.as_boolean().value(at)),
        DataType::Int8 => TableCell::Whole(value!(Int8Type).into()),
        DataType::Int16 => TableCell::Whole(value!(Int16Type).into()),
        DataType::Int32 => TableCell::Whole(value!(Int32Type).into()),
        DataType::Int64 => TableCell::Whole(value!(Int64Type)),
        DataType::UInt8 => TableCell::Whole(value!(UInt8Type).into()),
        DataType::UInt16 => TableCell::Whole(value!(UInt16Type).into()),
        DataType::UInt32 => TableCell::Whole(value!(UInt32Type).into()),
        DataType::UInt64 => {
            let value = value!(UInt64Type);
            i64::try_from(value).map_or_else(|_| TableCell::Text(value.to_string().into()), TableCell::Whole)
        }
        DataType::Float16 => TableCell::Number(value!(Float16Type).into()),
        DataType::Float32 => TableCell::Number(value!(Float32Type).into()),
        DataType::Float64 => TableCell::Number(value!(Float64Type)),
        DataType::Timestamp(TimeUnit::Second, _) => TableCell::Number(value!(TimestampSecondType) as f64),
        DataType::Timestamp(TimeUnit::Millisecond, _) => {
            TableCell::Number(value!(TimestampMillisecondType) as f64 / 1e3)
        }
        DataType::Timestamp(TimeUnit::Microsecond, _) => {
            TableCell::Number(value!(TimestampMicrosecondType) as f64 / 1e6)
        }
        DataType::Timestamp(TimeUnit::Nanosecond, _) => TableCell::Number(value!(TimestampNanosecondType) as f64 / 1e9),
        DataType::Decimal128(_, scale) => {
            TableCell::Number(value!(Decimal128Type) as f64 / 10f64.powi(i32::from(*scale)))
        }
        DataType::Decimal256(_, scale) => {
            let value = value!(Decimal256Type).to_string().parse::<f64>().unwrap_or(f64::NAN);
            TableCell::Number(value / 10f64.powi(i32::from(*scale)))
        }
        _ => TableCell::Null,
    }
}
