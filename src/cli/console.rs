//! Data on stdout, everything else on stderr; a closed pipe is not an error. All output goes through this file, so that
//! no foreign text (an id, a file name) sends control characters to a terminal.

use std::borrow::Cow;
use std::ffi::OsString;
use std::fmt;
use std::io::{self, IsTerminal, Write};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use clap::error::{ContextKind, ContextValue, ErrorKind};
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle, WeakProgressBar};
use tracing::{Level, Metadata};
use tracing_subscriber::fmt::MakeWriter;
use tracing_subscriber::fmt::format::debug_fn;

use super::{Exit, Output};
use lanesweep_report::tables::WIDTH;
use lanesweep_support::plain_text::{cut, cut_names, quoted_word, shown, shown_in_line, shown_json};
use lanesweep_support::readable::count;
use lanesweep_support::{Error, Place, Result};

/// Name of standard output in errors.
const STDOUT: &str = "standard output";

/// What a run inside another program says while it works, until its owner takes it.
#[derive(Debug, Default)]
pub(super) struct Captured {
    /// Lines of the log and of stderr.
    pub messages: Vec<(Level, String)>,
    /// The bar of the present work.
    pub bar: Option<ProgressBar>,
}

static CAPTURED: Mutex<Option<Captured>> = Mutex::new(None);

/// What is captured now; `None` if the program prints.
pub(super) fn captured() -> MutexGuard<'static, Option<Captured>> {
    CAPTURED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Whether a program has called a verb as a function.
pub(super) fn is_captured() -> bool {
    captured().is_some()
}

/// Adds a line to what is captured; false if the program prints.
fn capture(level: Level, line: &str) -> bool {
    let mut captured = captured();
    let Some(captured) = captured.as_mut() else { return false };
    captured.messages.push((level, line.trim_end().to_owned()));
    true
}

/// Writes lines of the log to stderr, or to what is captured.
struct Log(Level);

impl Write for Log {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if capture(self.0, &String::from_utf8_lossy(bytes)) { Ok(bytes.len()) } else { io::stderr().write(bytes) }
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stderr().flush()
    }
}

impl MakeWriter<'_> for Log {
    type Writer = Log;

    fn make_writer(&self) -> Log {
        Log(self.0)
    }

    fn make_writer_for(&self, meta: &Metadata<'_>) -> Log {
        Log(*meta.level())
    }
}

/// Starts the log. Colours only on a terminal and without `NO_COLOR`.
pub(super) fn start_log(level: Level) {
    // A second start (a test in the same process) keeps the first log.
    let _ = tracing_subscriber::fmt()
        .with_writer(Log(Level::INFO))
        // The owner of what is captured gets the level beside the line.
        .with_level(!is_captured())
        // If stderr is closed or full, no message can be shown, and writing one would panic.
        .log_internal_errors(false)
        // A message is one line, whatever characters a file name has.
        .fmt_fields(debug_fn(|out, field, value| match field.name() {
            "message" => write!(out, "{}", shown_in_line(&cut_names(&format!("{value:?}")))),
            name => write!(out, "{name}={}", shown_in_line(&format!("{value:?}"))),
        }))
        .with_ansi(io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none())
        .with_max_level(level)
        .with_target(false)
        .without_time()
        .try_init();
}

/// Width of tables on stdout, in columns: `COLUMNS` if set, else the terminal's, else 120.
pub(super) fn width() -> usize {
    let set = std::env::var("COLUMNS").ok().and_then(|columns| columns.parse().ok());
    let terminal = || Some(usize::from(terminal_size::terminal_size_of(io::stdout())?.0.0));
    set.filter(|width| *width > 0).or_else(terminal).unwrap_or(WIDTH)
}

/// Writes a text to stdout.
pub(super) fn print(text: &str) -> Result<()> {
    write_out(&shown(text))
}

/// Writes the text that is a verb's whole answer.
pub(super) fn answer(text: &str) -> Result<Output> {
    print(text)?;
    Ok(Exit::Ok.into())
}

/// Writes JSON or JSON Lines to stdout.
pub(super) fn print_json(json: &str) -> Result<()> {
    write_out(&shown_json(json))
}

