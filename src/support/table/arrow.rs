//! Rows as Arrow record batches, which data frame libraries take without a copy. Units and descriptions stand with every
//! column.

use std::collections::HashMap;
use std::sync::Arc;

use arrow_array::builder::{
    BooleanBuilder, Float32Builder, Float64Builder, Int64Builder, ListBuilder, StringBuilder, StringDictionaryBuilder,
};
use arrow_array::types::Int32Type;
use arrow_array::{ArrayRef, RecordBatch};
use arrow_schema::{ArrowError, DataType, Field, Schema, SchemaRef};

use super::{Cell, Column, ColumnKind};
use crate::{Error, Result};

/// Rows that are collected for the next record batch.
pub struct ArrowRows {
    schema: SchemaRef,
    builders: Vec<Builder>,
    count: usize,
}

impl ArrowRows {
    /// No rows yet; `metadata` belongs to the schema.
    pub fn new(columns: &[Column], metadata: HashMap<String, String>) -> ArrowRows {
        let fields: Vec<Field> = columns.iter().map(field).collect();
        let builders = columns.iter().map(|column| Builder::new(column.kind)).collect();
        ArrowRows { schema: Arc::new(Schema::new_with_metadata(fields, metadata)), builders, count: 0 }
    }

    /// The columns' names, types, units and descriptions.
    pub fn schema(&self) -> SchemaRef {
        self.schema.clone()
    }

    /// Number of rows since the last batch.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Appends a row; a cell of another type than its column's becomes null.
    ///
    /// # Errors
    /// [`Error::Internal`] for more than 2³¹ different names in a column.
    pub fn row(&mut self, row: &[Cell]) -> Result<()> {
        for (builder, cell) in self.builders.iter_mut().zip(row) {
            builder.append(cell).map_err(defect)?;
        }
        self.count += 1;
        Ok(())
    }

    /// Returns the rows since the last batch as a batch.
    ///
    /// # Errors
    /// [`Error::Internal`] if rows had too few cells.
    pub fn batch(&mut self) -> Result<RecordBatch> {
        self.count = 0;
        let arrays = self.builders.iter_mut().map(Builder::finish).collect();
        RecordBatch::try_new(self.schema.clone(), arrays).map_err(defect)
    }
}

fn defect(error: ArrowError) -> Error {
    Error::Internal(format!("Arrow: {error}"))
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
