//! The command line: one file per verb. It parses the arguments; the library implements their meaning. Data goes to
//! stdout, log and progress to stderr.

mod arguments;
mod case_flags;
mod check;
mod check_table;
mod config;
mod configured;
mod console;
mod devices;
pub mod embedded;
mod exit;
mod fit;
mod format;
mod help;
mod lists;
mod map;
mod merge;
mod mine;
mod sample;
mod sample_run;
pub mod settings;
pub mod signals;
mod simulate;
mod source;
mod study;
mod tracks;
mod verify;

pub use exit::Exit;

/// Commit that the program is built from; empty if unknown.
const COMMIT: &str = env!("LANESWEEP_COMMIT");

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{Args, FromArgMatches, Parser, Subcommand};
use configured::Configured;
use tracing::Level;

use lanesweep_support::error::{Notation, write_options_as};
use lanesweep_support::input_file::guarded;
use lanesweep_support::run_folder::NamedTable;
use lanesweep_support::{Error, Result, option};

#[derive(Parser)]
#[command(
    name = "lanesweep",
    version,
    about = "Runs UN R157 driver models in recorded and parameterized traffic scenarios",
    long_about = "Runs UN R157 driver models in recorded and parameterized traffic scenarios, and measures how far both \
                  agree.\n\nStart with: lanesweep study",
    after_long_help = Exit::table(),
    arg_required_else_help = true
)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
    #[command(flatten)]
    common: Common,
}

/// Flags of every verb.
#[derive(Debug, Clone, Args)]
struct Common {
    /// Errors only
    #[arg(short, long, global = true, conflicts_with = "verbose", help_heading = "Run", hide_short_help = true)]
    quiet: bool,
    /// More messages
    #[arg(short, long, global = true, help_heading = "Run", hide_short_help = true)]
    verbose: bool,
}

impl Common {
    fn level(&self) -> Level {
        match (self.quiet, self.verbose) {
            (true, _) => Level::ERROR,
            (false, true) => Level::DEBUG,
            (false, false) => Level::INFO,
        }
    }
}

#[derive(Subcommand)]
enum Verb {
    Study(Box<study::Study>),
    Tracks(tracks::Tracks),
    Mine(mine::Mine),
    Fit(fit::Fit),
    Sample(Box<sample::Sample>),
    Map(Box<map::Map>),
    Simulate(simulate::Simulate),
    Check(check::Check),
    Merge(merge::Merge),
    Verify(Box<verify::Verify>),
    Devices(devices::Devices),
    Config(config::Config),
}

/// How a verb ended. Texts are empty where the verb has printed its answer itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Output {
    /// The exit code; never one of an error.
    pub exit: Exit,
    /// The answer for people.
    pub text: String,
    /// Its numbers as one JSON document.
    pub document: String,
    /// Its tables, for a program that calls the verb as a function.
    pub tables: Vec<NamedTable>,
}

impl Output {
    /// With tables, if a program calls the verb.
    fn with_tables(self, tables: impl FnOnce() -> Vec<NamedTable>) -> Output {
        if console::is_captured() { Output { tables: tables(), ..self } } else { self }
    }
}

impl From<Exit> for Output {
    fn from(exit: Exit) -> Output {
        Output { exit, text: String::new(), document: String::new(), tables: Vec::new() }
    }
}

/// Parses the command line of the process, runs the verb and returns its exit code.
pub fn main() -> ExitCode {
    main_with(&std::env::args_os().skip(1).collect::<Vec<_>>()).into()
}

/// Like [`main`], with the words after the program's name. For a process that does nothing else: it handles signals and
/// starts the global thread pool.
pub fn main_with(words: &[OsString]) -> Exit {
    write_options_as(Notation::Flag);
    let all = std::iter::once(OsString::from("lanesweep")).chain(words.iter().cloned());
    let matches = match configured::command().try_get_matches_from(all) {
        Ok(matches) => matches,
        Err(error) => return run_and_report(|| console::refuse(&error)),
    };
    if let Ok(common) = Common::from_arg_matches(&matches) {
        console::start_log(common.level());
    }
    signals::install();
    run_and_report(|| {
        let (cli, configured) = Configured::of(&matches, console::command_line(words))?;
        let requested = configured.settings.run.threads;
        pool_of(requested)?.build_global().map_err(|error| not_started(requested, &error))?;
        cli.verb.run(&configured).map(|output| output.exit)
    })
}

