//! Handling of SIGINT, SIGTERM and SIGHUP.
//!
//! At the first signal a resumable run ends in good order, within `LONGEST_WAIT`. Any other run, and any run at the
//! second signal, ends at once: its unfinished files are removed and the exit status is 128 + the signal's number, as
//! shells expect.

use std::sync::LazyLock;
use std::time::Duration;

use lanesweep_support::cancel::Cancel;

/// Exit status of an interrupted run that resumes when repeated.
pub(super) const EXIT_STATUS: u8 = 75;

/// Maximum wait for a run to end in good order after a signal. The journal written by then is kept; the work on the
/// present chunk, or before the first one, is lost.
pub(crate) const LONGEST_WAIT: Duration = Duration::from_secs(4);

/// The cancellation token of this process: signals and `run.stop_after_s` set it, and runs hold it.
pub static CANCEL: LazyLock<Cancel> = LazyLock::new(Cancel::default);

/// Starts to handle SIGINT, SIGTERM and SIGHUP on a separate thread; a second call does nothing. SIGXFSZ is handled
/// too, so that exceeding a file size limit is an error and does not end the process. A SIGHUP that is ignored at the
/// start (`nohup`) stays ignored. Only Linux reports this; elsewhere the system handles SIGHUP. Without Unix signals
/// the function does nothing, and the system ends the process.
pub fn install() {
    #[cfg(unix)]
    {
        static ONCE: std::sync::Once = std::sync::Once::new();
        ONCE.call_once(|| {
            if let Err(error) = receive() {
                tracing::warn!("signals end the program without tidying up: {error}");
            }
            // At a file size limit (`ulimit -f`) the signal would end the process during a write. If it is handled, the
            // write fails instead, and the error names the file.
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
                end_with(128 + signal);
            }
        }
    };
    std::thread::Builder::new().name("signals".to_owned()).spawn(receiver).map(drop)
}

/// Ends the process if the run has not ended after the wait. If the request was withdrawn, the run continues.
#[cfg(unix)]
fn give_up_after(wait: Duration) {
    let give_up = move || {
        std::thread::sleep(wait);
        if CANCEL.requested() {
            say("the present chunk takes too long and is given up; the same command continues from the last record");
            end_with(EXIT_STATUS.into());
        }
    };
    // Without this thread the run still ends after its chunk, and at once at the second signal.
    let _ = std::thread::Builder::new().name("end".to_owned()).spawn(give_up);
}

/// Whether a signal is ignored, or this is unknown. Bit 0 of the system's mask of ignored signals is signal 1.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| u64::from_str_radix(line.strip_prefix("SigIgn:")?.trim(), 16).ok());
    mask.is_none_or(|mask| mask >> (signal - 1) & 1 == 1)
}

#[cfg(unix)]
fn say(line: &str) {
    use std::io::Write;
    // Ignore a closed stderr: no message can be shown.
    let _ = writeln!(std::io::stderr(), "{line}");
}

#[cfg(unix)]
fn end_with(status: i32) -> ! {
    // While the guard lives, no file can be created.
    let _live = lanesweep_support::atomic_file::remove_live();
    // Skips the exit handlers of libraries (such as drivers) whose threads are running.
    signal_hook::low_level::exit(status)
}
