//! Drivers in Python: called once per step with arrays over all running lanes.

use std::cell::Cell;
use std::sync::{Arc, Mutex, PoisonError};

use lanesweep::cli::embedded;
use lanesweep::model::driver::{Accelerations, LaneColumns, ModelId, VectorDriver, VehicleColumns};
use lanesweep::{Error, Place, Result};
use numpy::{PyArray1, PyReadonlyArray1, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::error::{exception, usage_error};

/// The exception that ended the driver of the running work.
static RAISED: Mutex<Option<PyErr>> = Mutex::new(None);

thread_local! {
    /// This thread is within a call of a driver: work that it asks for would wait for itself.
    static IS_CALLING: Cell<bool> = const { Cell::new(false) };
}

pub fn is_calling() -> bool {
    IS_CALLING.get()
}

pub fn take_exception() -> Option<PyErr> {
    RAISED.lock().unwrap_or_else(PoisonError::into_inner).take()
}

/// The error of a driver that raised an exception.
pub fn error_of(py: Python<'_>, raised: &PyErr) -> Error {
    let text = raised.value(py).repr().map_or_else(|_| "an exception".to_owned(), |text| text.to_string());
    Error::input(Place::item("a driver"), format!("it raised {text}"), "see the exception that caused this")
}

/// Another vehicle as the drivers of all running lanes see it: an entry per lane.
#[pyclass(frozen, module = "lanesweep")]
pub struct Vehicle {
    /// The vehicle is there for the ego; where it is not, the other entries have no meaning.
    #[pyo3(get)]
    present: Py<PyArray1<bool>>,
    /// It is there, and the attention rule lets the driver react to it.
    #[pyo3(get)]
    attended: Py<PyArray1<bool>>,
    /// Speed, m/s.
    #[pyo3(get)]
    speed: Py<PyArray1<f32>>,
    /// Gap, bumper to bumper, m.
    #[pyo3(get)]
    gap: Py<PyArray1<f32>>,
    /// Lateral gap, m.
    #[pyo3(get)]
    lateral_gap: Py<PyArray1<f32>>,
    /// Lateral speed towards the ego, m/s.
    #[pyo3(get)]
    lateral_speed: Py<PyArray1<f32>>,
    /// Half the sum of both lengths, m.
    #[pyo3(get)]
    half_lengths: Py<PyArray1<f32>>,
}

/// All running lanes at one step: an entry per lane.
#[pyclass(frozen, module = "lanesweep")]
pub struct View {
    /// Index of the step.
    #[pyo3(get)]
    step: u32,
    /// Time since the start, s.
    #[pyo3(get)]
    time_s: f64,
    /// Position of each lane in its batch, ascending: the index of its entry in arrays of states.
    #[pyo3(get)]
    lane: Py<PyArray1<i64>>,
    /// Speed of the ego, m/s.
    #[pyo3(get)]
    ego_speed: Py<PyArray1<f32>>,
    /// Acceleration of the ego over the last step, m/s²; 0 at the start.
    #[pyo3(get)]
    ego_acceleration: Py<PyArray1<f32>>,
    /// The principal vehicle: it cuts in, cuts out, or leads.
    #[pyo3(get)]
    other: Py<Vehicle>,
    /// In a cut-out, the vehicle ahead of the one that cuts out; elsewhere it is not present.
    #[pyo3(get)]
    ahead: Py<Vehicle>,
}

#[pymethods]
impl View {
    fn __len__(&self, py: Python<'_>) -> usize {
        self.lane.bind(py).len()
    }
}

fn vehicle(py: Python<'_>, of: VehicleColumns) -> PyResult<Py<Vehicle>> {
    let numbers = |values: Vec<f32>| PyArray1::from_vec(py, values).unbind();
    Py::new(
        py,
        Vehicle {
            present: PyArray1::from_vec(py, of.present).unbind(),
            attended: PyArray1::from_vec(py, of.attended).unbind(),
            speed: numbers(of.speed),
            gap: numbers(of.gap),
            lateral_gap: numbers(of.lateral_gap),
            lateral_speed: numbers(of.lateral_speed),
            half_lengths: numbers(of.half_lengths),
        },
    )
}

fn view(py: Python<'_>, columns: LaneColumns) -> PyResult<Py<View>> {
    let [other, ahead] = columns.vehicles;
    Py::new(
        py,
        View {
            step: columns.step,
            time_s: columns.time_s,
            lane: PyArray1::from_vec(py, columns.lane).unbind(),
            ego_speed: PyArray1::from_vec(py, columns.ego_speed).unbind(),
            ego_acceleration: PyArray1::from_vec(py, columns.ego_acceleration).unbind(),
            other: vehicle(py, other)?,
            ahead: vehicle(py, ahead)?,
        },
    )
}

struct PythonDriver {
    name: String,
    driver: Py<PyAny>,
    may_accelerate: bool,
    stands_for: ModelId,
}

impl PythonDriver {
    /// Keeps the exception for the caller and returns the error that ends the run.
    fn failed(&self, py: Python<'_>, at: &str, raised: PyErr) -> Error {
        let problem = format!(
            "it raised {}",
            raised.value(py).repr().map_or_else(|_| "an exception".into(), |text| text.to_string())
        );
        *RAISED.lock().unwrap_or_else(PoisonError::into_inner) = Some(raised);
        Error::input(Place::item(format!("driver {}, {at}", self.name)), problem, "see the exception that caused this")
    }
}

impl VectorDriver for PythonDriver {
    fn stands_for(&self) -> ModelId {
        self.stands_for
    }

    fn may_accelerate(&self) -> bool {
        self.may_accelerate
    }

    fn start(&self, lanes: usize, dt_s: f64) -> Result<Accelerations<'_>> {
        let state = attached(|py| {
            let state = self.driver.bind(py).call_method1("start", (lanes, dt_s));
            state.map(Bound::unbind).map_err(|raised| self.failed(py, "start", raised))
        })?;
        Ok(Box::new(move |columns| {
            if embedded::token().requested() {
                return Err(Error::Interrupted { done: "a driver was stopped".to_owned(), is_kept: false });
            }
            let (step, count) = (columns.step, columns.lane.len());
            attached(|py| {
                let found = accelerations(py, self.driver.bind(py), state.bind(py), columns, count);
                found.map_err(|raised| self.failed(py, &format!("step {step}"), raised))
            })
        }))
    }
}

