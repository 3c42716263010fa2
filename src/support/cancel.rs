//! Ending a run early in good order: a token that its owner sets, or a time limit, and that the run asks between its chunks.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Asks the runs that hold a clone of it to end. A run that keeps a journal brings what it has to the disk first; any
/// other one ends with nothing. Both return [`Error::Interrupted`](crate::Error::Interrupted).
#[derive(Debug, Clone, Default)]
pub struct Cancel(Arc<State>);

#[derive(Debug, Default)]
struct State {
    requested: AtomicBool,
    deadline: Mutex<Option<Instant>>,
    resumable: AtomicUsize,
}

/// While it lives, a run with a journal asks the token often enough (every few seconds).
#[derive(Debug)]
#[must_use = "the run is no longer resumable as soon as the guard is dropped"]
pub struct ResumableGuard<'a>(&'a Cancel);

impl Cancel {
    /// Whether runs are to end after the present chunk. It stays so until [`Cancel::withdraw`].
    pub fn requested(&self) -> bool {
        self.0.requested.load(Ordering::SeqCst) || self.deadline().is_some_and(|deadline| Instant::now() >= deadline)
    }

    /// Asks runs to end after the present chunk. Returns whether that had been asked before.
    pub fn request(&self) -> bool {
        self.0.requested.swap(true, Ordering::SeqCst)
    }

    /// Takes a request and a time limit back.
    pub fn withdraw(&self) {
        self.0.requested.store(false, Ordering::SeqCst);
        self.set_deadline(None);
    }

    /// From `seconds` (s, by the monotonic clock) after now, [`Cancel::requested`] is true. A later call replaces an
    /// earlier one. Negative values and NaN mean now; what is beyond the clock's range means never.
    pub fn stop_after(&self, seconds: f64) {
        let wait = if seconds > 0.0 { Duration::try_from_secs_f64(seconds).ok() } else { Some(Duration::ZERO) };
        self.set_deadline(wait.and_then(|wait| Instant::now().checked_add(wait)));
    }

    /// Declares that the work until the guard's end can be interrupted and continued. Guards may overlap.
    pub fn resumable(&self) -> ResumableGuard<'_> {
        self.0.resumable.fetch_add(1, Ordering::SeqCst);
        ResumableGuard(self)
    }

    /// Whether a run that can be continued asks this token.
    pub fn is_resumable(&self) -> bool {
        self.0.resumable.load(Ordering::SeqCst) > 0
    }

    fn deadline(&self) -> Option<Instant> {
        *self.0.deadline.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn set_deadline(&self, deadline: Option<Instant>) {
        *self.0.deadline.lock().unwrap_or_else(PoisonError::into_inner) = deadline;
    }
}

impl Drop for ResumableGuard<'_> {
    fn drop(&mut self) {
        self.0.0.resumable.fetch_sub(1, Ordering::SeqCst);
    }
}
