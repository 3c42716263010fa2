//! Errors of the library as Python exceptions: one class per kind, with place and help as attributes.

use std::collections::HashMap;

use lanesweep::Error;
use lanesweep::cli::Exit;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{IntoPyDict, PyTuple, PyType};

/// Names of the classes, what they say, and their bases: one above, and one of Python's own.
const CLASSES: [(&str, &str, &[&str]); 10] = [
    ("LanesweepError", "An error of lanesweep; see `help` and `exit_code`.", &["Exception"]),
    ("UsageError", "An argument, a key or a profile cannot be used.", &["LanesweepError", "ValueError"]),
    ("InputError", "The data are invalid.", &["LanesweepError", "ValueError"]),
    ("SystemRefusal", "The system refused to read, write or start a thread.", &["LanesweepError", "OSError"]),
    ("MissingFile", "There is no such file or folder.", &["SystemRefusal", "FileNotFoundError"]),
    ("DeviceError", "There is no usable device, or it failed.", &["LanesweepError"]),
    ("VerificationError", "A requested check failed.", &["LanesweepError"]),
    ("BusyError", "Another run uses this process or folder.", &["LanesweepError"]),
    ("RunStopped", "A time limit ended the run.", &["LanesweepError"]),
    ("InternalError", "A defect of lanesweep.", &["LanesweepError"]),
];

type Classes = HashMap<&'static str, Py<PyType>>;

fn classes(py: Python<'_>) -> PyResult<&'static Classes> {
    static MADE: PyOnceLock<Classes> = PyOnceLock::new();
    MADE.get_or_try_init(py, || {
        let (builtins, mut made) = (py.import("builtins")?, Classes::new());
        for (name, says, bases) in CLASSES {
            let base = |name: &&str| match made.get(name) {
                Some(class) => Ok(class.bind(py).clone().into_any()),
                None => builtins.getattr(*name),
            };
            let bases = bases.iter().map(base).collect::<PyResult<Vec<_>>>()?;
            let about = [("__module__", "lanesweep._core"), ("__doc__", says)].into_py_dict(py)?;
            let class = py.get_type::<PyType>().call1((name, PyTuple::new(py, bases)?, about))?;
            made.insert(name, class.cast_into::<PyType>()?.unbind());
        }
        Ok(made)
    })
}

/// An exception of the class of this name.
fn of_class(name: &str, text: String) -> PyErr {
    Python::attach(|py| match classes(py) {
        Ok(classes) => PyErr::from_type(classes[name].bind(py).clone(), (text,)),
        Err(error) => error,
    })
}

/// An argument, a key or a profile cannot be used.
pub fn usage_error(text: impl Into<String>) -> PyErr {
    of_class("UsageError", text.into())
}

/// The data are invalid.
pub fn input_error(text: impl Into<String>) -> PyErr {
    of_class("InputError", text.into())
}

pub fn add_to(module: &Bound<'_, PyModule>) -> PyResult<()> {
    classes(module.py())?.iter().try_for_each(|(name, class)| module.add(*name, class))
}

/// The exception of an error.
pub fn exception(py: Python<'_>, error: &Error) -> PyErr {
    let (problem, help) = (error.to_string(), error.help());
    let text = match &help {
        Some(help) => format!("{problem}\n  help: {help}"),
        None => problem.clone(),
    };
    let class = match error {
        Error::Usage { .. } => "UsageError",
        Error::Input { .. } => "InputError",
        Error::Io { source, .. } if source.kind() == std::io::ErrorKind::NotFound => "MissingFile",
        Error::Io { .. } => "SystemRefusal",
        Error::Device { .. } => "DeviceError",
        Error::Verification(_) => "VerificationError",
        Error::Busy { .. } => "BusyError",
        Error::Interrupted { .. } => "RunStopped",
        _ => "InternalError",
    };
    let made = of_class(class, text);
    // A value that cannot be set is missing from the exception; the text has all of it.
    let _ = made.value(py).setattr("help", help);
    let _ = made.value(py).setattr("problem", problem);
    let _ = made.value(py).setattr("exit_code", Exit::from(error).code());
    made
}
