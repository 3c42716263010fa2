//! Drivers in Python, called once per step with rows over all running lanes; and compiled ones, called in threads.

use std::cell::Cell;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use lanesweep::cli::embedded;
use lanesweep::model::driver::{Accelerations, LaneColumns, ModelId, VectorDriver};
use lanesweep::{Error, Place, Result};
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;

use crate::error::{exception, usage_error};

/// Lanes of a batch of a compiled driver: their rows and states fit into a core's second cache.
const BATCH_LANES: usize = 512;
/// A compiled driver is compared with `acceleration` over as many lanes, and over as many of their steps.
const COMPARED_LANES: usize = 512;
const COMPARED_STEPS: u32 = 250;
/// Largest difference of the two, m/s² and relative: both round as they like.
const TOLERANCE: f32 = 1e-3;

/// The exception that ended the driver of the running work.
static RAISED: Mutex<Option<PyErr>> = Mutex::new(None);

thread_local! {
    /// This thread is within a call of a driver: work that it asks for would wait for itself.
    static IS_CALLING: Cell<bool> = const { Cell::new(false) };
}

pub fn is_calling() -> bool {
    IS_CALLING.get()
}

fn calling<T>(work: impl FnOnce() -> T) -> T {
    IS_CALLING.set(true);
    let done = work();
    IS_CALLING.set(false);
    done
}

pub fn take_exception() -> Option<PyErr> {
    RAISED.lock().unwrap_or_else(PoisonError::into_inner).take()
}

/// The error of a driver that raised an exception.
pub fn error_of(py: Python<'_>, place: String, raised: &PyErr) -> Error {
    let text = raised.value(py).repr().map_or_else(|_| "an exception".to_owned(), |text| text.to_string());
    Error::input(Place::item(place), format!("it raised {text}"), "see the exception that caused this")
}

/// See `lanesweep.Driver.compiled`.
#[allow(unsafe_code)] // the type of a function in C
type Function = unsafe extern "C" fn(
    lanes: i64,
    stride: i64,
    step: i64,
    dt_s: f64,
    view: *const f32,
    state: *mut f32,
    parameters: *const f32,
    acceleration: *mut f32,
);

struct Compiled {
    function: Function,
    parameters: Vec<f32>,
    state_rows: usize,
    /// Lanes that were compared with `acceleration`.
    compared: AtomicUsize,
}

struct PythonDriver {
    name: String,
    driver: Py<PyAny>,
    may_accelerate: bool,
    stands_for: ModelId,
    compiled: Option<Compiled>,
}

impl PythonDriver {
    /// Keeps the exception for the caller and returns the error that ends the run.
    fn failed(&self, py: Python<'_>, at: &str, raised: PyErr) -> Error {
        let error = error_of(py, format!("driver {}, {at}", self.name), &raised);
        *RAISED.lock().unwrap_or_else(PoisonError::into_inner) = Some(raised);
        error
    }

    /// Calls `acceleration`.
    fn decide(&self, state: &Py<PyAny>, columns: &LaneColumns, rows: Vec<f32>, decided: &mut [f32]) -> Result<()> {
        let ask = |py: Python<'_>| -> PyResult<()> {
            let (rows, lane) = (PyArray1::from_vec(py, rows), PyArray1::from_slice(py, &columns.lane));
            let (step, time_s) = (columns.step, f64::from(columns.step) * columns.dt_s);
            let module = py.import("lanesweep._driver")?;
            let found = module.call_method1("decided", (&self.driver, state, step, time_s, lane, rows))?;
            let found: PyReadonlyArray1<'_, f32> = found.extract()?;
            decided.copy_from_slice(found.as_slice()?);
            Ok(())
        };
        attached(|py| ask(py).map_err(|raised| self.failed(py, &format!("step {}", columns.step), raised)))
    }
}

impl VectorDriver for PythonDriver {
    fn stands_for(&self) -> ModelId {
        self.stands_for
    }

    fn may_accelerate(&self) -> bool {
        self.may_accelerate
    }

    fn batch_lanes(&self) -> usize {
        if self.compiled.is_some() { BATCH_LANES } else { usize::MAX }
    }

    fn state_rows(&self) -> usize {
        self.compiled.as_ref().map_or(0, |compiled| compiled.state_rows)
    }

