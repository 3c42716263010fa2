//! What SIGINT, SIGTERM and SIGHUP do to the program.
//!
//! The first signal lets a run that can be continued end by itself, within [`LONGEST_WAIT`]. Any other run, and any run at
//! the second signal, ends at once: its unfinished files are removed and the exit status is 128 + the signal's number, as a
//! shell expects.

use std::sync::LazyLock;
use std::time::Duration;

use crate::support::cancel::Cancel;

/// Exit status of a run that was interrupted and continues when it is run again.
pub const EXIT_STATUS: u8 = 75;

/// Longest wait for a run to end by itself after a signal. What is in the journal by then is kept; the work on the present
/// chunk, or before the first one, is given up.
pub const LONGEST_WAIT: Duration = Duration::from_secs(4);

/// The token of this process: signals and `--stop-after` set it, and its runs hold it.
pub static CANCEL: LazyLock<Cancel> = LazyLock::new(Cancel::default);

/// Receives SIGINT, SIGTERM and SIGHUP from now on, on a thread of its own, and SIGXFSZ, so that what is written beyond a
/// limit of the size of files is an error and not the end; a second call does nothing. A SIGHUP that is ignored at the
/// start (`nohup`) stays ignored; that is known on Linux only, and elsewhere SIGHUP is left to the system. Without Unix
/// signals it does nothing, and the system's own way to end a process stays.
pub fn install() {
    #[cfg(unix)]
    {
        static ONCE: std::sync::Once = std::sync::Once::new();
        ONCE.call_once(|| {
            if let Err(error) = receive() {
                tracing::warn!("signals end the program without tidying up: {error}");
            }
            // At a limit of the size of files (`ulimit -f`) the signal would end the process in the middle of a write;
            // with it received, the write fails instead, and the error names the file.
            let at_limit = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(false));
            if let Err(error) = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, at_limit) {
                tracing::debug!("a limit of the size of files would end the program: {error}");
            }
        });
    }
}

#[cfg(unix)]
fn receive() -> std::io::Result<()> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    let mut signals = signal_hook::iterator::Signals::new([SIGINT, SIGTERM])?;
    if !is_ignored(SIGHUP) {
        signals.add_signal(SIGHUP)?;
    }
    let receiver = move || {
        for signal in signals.forever() {
            if CANCEL.is_resumable() && !CANCEL.request() {
                say("ending after the present chunk; again to end at once");
                give_up_after(LONGEST_WAIT);
            } else {
                end_at_once(signal);
            }
        }
    };
    std::thread::Builder::new().name("signals".to_owned()).spawn(receiver).map(drop)
}

/// Ends the process if the run has not ended by itself by then. A run that is not asked to end any more runs on.
#[cfg(unix)]
fn give_up_after(wait: Duration) {
    let give_up = move || {
        std::thread::sleep(wait);
        if CANCEL.requested() {
            say("the present chunk takes too long and is given up; the same command continues from the last record");
            end_with(EXIT_STATUS.into());
        }
    };
    // Without a thread the run still ends after its chunk, and at once at the second signal.
    let _ = std::thread::Builder::new().name("end".to_owned()).spawn(give_up);
}

/// Is a signal ignored, or is that unknown? The system's mask of ignored signals begins with signal 1.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| u64::from_str_radix(line.strip_prefix("SigIgn:")?.trim(), 16).ok());
    mask.is_none_or(|mask| mask >> (signal - 1) & 1 == 1)
}

#[cfg(unix)]
fn say(line: &str) {
    use std::io::Write;
    // Where stderr is gone there is nobody to tell.
    let _ = writeln!(std::io::stderr(), "{line}");
}

#[cfg(unix)]
fn end_at_once(signal: i32) -> ! {
    end_with(128 + signal)
}

#[cfg(unix)]
fn end_with(status: i32) -> ! {
    // Nobody begins another file until the end.
    let _live = crate::support::atomic_file::remove_live();
    // Without the exit handlers of libraries (a driver's, say) whose threads are at work.
    signal_hook::low_level::exit(status)
}
