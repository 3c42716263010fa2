//! The error type of the library. Every variant says *where* (file, row, column, scenario or lane), *what* was found or
//! expected, and *what to do about it*. Texts name an option by [`option`], as the user of this process writes it.

use std::borrow::Cow;
use std::fmt;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU8, Ordering};

use crate::plain_text::{MAX_PATH, cut, cut_names, nearest, shown_in_line};

/// Result of everything in this library that can fail on a user's input.
pub type Result<T> = std::result::Result<T, Error>;

/// How the users of a process write options.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Notation {
    /// On a command line: `--dt`, `--backend cpu`.
    Flag = 1,
    /// As arguments in Python: `dt`, `backend = cpu`.
    Argument,
}

static NOTATION: AtomicU8 = AtomicU8::new(0);

/// Sets the notation of this process.
pub fn write_options_as(notation: Notation) {
    NOTATION.store(notation as u8, Ordering::Relaxed);
}

/// An option, by the name of its field, in the notation of this process; with a value: `backend = cpu`.
pub fn option(text: &str) -> String {
    let notation = NOTATION.load(Ordering::Relaxed);
    let (name, value) = text.split_once(" = ").map_or((text, None), |(name, value)| (name, Some(value)));
    if notation == Notation::Flag as u8 {
        let value = value.map(|value| format!(" {value}")).unwrap_or_default();
        return format!("--{}{value}", name.replace('_', "-"));
    }
    let prefix = if notation == Notation::Argument as u8 { "" } else { "option " };
    // A keyword of Python.
    let text = if text == "from" { "from_" } else { text };
    format!("{prefix}`{text}`")
}

/// Adds an error to a list shown to users, unless the list already has it.
pub fn push_once(list: &mut Vec<Error>, error: Error) {
    if !list.iter().any(|known| known.to_string() == error.to_string()) {
        list.push(error);
    }
}

/// The place of a problem in a user's input. The message skips unknown parts.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Place {
    /// File or folder, as the user named it.
    pub file: Option<PathBuf>,
    /// Line of the file, counted from 1 and including the header line.
    pub row: Option<u64>,
    /// Column name as in the header.
    pub column: Option<String>,
    /// The item in the file, at most 80 characters: a vehicle, a scenario key, a lane key.
    pub item: Option<String>,
    /// A field of the library's options.
    pub option: Option<&'static str>,
}

impl Place {
    /// A whole file or folder.
    pub fn file(path: impl AsRef<Path>) -> Self {
        Place { file: Some(path.as_ref().to_path_buf()), ..Place::default() }
    }

    /// An item that is not in a file: a scenario, a lane, a flag.
    pub fn item(item: impl Into<String>) -> Self {
        Place::default().of(item)
    }

    /// A field of the library's options, which messages show as [`option`].
    pub fn option(name: &'static str) -> Self {
        Place { option: Some(name), ..Place::default() }
    }

    /// Adds the line, counted from 1 and including the header.
    pub fn row(mut self, row: u64) -> Self {
        self.row = Some(row);
        self
    }

    /// Adds the column.
    pub fn column(mut self, column: impl Into<String>) -> Self {
        self.column = Some(name(column.into()));
        self
    }

    /// Adds the item in the file.
    pub fn of(mut self, item: impl Into<String>) -> Self {
        self.item = Some(name(item.into()));
        self
    }
}

/// Shortens a name so that it fits into a message.
fn name(text: String) -> String {
    match cut(&text) {
        Cow::Borrowed(_) => text,
        Cow::Owned(short) => short,
    }
}

/// A path as a message shows it; a path above the system's maximum length is shortened like a name.
fn path_name(path: &Path) -> String {
    let text = path.display().to_string();
    if text.len() > MAX_PATH { shown_in_line(&cut(&text)) } else { shown_in_line(&text) }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parts = [
            self.file.as_deref().map(path_name),
            self.row.map(|row| format!("line {row}")),
            self.column.as_ref().map(|column| format!("column `{}`", shown_in_line(column))),
            self.item.as_deref().map(shown_in_line),
            self.option.map(option),
        ];
        f.write_str(&parts.into_iter().flatten().collect::<Vec<_>>().join(", "))
    }
}

/// Errors, grouped by who must act.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Invalid data: missing file or column, a bad number, a wrong order.
    #[error("{place}: {problem}")]
    Input {
        /// Where. Boxed to keep results without an error small: the reader returns millions.
        place: Box<Place>,
        /// What was found and what was expected.
        problem: String,
        /// What to do.
        help: String,
    },
    /// A profile, a flag or a combination of options cannot be used.
    #[error("{place}: {problem}")]
    Usage {
        /// Which flag, key or profile.
        place: Box<Place>,
        /// What is wrong with it.
        problem: String,
        /// What to write instead.
        help: String,
    },
    /// The system refused to read, to write or to start a thread.
    #[error("{path}: cannot {action}: {source}", path = path_name(path))]
    Io {
        /// File or folder; for threads, their owner.
        path: PathBuf,
        /// The attempted action, as a verb: `read`, `write`, `create the folder`, `start`.
        action: &'static str,
        /// The system's error.
        source: std::io::Error,
    },
    /// No usable compute device exists, or the one in use failed.
    #[error("{device}: {problem}")]
    Device {
        /// The device as a user names it (name, index or PCI bus id), or the flag that requested one. Boxed like the
        /// problem, to keep results without an error small.
        device: Box<str>,
        /// What is wrong with it.
        problem: Box<str>,
        /// What to do.
        help: String,
    },
    /// A check requested by the user failed (`verify`).
    #[error("{0}")]
    Verification(String),
    /// Another process works on the same run or part; the same command can be repeated later.
    #[error("{place}: {problem}")]
    Busy {
        /// The lock.
        place: Box<Place>,
        /// Who holds it.
        problem: String,
    },
    /// A defect of this program, caught before it could produce a wrong number.
    #[error("internal error: {0}")]
    Internal(String),
    /// The run was ended early by its owner, a signal or a time limit.
    #[error("interrupted: {done}")]
    Interrupted {
        /// Progress at the end.
        done: String,
        /// Whether progress is kept, so that the same run resumes there.
        is_kept: bool,
    },
}

