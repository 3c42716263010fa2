//! One writer per folder or part: an advisory lock on a file. The system releases it when the process ends in any way,
//! so the lock file of a killed process is free and is reused.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{ErrorKind, Read, Seek, Write};
use std::path::{Path, PathBuf};

use crate::atomic_file::{Live, folder_of, is_named, refuse_link};
use crate::{Error, Place, Result, option};

/// Maximum length of a lock file, bytes: a process id and an end of line are shorter.
const MAX_LOCK_BYTES: u64 = 32;
/// Number of times that the file may be another one after it was locked.
const MAX_TRIES: usize = 10_000;

/// Exclusive or shared right to write what a lock file protects; dropping it removes the file and releases the lock.
#[derive(Debug)]
pub struct FolderLock {
    path: PathBuf,
    /// Holds the lock while it is open.
    file: File,
    live: Option<Live>,
}

impl FolderLock {
    /// Takes the lock `path`, whose folder must exist, without waiting.
    ///
    /// # Errors
    /// [`Error::Busy`] if another process holds it, with its process id if readable; [`Error::Io`] if the file cannot
    /// be created or the file system has no locks.
    pub fn acquire(path: &Path) -> Result<FolderLock> {
        FolderLock::take(path, File::try_lock, true)
    }

    /// The same lock, shared: excluded by an exclusive holder, and excludes one.
    ///
    /// # Errors
    /// As [`FolderLock::acquire`].
    pub(crate) fn share(path: &Path) -> Result<FolderLock> {
        FolderLock::take(path, File::try_lock_shared, false)
    }

    fn take(
        path: &Path,
        try_lock: impl Fn(&File) -> std::result::Result<(), TryLockError>,
        is_alone: bool,
    ) -> Result<FolderLock> {
        for _ in 0..MAX_TRIES {
            let Some(mut file) = open(path)? else { continue };
            match try_lock(&file) {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => return Err(held(path, &mut file)),
                Err(TryLockError::Error(source)) => return Err(Error::io(path, "lock", source)),
            }
            // The former holder removes its file before it releases the lock. If the name vanished between opening and
            // locking, the lock would exclude nobody.
            if !is_named(path, &file) {
                continue;
            }
            refuse_foreign(path, &mut file)?;
            // A shared lock has several holders, so no process id is written.
            if is_alone { write_pid(&mut file) } else { file.set_len(0) }
                .map_err(|source| Error::io(path, "write", source))?;
            // Shared, it may be another's too: a signal leaves it.
            let live = is_alone.then(|| Live::enter(path.to_path_buf()));
            return Ok(FolderLock { path: path.to_path_buf(), file, live });
        }
        let why = format!("the folder {} vanished, or its system keeps no files", folder_of(path).display());
        Err(Error::io(path, "lock", std::io::Error::other(why)))
    }
}

impl Drop for FolderLock {
    fn drop(&mut self) {
        self.live = None;
        // Remove the file only while the lock is held exclusively, so that the name cannot belong to another holder,
        // unless the folder was removed and created anew. A remaining file is harmless.
        let is_alone = self.file.unlock().is_ok() && self.file.try_lock().is_ok();
        if is_alone && is_named(&self.path, &self.file) {
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// Opens or creates the lock file, never through a link; `None` if it was removed meanwhile.
fn open(path: &Path) -> Result<Option<File>> {
    let options = || OpenOptions::new().read(true).write(true).clone();
    let result = match options().create_new(true).open(path) {
        Err(error) if error.kind() == ErrorKind::AlreadyExists => {
            refuse_link(path)?;
            options().open(path)
        }
        result => result,
    };
    match result {
        Ok(file) => Ok(Some(file)),
        // The file, or its folder, vanished between the two calls.
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(Error::io(path, "lock", error)),
    }
}

/// Refuses a file that is not a lock, because it would lose its content. A lock file holds a process id or nothing.
fn refuse_foreign(path: &Path, file: &mut File) -> Result<()> {
    let mut text = Vec::new();
    file.take(MAX_LOCK_BYTES + 1).read_to_end(&mut text).map_err(|source| Error::io(path, "read", source))?;
    if text.len() as u64 > MAX_LOCK_BYTES || !text.trim_ascii().iter().all(u8::is_ascii_digit) {
        let problem = "it would be overwritten, and it is no lock file of lanesweep";
        let help = format!("move it away, or give another {}", option("out"));
        return Err(Error::usage(Place::file(path), problem, help));
    }
    Ok(())
}

/// Writes the process id for the message of other processes.
fn write_pid(file: &mut File) -> std::io::Result<()> {
    file.set_len(0)?;
    file.rewind()?;
    writeln!(file, "{}", std::process::id())
}

fn held(path: &Path, file: &mut File) -> Error {
    let mut text = String::new();
    // Where locks are mandatory, the holder's file cannot be read and the message has no process id.
    let pid = file.take(MAX_LOCK_BYTES).read_to_string(&mut text).ok().and_then(|_| text.trim().parse::<u32>().ok());
    let who = pid.map_or(String::new(), |pid| format!(" (pid {pid})"));
    Error::Busy {
        place: Box::new(Place::file(path)),
        problem: format!("another lanesweep process is writing this part or run{who}"),
    }
}
