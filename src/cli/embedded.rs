//! The program inside another process, such as a Python interpreter. A verb runs on a thread of the caller and returns
//! what it would print. It handles no signals; its owner can watch it and end it from another thread.

use std::ffi::OsString;
use std::sync::Mutex;

use super::configured::{self, Configured};
use super::console::{self, Captured, Verbosity};
use super::signals::CANCEL;
use super::{Exit, not_started, pool_of, run as run_verb, with_program_name, without_panic};
use crate::{Error, Place, Result};

/// How a verb ended, and what it printed on standard output.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Answer {
    /// The exit code; never one of an error.
    pub exit: Exit,
    /// Text, JSON or CSV.
    pub text: String,
}

/// Stack of the threads that run a verb, bytes.
pub const STACK_BYTES: usize = 8 << 20;

/// Runs a verb; `words` follow the program's name on a command line. One verb runs at a time in a process.
///
/// # Errors
/// [`Error::Usage`] for a wrong command line; [`Error::Busy`] while another verb runs; those of the verb.
pub fn run(words: &[OsString]) -> Result<Answer> {
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    let Ok(_one) = ONE_AT_A_TIME.try_lock() else {
        return Err(Error::Busy {
            place: Box::new(Place::item("this process")),
            problem: "another run of lanesweep is in progress here".to_owned(),
        });
    };
    CANCEL.withdraw();
    *console::captured() = Some(Captured::default());
    console::set_command_line(words);
    console::start_log(Verbosity::Normal);
    let result = without_panic(|| parse_and_run(words));
    let text = console::captured().as_mut().map(|captured| {
        captured.bar = None;
        std::mem::take(&mut captured.text)
    });
    Ok(Answer { exit: result?, text: text.unwrap_or_default() })
}

fn parse_and_run(words: &[OsString]) -> Result<Exit> {
    let matches = match configured::command().try_get_matches_from(with_program_name(words)) {
        Ok(matches) => matches,
        Err(error) if error.use_stderr() => return Err(wrong_words(&error)),
        Err(error) => {
            console::print(&error.to_string())?;
            return Ok(Exit::Ok);
        }
    };
    let (cli, configured) = Configured::of(&matches)?;
    let asked = configured.settings.run.threads;
    let pool = pool_of(asked)?.stack_size(STACK_BYTES).build().map_err(|error| not_started(asked, &error))?;
    pool.install(|| run_verb(&cli, &configured))
}

/// The first paragraph of clap's message; the rest is help for a terminal.
fn wrong_words(error: &clap::Error) -> Error {
    let text = error.to_string();
    let (problem, rest) = text.split_once("\n\n").unwrap_or((&text, ""));
    let tip = rest.lines().find_map(|line| line.trim().strip_prefix("tip: ")).unwrap_or_default();
    Error::usage(Place::item("arguments"), problem.trim_start_matches("error: ").trim(), tip)
}

/// Requests the running verb to end in good order: after the present chunk, with its journal on disk.
pub fn cancel() {
    CANCEL.request();
}

/// Whether the running verb was requested to end.
pub fn is_cancelled() -> bool {
    CANCEL.requested()
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
