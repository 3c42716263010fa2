//! JSON with kind, version and checksum: a file is intact, or refused.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;
use sha2::{Digest, Sha256};

use lanesweep_engine::ENGINE_VERSION;
use lanesweep_support::input_file::{ends, open, read};
use lanesweep_support::plain_text::hex;
use lanesweep_support::{Error, Place, Result};

const VERSION: u64 = 3;

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
    let unwritable = |e: serde_json::Error| unwritable(kind, &e);
    let content = serde_json::value::to_raw_value(content).map_err(unwritable)?;
    let sha256 = checksum(kind, &content);
    let (lanesweep, engine) = (kind.to_owned(), ENGINE_VERSION);
    let sealed = Sealed { lanesweep, version: VERSION, engine, sha256, content: &content };
    let mut text = serde_json::to_vec(&sealed).map_err(unwritable)?;
    text.push(b'\n');
    Ok((text, sealed.sha256))
}

fn unwritable(kind: &str, e: &serde_json::Error) -> Error {
    Error::Internal(format!("a {kind} cannot be written: {e}"))
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

/// Reads a sealed file of at most `max_bytes` bytes. Its first and last bytes are checked before all is read, to detect
/// other and truncated files.
///
/// # Errors
/// [`Error::Io`]; as [`unseal`].
pub(crate) fn read_sealed<T: DeserializeOwned>(
    kind: &str,
    path: &Path,
    max_bytes: u64,
    again: &str,
) -> Result<(T, String)> {
    let (begin, end) = ends(&mut open(path)?).map_err(|e| Error::io(path, "read", e))?;
    let wrong = |problem: String| Error::input(Place::file(path), problem, again);
    check_begin(kind, &begin).map_err(wrong)?;
    if !end.ends_with(b"}\n") {
        return Err(wrong(format!("this is no whole {kind}: it was cut off or added to")));
    }
    unseal(kind, &read(path, max_bytes)?, &Place::file(path), again)
}

/// The header of a sealed file, before its content.
struct Head {
    kind: String,
    version: u64,
    /// `None` before version 2.
    engine: Option<u64>,
}

impl Head {
    /// Checks whether this program may use the file.
    fn check(&self) -> std::result::Result<(), String> {
        if self.version != VERSION {
            return Err(format!("its version is {}, this program reads {VERSION}", self.version));
        }
        match self.engine {
            Some(ENGINE_VERSION) => Ok(()),
            Some(engine) => Err(format!(
                "it is of engine {engine}, this program has engine {ENGINE_VERSION}: their lanes differ, and are never \
                 mixed"
            )),
            None => Err("it does not tell its engine".to_owned()),
        }
    }
}

/// Checks whether a text begins as a sealed file of this kind that this program may use.
fn check_begin(kind: &str, text: &[u8]) -> std::result::Result<(), String> {
    match head_of(text) {
        None => Err(format!("this is no whole {kind}")),
        Some(head) if head.kind != kind => Err(format!("this is a `{}`, where a `{kind}` is needed", head.kind)),
        Some(head) => head.check(),
    }
}

/// Parses the beginning of a sealed file, as [`seal`] writes it.
fn head_of(text: &[u8]) -> Option<Head> {
    fn number<'a>(rest: &'a str, before: &str) -> Option<(u64, &'a str)> {
        let rest = rest.strip_prefix(before)?;
        let digits = rest.find(|c: char| !c.is_ascii_digit())?;
        Some((rest[..digits].parse().ok()?, &rest[digits..]))
    }
    let text = String::from_utf8_lossy(&text[..text.len().min(MAX_HEAD)]);
    let (kind, rest) = text.strip_prefix("{\"lanesweep\":\"")?.split_once('"')?;
    let (version, rest) = number(rest, ",\"version\":")?;
    let engine = number(rest, ",\"engine\":").map(|(engine, _)| engine);
    Some(Head { kind: kind.to_owned(), version, engine })
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
    let line = line.ok_or_else(|| wrong(format!("this is no whole {kind}: its first line has no end")))?;
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
    head_of(&text).map(|head| head.kind).ok_or_else(|| {
        let help = "give a file or folder that a run in parts has written";
        Error::input(Place::file(path), "this is no whole file of a run in parts", help)
    })
}
