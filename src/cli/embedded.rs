//! Verbs inside another process, such as a Python interpreter. A verb is a function of named values; it runs on a thread of the
//! caller and returns its answer. It handles no signals; its owner can watch it and end it from another thread.

use std::sync::{Arc, Mutex, PoisonError, TryLockError};

pub use super::arguments::{Given, described};
use super::configured::Configured;
use super::console;
use super::signals::CANCEL;
use super::{Output, not_started, pool_of, without_panic};
use lanesweep_support::cancel::Cancel;
use lanesweep_support::{Error, Place, Result};

/// Stack of the threads that run a verb, bytes.
pub const STACK_BYTES: usize = 8 << 20;

/// Runs a verb with named values of its flags and positions; `call` is for repeating it. One verb runs at a time in a
/// process.
///
/// # Errors
/// [`Error::Usage`] for an unknown or unusable argument; [`Error::Busy`] while another verb runs; those of the verb.
pub fn run(function: &str, call: String, given: Vec<(String, Given)>) -> Result<Output> {
    alone(|| {
        let result = without_panic(|| {
            let (cli, configured) = Configured::of(&super::arguments::parse(function, &given)?, call)?;
            let requested = configured.settings.run.threads;
            let pool = pool_of(requested)?.stack_size(STACK_BYTES);
            let pool = pool.build().map_err(|error| not_started(requested, &error))?;
            pool.install(|| cli.verb.run(&configured))
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
    console::start_log(tracing::Level::INFO);
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

/// The present work of the running verb: what it is, the units done, and all units if their number is known.
pub fn progress() -> Option<(String, u64, Option<u64>)> {
    let captured = console::captured();
    let bar = captured.as_ref()?.bar.as_ref()?;
    (!bar.is_finished()).then(|| (bar.message(), bar.position(), bar.length()))
}

/// Takes the lines of the log and of standard error since the last call, with their levels.
pub fn take_messages() -> Vec<(tracing::Level, String)> {
    console::captured().as_mut().map(|captured| std::mem::take(&mut captured.messages)).unwrap_or_default()
}
