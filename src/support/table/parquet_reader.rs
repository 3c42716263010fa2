//! Rows of a Parquet file that any program may have written. A few rows at a time are in memory; panics of
//! the decoder on damaged files become errors about the file.

use std::cell::Cell;
use std::fmt::Display;
use std::fs::File;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::result;

use arrow_array::cast::AsArray;
use arrow_array::types::{
    Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type, UInt8Type, UInt16Type, UInt32Type, UInt64Type,
};
use arrow_array::{Array, ArrayRef, ArrowPrimitiveType, BooleanArray, ListArray, RecordBatch, StringArray};
use arrow_schema::DataType;
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{
    ArrowReaderMetadata, ArrowReaderOptions, ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder,
};

use super::{Cell as TableCell, TableRows};
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
    wanted: Vec<usize>,
    reader: Option<ParquetRecordBatchReader>,
    batch: Vec<Values>,
    batch_rows: usize,
    at: usize,
    number: u64,
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
    fn new(array: &ArrayRef) -> result::Result<Values, String> {
        fn wholes<T: ArrowPrimitiveType<Native: TryInto<i64>>>(array: &ArrayRef) -> result::Result<Values, String> {
            let wholes = array.as_primitive::<T>().iter().map(|whole| whole.map(TryInto::try_into).transpose());
            let wholes: result::Result<_, _> = wholes.collect();
            Ok(Values::Wholes(wholes.map_err(|_| "a whole number is above 2^63; write such numbers as texts")?))
        }
        fn reals<T: ArrowPrimitiveType<Native: Into<f64>>>(array: &ArrayRef) -> Values {
            Values::Reals(array.as_primitive::<T>().iter().map(|real| real.map_or(f64::NAN, Into::into)).collect())
        }
        Ok(match array.data_type() {
            DataType::Null => Values::Nulls,
            DataType::Float32 => reals::<Float32Type>(array),
            DataType::Float64 => reals::<Float64Type>(array),
            DataType::Int8 => wholes::<Int8Type>(array)?,
            DataType::Int16 => wholes::<Int16Type>(array)?,
            DataType::Int32 => wholes::<Int32Type>(array)?,
            DataType::Int64 => wholes::<Int64Type>(array)?,
            DataType::UInt8 => wholes::<UInt8Type>(array)?,
            DataType::UInt16 => wholes::<UInt16Type>(array)?,
            DataType::UInt32 => wholes::<UInt32Type>(array)?,
            DataType::UInt64 => wholes::<UInt64Type>(array)?,
            DataType::Boolean => Values::Flags(array.as_boolean().clone()),
            DataType::Utf8 => {
                let texts = array.as_string::<i32>();
                match texts.iter().flatten().map(str::len).find(|length| *length > MAX_TEXT) {
                    Some(length) => return Err(format!("a text has {length} bytes; at most {MAX_TEXT} can be read")),
                    None => Values::Texts(texts.clone()),
                }
            }
            DataType::List(_) => {
                let lists = array.as_list::<i32>();
                match lists.offsets().lengths().find(|length| *length > MAX_SERIES) {
                    Some(length) => {
                        return Err(format!("a series has {length} values; at most {MAX_SERIES} can be read"));
                    }
                    None => Values::Lists(lists.clone(), Box::new(Values::new(lists.values())?)),
                }
            }
            other => return Err(format!("a column has the type {other}")),
        })
    }

    fn cell(&self, at: usize) -> TableCell<'_> {
        match self {
            Values::Reals(reals) => TableCell::Number(reals[at]),
            Values::Wholes(wholes) => wholes[at].map_or(TableCell::Null, TableCell::Whole),
            Values::Flags(flags) if flags.is_valid(at) => TableCell::Flag(flags.value(at)),
            Values::Texts(texts) if texts.is_valid(at) => TableCell::text(texts.value(at)),
            Values::Lists(lists, items) if lists.is_valid(at) => {
                let [first, end] = [at, at + 1].map(|at| lists.value_offsets()[at] as usize);
                items.cells(first..end)
            }
            _ => TableCell::Null,
        }
    }

    /// Values of a list; null is NaN.
    fn cells(&self, range: std::ops::Range<usize>) -> TableCell<'_> {
        match self {
            Values::Reals(reals) => TableCell::Series(reals[range].into()),
            Values::Wholes(wholes) => match wholes[range.clone()].iter().copied().collect::<Option<Vec<i64>>>() {
                Some(all) => TableCell::Wholes(all.into()),
                None => TableCell::Series(wholes[range].iter().map(|of| of.map_or(f64::NAN, |of| of as f64)).collect()),
            },
            _ => TableCell::Series(vec![f64::NAN; range.len()].into()),
        }
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
fn guarded<T, E: Display>(path: &Path, work: impl FnOnce() -> result::Result<T, E>) -> Result<T> {
    IS_CAUGHT.set(true);
    let result = catch_unwind(AssertUnwindSafe(work));
    IS_CAUGHT.set(false);
    match result {
        Ok(result) => result.map_err(|problem| damaged(path, problem)),
        Err(_) => Err(damaged(path, "its content contradicts itself")),
    }
}

