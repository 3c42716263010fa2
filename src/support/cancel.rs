//! Orderly early end of a run: a cancellation token set by its owner, or a time limit; the run polls it between its
//! chunks.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use crate::{Error, Result};

/// Cancellation token: requests the runs that hold a clone to end. A run with a journal first writes its progress to
/// disk; other runs return no result. Both return [`Error::Interrupted`].
#[derive(Debug, Clone, Default)]
pub struct Cancel(Arc<State>);

#[derive(Debug, Default)]
struct State {
    requested: AtomicBool,
    deadline: Mutex<Option<Instant>>,
    resumable: AtomicUsize,
}

/// While it lives, a run with a journal polls the token every few seconds.
#[derive(Debug)]
#[must_use = "the run is no longer resumable as soon as the guard is dropped"]
pub struct ResumableGuard<'a>(&'a Cancel);

impl Cancel {
    /// Whether runs must end after the present chunk; true until [`Cancel::withdraw`].
    pub fn requested(&self) -> bool {
        self.0.requested.load(Ordering::SeqCst) || self.deadline().is_some_and(|deadline| Instant::now() >= deadline)
    }

    /// Ends work that keeps nothing, if its end was requested; a time limit is for runs that resume.
    ///
    /// # Errors
    /// [`Error::Interrupted`].
    pub fn check(&self) -> Result<()> {
        if self.0.requested.load(Ordering::SeqCst) {
            return Err(Error::Interrupted { done: "the data were not read to the end".to_owned(), is_kept: false });
        }
        Ok(())
    }

    /// Requests runs to end after the present chunk. Returns whether that was already requested.
    pub fn request(&self) -> bool {
        self.0.requested.swap(true, Ordering::SeqCst)
    }

    /// Withdraws the request and the time limit.
    pub fn withdraw(&self) {
        self.0.requested.store(false, Ordering::SeqCst);
        self.set_deadline(None);
    }

    /// Makes [`Cancel::requested`] true `seconds` s from now, by the monotonic clock. A later call replaces an earlier
    /// one. Negative values and NaN mean now; values beyond the clock's range mean never.
    pub fn stop_after(&self, seconds: f64) {
        let wait = if seconds > 0.0 { Duration::try_from_secs_f64(seconds).ok() } else { Some(Duration::ZERO) };
        self.set_deadline(wait.and_then(|wait| Instant::now().checked_add(wait)));
    }

    /// Declares that the work can be interrupted and resumed while the guard lives. Guards may overlap.
    pub fn resumable(&self) -> ResumableGuard<'_> {
        self.0.resumable.fetch_add(1, Ordering::SeqCst);
        ResumableGuard(self)
    }

    /// Whether a resumable run polls this token.
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
