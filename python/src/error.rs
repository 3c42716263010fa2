//! Errors of the library as Python exceptions: one class per kind, with place and help as attributes.

use lanesweep::Error;
use lanesweep::cli::Exit;
use pyo3::create_exception;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;

create_exception!(lanesweep._core, LanesweepError, PyException, "An error of lanesweep; see `help` and `exit_code`.");
create_exception!(lanesweep._core, UsageError, LanesweepError, "An argument, a key or a profile cannot be used.");
create_exception!(lanesweep._core, InputError, LanesweepError, "The data are invalid.");
create_exception!(
    lanesweep._core,
    SystemRefusal,
    LanesweepError,
    "The system refused to read, write or start a thread."
);
create_exception!(lanesweep._core, DeviceError, LanesweepError, "There is no usable device, or it failed.");
create_exception!(lanesweep._core, VerificationError, LanesweepError, "A requested check failed.");
create_exception!(lanesweep._core, BusyError, LanesweepError, "Another run uses this process or folder.");
create_exception!(lanesweep._core, RunStopped, LanesweepError, "A time limit ended the run.");
create_exception!(lanesweep._core, InternalError, LanesweepError, "A defect of lanesweep.");

pub fn add_to(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    for class in [
        py.get_type::<LanesweepError>(),
        py.get_type::<UsageError>(),
        py.get_type::<InputError>(),
        py.get_type::<SystemRefusal>(),
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
    let help = error.help();
    let text = match &help {
        Some(help) => format!("{error}\n  help: {help}"),
        None => error.to_string(),
    };
    let made = match error {
        Error::Usage { .. } => UsageError::new_err(text),
        Error::Input { .. } => InputError::new_err(text),
        Error::Io { .. } => SystemRefusal::new_err(text),
        Error::Device { .. } => DeviceError::new_err(text),
        Error::Verification(_) => VerificationError::new_err(text),
        Error::Busy { .. } => BusyError::new_err(text),
        Error::Interrupted { .. } => RunStopped::new_err(text),
        _ => InternalError::new_err(text),
    };
    // A value that cannot be set is missing from the exception; the text has all of it.
    let _ = made.value(py).setattr("help", help);
    let _ = made.value(py).setattr("problem", error.to_string());
    let _ = made.value(py).setattr("exit_code", Exit::from(error).code());
    made
}