/// Calls Python, unless the interpreter is ending.
fn attached<T>(work: impl for<'py> FnOnce(Python<'py>) -> Result<T>) -> Result<T> {
    let work = |py: Python<'_>| {
        IS_CALLING.set(true);
        let done = work(py);
        IS_CALLING.set(false);
        done
    };
    let ending = || Error::Interrupted { done: "the interpreter ends".to_owned(), is_kept: false };
    Python::try_attach(work).unwrap_or_else(|| Err(ending()))
}

fn accelerations(
    py: Python<'_>,
    driver: &Bound<'_, PyAny>,
    state: &Bound<'_, PyAny>,
    columns: LaneColumns,
    count: usize,
) -> PyResult<Vec<f32>> {
    let found = driver.call_method1("acceleration", (view(py, columns)?, state))?;
    // NumPy converts lists, scalars, and arrays of other libraries and types.
    let numpy = py.import("numpy")?;
    let arguments = PyDict::new(py);
    arguments.set_item("dtype", "float32")?;
    let found = numpy.call_method("asarray", (found,), Some(&arguments))?;
    let found: PyReadonlyArray1<'_, f32> = match found.getattr("ndim")?.extract::<usize>()? {
        0 => numpy.call_method1("full", (count, found.call_method0("item")?, "float32"))?.extract()?,
        1 => found.extract()?,
        ndim => {
            let shape = found.getattr("shape")?;
            return Err(usage_error(format!(
                "`acceleration` returned an array of {ndim} dimensions and the shape {shape}; expected one number per lane: ({count},)"
            )));
        }
    };
    if found.len() != count {
        return Err(usage_error(format!("`acceleration` returned {} numbers for {count} lanes", found.len())));
    }
    Ok(found.as_array().to_vec())
}

/// Registers a driver and returns its name.
#[pyfunction]
pub fn register(
    py: Python<'_>,
    name: String,
    fingerprint: &str,
    driver: Py<PyAny>,
    may_accelerate: bool,
    attention: &str,
) -> PyResult<()> {
    let stands_for = ModelId::parse(attention).ok_or_else(|| {
        usage_error(format!("`attention` names no built-in model: `{attention}`; use one of {}", ModelId::names()))
    })?;
    let python = PythonDriver { name: name.clone(), driver, may_accelerate, stands_for };
    ModelId::register(&name, fingerprint, Arc::new(python)).map(drop).map_err(|error| exception(py, &error))
}
