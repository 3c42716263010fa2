//! Rows as Arrow record batches, which data frame libraries take without a copy. Units and descriptions stand with every
//! column.

use std::collections::HashMap;
use std::sync::Arc;

use arrow_array::RecordBatch;
use arrow_array::builder::{
    ArrayBuilder, BooleanBuilder, Float32Builder, Float64Builder, Int64Builder, ListBuilder, StringBuilder,
    StringDictionaryBuilder, make_builder,
};
use arrow_array::types::Int32Type;
use arrow_schema::{ArrowError, DataType, Field, Schema, SchemaRef};

use super::{Cell, Column, ColumnKind};
use crate::{Error, Result};

/// Rows that are collected for the next record batch.
pub struct ArrowRows {
    schema: SchemaRef,
    builders: Vec<(ColumnKind, Box<dyn ArrayBuilder>)>,
    /// Number of rows since the last batch.
    pub(crate) count: usize,
}

impl ArrowRows {
    /// No rows yet; `metadata` belongs to the schema.
    pub fn new(columns: &[Column], metadata: HashMap<String, String>) -> ArrowRows {
        let fields: Vec<Field> = columns.iter().map(field).collect();
        let builders =
            columns.iter().zip(&fields).map(|(column, field)| (column.kind, make_builder(field.data_type(), 0)));
        let builders = builders.collect();
        ArrowRows { schema: Arc::new(Schema::new_with_metadata(fields, metadata)), builders, count: 0 }
    }

    /// The columns' names, types, units and descriptions.
    pub fn schema(&self) -> SchemaRef {
        self.schema.clone()
    }

    /// Appends a row; a cell of another type than its column's becomes null.
    ///
    /// # Errors
    /// [`Error::Internal`] for more than 2³¹ different names in a column.
    pub fn row(&mut self, row: &[Cell]) -> Result<()> {
        for ((kind, builder), cell) in self.builders.iter_mut().zip(row) {
            append(*kind, builder, cell)?;
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
        let arrays = self.builders.iter_mut().map(|(_, builder)| builder.finish()).collect();
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

/// The builder of a type of column.
fn typed<B: 'static>(builder: &mut Box<dyn ArrayBuilder>) -> Result<&mut B> {
    let typed = builder.as_any_mut().downcast_mut();
    typed.ok_or_else(|| Error::Internal("a column of Arrow has another type".to_owned()))
}

/// Appends a cell to a column of this type. A cell of another type becomes null; the caller prevents it.
fn append(kind: ColumnKind, builder: &mut Box<dyn ArrayBuilder>, cell: &Cell) -> Result<()> {
    let text = if let Cell::Text(text) = cell { Some(text) } else { None };
    let flag = if let Cell::Flag(flag) = cell { Some(*flag) } else { None };
    let whole = if let Cell::Whole(number) = cell { Some(*number) } else { None };
    let number = if let Cell::Number(number) = cell { Some(*number) } else { None };
    match kind {
        ColumnKind::Text => typed::<StringBuilder>(builder)?.append_option(text),
        ColumnKind::Name => {
            let names = typed::<StringDictionaryBuilder<Int32Type>>(builder)?;
            match text {
                Some(text) => drop(names.append(text).map_err(defect)?),
                None => names.append_null(),
            }
        }
        ColumnKind::Flag => typed::<BooleanBuilder>(builder)?.append_option(flag),
        ColumnKind::Whole => typed::<Int64Builder>(builder)?.append_option(whole),
        ColumnKind::Binary32 => typed::<Float32Builder>(builder)?.append_option(number.map(|number| number as f32)),
        ColumnKind::Binary64 => typed::<Float64Builder>(builder)?.append_option(number),
        ColumnKind::Series | ColumnKind::Wholes => {
            let list = typed::<ListBuilder<Box<dyn ArrayBuilder>>>(builder)?;
            match (kind, cell) {
                (ColumnKind::Series, Cell::Series(of)) => typed::<Float64Builder>(list.values())?.append_slice(of),
                (ColumnKind::Wholes, Cell::Wholes(of)) => typed::<Int64Builder>(list.values())?.append_slice(of),
                _ => {
                    list.append(false);
                    return Ok(());
                }
            }
            list.append(true);
        }
    }
    Ok(())
}