    fn start(&self, lanes: usize, dt_s: f64) -> Result<Accelerations<'_>> {
        let is_compared = |compiled: &Compiled| {
            let compared = &compiled.compared;
            compared.load(Ordering::Relaxed) < COMPARED_LANES
                && compared.fetch_add(lanes, Ordering::Relaxed) < COMPARED_LANES
        };
        let asks_python = self.compiled.as_ref().is_none_or(is_compared);
        let state = asks_python.then(|| {
            attached(|py| {
                let state = self.driver.bind(py).call_method1("start", (lanes, dt_s));
                state.map(Bound::unbind).map_err(|raised| self.failed(py, "start", raised))
            })
        });
        let state = state.transpose()?;
        let mut differing = vec![false; lanes];
        Ok(Box::new(move |columns, decided| {
            if embedded::token().requested() {
                return Err(Error::Interrupted { done: "a driver was stopped".to_owned(), is_kept: false });
            }
            match (&self.compiled, &state) {
                (None, Some(state)) => {
                    let rows = std::mem::take(&mut columns.rows);
                    self.decide(state, columns, rows, decided)
                }
                (Some(compiled), Some(state)) if columns.step < COMPARED_STEPS => {
                    compiled.call(columns, decided);
                    let mut expected = vec![0.0; decided.len()];
                    self.decide(state, columns, columns.rows.clone(), &mut expected)?;
                    compare(&self.name, columns, decided, &expected, &mut differing)
                }
                (compiled, _) => {
                    if let Some(compiled) = compiled {
                        compiled.call(columns, decided);
                    }
                    Ok(())
                }
            }
        }))
    }
}

impl Compiled {
    #[allow(unsafe_code)] // a function in C
    fn call(&self, columns: &mut LaneColumns, decided: &mut [f32]) {
        let LaneColumns { step, dt_s, stride, rows, state, .. } = columns;
        let (lanes, stride) = (decided.len() as i64, *stride as i64);
        let (view, state, parameters) = (rows.as_ptr(), state.as_mut_ptr(), self.parameters.as_ptr());
        let (step, to) = ((*step).into(), decided.as_mut_ptr());
        // SAFETY: whoever gives the function promises that it reads and writes what `Driver.compiled` says.
        calling(|| unsafe { (self.function)(lanes, stride, step, *dt_s, view, state, parameters, to) });
    }
}

/// Checks the decisions of a compiled driver against those of `acceleration`. Where a decision flips at a limit, rounding
/// may flip it: one lane in a hundred may differ.
fn compare(name: &str, columns: &LaneColumns, decided: &[f32], expected: &[f32], differing: &mut [bool]) -> Result<()> {
    for ((&lane, compiled), expected) in columns.lane.iter().zip(decided).zip(expected) {
        if (compiled - expected).abs() <= TOLERANCE * expected.abs().max(1.0) {
            continue;
        }
        differing[lane as usize] = true;
        let lanes = differing.iter().filter(|differs| **differs).count();
        if lanes * 100 > differing.len() {
            let problem = format!(
                "`compiled` decides {compiled} m/s² where `acceleration` decides {expected}; they differ in {lanes} of {} lanes",
                differing.len()
            );
            let help = "make both the same driver, or give only one";
            return Err(Error::input(Place::item(format!("driver {name}, step {}", columns.step)), problem, help));
        }
    }
    Ok(())
}

/// Calls Python, unless the interpreter is ending.
fn attached<T>(work: impl for<'py> FnOnce(Python<'py>) -> Result<T>) -> Result<T> {
    let ending = || Error::Interrupted { done: "the interpreter ends".to_owned(), is_kept: false };
    Python::try_attach(|py| calling(|| work(py))).unwrap_or_else(|| Err(ending()))
}

/// Registers a driver; `compiled` is the address of its function, with parameters, the number of rows of its state, and
/// whether it is compared with `acceleration`.
#[pyfunction]
pub fn register(
    py: Python<'_>,
    name: String,
    fingerprint: &str,
    driver: Py<PyAny>,
    may_accelerate: bool,
    attention: &str,
    compiled: Option<(usize, Vec<f32>, usize, bool)>,
) -> PyResult<()> {
    let stands_for = ModelId::parse(attention).ok_or_else(|| {
        usage_error(format!("`attention` names no built-in model: `{attention}`; use one of {}", ModelId::names()))
    })?;
    let compiled = compiled.map(|(address, parameters, state_rows, is_compared)| {
        #[allow(unsafe_code)] // an address of a function in C
        // SAFETY: it is not 0 (`_driver.py`); whoever gives the address promises the rest.
        let function = unsafe { std::mem::transmute::<usize, Function>(address) };
        let compared = AtomicUsize::new(if is_compared { 0 } else { COMPARED_LANES });
        Compiled { function, parameters, state_rows, compared }
    });
    let python = PythonDriver { name: name.clone(), driver, may_accelerate, stands_for, compiled };
    ModelId::register(&name, fingerprint, Arc::new(python)).map(drop).map_err(|error| exception(py, &error))
}
