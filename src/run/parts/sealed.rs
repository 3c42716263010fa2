//! JSON with kind, version and checksum: a file is intact, or refused.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;
use sha2::{Digest, Sha256};

use lanesweep_engine::ENGINE_VERSION;
use lanesweep_support::input_file::open;
use lanesweep_support::plain_text::hex;
use lanesweep_support::{Error, Place, Result};

const VERSION: u64 = 4;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Sealed<'a> {
    /// Kind of the content: `part`, `plan`.
    lanesweep: String,
    version: u64,
    /// [`ENGINE_VERSION`] of the program that wrote it.
    engine: u64,
    /// SHA-256 of kind, version, engine and the content's bytes, in hexadecimal.
    sha256: String,
    #[serde(borrow)]
    content: &'a RawValue,
}

/// A checksum detects damage. It is not a signature: anyone who changes a file can recompute its checksum.
fn checksum(kind: &str, content: &RawValue) -> String {
    let digest = Sha256::new().chain_update(format!("{kind} {VERSION} {ENGINE_VERSION}\n"));
    hex(&digest.chain_update(content.get()).finalize())
}

/// Returns the text of a sealed file, and the hash of its content.
///
/// # Errors
/// None for types of this program.
pub fn seal<T: Serialize>(kind: &str, content: &T) -> Result<(Vec<u8>, String)> {
    let unwritable = |e: serde_json::Error| Error::Internal(format!("a {kind} cannot be written: {e}"));
    let content = serde_json::value::to_raw_value(content).map_err(unwritable)?;
    let sha256 = checksum(kind, &content);
    let (lanesweep, engine) = (kind.to_owned(), ENGINE_VERSION);
    let sealed = Sealed { lanesweep, version: VERSION, engine, sha256, content: &content };
    let mut text = serde_json::to_vec(&sealed).map_err(unwritable)?;
    text.push(b'\n');
    Ok((text, sealed.sha256))
}

/// Returns the content of a sealed text and its checksum. `again` says how to remake such a file.
///
/// # Errors
/// [`Error::Input`] for another kind or version, or a checksum mismatch.
pub fn unseal<T: DeserializeOwned>(kind: &str, text: &[u8], place: &Place, again: &str) -> Result<(T, String)> {
    let wrong = |problem: String| Error::input(place.clone(), problem, again);
    check_begin(kind, text).map_err(wrong)?;
    let sealed: Sealed = serde_json::from_slice(text).map_err(|e| wrong(format!("this is no whole {kind}: {e}")))?;
    if checksum(kind, sealed.content) != sealed.sha256 {
        return Err(wrong("its checksum does not fit: it was changed or damaged".to_owned()));
    }
    let content = serde_json::from_str(sealed.content.get())
        .map_err(|e| wrong(format!("its content is of another version: {e}")))?;
    Ok((content, sealed.sha256))
}

/// Reads a sealed file of at most `max_bytes` bytes. What follows the first line of a file is not read.
///
/// # Errors
/// [`Error::Io`]; as [`unseal`].
pub(crate) fn read_sealed<T: DeserializeOwned>(
    kind: &str,
    path: &Path,
    max_bytes: u64,
    again: &str,
) -> Result<(T, String)> {
    let (content, sha256, mut rest) = read_sealed_line(kind, path, max_bytes, again)?;
    if !rest.fill_buf().map_err(|e| Error::io(path, "read", e))?.is_empty() {
        return Err(Error::input(Place::file(path), format!("this is no whole {kind}: it was added to"), again));
    }
    Ok((content, sha256))
}

/// The header of a sealed file, before its content.
#[derive(Deserialize)]
struct Head {
    lanesweep: String,
    version: u64,
    engine: u64,
}

/// Checks whether a text begins as a sealed file of this kind that this program may use.
pub(super) fn check_begin(kind: &str, text: &[u8]) -> std::result::Result<(), String> {
    match head_of(text) {
        None => Err(format!("this is no {kind} of lanesweep")),
        Some(head) if head.lanesweep != kind => {
            Err(format!("this is a `{}`, where a `{kind}` is needed", head.lanesweep))
        }
        Some(Head { version, .. }) if version != VERSION => {
            Err(format!("its version is {version}, this program reads {VERSION}"))
        }
        Some(Head { engine, .. }) => check_engine(Some(engine)),
    }
}

/// Checks whether lanes were computed by this program's engine.
pub(crate) fn check_engine(engine: Option<u64>) -> std::result::Result<(), String> {
    match engine {
        Some(ENGINE_VERSION) => Ok(()),
        Some(engine) => Err(format!(
            "it is of engine {engine}, this program has engine {ENGINE_VERSION}: their lanes differ, and are never mixed"
        )),
        None => Err("it has no engine number: an earlier version of lanesweep made it".to_owned()),
    }
}

/// Parses the beginning of a sealed file, as [`seal`] writes it.
fn head_of(text: &[u8]) -> Option<Head> {
    let text = String::from_utf8_lossy(&text[..text.len().min(MAX_HEAD)]);
    let (head, _) = text.split_once(",\"sha256\"")?;
    serde_json::from_str(&format!("{head}}}")).ok()
}

/// Maximum number of bytes that hold the kind and versions of a sealed file.
const MAX_HEAD: usize = 256;

/// Reads the first line of a sealed file; further content stays in the reader.
///
/// # Errors
/// [`Error::Io`]; as [`unseal`].
pub fn read_sealed_line<T: DeserializeOwned>(
    kind: &str,
    path: &Path,
    max_bytes: u64,
    again: &str,
) -> Result<(T, String, BufReader<File>)> {
    let mut file = BufReader::new(open(path)?);
    let io = |e| Error::io(path, "read", e);
    let wrong = |problem: String| Error::input(Place::file(path), problem, again);
    check_begin(kind, file.fill_buf().map_err(io)?).map_err(wrong)?;
    let line = json_line(&mut file, max_bytes).map_err(io)?;
    let line = line.ok_or_else(|| {
        wrong(format!("this is no whole {kind}: its first line has no end, or is longer than {max_bytes} bytes"))
    })?;
    let (content, sha256) = unseal(kind, &line, &Place::file(path), again)?;
    Ok((content, sha256, file))
}

/// Reads a line of JSON with its line end; `None` if the file has none within `max_bytes` bytes. JSON has no control
/// characters: reading stops at the first one, so that other files are not held in memory.
pub(super) fn json_line(file: &mut impl BufRead, max_bytes: u64) -> std::io::Result<Option<Vec<u8>>> {
    let mut line = Vec::new();
    loop {
        let piece = file.fill_buf()?;
        let end = piece.iter().position(|byte| byte.is_ascii_control());
        if piece.is_empty() || end.is_some_and(|at| piece[at] != b'\n') || line.len() as u64 > max_bytes {
            return Ok(None);
        }
        let length = end.map_or(piece.len(), |at| at + 1);
        line.extend_from_slice(&piece[..length]);
        file.consume(length);
        if end.is_some() {
            return Ok(Some(line));
        }
    }
}

/// The kind of a sealed file, without reading its content.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] for a file that is not sealed.
pub(crate) fn kind_of(path: &Path) -> Result<String> {
    let mut text = Vec::new();
    let file = open(path)?;
    file.take(MAX_HEAD as u64).read_to_end(&mut text).map_err(|e| Error::io(path, "read", e))?;
    head_of(&text).map(|head| head.lanesweep).ok_or_else(|| {
        let help = "give a file or folder that a run in parts has written";
        Error::input(Place::file(path), "this is no whole file of a run in parts", help)
    })
}
