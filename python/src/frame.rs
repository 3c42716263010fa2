//! Tables in and out: Arrow record batches behind the Arrow PyCapsule interface, which pandas, Polars, pyarrow and DuckDB
//! read and write without a copy.

use std::collections::HashMap;
use std::sync::Arc;

use arrow_array::cast::AsArray;
use arrow_array::ffi_stream::{FFI_ArrowArrayStream, RecordBatchStreamReader};
use arrow_array::types::{Float32Type, Float64Type, Int32Type, Int64Type};
use arrow_array::{Array, ArrayRef, Float64Array, RecordBatch, RecordBatchIterator, RecordBatchReader, StringArray};
use arrow_ipc::reader::StreamReader;
use arrow_ipc::writer::StreamWriter;
use arrow_schema::{ArrowError, DataType, Field, Schema, SchemaRef};
use lanesweep::support::table::{ArrowRows, Cell, Column, ColumnKind};
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::exceptions::{PyKeyError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyBytes, PyCapsule, PyDict, PyFloat, PyIterator, PyList, PyString};
use serde_json::Value;

use crate::error::{InternalError, exception, input_error};

const STREAM: &std::ffi::CStr = c"arrow_array_stream";

/// A table: typed columns with units. Libraries of data frames take it as it is: `polars.DataFrame(frame)`,
/// `pyarrow.table(frame)`, `pandas.DataFrame.from_arrow(frame)`, and `to_pandas()`.
#[pyclass(frozen, module = "lanesweep")]
pub struct Frame {
    schema: SchemaRef,
    batches: Vec<RecordBatch>,
}

impl Frame {
    pub fn new(schema: SchemaRef, batches: Vec<RecordBatch>) -> Frame {
        Frame { schema, batches }
    }
}

/// A cell for readers.
fn shown(cell: &Bound<'_, PyAny>) -> PyResult<String> {
    match cell {
        cell if cell.is_none() => Ok(String::new()),
        cell if cell.is_instance_of::<PyFloat>() => Ok(cell.call_method1("__format__", (".5g",))?.to_string()),
        cell => Ok(cell.str()?.to_string()),
    }
}

#[pymethods]
impl Frame {
    fn __len__(&self) -> usize {
        self.batches.iter().map(RecordBatch::num_rows).sum()
    }

    /// Names of the columns.
    #[getter]
    fn columns(&self) -> Vec<String> {
        self.schema.fields().iter().map(|field| field.name().clone()).collect()
    }

