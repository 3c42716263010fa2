//! Rows of a Parquet file that any program may have written. A few rows at a time are in memory; panics of
//! the decoder on damaged files become errors about the file.

use std::cell::Cell;
use std::fs::File;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use arrow_array::cast::AsArray;
use arrow_array::types::{
    Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type, UInt8Type, UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{Array, ArrayRef, BooleanArray, ListArray, RecordBatch, StringArray, StructArray};
use arrow_schema::{DataType, Field};
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{
    ArrowReaderMetadata, ArrowReaderOptions, ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder,
};
use parquet::basic::Compression;
use serde_json::Value;

use super::{Cell as TableCell, Row, TableRows};
use crate::{Error, Place, Result, input_file};

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
    values: Values,
}

/// Values without a type to ask for.
enum Values {
    Nulls,
    /// Null is NaN.
    Reals(Vec<f64>),
    Wholes(Vec<Option<i64>>),
    Flags(BooleanArray),
    Texts(StringArray),
    Lists(ListArray, Box<Values>),
}

impl Values {
    fn new(array: &ArrayRef) -> std::result::Result<Values, String> {
        macro_rules! reals {
            ($of:ident) => {
                Values::Reals(array.as_primitive::<$of>().iter().map(|real| real.map_or(f64::NAN, f64::from)).collect())
            };
        }
        macro_rules! wholes {
            ($of:ident) => {
                Values::Wholes(array.as_primitive::<$of>().iter().map(|whole| whole.map(i64::from)).collect())
            };
        }
        Ok(match array.data_type() {
            DataType::Null => Values::Nulls,
            DataType::Float32 => reals!(Float32Type),
            DataType::Float64 => reals!(Float64Type),
            DataType::Int8 => wholes!(Int8Type),
            DataType::Int16 => wholes!(Int16Type),
            DataType::Int32 => wholes!(Int32Type),
            DataType::Int64 => wholes!(Int64Type),
            DataType::UInt8 => wholes!(UInt8Type),
            DataType::UInt16 => wholes!(UInt16Type),
            DataType::UInt32 => wholes!(UInt32Type),
            DataType::UInt64 => {
                let wholes = array.as_primitive::<UInt64Type>().iter();
                let wholes: std::result::Result<_, _> = wholes.map(|of| of.map(i64::try_from).transpose()).collect();
                Values::Wholes(wholes.map_err(|_| "a whole number is above 2^63; write such numbers as texts")?)
            }
            DataType::Boolean => Values::Flags(array.as_boolean().clone()),
            DataType::Utf8 => Values::Texts(array.as_string().clone()),
            DataType::List(_) => {
                let lists = array.as_list::<i32>();
                Values::Lists(lists.clone(), Box::new(Values::new(lists.values())?))
            }
            other => return Err(format!("a column has the type {other}")),
        })
    }

    /// A value; null for a list.
    fn cell(&self, at: usize) -> TableCell<'_> {
        match self {
            Values::Reals(reals) => TableCell::Number(reals[at]),
            Values::Wholes(wholes) => wholes[at].map_or(TableCell::Null, TableCell::Whole),
            Values::Flags(flags) if flags.is_valid(at) => TableCell::Flag(flags.value(at)),
            Values::Texts(texts) if texts.is_valid(at) => TableCell::text(texts.value(at)),
            _ => TableCell::Null,
        }
    }

    /// A value; NaN and infinity become null, because JSON lacks them.
    fn value(&self, at: usize) -> std::result::Result<Value, String> {
        if let Values::Lists(lists, items) = self
            && lists.is_valid(at)
        {
            let length = lists.value_length(at) as usize;
            if length > MAX_SERIES {
                return Err(format!("a series has {length} values; at most {MAX_SERIES} can be read"));
            }
            let first = lists.value_offsets()[at] as usize;
            return (first..first + length)
                .map(|at| items.value(at))
                .collect::<std::result::Result<_, _>>()
                .map(Value::Array);
        }
        Ok(match self.cell(at) {
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
}

impl Leaf {
    fn is_null(&self, at: usize) -> bool {
        self.record.as_ref().is_some_and(|record| record.is_null(at))
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
            Ok(Leaf { record, values: Values::new(&values)? })
        };
        self.wanted.iter().map(leaf).collect()
    }
}

impl TableRows for ParquetRows {
    fn want(&mut self, columns: &[usize]) -> Result<()> {
        for &column in columns {
            let data_type = self.data_type(column);
            if !is_readable(&data_type) {
                let name = &self.names[column];
                let cast = |[pandas, polars]: [&str; 2]| {
                    format!(
                        "cast it: df[\"{name}\"].astype(\"{pandas}\") in pandas, pl.col(\"{name}\").cast(pl.{polars}) in Polars"
                    )
                };
                let help = match data_type {
                    DataType::Float16 | DataType::Decimal128(..) | DataType::Decimal256(..) => {
                        cast(["float64", "Float64"])
                    }
                    DataType::Timestamp(..) => cast(["int64", "Int64"]),
                    _ => "expected numbers, texts, truth values or lists of numbers".to_owned(),
                };
                let problem = format!("holds values of the type {data_type}");
                return Err(Error::input(Place::file(&self.path).column(name), problem, help));
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
        if leaf.is_null(at) { TableCell::Null } else { leaf.values.cell(at) }
    }

    fn next_row(&mut self) -> Result<Option<Row>> {
        if !self.step()? {
            return Ok(None);
        }
        let (batch, at) = (&self.batch, self.at - 1);
        let value = |leaf: &Leaf| if leaf.is_null(at) { Ok(Value::Null) } else { leaf.values.value(at) };
        let values = guarded(&self.path, || batch.iter().map(value).collect())?;
        Ok(Some(Row { number: self.number, values }))
    }

    fn has_lists(&self) -> bool {
        self.wanted.iter().any(|&column| matches!(self.data_type(column), DataType::List(_)))
    }
}

/// Whether values of this type can be read. Arrow's own types (dictionaries, large lists) do not occur, because the
/// Arrow metadata is skipped.
fn is_readable(of: &DataType) -> bool {
    let is_number = |of: &DataType| of.is_integer() || matches!(of, DataType::Float32 | DataType::Float64);
    match of {
        DataType::Utf8 | DataType::Boolean | DataType::Null => true,
        DataType::List(item) => item.data_type() == &DataType::Null || is_number(item.data_type()),
        other => is_number(other),
    }
}