/// Runs the work and reports the result.
fn run_and_report(work: impl FnOnce() -> Result<Exit>) -> Exit {
    without_panic(work).unwrap_or_else(|error| {
        console::complain(&error);
        Exit::from(&error)
    })
}

/// Runs the work. A panic in any thread of the work is a defect of the program, not a user's error.
fn without_panic<T>(work: impl FnOnce() -> Result<T>) -> Result<T> {
    guarded(|| std::panic::catch_unwind(std::panic::AssertUnwindSafe(work))).unwrap_or_else(|_| {
        Err(Error::Internal(
            "the program panicked; see the message above. Existing files are complete; \
                         the same command resumes a run from its journal"
                .to_owned(),
        ))
    })
}

impl Verb {
    fn run(&self, configured: &Configured) -> Result<Output> {
        if let Some(seconds) = configured.settings.run.stop_after_s {
            signals::CANCEL.stop_after(seconds);
        }
        match self {
            Verb::Study(verb) => verb.run(configured),
            Verb::Tracks(verb) => verb.run(configured),
            Verb::Mine(verb) => verb.run(configured),
            Verb::Fit(verb) => verb.run(configured),
            Verb::Sample(verb) => verb.run(configured),
            Verb::Map(verb) => verb.run(configured),
            Verb::Simulate(verb) => verb.run(configured),
            Verb::Check(verb) => verb.run(configured),
            Verb::Merge(verb) => verb.run(configured),
            Verb::Verify(verb) => verb.run(configured),
            Verb::Devices(verb) => verb.run(),
            Verb::Config(verb) => verb.run(configured),
        }
    }
}

/// Maximum number of threads per logical core. Lanes are compute-bound, so more threads would not be faster.
const THREADS_PER_CORE: usize = 4;

/// Address space per thread: its stack, and its part of the allocator's arenas.
const BYTES_PER_THREAD: usize = 4 << 20;

/// The worker threads, which start before the work, because a pool that cannot start later panics. The default is one
/// per core; the maximum is the number that is useful. Results do not depend on it.
///
/// # Errors
/// [`Error::Io`] if there is no memory for them.
fn pool_of(requested: Option<usize>) -> Result<rayon::ThreadPoolBuilder> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let useful = THREADS_PER_CORE * cores;
    if let Some(requested) = requested.filter(|requested| *requested > useful) {
        tracing::info!("{}: {useful} are started, {THREADS_PER_CORE} per logical core", threads(requested));
    }
    let count = requested.map(|requested| requested.min(useful));
    // If memory ran out after some threads had started, an allocation in one of them would end the process.
    let mut room = Vec::<u8>::new();
    let bytes = count.unwrap_or(cores).saturating_mul(BYTES_PER_THREAD);
    room.try_reserve_exact(bytes).map_err(|error| refused(requested, error.to_string()))?;
    // Otherwise the compiler removes the unused allocation.
    std::hint::black_box(&room);
    drop(room);
    Ok(rayon::ThreadPoolBuilder::new().num_threads(count.unwrap_or(0)))
}

/// The error of a system that has no more threads.
fn not_started(requested: Option<usize>, error: &rayon::ThreadPoolBuildError) -> Error {
    match std::error::Error::source(error).and_then(|e| e.downcast_ref::<std::io::Error>()) {
        Some(source) => refused(requested, source.to_string()),
        None => Error::Internal(format!("the thread pool did not start: {error}")),
    }
}

/// The option of a number of threads.
fn threads(requested: usize) -> String {
    option(&format!("threads = {requested}"))
}

fn refused(requested: Option<usize>, reason: String) -> Error {
    let what = requested.map_or("the worker threads".to_owned(), threads);
    Error::io(what, "start", std::io::Error::new(std::io::ErrorKind::WouldBlock, reason))
}