impl Error {
    /// Bad data at `place`.
    pub fn input(place: Place, problem: impl Into<String>, help: impl Into<String>) -> Self {
        Error::Input { place: Box::new(place), problem: cut_names(&problem.into()), help: help.into() }
    }

    /// A flag, key or profile that cannot be used.
    pub fn usage(place: Place, problem: impl Into<String>, help: impl Into<String>) -> Self {
        Error::Usage { place: Box::new(place), problem: cut_names(&problem.into()), help: help.into() }
    }

    /// A name that nothing has: the help has the most similar of `names`, all of them, and what else is possible (`or`).
    pub fn unknown<'a>(
        place: Place,
        what: &str,
        name: &str,
        names: impl IntoIterator<Item = &'a str>,
        or: &str,
    ) -> Self {
        let names: Vec<&str> = names.into_iter().collect();
        let all = names.join(", ");
        let help = match nearest(name, names, 0.6) {
            Some(near) => format!("did you mean `{near}`? There are {all}{or}"),
            None => format!("use one of {all}{or}"),
        };
        Error::usage(place, format!("there is no {what} `{name}`"), help)
    }

    /// A compute device that is missing or failed.
    pub fn device(device: impl Into<String>, problem: impl Into<String>, help: impl Into<String>) -> Self {
        let (device, problem) = (name(device.into()), cut_names(&problem.into()));
        Error::Device { device: device.into(), problem: problem.into(), help: help.into() }
    }

    /// The system's refusal, with the path and the attempted action.
    pub fn io(path: impl AsRef<Path>, action: &'static str, source: std::io::Error) -> Self {
        Error::Io { path: path.as_ref().to_path_buf(), action, source }
    }

    /// What the user can do about it; `None` if the message says it all.
    pub fn help(&self) -> Option<String> {
        let help = match self {
            Error::Input { help, .. } | Error::Usage { help, .. } | Error::Device { help, .. } => help,
            Error::Io { source, .. } if is_limit_of_open_files(source) => {
                "the limit of open files is reached: raise it (`ulimit -n`), or close programs that hold many"
            }
            Error::Io { action, source, .. } => match source.kind() {
                ErrorKind::NotFound => "check the path for typing errors",
                ErrorKind::PermissionDenied => {
                    let change = "change the permissions or choose another path";
                    return Some(format!("you have no permission to {action} here: {change}"));
                }
                ErrorKind::UnexpectedEof => "the file is truncated: copy it again",
                ErrorKind::InvalidData => "save the file as UTF-8 text",
                ErrorKind::IsADirectory => "this is a folder; give the path of a file",
                ErrorKind::NotADirectory | ErrorKind::AlreadyExists => {
                    "a file is where a folder is needed: choose another path"
                }
                ErrorKind::StorageFull => "the disk is full: free some space and run again",
                ErrorKind::QuotaExceeded => "your quota is used up: free some space and run again",
                ErrorKind::FileTooLarge => {
                    "files may not become that large here: raise the limit (`ulimit -f`) and run again"
                }
                ErrorKind::WouldBlock | ErrorKind::OutOfMemory => {
                    return Some(format!(
                        "the limit of processes or of memory is reached: use fewer threads ({}; more threads than cores do \
                         not help), or raise the limit (`ulimit -u`, `ulimit -v`)",
                        option("threads")
                    ));
                }
                ErrorKind::ReadOnlyFilesystem => {
                    "the disk is mounted read-only: choose another path, or mount it writable and run again"
                }
                _ => "check that the disk is present and has space, then run again",
            },
            Error::Verification(_) => "",
            Error::Busy { .. } => {
                return Some(format!("wait for it and run this again, or choose another {}", option("out")));
            }
            Error::Internal(_) => "this is a defect of lanesweep: please report it with the command and its input",
            Error::Interrupted { is_kept: true, .. } => "run the same command again: it continues",
            Error::Interrupted { is_kept: false, .. } => "run it again: nothing was kept",
        };
        (!help.is_empty()).then(|| help.to_owned())
    }
}

/// Whether the system refused to open one more file (EMFILE, ENFILE). The text is checked too, because an error wrapped
/// with a reason has no error code.
fn is_limit_of_open_files(source: &std::io::Error) -> bool {
    let text = source.to_string();
    cfg!(unix) && ["(os error 23)", "(os error 24)"].iter().any(|number| text.contains(number))
}
