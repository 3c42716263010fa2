//! Opening files that a user names: regular files only, and no larger than their kind can be.
//!
//! A pipe without a writer would be waited on for ever, and a device such as `/dev/zero` never ends.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use sha2::{Digest, Sha256};

use crate::{Error, Place, Result};

/// Largest file of settings (configurations, profiles, exposures): those that the program writes have a few kilobytes.
pub(crate) const MAX_SETTINGS_BYTES: u64 = 1 << 20;
/// Largest XML file: an OpenSCENARIO file has a few kilobytes, and some more for every second of a trajectory.
pub(crate) const MAX_XML_BYTES: u64 = 4 << 20;
/// Largest table that is held in memory as a whole: a few million rows.
pub(crate) const MAX_TABLE_BYTES: u64 = 256 << 20;

/// Opens a regular file, or a link to one.
///
/// # Errors
/// [`Error::Io`] if it cannot be opened; [`Error::Input`] for a folder, a pipe, a device or a socket.
pub(crate) fn open(path: &Path) -> Result<File> {
    let io = |e| Error::io(path, "read", e);
    // Before opening: to open a pipe is to wait for its writer.
    let kind = std::fs::metadata(path).map_err(io)?.file_type();
    if kind.is_dir() {
        let problem = "this is a folder; expected a regular file";
        return Err(Error::input(Place::file(path), problem, "give the path of a file"));
    }
    if !kind.is_file() {
        return Err(Error::input(
            Place::file(path),
            "this is a pipe, a device or a socket; expected a regular file",
            "write its content to a file first and name that one",
        ));
    }
    File::open(path).map_err(io)
}

/// The content of a regular file of at most `largest` bytes.
///
/// # Errors
/// As [`open`]; [`Error::Input`] for a larger one.
pub(crate) fn read(path: &Path, largest: u64) -> Result<Vec<u8>> {
    let file = open(path)?;
    let mut content = Vec::new();
    // The size in the folder may lie or change: what counts is what comes.
    file.take(largest + 1).read_to_end(&mut content).map_err(|e| Error::io(path, "read", e))?;
    if content.len() as u64 > largest {
        return Err(Error::input(
            Place::file(path),
            format!("more than {} MiB, larger than any file of this kind", largest >> 20),
            "check that this is the right file",
        ));
    }
    Ok(content)
}

/// As [`read`], of a JSON object. What does not begin and end as one, such as a file that was cut off, is refused by its
/// first and last bytes, whatever its size. `kind` is what it should be: `a density file`.
///
/// # Errors
/// As [`read`]; [`Error::Input`] with `help` for anything but `{…}`.
pub(crate) fn read_json(path: &Path, largest: u64, kind: &str, help: &str) -> Result<Vec<u8>> {
    let (begin, end) = ends(&mut open(path)?).map_err(|e| Error::io(path, "read", e))?;
    if begin.trim_ascii_start().first() != Some(&b'{') || end.trim_ascii_end().last() != Some(&b'}') {
        let problem = format!("not {kind}: it does not begin with {{ and end with }}");
        return Err(Error::input(Place::file(path), problem, help));
    }
    read(path, largest)
}

/// The first and the last bytes of a file, 256 at most; the file is at its beginning then.
pub(crate) fn ends(file: &mut File) -> std::io::Result<(Vec<u8>, Vec<u8>)> {
    const BYTES: u64 = 256;
    let length = file.seek(SeekFrom::End(0))?;
    let piece = |file: &mut File, at: u64| {
        let mut bytes = Vec::new();
        file.seek(SeekFrom::Start(at))?;
        file.by_ref().take(BYTES).read_to_end(&mut bytes)?;
        std::io::Result::Ok(bytes)
    };
    let (end, begin) = (piece(file, length.saturating_sub(BYTES))?, piece(file, 0)?);
    file.rewind()?;
    Ok((begin, end))
}

/// As [`read`], as text.
///
/// # Errors
/// As [`read`]; [`Error::Input`] for what is not UTF-8.
pub(crate) fn read_text(path: &Path, largest: u64) -> Result<String> {
    String::from_utf8(read(path, largest)?).map_err(|e| {
        let at = e.utf8_error().valid_up_to();
        let row = 1 + e.as_bytes()[..at].iter().filter(|&&b| b == b'\n').count() as u64;
        Error::input(Place::file(path).row(row), "not UTF-8 text", "save the file as UTF-8")
    })
}

/// SHA-256 of a regular file of any size, in hexadecimal; a piece at a time is in memory.
///
/// # Errors
/// As [`open`].
pub(crate) fn sha256(path: &Path) -> Result<String> {
    let mut file = open(path)?;
    let mut hash = Sha256::new();
    let mut piece = vec![0; 1 << 16];
    loop {
        match file.read(&mut piece) {
            Ok(0) => return Ok(crate::support::hex::hex(&hash.finalize())),
            Ok(count) => hash.update(&piece[..count]),
            Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
            Err(e) => return Err(Error::io(path, "read", e)),
        }
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_pipe_and_a_device_are_refused_and_not_waited_for() {
        let dir = tempfile::tempdir().unwrap();
        let pipe = dir.path().join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        for path in [pipe.as_path(), Path::new("/dev/zero")] {
            let error = read(path, 10).unwrap_err();
            assert!(error.to_string().contains("expected a regular file"), "{error}");
        }
    }

    #[test]
    fn a_file_that_is_too_large_is_refused_and_a_link_is_followed() {
        let dir = tempfile::tempdir().unwrap();
        let (file, link) = (dir.path().join("file"), dir.path().join("link"));
        std::fs::write(&file, "0123456789").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        assert_eq!(read(&link, 10).unwrap(), b"0123456789");
        assert!(matches!(read(&link, 9), Err(Error::Input { .. })));
        assert!(matches!(read(dir.path(), 9), Err(Error::Input { .. })));
    }

    #[test]
    fn the_checksum_does_not_depend_on_the_pieces() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("file");
        for size in [0, 1, (1 << 16) - 1, 1 << 16, (1 << 17) + 3] {
            let content: Vec<u8> = (0..size).map(|at| (at % 251) as u8).collect();
            std::fs::write(&path, &content).unwrap();
            assert_eq!(sha256(&path).unwrap(), crate::support::hex::hex(&Sha256::digest(&content)), "{size}");
        }
    }
}
