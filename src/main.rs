//! The program. [`lanesweep::cli`] does the work; this file only sets what affects the whole process. A program that
//! uses the library keeps its own environment, panic hook and allocator.

#![allow(clippy::disallowed_methods, reason = "the process is the program's")]

use std::process::ExitCode;

use lanesweep::cli::Exit;

#[cfg(unix)]
mod out_of_memory;

/// Stack size that the program needs, with a margin.
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

/// Whether this thread has the usual stack; a shell may allow less (`ulimit -s`). Where it is large enough, the main
/// thread is used, because the allocator reserves address space for every further thread.
fn is_stack_large() -> bool {
    let limits = std::fs::read_to_string("/proc/self/limits").unwrap_or_default();
    let limit = limits.lines().find_map(|line| line.strip_prefix("Max stack size")?.split_whitespace().next());
    limit.is_some_and(|limit| limit == "unlimited" || limit.parse().is_ok_and(|bytes: usize| bytes >= STACK_BYTES))
}

/// Mesa's device-select layer reports a missing `XDG_RUNTIME_DIR` on stderr, which reads like a failure. It also
/// reorders devices, whose order lanesweep defines itself.
#[allow(unsafe_code)] // changing the environment is unsafe where other threads may read it
fn quiet_drivers() {
    if std::env::var_os("NODEVICE_SELECT").is_none() {
        // SAFETY: this runs first, before any other thread exists.
        unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
    }
}

/// Suppresses the panic message where the library turns the panic into an error.
fn quiet_caught_panics() {
    let others = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        if !lanesweep::support::table::is_panic_caught() {
            others(info);
        }
    }));
}
