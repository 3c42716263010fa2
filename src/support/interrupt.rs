//! Ending early in good order: what a signal (SIGINT, SIGTERM, SIGHUP) or a time limit does to a run.
//!
//! A run that keeps a journal says so with [`resumable`] and asks [`requested`] between its chunks: the first
//! signal lets it end by itself, within [`LONGEST_WAIT`]. Any other run, and any run at the second signal, ends at once:
//! its unfinished files are removed and the exit status is 128 + the signal's number, as a shell expects.
//!
//! State of the process, as signals are: a library user who calls none of these is not affected.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

static REQUESTED: AtomicBool = AtomicBool::new(false);
static GUARDS: AtomicUsize = AtomicUsize::new(0);
static DEADLINE: Mutex<Option<Instant>> = Mutex::new(None);

/// Exit status of a run that was interrupted and continues when it is run again.
pub const EXIT_STATUS: u8 = 75;

/// Longest wait for a run to end by itself after a signal. What is in the journal by then is kept; the work on the present
/// chunk, or before the first one, is given up.
pub const LONGEST_WAIT: Duration = Duration::from_secs(4);

/// While it lives, the first signal is only noted, for [`requested`].
#[derive(Debug)]
#[must_use = "a signal ends the process at once as soon as the guard is dropped"]
pub struct Guard(());

/// Declares that the work until the guard's end can be interrupted and continued: it asks [`requested`] often
/// enough (every few seconds) and brings what is done to the disk. Guards may overlap.
pub fn resumable() -> Guard {
    GUARDS.fetch_add(1, Ordering::SeqCst);
    Guard(())
}

impl Drop for Guard {
    fn drop(&mut self) {
        GUARDS.fetch_sub(1, Ordering::SeqCst);
    }
}

/// Whether the run is to end after the present chunk: after a signal, after [`request`], or past the time of
/// [`stop_after`]. It stays so until [`withdraw`].
pub fn requested() -> bool {
    REQUESTED.load(Ordering::SeqCst) || deadline().is_some_and(|deadline| Instant::now() >= deadline)
}

/// Asks the run to end after the present chunk, as the first signal does.
pub fn request() {
    REQUESTED.store(true, Ordering::SeqCst);
}

/// Takes a request and a time limit back, for a process that runs on after an interrupted run.
pub fn withdraw() {
    REQUESTED.store(false, Ordering::SeqCst);
    *DEADLINE.lock().unwrap_or_else(PoisonError::into_inner) = None;
}

/// From `seconds` (s, by the monotonic clock) after now, [`requested`] is true. A later call replaces an
/// earlier one. What is negative or no number means now; what is beyond the clock's range, never.
pub fn stop_after(seconds: f64) {
    let wait = if seconds > 0.0 { Duration::try_from_secs_f64(seconds).ok() } else { Some(Duration::ZERO) };
    let deadline = wait.and_then(|wait| Instant::now().checked_add(wait));
    *DEADLINE.lock().unwrap_or_else(PoisonError::into_inner) = deadline;
}

fn deadline() -> Option<Instant> {
    *DEADLINE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Receives SIGINT, SIGTERM and SIGHUP from now on, on a thread of its own, and SIGXFSZ, so that what is written beyond a
/// limit of the size of files is an error and not the end; a second call does nothing. A SIGHUP that is ignored at the
/// start (`nohup`) stays ignored; that is known on Linux only, and elsewhere SIGHUP is left to the system. For the
/// program's start: a library user keeps the signals to itself by not calling it. Without Unix signals it does
/// nothing, and the system's own way to end a process stays.
pub fn install() {
    #[cfg(all(unix, feature = "cli"))]
    {
        static ONCE: std::sync::Once = std::sync::Once::new();
        ONCE.call_once(|| {
            if let Err(error) = receive() {
                tracing::warn!("signals end the program without tidying up: {error}");
            }
            // At a limit of the size of files (`ulimit -f`) the signal would end the process in the middle of a write;
            // with it received, the write fails instead, and the error names the file.
            let at_limit = std::sync::Arc::new(AtomicBool::new(false));
            if let Err(error) = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, at_limit) {
                tracing::debug!("a limit of the size of files would end the program: {error}");
            }
        });
    }
}

#[cfg(all(unix, feature = "cli"))]
fn receive() -> std::io::Result<()> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    let mut signals = signal_hook::iterator::Signals::new([SIGINT, SIGTERM])?;
    if !is_ignored(SIGHUP) {
        signals.add_signal(SIGHUP)?;
    }
    let receiver = move || {
        for signal in signals.forever() {
            if GUARDS.load(Ordering::SeqCst) > 0 && !REQUESTED.swap(true, Ordering::SeqCst) {
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
#[cfg(all(unix, feature = "cli"))]
fn give_up_after(wait: Duration) {
    let give_up = move || {
        std::thread::sleep(wait);
        if REQUESTED.load(Ordering::SeqCst) {
            say("the present chunk takes too long and is given up; the same command continues from the last record");
            end_with(EXIT_STATUS.into());
        }
    };
    // Without a thread the run still ends after its chunk, and at once at the second signal.
    let _ = std::thread::Builder::new().name("end".to_owned()).spawn(give_up);
}

/// Is a signal ignored, or is that unknown? The system's mask of ignored signals begins with signal 1.
#[cfg(all(unix, feature = "cli"))]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| u64::from_str_radix(line.strip_prefix("SigIgn:")?.trim(), 16).ok());
    mask.is_none_or(|mask| mask >> (signal - 1) & 1 == 1)
}

#[cfg(all(unix, feature = "cli"))]
fn say(line: &str) {
    use std::io::Write;
    // Where stderr is gone there is nobody to tell.
    let _ = writeln!(std::io::stderr(), "{line}");
}

#[cfg(all(unix, feature = "cli"))]
fn end_at_once(signal: i32) -> ! {
    end_with(128 + signal)
}

#[cfg(all(unix, feature = "cli"))]
fn end_with(status: i32) -> ! {
    // Nobody begins another file until the end.
    let _live = crate::support::live_files::remove_live();
    // Without the exit handlers of libraries (a driver's, say) whose threads are at work.
    signal_hook::low_level::exit(status)
}
