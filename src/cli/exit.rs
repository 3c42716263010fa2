//! Exit codes: one documented code per kind of ending.

use std::io::ErrorKind;
use std::process::ExitCode;

use lanesweep_run::check::{Answer, Verdict};
use lanesweep_support::Error;

/// Exit codes of every verb.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Exit {
    /// Complete. `check`: the case is preventable, and the answer is robust.
    Ok = 0,
    /// The checked case is not preventable; the sheet was written.
    NotPreventable = 1,
    /// A flag, a key or a profile is invalid; nothing was done.
    Usage = 2,
    /// The data are invalid; nothing was written.
    BadInput = 3,
    /// A result was written, but parts of the input were skipped; stderr names each.
    Incomplete = 4,
    /// A requested check failed (`verify`).
    VerificationFailed = 5,
    /// The system refused to read or write, to start a thread or to allocate memory.
    Io = 6,
    /// No usable compute device, or the device failed.
    NoDevice = 7,
    /// A small change of the checked case or of the time step changes the answer; the sheet was written.
    Undecided = 8,
    /// Nothing collides in the checked case even if the ego never reacts; the sheet was written.
    NoConflict = 9,
    /// Annex 3 does not describe the checked case, so its drivers give no answer; the sheet was written.
    OutsideAnnex = 10,
    /// A defect of the program.
    Internal = 70,
    /// A signal or `run.stop_after_s` ended the run early; progress is kept, and the same command resumes.
    Interrupted = crate::signals::EXIT_STATUS,
}

impl Exit {
    /// All codes with their meanings, for documentation.
    pub const ALL: [(Exit, &str); 13] = [
        (Exit::Ok, "done; the checked case is preventable (check)"),
        (Exit::NotPreventable, "the checked case is not preventable (check)"),
        (Exit::Usage, "invalid flag, key or profile; nothing was done"),
        (Exit::BadInput, "invalid data; nothing was written"),
        (Exit::Incomplete, "a result was written, but parts of the input were left out"),
        (Exit::VerificationFailed, "a check failed"),
        (Exit::Io, "the system refused to read, to write, to start a thread or to give memory"),
        (Exit::NoDevice, "no usable device, or the device failed"),
        (Exit::Undecided, "the answer is undecided (check)"),
        (Exit::NoConflict, "the checked case has no conflict: nothing to prevent (check)"),
        (Exit::OutsideAnnex, "Annex 3 of UN R157 does not describe the checked case (check)"),
        (Exit::Internal, "a program error"),
        (Exit::Interrupted, "interrupted, or another process uses the folder; the same command resumes"),
    ];

    /// The numeric code.
    pub fn code(self) -> u8 {
        self as u8
    }

    /// Exit statuses after a signal, 128 + the signal's number, with their meanings.
    const BY_SIGNAL: [(u8, &str); 3] = [
        (129, "ended at once by SIGHUP; a run with a journal ends with 75 instead, and can resume"),
        (130, "the same by SIGINT (Ctrl-C)"),
        (143, "the same by SIGTERM"),
    ];

    /// The table for `--help`.
    pub(crate) fn table() -> String {
        let ends = Exit::ALL.map(|(exit, meaning)| (exit.code(), meaning)).into_iter().chain(Exit::BY_SIGNAL);
        let lines = ends.map(|(code, meaning)| format!("  {code:>3}  {meaning}\n"));
        format!("Exit codes:\n{}", lines.collect::<String>())
    }
}

impl From<&Error> for Exit {
    fn from(error: &Error) -> Exit {
        match error {
            Error::Input { .. } => Exit::BadInput,
            Error::Usage { .. } => Exit::Usage,
            // An input that is missing or damaged stays so: nothing to repeat.
            Error::Io { action, source, .. } if action.starts_with("read") && is_of_data(source.kind()) => {
                Exit::BadInput
            }
            Error::Io { .. } => Exit::Io,
            Error::Device { .. } => Exit::NoDevice,
            Error::Verification(_) => Exit::VerificationFailed,
            Error::Internal(_) => Exit::Internal,
            Error::Interrupted { .. } | Error::Busy { .. } => Exit::Interrupted,
        }
    }
}

fn is_of_data(kind: ErrorKind) -> bool {
    use ErrorKind::{InvalidData, InvalidFilename, InvalidInput, IsADirectory, NotADirectory, NotFound, UnexpectedEof};
    matches!(
        kind,
        InvalidData | InvalidFilename | InvalidInput | IsADirectory | NotADirectory | NotFound | UnexpectedEof
    )
}

impl From<Verdict> for Exit {
    fn from(verdict: Verdict) -> Exit {
        match verdict {
            Verdict::Undecided | Verdict::Answer(Answer::Open) => Exit::Undecided,
            Verdict::OutsideAnnex | Verdict::NotJudged => Exit::OutsideAnnex,
            Verdict::Answer(Answer::Preventable) => Exit::Ok,
            Verdict::Answer(Answer::NotPreventable) => Exit::NotPreventable,
            Verdict::Answer(Answer::NoConflict) => Exit::NoConflict,
        }
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> ExitCode {
        ExitCode::from(exit.code())
    }
}
