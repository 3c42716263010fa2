//! The program: everything is in the library's [`lanesweep::cli`], but for what changes the whole process. A program
//! that uses the library keeps its own environment, panic hook and allocator.

use std::process::ExitCode;

use lanesweep::cli::Exit;

#[cfg(unix)]
mod out_of_memory;

/// Stack that the program needs at most, with room to spare.
const STACK_BYTES: usize = 8 << 20;

fn main() -> ExitCode {
    quiet_drivers();
    quiet_caught_panics();
    #[cfg(unix)]
    out_of_memory::is_no_crash();
    if is_stack_large() {
        return lanesweep::cli::main();
    }
    let program = std::thread::Builder::new().name("main".to_owned()).stack_size(STACK_BYTES);
    match program.spawn(lanesweep::cli::main) {
        Ok(program) => program.join().unwrap_or(Exit::Internal.into()),
        Err(refused) => {
            eprintln!(
                "lanesweep: cannot start: {refused}\nraise the limit of memory (ulimit -v) or of threads (ulimit -u)"
            );
            Exit::Io.into()
        }
    }
}

/// Does this thread have the usual stack? A shell may allow less (`ulimit -s`). Its own thread is used where it may: the
/// allocator reserves address space for every other one.
fn is_stack_large() -> bool {
    let limits = std::fs::read_to_string("/proc/self/limits").unwrap_or_default();
    let limit = limits.lines().find_map(|line| line.strip_prefix("Max stack size")?.split_whitespace().next());
    limit.is_some_and(|limit| limit == "unlimited" || limit.parse().is_ok_and(|bytes: usize| bytes >= STACK_BYTES))
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
