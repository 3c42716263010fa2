//! An allocation that the system refuses ends the program with a status and a help, where Rust would end it by SIGABRT.
#![allow(unsafe_code)] // allocators and handlers of signals are

use std::alloc::{GlobalAlloc, Layout, System};
use std::fs::File;
use std::io::Write;
use std::mem::ManuallyDrop;
use std::os::fd::FromRawFd;
use std::sync::atomic::{AtomicBool, Ordering};

use lanesweep::cli::Exit;

const HELP: &str = "lanesweep: the system refused more memory; files under their final names are complete.\n\
                    raise the limit (ulimit -v, or that of the container), or use fewer threads (--threads)\n";

/// The system's allocator, which notes its refusals.
struct Noted;

#[global_allocator]
static ALLOCATOR: Noted = Noted;
static WAS_REFUSED: AtomicBool = AtomicBool::new(false);

fn noted(memory: *mut u8) -> *mut u8 {
    if memory.is_null() {
        WAS_REFUSED.store(true, Ordering::Relaxed);
    }
    memory
}

// SAFETY: every call is the system allocator's, with the caller's arguments.
unsafe impl GlobalAlloc for Noted {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as the caller's.
        noted(unsafe { System.alloc(layout) })
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as the caller's.
        noted(unsafe { System.alloc_zeroed(layout) })
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: as the caller's.
        noted(unsafe { System.realloc(memory, layout, size) })
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: as the caller's.
        unsafe { System.dealloc(memory, layout) }
    }
}

/// From now on SIGABRT after a refused allocation ends the program with [`Exit::Io`]; any other one ends it as before.
pub(crate) fn is_no_crash() {
    let end = || {
        if WAS_REFUSED.load(Ordering::Relaxed) {
            // SAFETY: the descriptor stays open, as the file is not dropped.
            let mut stderr = ManuallyDrop::new(unsafe { File::from_raw_fd(2) });
            let _ = stderr.write_all(HELP.as_bytes());
            signal_hook::low_level::exit(Exit::Io.code().into());
        }
    };
    // SAFETY: `end` loads, writes and exits: each may be done in a handler of signals.
    let _ = unsafe { signal_hook::low_level::register(signal_hook::consts::SIGABRT, end) };
}
