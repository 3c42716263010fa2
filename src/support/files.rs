//! Atomic writing of report files.

use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use crate::atomic_file::{AtomicFile, folder_of};
use crate::input_file::claim_output;
use crate::{Error, Place, Result, option};

/// Checks that a folder exists or could be created; it only inspects names, before the work starts.
///
/// # Errors
/// [`Error::Io`] naming the file that blocks the folder.
pub fn check_folder(dir: &Path) -> Result<()> {
    for above in dir.ancestors().filter(|above| !above.as_os_str().is_empty()) {
        match std::fs::metadata(above) {
            Ok(about) if about.is_dir() => return Ok(()),
            Ok(_) => {
                let why =
                    if above == dir { "it is a file".to_owned() } else { format!("{} is a file", above.display()) };
                return Err(Error::io(dir, "create the folder", std::io::Error::new(ErrorKind::NotADirectory, why)));
            }
            Err(e) if matches!(e.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {}
            Err(e) => return Err(Error::io(dir, "create the folder", e)),
        }
    }
    Ok(())
}

/// Removes a file, if there is one.
///
/// # Errors
/// [`Error::Io`].
pub fn remove_file(path: &Path) -> Result<()> {
    match std::fs::remove_file(path) {
        Err(e) if e.kind() != ErrorKind::NotFound => Err(Error::io(path, "remove", e)),
        _ => Ok(()),
    }
}

/// Checks that the folder of a run that is to be read is no file.
///
/// # Errors
/// [`Error::Input`] for a file.
pub fn check_run_folder(dir: &Path) -> Result<()> {
    if dir.is_file() {
        let help = format!("give the folder ({}) that the run was written to", option("out"));
        return Err(Error::input(Place::file(dir), "this is a file; expected the folder of a run", help));
    }
    Ok(())
}

/// Checks before the work that a file can be written and is no input of the command.
///
/// # Errors
/// As [`AtomicFile::create`] and [`check_folder`].
pub fn check_output(file: &Path) -> Result<()> {
    check_folder(folder_of(file))?;
    if folder_of(file).is_dir() { AtomicFile::create(file).map(drop) } else { claim_output(file) }
}

/// Creates a folder and its parents if they do not exist.
///
/// # Errors
/// [`Error::Io`].
pub fn make_folder(dir: &Path) -> Result<()> {
    check_folder(dir)?;
    std::fs::create_dir_all(dir).map_err(|e| Error::io(dir, "create the folder", e))
}

/// The last part of a path; empty if it has none.
pub fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Like [`make_folder`], for the folder of a file.
///
/// # Errors
/// As [`make_folder`].
pub fn make_folder_of(file: &Path) -> Result<()> {
    file.parent().filter(|dir| !dir.as_os_str().is_empty()).map_or(Ok(()), make_folder)
}

/// Writes a file under a temporary name beside it, syncs, and renames: a reader sees the old or the new content, never
/// a part. Its folder is created if needed.
///
/// # Errors
/// [`Error::Io`].
pub fn write_atomically(path: &Path, content: &[u8]) -> Result<()> {
    make_folder_of(path)?;
    let mut file = AtomicFile::create(path)?;
    file.write_all(content).map_err(|e| Error::io(path, "write", e))?;
    file.stage()?.publish()
}

/// Like [`write_atomically`], for content that is streamed to a file in a run directory: a link in its place is refused,
/// not followed.
///
/// # Errors
/// [`Error::Input`] for a link; [`Error::Io`].
pub fn write_inside(path: &Path, produce: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<()> {
    let mut file = AtomicFile::create_inside(path)?;
    produce(&mut file).map_err(|e| Error::io(path, "write", e))?;
    file.stage()?.publish()
}

/// The files of a folder, sorted; hidden ones are left out.
///
/// # Errors
/// [`Error::Io`] if the folder cannot be listed.
pub fn files_of(folder: &Path) -> Result<Vec<PathBuf>> {
    let listed = std::fs::read_dir(folder).map_err(|e| Error::io(folder, "list", e))?;
    let is_hidden = |path: &PathBuf| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
    let mut files: Vec<PathBuf> =
        listed.flatten().map(|entry| entry.path()).filter(|path| !path.is_dir() && !is_hidden(path)).collect();
    files.sort();
    Ok(files)
}
