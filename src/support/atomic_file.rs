//! Atomic files: written beside their target under a hidden name, synced to disk, then renamed. Used for all results.
//!
//! A registry lists what a process removes when a signal ends it: unfinished files, its lock, and an empty folder that
//! it created.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::{NamedTempFile, TempPath};

use crate::input_file::claim_output;
use crate::{Error, Place, Result};

/// Hidden names are `.lanesweep-<file name>-XXXXXX.part`.
const PREFIX: &str = ".lanesweep-";
const SUFFIX: &str = ".part";
/// Number of random letters and digits in a hidden name.
const RANDOM: usize = 6;
/// Maximum number of bytes of the file name that a hidden name repeats: file systems limit a name to 255 bytes.
const LONGEST: usize = 200;

/// The folder that a file is in.
pub fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|dir| !dir.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Removes from `dir` the hidden files of killed processes, of one target or of all. A process locks the hidden files
/// that it writes, and the lock ends with the process. Files that cannot be removed are harmless and stay.
pub(super) fn clear_stale(dir: &Path, target: Option<&Path>) {
    let Ok(entries) = std::fs::read_dir(dir) else { return };
    let wanted = target.map(|target| target.file_name().and_then(|name| name.to_str()));
    for entry in entries.flatten() {
        let (name, path) = (entry.file_name(), entry.path());
        let found = name.to_str().and_then(target_of);
        let is_wanted = found.is_some() && wanted.is_none_or(|wanted| wanted == found);
        if !is_wanted || !entry.file_type().is_ok_and(|kind| kind.is_file()) {
            continue;
        }
        // Check the registry too: a staged file of this process may have released its lock.
        if live().iter().any(|path| path.file_name() == Some(&name)) {
            continue;
        }
        let Ok(file) = OpenOptions::new().read(true).write(true).open(&path) else { continue };
        if file.try_lock().is_ok() && is_named(&path, &file) {
            match std::fs::remove_file(&path) {
                Ok(()) => tracing::debug!("removed {}, left by a process that was killed", path.display()),
                Err(error) => tracing::debug!("{} stays: {error}", path.display()),
            }
        }
    }
}

/// Whether `path` itself, not the target of a link, is the file open as `file`.
#[cfg(unix)]
pub fn is_named(path: &Path, file: &File) -> bool {
    use std::os::unix::fs::MetadataExt;
    match (std::fs::symlink_metadata(path), file.metadata()) {
        (Ok(named), Ok(open)) => (named.dev(), named.ino()) == (open.dev(), open.ino()),
        _ => false,
    }
}

/// On other systems std cannot compare the files; there the name of an open file stays in use until it is closed.
#[cfg(not(unix))]
pub(crate) fn is_named(_: &Path, _: &File) -> bool {
    true
}

/// Refuses a link, a folder or a device where a run writes its own file, so that a prepared folder cannot redirect the
/// run's output.
///
/// # Errors
/// [`Error::Input`].
pub fn refuse_link(path: &Path) -> Result<()> {
    let what = match std::fs::symlink_metadata(path) {
        Ok(about) if about.is_symlink() => "a link",
        Ok(about) if about.is_dir() => "a folder",
        Ok(about) if !about.is_file() => "a device or pipe",
        _ => return Ok(()),
    };
    let problem = format!("this is {what}; a run writes only to files of its own in its folder");
    Err(Error::input(Place::file(path), problem, "remove it, or choose another folder"))
}

/// The target's file name within a hidden name.
fn target_of(hidden: &str) -> Option<&str> {
    let (target, random) = hidden.strip_prefix(PREFIX)?.strip_suffix(SUFFIX)?.rsplit_once('-')?;
    (!target.is_empty() && random.len() == RANDOM && random.bytes().all(|b| b.is_ascii_alphanumeric()))
        .then_some(target)
}

/// The prefix of a hidden name.
fn prefix(target: &Path) -> OsString {
    let mut prefix = OsString::from(PREFIX);
    if let Some(name) = target.file_name().filter(|name| name.len() <= LONGEST) {
        prefix.push(name);
        prefix.push("-");
    }
    prefix
}

/// The error for a failure to write. The system's "no such file" names neither file nor folder: the result's name is new, and
/// the user does not know the hidden one.
fn failed(target: &Path, source: std::io::Error) -> Error {
    if source.kind() != ErrorKind::NotFound {
        return Error::io(target, "write", source);
    }
    let folder = folder_of(target);
    let why = match folder.is_dir() {
        true => "the unfinished file was removed while it was written, by another program".to_owned(),
        false => format!("there is no folder {}", folder.display()),
    };
    Error::io(target, "write", std::io::Error::new(ErrorKind::NotFound, why))
}

/// Makes a rename in `folder` survive a power loss, if the system supports it.
pub(super) fn sync_folder(folder: &Path) {
    #[cfg(unix)]
    if let Ok(folder) = std::fs::File::open(folder) {
        // Some file systems refuse to sync folders; the file's content is already on disk.
        let _ = folder.sync_all();
    }
    #[cfg(not(unix))]
    let _ = folder;
}

/// A file being written; dropping it before [`AtomicFile::stage`] removes it.
pub struct AtomicFile {
    target: PathBuf,
    writer: BufWriter<NamedTempFile>,
    // Declared after the file, so that the registry entry outlives it.
    live: Live,
}

/// A complete file under its hidden name; dropping it before [`StagedFile::publish`] removes it.
pub struct StagedFile {
    /// The final path.
    pub(super) target: PathBuf,
    /// The hidden one.
    pub(super) path: TempPath,
    /// Kept open for its lock.
    file: Option<File>,
    live: Live,
}

