//! The program inside another process, such as a Python interpreter. A verb runs on a thread of the caller and returns
//! what it would print. It handles no signals; its owner can watch it and end it from another thread.

use std::ffi::OsString;
use std::sync::{Arc, Mutex, PoisonError, TryLockError};

use serde_json::Value;

use super::configured::{self, Configured};
use super::console::{self, Verbosity};
use super::signals::CANCEL;
use super::{Exit, not_started, pool_of, run as run_verb, with_program_name, without_panic};
use crate::support::cancel::Cancel;
use crate::{Error, Place, Result};

/// How a verb ended, and what it printed on standard output.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Answer {
    /// The exit code; never one of an error.
    pub exit: Exit,
    /// Text, JSON or CSV.
    pub text: String,
    /// The numbers of the text as one JSON document; empty if the verb has none.
    pub document: String,
}

/// Stack of the threads that run a verb, bytes.
pub const STACK_BYTES: usize = 8 << 20;

/// Runs a verb; `words` follow the program's name on a command line. One verb runs at a time in a process.
///
/// # Errors
/// [`Error::Usage`] for a wrong command line; [`Error::Busy`] while another verb runs; those of the verb.
pub fn run(words: &[OsString]) -> Result<Answer> {
    alone(|| {
        console::set_command_line(words);
        let result = without_panic(|| parse_and_run(words));
        let (text, document) = console::captured().as_mut().map_or_else(Default::default, |captured| {
            captured.bar = None;
            (std::mem::take(&mut captured.text), std::mem::take(&mut captured.document))
        });
        Ok(Answer { exit: result?, text, document })
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

fn parse_and_run(words: &[OsString]) -> Result<Exit> {
    let matches = match configured::command().try_get_matches_from(with_program_name(words)) {
        Ok(matches) => matches,
        Err(mut error) if error.use_stderr() => {
            configured::name_replacement(&mut error);
            return Err(wrong_words(&error));
        }
        Err(error) => {
            console::print(&error.to_string())?;
            return Ok(Exit::Ok);
        }
    };
    let (cli, configured) = Configured::of(&matches)?;
    let requested = configured.settings.run.threads;
    let pool = pool_of(requested)?.stack_size(STACK_BYTES).build().map_err(|error| not_started(requested, &error))?;
    pool.install(|| run_verb(&cli, &configured))
}

/// The first paragraph of clap's message; the rest is help for a terminal.
fn wrong_words(error: &clap::Error) -> Error {
    let text = error.to_string();
    let (problem, rest) = text.split_once("\n\n").unwrap_or((&text, ""));
    let tip = rest.lines().find_map(|line| line.trim().strip_prefix("tip: ")).unwrap_or_default();
    Error::usage(Place::item("arguments"), problem.trim_start_matches("error: ").trim(), tip)
}

/// The command line as data, for programs that make an interface of it: a list of verbs with their arguments, in the
/// order of their help.
pub fn definition() -> Value {
    let mut program = configured::command();
    program.build();
    let verbs = program.get_subcommands().filter(|verb| verb.get_name() != "help");
    Value::Array(verbs.flat_map(|verb| verb_definitions("", verb)).collect())
}

fn verb_definitions(before: &str, verb: &clap::Command) -> Vec<Value> {
    let name = format!("{before}{}", verb.get_name());
    if verb.has_subcommands() {
        let within = verb.get_subcommands().filter(|verb| verb.get_name() != "help");
        return within.flat_map(|verb| verb_definitions(&format!("{name} "), verb)).collect();
    }
    let text = |styled: Option<&clap::builder::StyledStr>| styled.map(ToString::to_string).unwrap_or_default();
    let argument = |arg: &clap::Arg| {
        let defaults = arg.get_default_values().iter().map(|value| value.to_string_lossy());
        let choices = arg.get_possible_values().into_iter().map(|value| value.get_name().to_owned());
        let count = arg.get_num_args().map_or(1, |range| range.max_values());
        serde_json::json!({
            "id": arg.get_id().as_str(),
            "flag": arg.get_long(),
            "takes_value": arg.get_action().takes_values(),
            "repeats": count > 1 || matches!(arg.get_action(), clap::ArgAction::Append),
            "is_list": arg.get_value_delimiter().is_some(),
            "is_required": arg.is_required_set(),
            "value_name": arg.get_value_names().unwrap_or_default().first().map(ToString::to_string),
            "default": defaults.collect::<Vec<_>>().join(","),
            "choices": choices.collect::<Vec<_>>(),
            "help": text(arg.get_long_help().or(arg.get_help())),
            "heading": arg.get_help_heading(),
        })
    };
    let arguments = verb.get_arguments().filter(|arg| !["help", "version"].contains(&arg.get_id().as_str()));
    vec![serde_json::json!({
        "verb": name,
        "help": text(verb.get_long_about().or(verb.get_about())),
        "arguments": arguments.map(argument).collect::<Vec<_>>(),
    })]
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