    /// Unit of every column that has one.
    #[getter]
    fn units<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.metadata("unit").into_py_dict(py)
    }

    /// One sentence per column that has one.
    #[getter]
    fn descriptions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.metadata("description").into_py_dict(py)
    }

    /// The Arrow C stream of the table.
    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        // The protocol allows to return the own schema.
        let _ = requested_schema;
        let batches = self.batches.clone().into_iter().map(Ok);
        let reader: Box<dyn RecordBatchReader + Send> =
            Box::new(RecordBatchIterator::new(batches, self.schema.clone()));
        PyCapsule::new_with_value(py, FFI_ArrowArrayStream::new(reader), STREAM)
    }

    /// Numbers of rows and columns.
    #[getter]
    fn shape(&self) -> (usize, usize) {
        (self.__len__(), self.schema.fields().len())
    }

    /// The rows, as dictionaries.
    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyIterator>> {
        self.rows(py, None)?.try_iter()
    }

    /// A copy by way of Arrow's format for streams.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let failed = |error: ArrowError| InternalError::new_err(format!("a table: {error}"));
        let mut writer = StreamWriter::try_new(Vec::new(), &self.schema).map_err(failed)?;
        self.batches.iter().try_for_each(|batch| writer.write(batch)).map_err(failed)?;
        let bytes = writer.into_inner().map_err(failed)?;
        Ok((py.import("lanesweep._core")?.getattr("frame_of_stream")?, (PyBytes::new(py, &bytes),)))
    }

    /// A column as a NumPy array; texts as a list. Null is NaN in columns of numbers and None in others. Of a list of names:
    /// a table of these columns.
    fn __getitem__<'py>(&self, py: Python<'py>, name: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        if let Ok(names) = name.cast::<PyList>() {
            let at: Vec<usize> =
                names.iter().map(|name| self.at(&name.extract::<String>()?)).collect::<PyResult<_>>()?;
            let failed = |error: ArrowError| InternalError::new_err(format!("a table: {error}"));
            let schema = Arc::new(self.schema.project(&at).map_err(failed)?);
            let batches = self.batches.iter().map(|batch| batch.project(&at)).collect::<Result<_, _>>();
            return Ok(Bound::new(py, Frame::new(schema, batches.map_err(failed)?))?.into_any());
        }
        let at = self.at(&name.extract::<String>()?)?;
        let arrays: Vec<&dyn Array> = self.batches.iter().map(|batch| batch.column(at).as_ref()).collect();
        let has_null = arrays.iter().any(|array| array.null_count() > 0);
        match self.schema.field(at).data_type() {
            DataType::Float64 => {
                let values = arrays.iter().flat_map(|array| array.as_primitive::<Float64Type>().iter());
                Ok(PyArray1::from_iter(py, values.map(|value| value.unwrap_or(f64::NAN))).into_any())
            }
            DataType::Float32 => {
                let values = arrays.iter().flat_map(|array| array.as_primitive::<Float32Type>().iter());
                Ok(PyArray1::from_iter(py, values.map(|value| value.unwrap_or(f32::NAN))).into_any())
            }
            DataType::Int64 if !has_null => {
                let values = arrays.iter().flat_map(|array| array.as_primitive::<Int64Type>().iter().flatten());
                Ok(PyArray1::from_iter(py, values).into_any())
            }
            DataType::Boolean if !has_null => {
                let values = arrays.iter().flat_map(|array| array.as_boolean().iter().flatten());
                Ok(PyArray1::from_iter(py, values).into_any())
            }
            _ => {
                let list = PyList::empty(py);
                for array in arrays {
                    (0..array.len()).try_for_each(|row| list.append(value(py, array, row)?))?;
                }
                Ok(list.into_any())
            }
        }
    }

    /// The table as a pandas data frame (a copy).
    fn to_pandas<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let py = slf.py();
        let columns = PyDict::new(py);
        for name in slf.get().columns() {
            columns.set_item(&name, slf.get().__getitem__(py, PyString::new(py, &name).as_any())?)?;
        }
        py.import("pandas")?.call_method1("DataFrame", (columns,))
    }

    /// The table as a Polars data frame.
    fn to_polars<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("polars")?.call_method1("DataFrame", (slf,))
    }

    /// The table as a pyarrow table.
    fn to_arrow<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("pyarrow")?.call_method1("table", (slf,))
    }

    /// The first rows, as many columns as a line of 120 characters holds.
    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        const WIDTH: usize = 120;
        let mut table = vec![self.columns()];
        for row in self.rows(py, Some(10))?.iter() {
            let row = row.cast::<PyDict>()?.values();
            table.push(row.iter().map(|cell| shown(&cell)).collect::<PyResult<Vec<String>>>()?);
        }
        let width = |at: usize| table.iter().map(|row| row[at].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..table[0].len()).map(width).collect();
        let ends = widths.iter().scan(0, |end, width| {
            *end += width + 2;
            Some(*end)
        });
        let fitting = ends.take_while(|end| *end <= WIDTH).count().max(1).min(widths.len());
        let cell = |(text, width): (&String, &usize)| format!("{text:>width$}");
        let line = |row: &Vec<String>| row.iter().zip(&widths).take(fitting).map(cell).collect::<Vec<_>>().join("  ");
        let lines: Vec<String> = table.iter().map(line).collect();
        let more = widths.len() - fitting;
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        Ok(format!("{}\n[{} rows; {fitting} columns{more}]", lines.join("\n"), self.__len__()))
    }

    fn _repr_html_(&self, py: Python<'_>) -> PyResult<String> {
        const SHOWN: usize = 20;
        let escape = |text: &str| text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;");
        let mut html = String::from("<table><thead><tr>");
        let descriptions: HashMap<String, String> = self.metadata("description").into_iter().collect();
        for name in self.columns() {
            let title = descriptions.get(&name).map_or("", |text| text.as_str());
            html += &format!("<th title=\"{}\">{}</th>", escape(title), escape(&name));
        }
        html += "</tr></thead><tbody>";
        for row in self.rows(py, Some(SHOWN))?.iter() {
            html += "<tr>";
            for cell in row.cast::<PyDict>()?.values().iter() {
                html += &format!("<td>{}</td>", escape(&shown(&cell)?));
            }
            html += "</tr>";
        }
        let rows = self.__len__();
        let more = if rows > SHOWN { format!("<p>{SHOWN} of {rows} rows</p>") } else { String::new() };
        Ok(html + "</tbody></table>" + &more)
    }

    /// The first rows as dictionaries.
    #[pyo3(signature = (n=None))]
    fn rows<'py>(&self, py: Python<'py>, n: Option<usize>) -> PyResult<Bound<'py, PyList>> {
        let list = PyList::empty(py);
        let mut left = n.unwrap_or(usize::MAX);
        for batch in &self.batches {
            for row in 0..batch.num_rows().min(left) {
                let dict = PyDict::new(py);
                for (field, array) in self.schema.fields().iter().zip(batch.columns()) {
                    dict.set_item(field.name(), value(py, array.as_ref(), row)?)?;
                }
                list.append(dict)?;
            }
            left = left.saturating_sub(batch.num_rows());
        }
        Ok(list)
    }
}