fn write_out(text: &str) -> Result<()> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        other => other.map_err(|e| Error::io(STDOUT, "write", e)),
    }
}

/// Writes a text to stderr verbatim: messages of a result besides its data.
pub(super) fn say(text: &str) {
    if capture(Level::INFO, text) {
        return;
    }
    // Ignore a closed stderr: no message can be shown.
    let _ = write!(io::stderr().lock(), "{}", shown(text));
}

/// The command line as typed, for repeating the run.
pub(super) fn command_line(words: &[OsString]) -> String {
    let words = words.iter().map(|word| quoted_word(&word.to_string_lossy()));
    format!("lanesweep {}", words.collect::<Vec<_>>().join(" "))
}

/// A progress bar on stderr, or a line now and then if stderr is no terminal. Its remaining time follows from the units per time;
/// nobody knows it where the number of units is not known.
pub(super) fn progress(level: Level, units: Option<u64>, what: &str) -> ProgressBar {
    let bar = units.map_or_else(ProgressBar::no_length, ProgressBar::new);
    let is_terminal = io::stderr().is_terminal();
    if level == Level::ERROR || !is_terminal {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    let done = if units.is_some() { "{wide_bar} {pos}/{len}" } else { "{pos}" };
    if let Ok(style) = ProgressStyle::with_template(&format!("{{msg:24}} {done} {{elapsed}}{{left}}")) {
        bar.set_style(style.with_key("left", |state: &ProgressState, out: &mut dyn fmt::Write| {
            let measured = (state.pos() > 0).then(|| state.elapsed());
            // A bar that cannot be drawn is no error of the run.
            let _ = out.write_str(&remaining(measured.unwrap_or_default(), state.eta()));
        }));
    }
    bar.set_message(what.to_owned());
    if let Some(captured) = captured().as_mut() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
        captured.bar = Some(bar.clone());
    } else if level != Level::ERROR && !is_terminal {
        let weak = bar.downgrade();
        // A system without another thread hears nothing on the way.
        let _ = std::thread::Builder::new().spawn(move || log_at_intervals(&weak));
    }
    bar
}

/// Time between two lines about a run whose stderr is no terminal.
const BETWEEN_LINES: Duration = Duration::from_secs(60);

/// Logs the state of a bar at intervals until it is finished or dropped.
fn log_at_intervals(bar: &WeakProgressBar) {
    let mut due = Instant::now() + BETWEEN_LINES;
    loop {
        // Short naps: the thread ends soon after its bar.
        std::thread::sleep(Duration::from_secs(1));
        let Some(bar) = bar.upgrade().filter(|bar| !bar.is_finished()) else { return };
        if Instant::now() >= due {
            due += BETWEEN_LINES;
            tracing::info!("{}", line_of(&bar));
        }
    }
}

/// `sweeping: 1,200 of 9,600 (12 %) in 2 minutes, about 15 minutes left`, or `judging: 1,200 in 2 minutes`.
fn line_of(bar: &ProgressBar) -> String {
    let (what, done, elapsed) = (bar.message(), bar.position(), bar.elapsed());
    let Some(all) = bar.length() else {
        return format!("{what}: {} in {:#}", count(done), HumanDuration(elapsed));
    };
    let parts = done as f64 / all.max(1) as f64;
    // At the mean speed so far.
    let left = if done > 0 { elapsed.mul_f64((1.0 / parts - 1.0).max(0.0)) } else { Duration::ZERO };
    let ([done, all], percent, left) = ([done, all].map(count), 100.0 * parts, remaining(elapsed, left));
    format!("{what}: {done} of {all} ({percent:.0} %) in {:#}{left}", HumanDuration(elapsed))
}

/// Measured work before the remaining time is told: first units are slower, and few tell little.
const MIN_MEASURED: Duration = Duration::from_secs(3);

/// The remaining time in words; empty before enough is measured. Indicatif's estimate is 0 where it has none.
fn remaining(measured: Duration, left: Duration) -> String {
    match measured < MIN_MEASURED || left.is_zero() {
        true => String::new(),
        false => format!(", about {:#} left", HumanDuration(left)),
    }
}

