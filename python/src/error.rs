//! Errors of the library as Python exceptions: one class per kind, with place and help as attributes.

use lanesweep::Error;
use lanesweep::cli::Exit;
use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyFileNotFoundError, PyOSError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyTuple, PyType};

create_exception!(lanesweep._core, LanesweepError, PyException, "An error of lanesweep; see `help` and `exit_code`.");
create_exception!(lanesweep._core, DeviceError, LanesweepError, "There is no usable device, or it failed.");
create_exception!(lanesweep._core, VerificationError, LanesweepError, "A requested check failed.");
create_exception!(lanesweep._core, BusyError, LanesweepError, "Another run uses this process or folder.");
create_exception!(lanesweep._core, RunStopped, LanesweepError, "A time limit ended the run.");
create_exception!(lanesweep._core, InternalError, LanesweepError, "A defect of lanesweep.");

/// Classes that also are one of Python's own: each has its name, what it says, and both.
struct Classes {
    usage: Py<PyType>,
    input: Py<PyType>,
    refusal: Py<PyType>,
    missing: Py<PyType>,
}

impl Classes {
    fn get(py: Python<'_>) -> PyResult<&'static Classes> {
        static CLASSES: PyOnceLock<Classes> = PyOnceLock::new();
        CLASSES.get_or_try_init(py, || {
            let class = |name: &str, says: &str, of: [Bound<'_, PyType>; 2]| -> PyResult<Py<PyType>> {
                let about = PyDict::new(py);
                about.set_item("__module__", "lanesweep._core")?;
                about.set_item("__doc__", says)?;
                let made = py.get_type::<PyType>().call1((name, PyTuple::new(py, of)?, about))?;
                Ok(made.cast_into::<PyType>()?.unbind())
            };
            let base = py.get_type::<LanesweepError>();
            let value = || [base.clone(), py.get_type::<PyValueError>()];
            let usage = class("UsageError", "An argument, a key or a profile cannot be used.", value())?;
            let input = class("InputError", "The data are invalid.", value())?;
            let system = [base.clone(), py.get_type::<PyOSError>()];
            let says = "The system refused to read, write or start a thread.";
            let refusal = class("SystemRefusal", says, system)?;
            let missing = [refusal.bind(py).clone(), py.get_type::<PyFileNotFoundError>()];
            let missing = class("MissingFile", "There is no such file or folder.", missing)?;
            Ok(Classes { usage, input, refusal, missing })
        })
    }

    fn error(of: fn(&Classes) -> &Py<PyType>, text: String) -> PyErr {
        Python::attach(|py| match Classes::get(py) {
            Ok(classes) => PyErr::from_type(of(classes).bind(py).clone(), (text,)),
            Err(error) => error,
        })
    }
}

/// An argument, a key or a profile cannot be used.
pub fn usage_error(text: impl Into<String>) -> PyErr {
    Classes::error(|classes| &classes.usage, text.into())
}

/// The data are invalid.
pub fn input_error(text: impl Into<String>) -> PyErr {
    Classes::error(|classes| &classes.input, text.into())
}

pub fn add_to(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    let Classes { usage, input, refusal, missing } = Classes::get(py)?;
    for class in [
        py.get_type::<LanesweepError>(),
        usage.bind(py).clone(),
        input.bind(py).clone(),
        refusal.bind(py).clone(),
        missing.bind(py).clone(),
        py.get_type::<DeviceError>(),
        py.get_type::<VerificationError>(),
        py.get_type::<BusyError>(),
        py.get_type::<RunStopped>(),
        py.get_type::<InternalError>(),
    ] {
        module.add(class.name()?.to_str()?, &class)?;
    }
    Ok(())
}

/// The exception of an error.
pub fn exception(py: Python<'_>, error: &Error) -> PyErr {
    let (problem, help) = (error.to_string(), error.help());
    let text = match &help {
        Some(help) => format!("{problem}\n  help: {help}"),
        None => problem.clone(),
    };
    let made = match error {
        Error::Usage { .. } => usage_error(text),
        Error::Input { .. } => input_error(text),
        Error::Io { source, .. } if source.kind() == std::io::ErrorKind::NotFound => {
            Classes::error(|classes| &classes.missing, text)
        }
        Error::Io { .. } => Classes::error(|classes| &classes.refusal, text),
        Error::Device { .. } => DeviceError::new_err(text),
        Error::Verification(_) => VerificationError::new_err(text),
        Error::Busy { .. } => BusyError::new_err(text),
        Error::Interrupted { .. } => RunStopped::new_err(text),
        _ => InternalError::new_err(text),
    };
    // A value that cannot be set is missing from the exception; the text has all of it.
    let _ = made.value(py).setattr("help", help);
    let _ = made.value(py).setattr("problem", problem);
    let _ = made.value(py).setattr("exit_code", Exit::from(error).code());
    made
}
