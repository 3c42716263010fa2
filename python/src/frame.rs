//! Tables in and out: Arrow record batches behind the Arrow PyCapsule interface, which pandas, Polars, pyarrow and DuckDB
//! read and write without a copy.

use std::collections::HashMap;
use std::sync::Arc;

use arrow_array::cast::AsArray;
use arrow_array::ffi_stream::{FFI_ArrowArrayStream, RecordBatchStreamReader};
use arrow_array::types::{Float32Type, Float64Type, Int32Type, Int64Type};
use arrow_array::{
    Array, ArrayRef, ArrowPrimitiveType, Float64Array, RecordBatch, RecordBatchIterator, RecordBatchReader, StringArray,
};
use arrow_ipc::reader::StreamReader;
use arrow_ipc::writer::StreamWriter;
use arrow_schema::{ArrowError, DataType, Field, Schema, SchemaRef};
use lanesweep::report::column_words::explain;
use lanesweep::support::table::{ArrowRows, Table};
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::exceptions::{PyKeyError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyBytes, PyCapsule, PyDict, PyFloat, PyList};

use crate::error::{exception, input_error};

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

    /// A table of a result.
    pub fn of(mut table: Table) -> lanesweep::Result<Frame> {
        explain(&mut table);
        let mut rows = ArrowRows::new(&table.columns, HashMap::new());
        table.rows.iter().try_for_each(|row| rows.row(row))?;
        let batch = rows.batch()?;
        Ok(Frame::new(rows.schema(), vec![batch]))
    }
}

fn failed(error: ArrowError) -> PyErr {
    Python::attach(|py| exception(py, &lanesweep::Error::Internal(format!("a table: {error}"))))
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

    /// A copy by way of Arrow's format for streams.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let mut writer = StreamWriter::try_new(Vec::new(), &self.schema).map_err(failed)?;
        self.batches.iter().try_for_each(|batch| writer.write(batch)).map_err(failed)?;
        let bytes = writer.into_inner().map_err(failed)?;
        Ok((py.import("lanesweep._core")?.getattr("frame_of_stream")?, (PyBytes::new(py, &bytes),)))
    }

    /// A column as a NumPy array: null is NaN among numbers and None elsewhere, texts are objects.
    fn __getitem__<'py>(slf: &Bound<'py, Self>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let (py, this) = (slf.py(), slf.get());
        let unknown = || format!("there is no column `{name}`; there are {}", this.columns().join(", "));
        let at = this.schema.index_of(name).map_err(|_| PyKeyError::new_err(unknown()))?;
        let arrays: Vec<&dyn Array> = this.batches.iter().map(|batch| batch.column(at).as_ref()).collect();
        let has_null = arrays.iter().any(|array| array.null_count() > 0);
        Ok(match this.schema.field(at).data_type() {
            DataType::Float64 => numbers::<Float64Type, _>(py, &arrays, |value| value.unwrap_or(f64::NAN)),
            DataType::Float32 => numbers::<Float32Type, _>(py, &arrays, |value| value.unwrap_or(f32::NAN)),
            DataType::Int64 if has_null => {
                numbers::<Int64Type, _>(py, &arrays, |value| value.map_or(f64::NAN, |value| value as f64))
            }
            DataType::Int64 => numbers::<Int64Type, _>(py, &arrays, Option::unwrap_or_default),
            DataType::Boolean if !has_null => {
                let values = arrays.iter().flat_map(|array| array.as_boolean().iter().flatten());
                PyArray1::from_iter(py, values).into_any()
            }
            DataType::Utf8 | DataType::Dictionary(..) | DataType::List(_) | DataType::Boolean => {
                let rows = arrays.iter().flat_map(|array| (0..array.len()).map(move |row| (*array, row)));
                let objects = rows.map(|(array, row)| Ok(value(py, array, row)?.unbind()));
                PyArray1::from_vec(py, objects.collect::<PyResult<Vec<Py<PyAny>>>>()?).into_any()
            }
            _ => py.import("pyarrow")?.call_method1("table", (slf,))?.get_item(name)?.call_method0("to_numpy")?,
        })
    }

    /// The columns as NumPy arrays, by their names.
    fn to_numpy<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        let columns = PyDict::new(slf.py());
        slf.get().columns().iter().try_for_each(|name| columns.set_item(name, Self::__getitem__(slf, name)?))?;
        Ok(columns)
    }

    /// The table as a pandas data frame (a copy). Whole numbers with nulls stay whole.
    fn to_pandas<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let pandas = slf.py().import("pandas")?;
        let columns = Self::to_numpy(slf)?;
        for (name, values) in columns.iter() {
            let field = slf.get().schema.field_with_name(name.extract()?).map_err(failed)?;
            let is_float = values.getattr("dtype")?.getattr("kind")?.extract::<char>()? == 'f';
            match field.data_type() {
                DataType::Int64 if is_float => {
                    columns.set_item(&name, pandas.call_method1("array", (values, "Int64"))?)?
                }
                // pandas tells the type of texts from a list.
                DataType::Utf8 | DataType::Dictionary(..) => columns.set_item(&name, values.call_method0("tolist")?)?,
                _ => {}
            }
        }
        pandas.call_method1("DataFrame", (columns,))
    }

    /// The table as a Polars data frame.
    fn to_polars<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("polars")?.call_method1("DataFrame", (slf,))
    }

    /// The first rows, cut after 120 characters.
    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let mut table = vec![self.columns()];
        table.extend(self.first_rows(py, 10)?);
        let width = |at: usize| table.iter().map(|row| row[at].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..table[0].len()).map(width).collect();
        let cell = |(text, width): (&String, &usize)| format!("{text:>width$}");
        let line = |row: &Vec<String>| row.iter().zip(&widths).map(cell).collect::<Vec<_>>().join("  ");
        let cut = |row| line(row).chars().take(120).collect::<String>().trim_end().to_owned();
        let lines: Vec<String> = table.iter().map(cut).collect();
        Ok(format!("{}\n[{} rows; {} columns]", lines.join("\n"), self.__len__(), widths.len()))
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
        for row in self.first_rows(py, SHOWN)? {
            let cells: String = row.iter().map(|cell| format!("<td>{}</td>", escape(cell))).collect();
            html += &format!("<tr>{cells}</tr>");
        }
        let rows = self.__len__();
        let more = if rows > SHOWN { format!("<p>{SHOWN} of {rows} rows</p>") } else { String::new() };
        Ok(html + "</tbody></table>" + &more)
    }
}

impl Frame {
    /// The first rows for readers.
    fn first_rows(&self, py: Python<'_>, count: usize) -> PyResult<Vec<Vec<String>>> {
        let rows = self.batches.iter().flat_map(|batch| (0..batch.num_rows()).map(move |row| (batch, row)));
        let shown = |(batch, row): (&RecordBatch, usize)| {
            batch.columns().iter().map(|array| shown(&value(py, array.as_ref(), row)?)).collect()
        };
        rows.take(count).map(shown).collect()
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

/// A column of numbers.
fn numbers<'py, T: ArrowPrimitiveType, N: numpy::Element>(
    py: Python<'py>,
    arrays: &[&dyn Array],
    of: fn(Option<T::Native>) -> N,
) -> Bound<'py, PyAny> {
    PyArray1::from_iter(py, arrays.iter().flat_map(|array| array.as_primitive::<T>().iter()).map(of)).into_any()
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
        other => format!("<{other}>").into_pyobject(py)?.into_any(),
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
