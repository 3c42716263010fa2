//! Verbs of the program inside the interpreter. The work runs on its own thread without the GIL; the calling thread looks
//! for signals and passes on progress and messages.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};

use lanesweep::cli::embedded::{self, Given};
use lanesweep::cli::settings::Key;
use lanesweep::model::driver::ModelId;
use lanesweep::model::profile::Profile;
use lanesweep::scenario::parameterization::Parameterization;
use lanesweep::{Error, Place, Result};
use pyo3::exceptions::{PyException, PyKeyboardInterrupt};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::driver;
use crate::error::exception;
use crate::frame::Frame;

/// How often the calling thread looks for signals.
const LOOK: Duration = Duration::from_millis(20);
/// How long a call waits for work that nobody waits for: its present chunk ends sooner, unless a driver blocks.
const PATIENCE: Duration = Duration::from_secs(5);

/// The turn of this process to work: threads take turns.
struct Turn;

/// The process whose turn it is; 0 if nobody's. A forked child does not wait for its parent's.
static OWNER: AtomicU32 = AtomicU32::new(0);
/// The work of this turn went on without its caller, who was interrupted twice.
static IS_LEFT_ALONE: AtomicBool = AtomicBool::new(false);

impl Turn {
    /// Waits for the turn. Work that a driver asks for, and work behind one that nobody waits for, is refused.
    fn take(py: Python<'_>) -> PyResult<Turn> {
        let asked = Instant::now();
        loop {
            let (me, owner) = (std::process::id(), OWNER.load(Ordering::Acquire));
            if owner != me && OWNER.compare_exchange(owner, me, Ordering::AcqRel, Ordering::Relaxed).is_ok() {
                IS_LEFT_ALONE.store(false, Ordering::Release);
                return Ok(Turn);
            }
            let is_left_alone = IS_LEFT_ALONE.load(Ordering::Acquire) && asked.elapsed() > PATIENCE;
            if driver::is_calling() || is_left_alone {
                let problem = "another run of lanesweep is in progress here".to_owned();
                return Err(exception(py, &Error::Busy { place: Box::new(Place::item("this process")), problem }));
            }
            py.detach(|| std::thread::sleep(LOOK));
            py.check_signals()?;
        }
    }
}

impl Drop for Turn {
    fn drop(&mut self) {
        OWNER.store(0, Ordering::Release);
    }
}

/// Runs work on a thread with the program's stack, after that of other threads, and waits for it. A signal (Ctrl-C) requests the end of the work and is
/// raised after it.
pub fn watched<T: Send + 'static>(
    py: Python<'_>,
    on_progress: Option<&Bound<'_, PyAny>>,
    on_message: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce() -> Result<T> + Send + 'static,
) -> PyResult<T> {
    let turn = Turn::take(py)?;
    let (send, done) = mpsc::channel();
    let done = Mutex::new(done);
    let thread = std::thread::Builder::new().name("lanesweep".to_owned()).stack_size(embedded::STACK_BYTES);
    let started = thread.spawn(move || drop(send.send((work(), turn))));
    started.map_err(|error| exception(py, &Error::io("a thread", "start", error)))?;
    let mut ended: Option<PyErr> = None;
    // The turn ends after messages and exceptions of this work are taken, or with the work if nobody waits for it.
    let (result, _turn) = loop {
        let result = py.detach(|| match done.lock() {
            Ok(done) => done.recv_timeout(LOOK),
            Err(_) => Err(RecvTimeoutError::Disconnected),
        });
        if let Err(error) = pass_on(py, on_progress, on_message) {
            if ended.is_some() && result.is_err() && error.is_instance_of::<PyKeyboardInterrupt>(py) {
                // The work does not look for the request: it goes on alone, and the next call is refused until it ends.
                IS_LEFT_ALONE.store(true, Ordering::Release);
                return Err(error);
            }
            ended = ended.or(Some(error));
        }
        if ended.is_some() {
            // Work that began after the signal has not seen the request.
            embedded::cancel();
        }
        match result {
            Ok((result, turn)) => break (result, Some(turn)),
            Err(RecvTimeoutError::Disconnected) => break (Err(Error::Internal("the work panicked".to_owned())), None),
            Err(RecvTimeoutError::Timeout) => {}
        }
    };
    // The exception of a driver says more than the error that it caused. Only work that has a driver leaves one.
    let raised = driver::take_exception().filter(|_| result.is_err());
    if let Some(error) = ended {
        return Err(error);
    }
    result.map_err(|error| match raised {
        // What ends the program is no error of the driver.
        Some(cause) if !cause.is_instance_of::<PyException>(py) => cause,
        Some(cause) => {
            let error = match error {
                // A single lane, whose run cannot fail by itself.
                Error::Internal(_) => driver::error_of(py, "a driver".to_owned(), &cause),
                other => other,
            };
            let made = exception(py, &error);
            made.set_cause(py, Some(cause));
            made
        }
        None => exception(py, &error),
    })
}