impl Frame {
    /// Position of a column.
    fn at(&self, name: &str) -> PyResult<usize> {
        let unknown = || format!("there is no column `{name}`; there are {}", self.columns().join(", "));
        self.schema.index_of(name).map_err(|_| PyKeyError::new_err(unknown()))
    }

    /// What the columns say under a key, in their order.
    fn metadata(&self, key: &str) -> Vec<(String, String)> {
        let of = |field: &Arc<arrow_schema::Field>| {
            let text = field.metadata().get(key).filter(|text| !text.is_empty())?;
            Some((field.name().clone(), text.clone()))
        };
        self.schema.fields().iter().filter_map(of).collect()
    }
}

/// A value of an array of one of our types.
fn value<'py>(py: Python<'py>, array: &dyn Array, row: usize) -> PyResult<Bound<'py, PyAny>> {
    if array.is_null(row) {
        return Ok(py.None().into_bound(py));
    }
    Ok(match array.data_type() {
        DataType::Utf8 => array.as_string::<i32>().value(row).into_pyobject(py)?.into_any(),
        DataType::Boolean => array.as_boolean().value(row).into_pyobject(py)?.to_owned().into_any(),
        DataType::Int64 => array.as_primitive::<Int64Type>().value(row).into_pyobject(py)?.into_any(),
        DataType::Float32 => array.as_primitive::<Float32Type>().value(row).into_pyobject(py)?.into_any(),
        DataType::Float64 => array.as_primitive::<Float64Type>().value(row).into_pyobject(py)?.into_any(),
        DataType::Dictionary(..) => {
            let names = array.as_dictionary::<Int32Type>();
            let key = names.keys().value(row) as usize;
            names.values().as_string::<i32>().value(key).into_pyobject(py)?.into_any()
        }
        DataType::List(_) => {
            let items = array.as_list::<i32>().value(row);
            let list = PyList::empty(py);
            (0..items.len()).try_for_each(|at| list.append(value(py, items.as_ref(), at)?))?;
            list.into_any()
        }
        other => return Err(InternalError::new_err(format!("a column has the type {other}"))),
    })
}

/// The stream of a table of another library.
pub fn stream_of(table: &Bound<'_, PyAny>) -> PyResult<RecordBatchStreamReader> {
    let method = table.getattr("__arrow_c_stream__").map_err(|_| {
        let of = table.get_type().name().map_or_else(|_| "an object".to_owned(), |name| name.to_string());
        PyTypeError::new_err(format!(
            "{of} is no table: expected one with the Arrow interface (`__arrow_c_stream__`), such as a DataFrame of \
             pandas 2.2 or Polars, or pyarrow.table({{...}})"
        ))
    })?;
    let capsule = method.call0()?.cast_into::<PyCapsule>()?;
    let pointer = capsule.pointer_checked(Some(STREAM))?.cast::<FFI_ArrowArrayStream>();
    #[allow(unsafe_code)] // the C interface has no safe form
    // SAFETY: a capsule of this name holds a valid stream, and the reader moves it out.
    let reader = unsafe { RecordBatchStreamReader::from_raw(pointer.as_ptr()) };
    reader.map_err(|error| input_error(format!("the table cannot be read: {error}")))
}

/// The table of a stream in Arrow's format.
#[pyfunction]
pub fn frame_of_stream(bytes: &[u8]) -> PyResult<Frame> {
    let failed = |error: ArrowError| input_error(format!("a table: {error}"));
    let reader = StreamReader::try_new(bytes, None).map_err(failed)?;
    let schema = reader.schema();
    Ok(Frame::new(schema, reader.collect::<Result<_, _>>().map_err(failed)?))
}

