//! Parquet files read and made with the `parquet` crate itself.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use arrow_array::builder::{Float64Builder, ListBuilder};
use arrow_array::cast::AsArray;
use arrow_array::types::{Float32Type, Float64Type, Int32Type, Int64Type};
use arrow_array::{Array, ArrayRef, RecordBatch};
use arrow_schema::{DataType, Field};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::basic::Compression;
use parquet::file::properties::WriterProperties;

pub struct Read {
    pub columns: Vec<String>,
    /// Unit and description of each column.
    pub metadata: Vec<(String, String)>,
    pub key_values: BTreeMap<String, String>,
    /// Values as texts: numbers in as many digits as they need, 1 and 0 for truth, empty for null.
    pub rows: Vec<Vec<String>>,
}

pub fn read(path: &Path) -> Read {
    let builder = ParquetRecordBatchReaderBuilder::try_new(File::open(path).unwrap()).unwrap();
    let schema = builder.schema().clone();
    let about = builder.metadata().clone();
    let pairs = about.file_metadata().key_value_metadata().unwrap();
    let key_values = pairs.iter().map(|pair| (pair.key.clone(), pair.value.clone().unwrap_or_default())).collect();
    let mut rows = Vec::new();
    for batch in builder.build().unwrap() {
        let batch = batch.unwrap();
        let columns: Vec<Vec<String>> = batch.columns().iter().map(texts).collect();
        rows.extend((0..batch.num_rows()).map(|row| columns.iter().map(|c| c[row].clone()).collect()));
    }
    let word = |field: &Field, key: &str| field.metadata().get(key).unwrap().to_string();
    Read {
        columns: schema.fields().iter().map(|field| field.name().clone()).collect(),
        metadata: schema.fields().iter().map(|field| (word(field, "unit"), word(field, "description"))).collect(),
        key_values,
        rows,
    }
}

fn texts(array: &ArrayRef) -> Vec<String> {
    let text = |at: usize| match array.data_type() {
        _ if array.is_null(at) => String::new(),
        DataType::Float32 => array.as_primitive::<Float32Type>().value(at).to_string(),
        DataType::Float64 => array.as_primitive::<Float64Type>().value(at).to_string(),
        DataType::Boolean => u8::from(array.as_boolean().value(at)).to_string(),
        DataType::List(_) => "[…]".to_owned(),
        DataType::Int64 => array.as_primitive::<Int64Type>().value(at).to_string(),
        DataType::Dictionary(..) => {
            let texts = array.as_dictionary::<Int32Type>();
            texts.values().as_string::<i32>().value(texts.keys().value(at) as usize).to_owned()
        }
        _ => array.as_string::<i32>().value(at).to_owned(),
    };
    (0..array.len()).map(text).collect()
}

pub fn series(rows: &[Vec<f64>]) -> ArrayRef {
    let mut builder = ListBuilder::new(Float64Builder::new());
    for row in rows {
        builder.values().append_slice(row);
        builder.append(true);
    }
    Arc::new(builder.finish())
}

/// Writes a file as other programs do.
pub fn write<N: AsRef<str>>(path: &Path, columns: Vec<(N, ArrayRef)>, compression: Compression) {
    let batch = RecordBatch::try_from_iter(columns).unwrap();
    let properties = WriterProperties::builder().set_compression(compression).build();
    let mut writer = ArrowWriter::try_new(File::create(path).unwrap(), batch.schema(), Some(properties)).unwrap();
    writer.write(&batch).unwrap();
    writer.close().unwrap();
}
