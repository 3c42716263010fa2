//! JSON with kind, version and checksum around it: whole and unchanged, or refused.

use std::io::Write;
use std::path::Path;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;
use sha2::{Digest, Sha256};

use crate::sweep::hex;
use crate::{Error, Place, Result};

const VERSION: u64 = 1;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Sealed<'a> {
    /// What the content is: `part`, `plan`.
    lanesweep: String,
    version: u64,
    /// SHA-256 of the content's bytes, in hexadecimal.
    sha256: String,
    #[serde(borrow)]
    content: &'a RawValue,
}

/// The text of a sealed file, with its content's hash.
///
/// # Errors
/// None for what this program makes.
pub fn seal<T: Serialize>(kind: &str, content: &T) -> Result<(Vec<u8>, String)> {
    let unwritable = |e: serde_json::Error| unwritable(kind, &e);
    let content = serde_json::value::to_raw_value(content).map_err(unwritable)?;
    let sha256 = hex(&Sha256::digest(content.get()));
    let sealed = Sealed { lanesweep: kind.to_owned(), version: VERSION, sha256, content: &content };
    let mut text = serde_json::to_vec(&sealed).map_err(unwritable)?;
    text.push(b'\n');
    Ok((text, sealed.sha256))
}

/// What a sealed file of this content would be: its size in bytes; `None` above `most_bytes`, which is found out early.
/// No text is kept: for content too large to be held twice.
///
/// # Errors
/// None for what this program makes.
pub fn sealed_size<T: Serialize>(kind: &str, content: &T, most_bytes: u64) -> Result<Option<(u64, ContentSha256)>> {
    let mut measure = Measure { digest: Sha256::new(), bytes: 0, most_bytes };
    match serde_json::to_writer(&mut measure, content) {
        Ok(()) => {
            let sha256 = hex(&measure.digest.finalize());
            let around = head(kind, &sha256)?.len() + TAIL.len();
            let bytes = measure.bytes + around as u64;
            Ok((bytes <= most_bytes).then_some((bytes, ContentSha256(sha256))))
        }
        Err(_) if measure.bytes > most_bytes => Ok(None),
        Err(e) => Err(unwritable(kind, &e)),
    }
}

/// Writes the same bytes as [`seal`] gives, content whose checksum [`sealed_size`] has found.
///
/// # Errors
/// Those of `out`.
pub fn write_sealed<T: Serialize>(
    out: &mut dyn Write,
    kind: &str,
    content: &T,
    sha256: &ContentSha256,
) -> std::io::Result<()> {
    out.write_all(head(kind, &sha256.0).map_err(std::io::Error::other)?.as_bytes())?;
    serde_json::to_writer(&mut *out, content)?;
    out.write_all(TAIL)
}

/// Checksum of a sealed file's content, in hexadecimal.
pub struct ContentSha256(String);

const TAIL: &[u8] = b"}\n";

/// A sealed file up to its content.
fn head(kind: &str, sha256: &str) -> Result<String> {
    let kind = serde_json::to_string(kind).map_err(|e| unwritable(kind, &e))?;
    Ok(format!("{{\"lanesweep\":{kind},\"version\":{VERSION},\"sha256\":\"{sha256}\",\"content\":"))
}

fn unwritable(kind: &str, e: &serde_json::Error) -> Error {
    Error::Internal(format!("a {kind} cannot be written: {e}"))
}

/// Hashes and counts what is written, up to a limit.
struct Measure {
    digest: Sha256,
    bytes: u64,
    most_bytes: u64,
}

impl Write for Measure {
    fn write(&mut self, part: &[u8]) -> std::io::Result<usize> {
        self.digest.update(part);
        self.bytes += part.len() as u64;
        if self.bytes > self.most_bytes { Err(std::io::Error::other("too large")) } else { Ok(part.len()) }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// The content of a sealed text with its checksum. `again` says how such a file is made.
///
/// # Errors
/// [`Error::Input`] for another kind or version, or anything but the bytes that were written.
pub fn unseal<T: DeserializeOwned>(kind: &str, text: &[u8], place: &Place, again: &str) -> Result<(T, String)> {
    let wrong = |problem: String| Error::input(place.clone(), problem, again);
    let sealed: Sealed = serde_json::from_slice(text).map_err(|e| wrong(format!("this is no whole {kind}: {e}")))?;
    if sealed.lanesweep != kind {
        return Err(wrong(format!("this is a `{}`, where a `{kind}` is needed", sealed.lanesweep)));
    }
    if sealed.version != VERSION {
        return Err(wrong(format!("its version is {}, this program reads {VERSION}", sealed.version)));
    }
    if hex(&Sha256::digest(sealed.content.get())) != sealed.sha256 {
        return Err(wrong("its checksum does not fit: it was changed or damaged".to_owned()));
    }
    let content = serde_json::from_str(sealed.content.get())
        .map_err(|e| wrong(format!("its content is of another version: {e}")))?;
    Ok((content, sealed.sha256))
}

/// Reads a sealed file of at most so many bytes.
///
/// # Errors
/// [`Error::Io`]; as [`unseal`].
pub fn read_sealed<T: DeserializeOwned>(kind: &str, path: &Path, most_bytes: u64, again: &str) -> Result<(T, String)> {
    unseal(kind, &crate::input_file::read(path, most_bytes)?, &Place::file(path), again)
}

/// The kind of a sealed file, without reading its content.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] for what is not sealed.
pub fn kind_of(path: &Path, most_bytes: u64) -> Result<String> {
    #[derive(Deserialize)]
    struct Kind {
        lanesweep: String,
    }
    let wrong = |problem: String| {
        Error::input(Place::file(path), problem, "give a file or folder that a run in parts has written")
    };
    let kind: Kind = serde_json::from_slice(&crate::input_file::read(path, most_bytes)?)
        .map_err(|e| wrong(format!("this is no whole file of a run in parts: {e}")))?;
    Ok(kind.lanesweep)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sealed_file_that_is_written_without_being_held_has_the_same_bytes() {
        let content = vec![1.5_f64, 0.1, 3.0];
        let (text, _) = seal("part", &content).unwrap();
        let (bytes, sha256) = sealed_size("part", &content, text.len() as u64).unwrap().unwrap();
        let mut written = Vec::new();
        write_sealed(&mut written, "part", &content, &sha256).unwrap();
        assert_eq!((written, bytes), (text.clone(), text.len() as u64));
        for most in [0, 3, text.len() as u64 - 1] {
            assert!(sealed_size("part", &content, most).unwrap().is_none(), "{most}");
        }
    }

    #[test]
    fn every_changed_byte_and_every_cut_is_noticed() {
        let (text, sha256) = seal("part", &vec![1.5_f64, 0.1, 3.0]).unwrap();
        let place = Place::item("here");
        let read = |text: &[u8]| unseal::<Vec<f64>>("part", text, &place, "make it again");
        assert_eq!(read(&text).unwrap(), (vec![1.5, 0.1, 3.0], sha256));
        for at in 0..text.len() - 1 {
            let mut changed = text.clone();
            changed[at] ^= 1;
            assert!(read(&changed).is_err(), "byte {at}");
            assert!(read(&text[..at]).is_err(), "cut at {at}");
        }
        assert!(unseal::<Vec<f64>>("plan", &text, &place, "").unwrap_err().to_string().contains("a `plan` is needed"));
    }
}