impl AtomicFile {
    /// Creates the file `target` that a user named, whose folder must exist; a link is followed. An existing file of
    /// that name stays until [`StagedFile::publish`]. Hidden files of killed processes for the same target are removed.
    ///
    /// # Errors
    /// If the folder cannot be written to; [`Error::Usage`] for an input of the command.
    pub fn create(target: &Path) -> Result<Self> {
        claim_output(target)?;
        let target = &resolve(target)?;
        clear_stale(folder_of(target), Some(target));
        AtomicFile::begin(target)
    }

    /// Like [`AtomicFile::create`], for a file in a run directory, where links are not followed.
    ///
    /// # Errors
    /// As [`refuse_link`]; if the folder cannot be written to.
    pub fn create_inside(target: &Path) -> Result<Self> {
        refuse_link(target)?;
        AtomicFile::begin(target)
    }

    fn begin(target: &Path) -> Result<Self> {
        let prefix = prefix(target);
        let mut builder = tempfile::Builder::new();
        builder.prefix(&prefix).suffix(SUFFIX).rand_bytes(RANDOM);
        // Temporary files are private by default; a result gets the permissions of any new file.
        #[cfg(unix)]
        builder.permissions(match std::fs::metadata(target) {
            Ok(existing) => existing.permissions(),
            Err(_) => std::os::unix::fs::PermissionsExt::from_mode(0o666),
        });
        // Hold the registry until the file is in it; an interruption in between would leave the file behind.
        let mut registry = live();
        let mut tries = 0;
        let file = loop {
            let file = builder.tempfile_in(folder_of(target)).map_err(|source| failed(target, source))?;
            // Another process may hold the lock while it checks for stale files. A file system without locks keeps
            // stale files.
            match file.as_file().try_lock() {
                Ok(()) if is_named(file.path(), file.as_file()) => break file,
                Err(TryLockError::Error(_)) => break file,
                _ if tries == 1000 => break file,
                _ => tries += 1,
            }
        };
        registry.insert(file.path().to_path_buf());
        drop(registry);
        let live = Live(file.path().to_path_buf());
        Ok(AtomicFile { target: target.to_path_buf(), writer: BufWriter::with_capacity(1 << 16, file), live })
    }

    /// Appends bytes.
    ///
    /// # Errors
    /// If the system refuses, for instance because the disk is full.
    pub fn append(&mut self, bytes: &[u8]) -> Result<()> {
        self.writer.write_all(bytes).map_err(|source| failed(&self.target, source))
    }

    /// Syncs the file to disk under its hidden name.
    ///
    /// # Errors
    /// If the system refuses.
    pub fn stage(self) -> Result<StagedFile> {
        let AtomicFile { target, writer, live } = self;
        let failed = |source| failed(&target, source);
        let file = writer.into_inner().map_err(|error| failed(error.into_error()))?;
        file.as_file().sync_all().map_err(failed)?;
        let (file, path) = file.into_parts();
        Ok(StagedFile { target, path, file: Some(file), live })
    }
}

/// The actual target: a link is followed. A target that exists and is not a file is refused, because the rename would
/// replace it.
fn resolve(target: &Path) -> Result<PathBuf> {
    let Ok(kind) = std::fs::metadata(target) else { return Ok(target.to_path_buf()) };
    if !kind.is_file() {
        let what = if kind.is_dir() { "a folder" } else { "a device or pipe" };
        let problem = format!("this is {what}, and a result is written to a file of its own");
        return Err(Error::usage(Place::file(target), problem, "give the path of a file"));
    }
    std::fs::canonicalize(target).map_err(|source| Error::io(target, "write", source))
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.writer.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.writer.flush()
    }
}

impl StagedFile {
    /// Renames the file to its target and replaces an existing one.
    ///
    /// # Errors
    /// If the system refuses.
    pub fn publish(self) -> Result<()> {
        let folder = folder_of(&self.target).to_path_buf();
        self.place()?;
        sync_folder(&folder);
        Ok(())
    }

    /// Like [`StagedFile::publish`], for one of several files whose folder is synced after the last.
    ///
    /// # Errors
    /// If the system refuses.
    pub(crate) fn place(self) -> Result<()> {
        let StagedFile { target, path, file, live } = self;
        path.persist(&target).map_err(|error| failed(&target, error.error))?;
        drop((file, live));
        Ok(())
    }

    /// Closes the file, for a caller that holds a lock on its folder; the number of open files per process is limited.
    pub(crate) fn closed(mut self) -> Self {
        self.file = None;
        self
    }
}

/// Existing hidden files of this process, and the folders and locks registered with them.
static LIVE: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn live() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    LIVE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// An entry in the registry of hidden files; dropping it removes the entry.
#[derive(Debug)]
pub(super) struct Live(PathBuf);

impl Live {
    /// Registers a lock file, or a folder to be removed if it is empty.
    pub(super) fn enter(path: PathBuf) -> Live {
        live().insert(path.clone());
        Live(path)
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        live().remove(&self.0);
    }
}

/// Removes the hidden files of this process, which is about to end. While the returned guard lives, no file can be
/// created.
#[cfg(unix)]
pub fn remove_live() -> Option<MutexGuard<'static, BTreeSet<PathBuf>>> {
    // A file system that hangs while creating a file must not prevent the process from ending.
    for _ in 0..100 {
        let paths = match LIVE.try_lock() {
            Ok(paths) => paths,
            Err(std::sync::TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(std::sync::TryLockError::WouldBlock) => {
                std::thread::sleep(std::time::Duration::from_millis(10));
                continue;
            }
        };
        // The content of a folder precedes the folder. A file that was just renamed no longer exists under its hidden
        // name.
        for path in paths.iter().rev() {
            let _ = std::fs::remove_file(path).or_else(|_| std::fs::remove_dir(path));
        }
        return Some(paths);
    }
    None
}
