//! Verbs inside another process, such as a Python interpreter. A verb is a function of named values; it runs on a thread of the
//! caller and returns its answer. It handles no signals; its owner can watch it and end it from another thread.

use std::sync::{Arc, Mutex, PoisonError, TryLockError};

pub use super::arguments::Value;
use super::arguments::{self, Arguments, FromArguments};
use super::configured::{self, Configured};
use super::console::{self, Verbosity};
use super::signals::CANCEL;
use super::{Output, Verb, not_started, pool_of, without_panic};
use lanesweep_support::cancel::Cancel;
use lanesweep_support::{Error, Place, Result};

/// Stack of the threads that run a verb, bytes.
pub const STACK_BYTES: usize = 8 << 20;

/// A verb as a function: its name, its words on a command line, and its options.
type Function = (&'static str, &'static [&'static str], fn(&mut Arguments) -> Result<Verb>);

#[rustfmt::skip] // a table
const FUNCTIONS: [Function; 9] = [
    ("study", &["study"], |given| Ok(Verb::Study(of(given)?))),
    ("tracks", &["tracks"], |given| Ok(Verb::Tracks(of(given)?))),
    ("mine", &["mine"], |given| Ok(Verb::Mine(of(given)?))),
    ("fit", &["fit"], |given| Ok(Verb::Fit(of(given)?))),
    ("sample", &["sample"], |given| Ok(Verb::Sample(of(given)?))),
    ("map", &["map"], |given| Ok(Verb::Map(of(given)?))),
    ("check", &["check"], |given| Ok(Verb::Check(of(given)?))),
    ("trace", &["simulate"], |given| Ok(Verb::Simulate(of(given)?))),
    ("merge", &["merge"], |given| Ok(Verb::Merge(of(given)?))),
];

fn of<T: FromArguments>(arguments: &mut Arguments) -> Result<T> {
    T::from_arguments(arguments)
}

/// A function with the definition of its verb.
fn find(function: &str) -> Result<(Function, clap::Command)> {
    let found = FUNCTIONS.into_iter().find(|(name, ..)| *name == function);
    let found = found.ok_or_else(|| Error::usage(Place::item(function), "there is no such function", ""))?;
    let mut program = configured::command();
    program.build();
    let verb = found.1.iter().try_fold(&program, |command, word| command.find_subcommand(word));
    let verb = verb.cloned().ok_or_else(|| Error::Internal(format!("there is no verb of {function}")))?;
    Ok((found, verb))
}

/// Names of a function's arguments.
///
/// # Errors
/// [`Error::Usage`] for an unknown function.
pub fn arguments(function: &str) -> Result<Vec<String>> {
    Ok(arguments::names(&find(function)?.1).map(str::to_owned).collect())
}

/// Runs a verb with named values; those of its flags and positions. One verb runs at a time in a process.
///
/// # Errors
/// [`Error::Usage`] for an unknown or unusable argument; [`Error::Busy`] while another verb runs; those of the verb.
pub fn run(function: &str, values: Vec<(String, Value)>) -> Result<Output> {
    alone(|| {
        let result = without_panic(|| {
            let ((.., verb), command) = find(function)?;
            let name = command.get_name().to_owned();
            let mut arguments = Arguments::new(command, function, values)?;
            let configured = Configured::of_arguments(&mut arguments, &name)?;
            let mut verb = verb(&mut arguments)?;
            configured.fill(&mut verb);
            let requested = configured.settings.run.threads;
            let pool = pool_of(requested)?.stack_size(STACK_BYTES);
            let pool = pool.build().map_err(|error| not_started(requested, &error))?;
            pool.install(|| verb.run(&configured))
        });
        console::captured().iter_mut().for_each(|captured| captured.bar = None);
        result
    })
}

/// Does other work of the library as [`run`] does a verb: alone in this process, with its own cancellation, and with
/// its messages captured.
///
/// # Errors
/// [`Error::Busy`] while other work is in progress; those of the work.
pub fn exclusively<T: Send>(work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
    alone(|| pool()?.install(work))
}

fn alone<T>(work: impl FnOnce() -> Result<T>) -> Result<T> {
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    let _one = match ONE_AT_A_TIME.try_lock() {
        Ok(one) => one,
        Err(TryLockError::Poisoned(one)) => one.into_inner(),
        Err(TryLockError::WouldBlock) => {
            return Err(Error::Busy {
                place: Box::new(Place::item("this process")),
                problem: "another run of lanesweep is in progress here".to_owned(),
            });
        }
    };
    CANCEL.withdraw();
    console::captured().get_or_insert_default();
    console::start_log(Verbosity::Normal);
    work()
}

/// The worker threads of work without an option `threads`. The threads of a process do not survive its fork, so a child
/// starts its own.
fn pool() -> Result<Arc<rayon::ThreadPool>> {
    static POOL: Mutex<Option<(u32, Arc<rayon::ThreadPool>)>> = Mutex::new(None);
    let mut pool = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    match pool.take() {
        Some((process, found)) if process == std::process::id() => {
            *pool = Some((process, found.clone()));
            return Ok(found);
        }
        // Dropping it would wait for threads that are not there.
        Some((_, of_parent)) => std::mem::forget(of_parent),
        None => {}
    }
    let made = pool_of(None)?.stack_size(STACK_BYTES).build().map_err(|error| not_started(None, &error))?;
    let made = Arc::new(made);
    *pool = Some((std::process::id(), made.clone()));
    Ok(made)
}

/// Requests the running verb to end in good order: after the present chunk, with its journal on disk.
pub fn cancel() {
    CANCEL.request();
}

/// The token that [`cancel`] sets.
pub fn token() -> Cancel {
    CANCEL.clone()
}

/// The present work of the running verb: what it is, the units done, and all units.
pub fn progress() -> Option<(String, u64, u64)> {
    let captured = console::captured();
    let bar = captured.as_ref()?.bar.as_ref()?;
    (!bar.is_finished()).then(|| (bar.message(), bar.position(), bar.length().unwrap_or(0)))
}

/// Takes the lines of the log and of standard error since the last call, with their levels.
pub fn take_messages() -> Vec<(tracing::Level, String)> {
    console::captured().as_mut().map(|captured| std::mem::take(&mut captured.messages)).unwrap_or_default()
}