/// Passes on messages and progress, and raises what a signal asks for.
fn pass_on(
    py: Python<'_>,
    on_progress: Option<&Bound<'_, PyAny>>,
    on_message: Option<&Bound<'_, PyAny>>,
) -> PyResult<()> {
    for (level, line) in embedded::take_messages() {
        if let Some(on_message) = on_message {
            on_message.call1((level.as_str(), line))?;
        }
    }
    if let Some(on_progress) = on_progress
        && let Some(progress) = embedded::progress()
    {
        on_progress.call1(progress)?;
    }
    py.check_signals()
}

/// The value of an argument: whether a flag is present, or values as a command line has them.
#[derive(FromPyObject)]
enum Argument {
    Flag(bool),
    Words(Vec<PathBuf>),
}

impl From<Argument> for Given {
    fn from(argument: Argument) -> Given {
        match argument {
            Argument::Flag(is_present) => Given::Flag(is_present),
            Argument::Words(words) => Given::Words(words.into_iter().map(PathBuf::into_os_string).collect()),
        }
    }
}

/// Exit status, record, messages and tables by name.
type Ran = (u8, String, String, Vec<(String, Frame)>);

/// Runs a verb by the name of its function, with the values of named arguments: exit code, text, document and tables.
#[pyfunction]
#[pyo3(signature = (function, call, arguments, on_progress=None, on_message=None))]
pub fn run(
    py: Python<'_>,
    function: String,
    call: String,
    arguments: &Bound<'_, PyDict>,
    on_progress: Option<&Bound<'_, PyAny>>,
    on_message: Option<&Bound<'_, PyAny>>,
) -> PyResult<Ran> {
    let given = arguments.iter().map(|(name, one)| Ok((name.extract()?, one.extract::<Argument>()?.into())));
    let given = given.collect::<PyResult<Vec<(String, Given)>>>()?;
    watched(py, on_progress, on_message, move || {
        let output = embedded::run(&function, call, given)?;
        let tables = output.tables.into_iter().map(|(name, table)| Ok((name, Frame::of(table)?)));
        Ok((output.exit.code(), output.text, output.document, tables.collect::<Result<_>>()?))
    })
}

/// The command line itself, with its own handling of signals. For a process that does nothing else.
#[pyfunction]
pub fn main(py: Python<'_>, words: Vec<OsString>) -> u8 {
    py.detach(|| {
        let thread = std::thread::Builder::new().stack_size(embedded::STACK_BYTES);
        let program = thread.spawn(move || lanesweep::cli::main_with(&words));
        program.map_or(lanesweep::cli::Exit::Io, |program| program.join().unwrap_or(lanesweep::cli::Exit::Internal))
    })
    .code()
}

/// A profile of drivers and criteria, as nested dictionaries.
#[pyfunction]
pub fn profile<'py>(py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
    let profile = Profile::load(name).map_err(|error| exception(py, &error))?;
    parsed(py, serde_json::to_string(&profile))
}

/// What the program says of a function and its arguments, as nested dictionaries.
#[pyfunction]
pub fn described<'py>(py: Python<'py>, function: &str) -> PyResult<Bound<'py, PyAny>> {
    parsed(py, serde_json::to_string(&embedded::described(function).map_err(|error| exception(py, &error))?))
}

/// Names of profiles, drivers and parameterizations, and the keys of a configuration with their meanings.
#[pyfunction]
pub fn lists(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    let keys: BTreeMap<String, String> = Key::all().into_iter().map(|key| (key.name, key.description)).collect();
    let parameterizations = Parameterization::ALL
        .map(|one| (format!("{}-{}", one.category.key().replace('_', "-"), one.key), one.description()));
    let record = serde_json::json!({
        "profiles": Profile::names().collect::<Vec<_>>(),
        "models": ModelId::ALL.map(ModelId::name),
        "parameterizations": BTreeMap::from(parameterizations),
        "keys": keys,
    });
    parsed(py, serde_json::to_string(&record))
}

/// A record of the library as nested dictionaries.
fn parsed<'py>(py: Python<'py>, record: serde_json::Result<String>) -> PyResult<Bound<'py, PyAny>> {
    let text = record.map_err(|error| exception(py, &Error::Internal(format!("a record: {error}"))))?;
    py.import("json")?.call_method1("loads", (text,))
}
