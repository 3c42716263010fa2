//! What a process takes away when a signal ends it: the files that it has not finished, its lock, and a folder that it
//! made and put nothing into.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// The hidden files of this process that exist now, and the folders and locks that go with them.
static LIVE: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

pub(super) fn live() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    LIVE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// An entry in the registry of hidden files, for as long as the file has that name.
#[derive(Debug)]
pub(crate) struct Live(pub(super) PathBuf);

impl Live {
    /// Enters a lock file, or a folder that goes where nothing is in it.
    pub(crate) fn enter(path: PathBuf) -> Live {
        live().insert(path.clone());
        Live(path)
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        live().remove(&self.0);
    }
}

/// Removes the hidden files of this process, which is about to end. While the answer is kept, no other begins.
#[cfg(unix)]
pub(crate) fn remove_live() -> Option<MutexGuard<'static, BTreeSet<PathBuf>>> {
    // A file system that hangs while a file is begun there must not keep the process from ending.
    for _ in 0..100 {
        let paths = match LIVE.try_lock() {
            Ok(paths) => paths,
            Err(std::sync::TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(std::sync::TryLockError::WouldBlock) => {
                std::thread::sleep(std::time::Duration::from_millis(10));
                continue;
            }
        };
        // What is in a folder goes before the folder. A file that has just got its proper name is not there any more.
        for path in paths.iter().rev() {
            let _ = std::fs::remove_file(path).or_else(|_| std::fs::remove_dir(path));
        }
        return Some(paths);
    }
    None
}
