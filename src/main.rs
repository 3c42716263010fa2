//! The program: everything is in the library's [`lanesweep::cli`], but for what changes the whole process. A program
//! that uses the library keeps its own environment and panic hook.

use std::process::ExitCode;

fn main() -> ExitCode {
    quiet_drivers();
    quiet_caught_panics();
    lanesweep::cli::main()
}

/// Mesa's device-select layer complains on stderr of a missing `XDG_RUNTIME_DIR`, as if something had failed, and
/// reorders devices that lanesweep orders itself.
#[allow(unsafe_code)] // changing the environment is unsafe where other threads may read it
fn quiet_drivers() {
    if std::env::var_os("NODEVICE_SELECT").is_none() {
        // SAFETY: the first thing that the program does; there is no other thread.
        unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
    }
}

/// What the library makes an error of is not told as a panic as well.
fn quiet_caught_panics() {
    let others = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        if !lanesweep::support::table::is_panic_caught() {
            others(info);
        }
    }));
}
