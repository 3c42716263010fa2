//! Files that are there whole or not at all: written beside their place under a hidden name, brought to
//! the disk, then renamed. Used by everything that leaves results behind.

use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::{Error, Place, Result};

/// A file being written; dropped before [`AtomicFile::stage`], it leaves nothing behind.
pub(crate) struct AtomicFile {
    target: PathBuf,
    writer: BufWriter<NamedTempFile>,
}

/// A complete file that waits under its hidden name; dropped before [`StagedFile::publish`], it leaves
/// nothing behind.
pub(crate) struct StagedFile {
    target: PathBuf,
    file: NamedTempFile,
}

impl AtomicFile {
    /// Begins the file `target`, whose folder must exist. What is there under that name stays until
    /// [`StagedFile::publish`].
    ///
    /// # Errors
    /// If the folder cannot be written to.
    pub(crate) fn create(target: &Path) -> Result<Self> {
        let target = &resolve(target)?;
        let folder = match target.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        };
        let mut builder = tempfile::Builder::new();
        builder.prefix(".lanesweep-").suffix(".part");
        // A temporary file is private by default; a result is as readable as any other new file.
        #[cfg(unix)]
        builder.permissions(match std::fs::metadata(target) {
            Ok(existing) => existing.permissions(),
            Err(_) => std::os::unix::fs::PermissionsExt::from_mode(0o666),
        });
        let file = builder.tempfile_in(folder).map_err(|source| Error::io(target, "write", source))?;
        Ok(AtomicFile { target: target.to_path_buf(), writer: BufWriter::with_capacity(1 << 16, file) })
    }

    /// Appends.
    ///
    /// # Errors
    /// If the system refuses, a full disk for instance.
    pub(crate) fn append(&mut self, bytes: &[u8]) -> Result<()> {
        self.writer.write_all(bytes).map_err(|source| Error::io(&self.target, "write", source))
    }

    /// Brings everything to the disk, still under the hidden name.
    ///
    /// # Errors
    /// If the system refuses.
    pub(crate) fn stage(self) -> Result<StagedFile> {
        let AtomicFile { target, writer } = self;
        let failed = |source| Error::io(&target, "write", source);
        let file = writer.into_inner().map_err(|error| failed(error.into_error()))?;
        file.as_file().sync_all().map_err(failed)?;
        Ok(StagedFile { target, file })
    }
}

/// Where the file really goes: a link is followed; what is neither a file nor free is refused, because the
/// rename would put a file in its place.
fn resolve(target: &Path) -> Result<PathBuf> {
    let Ok(kind) = std::fs::metadata(target) else { return Ok(target.to_path_buf()) };
    if !kind.is_file() {
        let what = if kind.is_dir() { "a folder" } else { "a device or pipe" };
        return Err(Error::usage(
            Place::file(target),
            format!("this is {what}, and a result is written to a file of its own"),
            "give the path of a file",
        ));
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
    /// Gives the file its name, in place of what was there.
    ///
    /// # Errors
    /// If the system refuses.
    pub(crate) fn publish(self) -> Result<()> {
        let StagedFile { target, file } = self;
        file.persist(&target).map(drop).map_err(|error| Error::io(&target, "write", error.error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn a_file_appears_when_it_is_complete_and_an_abandoned_one_never() {
        let dir = tempfile::tempdir().unwrap();
        let target = dir.path().join("result.csv");
        fs::write(&target, "old").unwrap();

        let mut abandoned = AtomicFile::create(&target).unwrap();
        abandoned.append(b"half").unwrap();
        drop(abandoned);
        drop(AtomicFile::create(&target).unwrap().stage().unwrap());
        assert_eq!(fs::read_to_string(&target).unwrap(), "old");

        let mut file = AtomicFile::create(&target).unwrap();
        file.append(b"new").unwrap();
        file.stage().unwrap().publish().unwrap();
        assert_eq!(fs::read_to_string(&target).unwrap(), "new");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1, "nothing else is left in the folder");
    }

    #[cfg(unix)]
    #[test]
    fn a_link_is_followed_and_what_is_no_file_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let (file, link) = (dir.path().join("file"), dir.path().join("link"));
        fs::write(&file, "old").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        let mut written = AtomicFile::create(&link).unwrap();
        written.append(b"new").unwrap();
        written.stage().unwrap().publish().unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().file_type().is_symlink());
        assert_eq!(fs::read_to_string(&file).unwrap(), "new");
        let error = AtomicFile::create(dir.path()).err().unwrap();
        assert!(error.to_string().contains("this is a folder"), "{error}");
    }

    #[test]
    fn a_folder_that_is_not_there_is_named() {
        let error = AtomicFile::create(Path::new("no/such/folder/result.csv")).err().unwrap();
        assert!(error.to_string().contains("result.csv"), "{error}");
    }
}