/// Warns about skipped input, with help.
pub(super) fn warn<'a>(errors: impl IntoIterator<Item = &'a Error>) {
    errors.into_iter().for_each(|error| tracing::warn!("{error}; {}", error.help().unwrap_or_default()));
}

/// First character of Unicode's private use, where no line is broken.
const WHOLE: u32 = 0xf0000;

/// Text that is not broken at hyphens, nor anywhere in a line that is a command.
fn unbroken(text: &str) -> String {
    let of_line = |line: &'_ str| {
        let is_command = line.starts_with("lanesweep ");
        let moved = |c: char| char::from_u32(WHOLE + c as u32).unwrap_or(c);
        line.chars().map(|c| if c == '-' || is_command && c != '\n' { moved(c) } else { c }).collect::<String>()
    };
    text.split_inclusive('\n').map(of_line).collect()
}

/// Prints an error with its help on stderr.
pub(super) fn complain(error: &Error) {
    if capture(Level::ERROR, &format!("{error}; {}", error.help().unwrap_or_default())) {
        return;
    }
    let part = |text: &str| unbroken(&shown(text));
    let _ = miette::set_hook(Box::new(|_| Box::new(miette::MietteHandlerOpts::new().break_words(false).build())));
    let mut report = miette::MietteDiagnostic::new(part(&error.to_string()));
    report.help = error.help().map(|help| part(&help));
    let back = |c: char| (c as u32).checked_sub(WHOLE).and_then(char::from_u32).unwrap_or(c);
    let report: String = format!("{:?}", miette::Report::new(report)).chars().map(back).collect();
    // Ignore a closed stderr: no message can be shown.
    let _ = writeln!(io::stderr().lock(), "{report}");
}

/// Reports an error of the command line, or prints the requested help.
///
/// # Errors
/// [`Error::Io`] if the help cannot be written to standard output.
pub(super) fn refuse(error: &clap::Error) -> Result<Exit> {
    if !error.use_stderr() {
        return match error.print().and_then(|()| io::stdout().flush()) {
            Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(Error::io(STDOUT, "write", error)),
            _ => Ok(Exit::Ok),
        };
    }
    let text = error.to_string();
    let mut safe = shown(&text).into_owned();
    for (_, value) in error.context() {
        if let ContextValue::String(value) = value
            && let Cow::Owned(short) = cut(&shown(value))
        {
            safe = safe.replace(&*shown(value), &short);
        }
    }
    if error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        say(&safe);
        return Ok(Exit::Usage);
    }
    // Clap's paragraphs: what is wrong, tips, the usage, where the help is.
    let one_line = |part: &str| part.split_whitespace().collect::<Vec<_>>().join(" ");
    let parts: Vec<String> = safe.split("\n\n").map(one_line).collect();
    let after = |words: &'static str| parts.iter().filter_map(move |part| part.strip_prefix(words));
    // A flag of another verb is no value.
    let tips = after("tip: ").filter(|tip| !tip.starts_with("to pass '")).map(str::to_owned);
    let wrong = error.get(ContextKind::InvalidArg).map(ToString::to_string).unwrap_or_default();
    let verbs = if error.kind() == ErrorKind::UnknownArgument { verbs_with(&wrong) } else { Vec::new() };
    let of_verbs = (!verbs.is_empty()).then(|| format!("{wrong} belongs to {}", verbs.join(", ")));
    let usage = after("Usage: ").map(|usage| format!("usage: {usage}"));
    let more = after("For more information, ").map(|more| more.trim_end_matches('.').to_owned());
    let help: Vec<String> = of_verbs.into_iter().chain(tips).chain(usage).chain(more).collect();
    let problem = after("error: ").next().unwrap_or(&safe);
    complain(&Error::usage(Place::item("lanesweep"), problem, help.join("\n")));
    Ok(Exit::Usage)
}

/// The verbs with a flag that another verb has not.
fn verbs_with(flag: &str) -> Vec<String> {
    let Some(flag) = flag.strip_prefix("--") else { return Vec::new() };
    let has = |verb: &&clap::Command| verb.get_arguments().any(|arg| arg.get_long() == Some(flag));
    super::configured::command().get_subcommands().filter(has).map(|verb| verb.get_name().to_owned()).collect()
}
