//! What no input may ask for, with an allocator that counts the live bytes of the thread it is asked from.

#![allow(clippy::disallowed_methods, reason = "panics are caught, and a hang ends the process")]
#![allow(unsafe_code)] // SAFETY: a counting shell around the system's allocator; every call is passed on unchanged.

mod mutated_inputs;
#[cfg(feature = "parquet")]
mod table_memory;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::io::Write;

/// Most that one input may hold at once, bytes.
const MAX_BYTES: isize = 1 << 30;

/// The input that a thread works on outside of any.
const NO_INPUT: u64 = u64::MAX;

thread_local! {
    static LIVE: Cell<isize> = const { Cell::new(0) };
    static PEAK: Cell<isize> = const { Cell::new(0) };
    static INPUT: Cell<u64> = const { Cell::new(NO_INPUT) };
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

struct Counting;

impl Counting {
    /// Counts a change; false where the input has asked for too much.
    fn count(change: isize) -> bool {
        let live = LIVE.get() + change;
        if change > 0 && live > MAX_BYTES && INPUT.get() != NO_INPUT {
            let mut text = [0_u8; 128];
            let (input, mib) = (INPUT.get(), live >> 20);
            let _ = writeln!(&mut text[..], "input {input} asks for {mib} MiB: refused, so this process ends");
            let _ = std::io::stderr().write_all(&text);
            return false;
        }
        LIVE.set(live);
        PEAK.set(PEAK.get().max(live));
        true
    }
}

// SAFETY: memory comes from and goes to `System` with the layouts given; a null pointer is the contract's refusal.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if !Counting::count(layout.size() as isize) {
            return std::ptr::null_mut();
        }
        // SAFETY: the caller's promises are passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        if !Counting::count(layout.size() as isize) {
            return std::ptr::null_mut();
        }
        // SAFETY: the caller's promises are passed on.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        Counting::count(-(layout.size() as isize));
        // SAFETY: the caller's promises are passed on.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        if !Counting::count(size as isize - layout.size() as isize) {
            return std::ptr::null_mut();
        }
        // SAFETY: the caller's promises are passed on.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

pub fn begin(input: u64) {
    INPUT.set(input);
    LIVE.set(0);
    PEAK.set(0);
}

pub fn is_counting() -> bool {
    INPUT.get() != NO_INPUT
}

/// Ends it: the largest number of bytes held at once.
pub fn end() -> u64 {
    INPUT.set(NO_INPUT);
    PEAK.get().max(0) as u64
}