/// A table of columns: arrays of numbers, and lists of texts.
#[pyfunction]
pub fn frame_of_columns(columns: &Bound<'_, PyDict>) -> PyResult<Frame> {
    let (mut fields, mut arrays): (Vec<Field>, Vec<ArrayRef>) = (Vec::new(), Vec::new());
    for (name, values) in columns.iter() {
        let array: ArrayRef = match values.extract::<PyReadonlyArray1<'_, f64>>() {
            // NumPy has no null.
            Ok(numbers) => {
                Arc::new(Float64Array::from_iter(numbers.as_array().iter().map(|n| (!n.is_nan()).then_some(*n))))
            }
            Err(_) => Arc::new(StringArray::from(values.extract::<Vec<Option<String>>>()?)),
        };
        fields.push(Field::new(name.extract::<String>()?, array.data_type().clone(), true));
        arrays.push(array);
    }
    let schema = Arc::new(Schema::new(fields));
    let batch = RecordBatch::try_new(schema.clone(), arrays);
    Ok(Frame::new(schema, vec![batch.map_err(|error| input_error(format!("the columns: {error}")))?]))
}

/// A table of records: a list of objects with equal keys, as JSON; columns in this order, then the others. A column has
/// the type of its values; whole numbers beside others become numbers.
#[pyfunction]
#[pyo3(signature = (json, order=vec![]))]
pub fn frame_of_records(py: Python<'_>, json: &str, order: Vec<String>) -> PyResult<Frame> {
    let records: Vec<serde_json::Map<String, Value>> =
        serde_json::from_str(json).map_err(|error| InternalError::new_err(format!("a table: {error}")))?;
    let mut names: Vec<&String> =
        order.iter().filter(|name| records.first().is_some_and(|record| record.contains_key(*name))).collect();
    for name in records.iter().flat_map(|record| record.keys()) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    // JSON has no infinity: the program writes a text.
    let infinite = |value: &Value| match value.as_str() {
        Some("Infinity") => Some(f64::INFINITY),
        Some("-Infinity") => Some(f64::NEG_INFINITY),
        _ => None,
    };
    let kind = |name: &str| {
        let mut values =
            records.iter().filter_map(|record| record.get(name)).filter(|value| !value.is_null()).peekable();
        let has_values = values.peek().is_some();
        let mut kinds = values.map(|value| match value {
            Value::Bool(_) => ColumnKind::Flag,
            Value::Number(number) if number.is_i64() => ColumnKind::Whole,
            Value::Number(_) => ColumnKind::Binary64,
            text if infinite(text).is_some() => ColumnKind::Binary64,
            _ => ColumnKind::Text,
        });
        let first = kinds.next().unwrap_or(ColumnKind::Binary64);
        let joined = kinds.fold(first, |joined, kind| match (joined, kind) {
            (a, b) if a == b => a,
            (ColumnKind::Whole | ColumnKind::Binary64, ColumnKind::Whole | ColumnKind::Binary64) => {
                ColumnKind::Binary64
            }
            _ => ColumnKind::Text,
        });
        if has_values { joined } else { ColumnKind::Binary64 }
    };
    let columns: Vec<Column> =
        names.iter().map(|name| Column::new((*name).clone(), kind(name), String::new(), String::new())).collect();
    let mut rows = ArrowRows::new(&columns, HashMap::new());
    for record in &records {
        let cell = |column: &Column| match (column.kind, record.get(column.name.as_ref())) {
            (_, None | Some(Value::Null)) => Cell::Null,
            (ColumnKind::Text, Some(Value::String(text))) => Cell::text(text.clone()),
            (ColumnKind::Text, Some(other)) => Cell::text(other.to_string()),
            (_, Some(Value::Bool(flag))) => Cell::Flag(*flag),
            (ColumnKind::Whole, Some(number)) => number.as_i64().map_or(Cell::Null, Cell::Whole),
            (_, Some(number)) => Cell::number(number.as_f64().or_else(|| infinite(number))),
        };
        let row: Vec<Cell> = columns.iter().map(cell).collect();
        rows.row(&row).map_err(|error| exception(py, &error))?;
    }
    let batch = rows.batch().map_err(|error| exception(py, &error))?;
    Ok(Frame::new(rows.schema(), vec![batch]))
}