fn damaged(path: &Path, problem: impl Display) -> Error {
    let problem = format!("not a Parquet file that can be read: {problem}");
    let help = "write the file again, with compression=\"zstd\", or use JSON Lines or CSV";
    Error::input(Place::file(path), problem, help)
}

impl ParquetRows {
    pub(super) fn open(path: &Path) -> Result<(Vec<String>, ParquetRows)> {
        let file = input_file::open(path)?;
        // Use only Parquet's own types and ignore the Arrow schema of another program.
        let options = ArrowReaderOptions::new().with_skip_arrow_metadata(true);
        let metadata = guarded(path, || ArrowReaderMetadata::load(&file, options))?;
        for field in metadata.schema().fields().iter().filter(|field| matches!(field.data_type(), DataType::Struct(_)))
        {
            let (file, name) = (Place::file(path), field.name());
            tracing::warn!(
                "{file}: the column `{name}` holds records, which are not read; write a column per field, like `{name}_v0`"
            );
        }
        let names = metadata.schema().fields().iter().map(|field| field.name().clone()).collect();
        let (path, wanted, batch) = (path.to_path_buf(), Vec::new(), Vec::new());
        Ok((names, ParquetRows { path, file, metadata, wanted, reader: None, batch, batch_rows: 0, at: 0, number: 0 }))
    }

    fn data_type(&self, column: usize) -> &DataType {
        self.metadata.schema().field(column).data_type()
    }

    /// The requested columns of a batch, which has them in the order of the file.
    fn values_of(&self, batch: &RecordBatch) -> result::Result<Vec<Values>, String> {
        let mut in_file = self.wanted.clone();
        in_file.sort_unstable();
        in_file.dedup();
        let values = |column: &usize| {
            let array = batch.columns().get(in_file.partition_point(|other| other < column));
            Values::new(array.ok_or("a column is missing")?)
        };
        self.wanted.iter().map(values).collect()
    }
}

impl TableRows for ParquetRows {
    fn want(&mut self, columns: &[usize]) -> Result<()> {
        if let Some(&column) = columns.iter().find(|&&column| !is_readable(self.data_type(column))) {
            let name = self.metadata.schema().field(column).name();
            let problem = format!("holds values of the type {}", self.data_type(column));
            let help = format!(
                "expected numbers, texts, truth values or lists of numbers; cast numbers: df[\"{name}\"].astype(\"float64\") in \
                 pandas, pl.col(\"{name}\").cast(pl.Float64) in Polars; cast times to int64, and bytes to texts"
            );
            return Err(Error::input(Place::file(&self.path).column(name), problem, help));
        }
        self.wanted = columns.to_vec();
        let mask = ProjectionMask::roots(self.metadata.parquet_schema(), columns.iter().copied());
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
            self.batch = guarded(&self.path, || self.values_of(&batch))?;
            (self.batch_rows, self.at) = (batch.num_rows(), 0);
        }
        self.at += 1;
        self.number += 1;
        Ok(true)
    }

    fn number(&self) -> u64 {
        self.number
    }

    fn cell(&self, wanted: usize) -> TableCell<'_> {
        self.batch[wanted].cell(self.at - 1)
    }

    fn width(&self) -> usize {
        self.wanted.len()
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
