//! Opens files that a user names: regular files only, up to the maximum size of their kind.
//!
//! Opening a pipe without a writer would block forever, and a device such as `/dev/zero` never ends. All TOML settings
//! use one reader, so that every error names its line. Texts of other programs may be compressed or in UTF-16.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{File, Metadata};
use std::io::{BufReader, Cursor, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use flate2::read::MultiGzDecoder;
use serde::de::DeserializeOwned;
use sha2::{Digest, Sha256};

use crate::atomic_file::folder_of;
use crate::plain_text::{cut_names, hex, nearest};
use crate::{Error, Place, Result};

/// Maximum size of a settings file (configurations, profiles, exposures), bytes; those that the program writes have a
/// few kilobytes.
pub const MAX_SETTINGS_BYTES: u64 = 1 << 20;
/// Maximum size of a table that is held in memory, bytes: a few million rows.
pub const MAX_TABLE_BYTES: u64 = 256 << 20;

/// Size and time of a file's last change.
type State = (u64, String);

fn state(about: &Metadata) -> State {
    (about.len(), format!("{:?}", about.modified().ok()))
}

/// What the command in progress has read, as it was then, and what it writes.
#[derive(Default)]
struct InUse {
    read: BTreeMap<PathBuf, State>,
    written: BTreeSet<PathBuf>,
}

static IN_USE: Mutex<Option<InUse>> = Mutex::new(None);

fn in_use() -> MutexGuard<'static, Option<InUse>> {
    IN_USE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Runs a command; meanwhile no file is an input and an output.
pub fn guarded<T>(command: impl FnOnce() -> T) -> T {
    *in_use() = Some(InUse::default());
    let result = command();
    *in_use() = None;
    result
}

/// The canonical path of a file, however it is written.
pub fn canonical(path: &Path) -> PathBuf {
    // If the file does not exist yet, its folder is resolved.
    let of_folder = || Some(folder_of(path).canonicalize().ok()?.join(path.file_name()?));
    path.canonicalize().ok().or_else(of_folder).unwrap_or_else(|| path.to_path_buf())
}

fn both(path: &Path) -> Error {
    let problem = "it would be overwritten: this run reads and writes it";
    Error::usage(Place::file(path), problem, "choose another path for the output")
}

/// Refuses an output that the command has read, and an input that it is going to write.
///
/// # Errors
/// [`Error::Usage`].
pub(super) fn claim_output(path: &Path) -> Result<()> {
    let (mut used, file) = (in_use(), canonical(path));
    let Some(used) = used.as_mut() else { return Ok(()) };
    used.written.insert(file.clone());
    if used.read.contains_key(&file) { Err(both(path)) } else { Ok(()) }
}

/// Opens a regular file, or a link to one, as an input of the command.
///
/// # Errors
/// [`Error::Io`] if it cannot be opened; [`Error::Input`] for a folder, a pipe, a device or a socket; [`Error::Usage`]
/// for an output of the command.
pub fn open(path: &Path) -> Result<File> {
    let opened = open_own(path)?;
    let about = opened.metadata().map_err(|e| Error::io(path, "read", e))?;
    let (mut used, file) = (in_use(), canonical(path));
    let Some(used) = used.as_mut() else { return Ok(opened) };
    let is_output = used.written.contains(&file);
    used.read.entry(file).or_insert_with(|| state(&about));
    if is_output { Err(both(path)) } else { Ok(opened) }
}

/// Refuses a file that was changed since the command opened it: what was read may be of two states.
///
/// # Errors
/// [`Error::Input`]; [`Error::Io`].
pub fn unchanged(path: &Path) -> Result<()> {
    let now = state(&std::fs::metadata(path).map_err(|e| Error::io(path, "read", e))?);
    match in_use().as_ref().and_then(|used| used.read.get(&canonical(path))) {
        Some(then) if *then != now => {
            let problem = "it was changed while it was read";
            Err(Error::input(Place::file(path), problem, "run again when the other program has saved it"))
        }
        _ => Ok(()),
    }
}

fn open_own(path: &Path) -> Result<File> {
    let io = |e| Error::io(path, "read", e);
    // Check before opening, because opening a pipe blocks until it has a writer.
    let kind = std::fs::metadata(path).map_err(io)?.file_type();
    if kind.is_dir() {
        let problem = "this is a folder; expected a regular file";
        return Err(Error::input(Place::file(path), problem, "give the path of a file"));
    }
    if !kind.is_file() {
        let problem = "this is a pipe, a device or a socket; expected a regular file";
        return Err(Error::input(Place::file(path), problem, "write its content to a file first and name that one"));
    }
    File::open(path).map_err(io)
}

/// Opens a text file as UTF-8, piece by piece: unpacked if gzip compressed it, converted if it begins with the mark of
/// UTF-16.
///
/// # Errors
/// As [`open`]; [`Error::Input`] for another file with gzip's ending.
pub fn open_text(path: &Path) -> Result<Box<dyn Read + Send>> {
    let io = |e| Error::io(path, "read", e);
    let begin = |reader: &mut dyn Read| -> std::io::Result<Vec<u8>> {
        let mut begin = Vec::new();
        reader.take(2).read_to_end(&mut begin)?;
        Ok(begin)
    };
    let mut file = open(path)?;
    let is_packed = begin(&mut file).map_err(io)? == [0x1f, 0x8b];
    let name = path.to_string_lossy();
    if !is_packed && unpacked(&name) != name {
        let problem = "its name ends in .gz, but gzip did not compress it";
        return Err(Error::input(Place::file(path), problem, "copy it again, or rename it"));
    }
    file.rewind().map_err(io)?;
    let mut reader: Box<dyn Read + Send> = Box::new(file);
    if is_packed {
        reader = Box::new(MultiGzDecoder::new(BufReader::with_capacity(1 << 16, reader)));
    }
    let mark = begin(&mut reader).map_err(io)?;
    let unit = match mark[..] {
        [0xff, 0xfe] => u16::from_le_bytes,
        [0xfe, 0xff] => u16::from_be_bytes,
        _ => return Ok(Box::new(Cursor::new(mark).chain(reader))),
    };
    Ok(Box::new(Utf16 { inner: reader, unit, rest: Vec::new(), ready: Cursor::default() }))
}

/// The name of a file that gzip compressed, without its ending; other names as they are.
pub fn unpacked(name: &str) -> &str {
    name.strip_suffix(".gz").or_else(|| name.strip_suffix(".GZ")).unwrap_or(name)
}

/// The path without gzip's ending.
pub fn plain_name(path: &Path) -> PathBuf {
    let is_packed = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("gz"));
    if is_packed { path.with_extension("") } else { path.to_path_buf() }
}

/// The file, or the one that gzip compressed in its place.
pub fn packed_or_not(file: PathBuf) -> PathBuf {
    let packed = file.with_added_extension("gz");
    if !file.exists() && packed.exists() { packed } else { file }
}

/// Whether [`open_text`] gives the bytes of the file as they are.
///
/// # Errors
/// As [`open`].
pub fn is_plain(path: &Path) -> Result<bool> {
    let (begin, _) = ends(&mut open(path)?).map_err(|e| Error::io(path, "read", e))?;
    Ok(![[0x1f, 0x8b], [0xff, 0xfe], [0xfe, 0xff]].iter().any(|mark| begin.starts_with(mark)))
}

/// Text in UTF-16 as UTF-8.
struct Utf16<R> {
    inner: R,
    unit: fn([u8; 2]) -> u16,
    /// Bytes of a character that goes on in the next piece.
    rest: Vec<u8>,
    ready: Cursor<Vec<u8>>,
}

impl<R: Read> Read for Utf16<R> {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        const PIECE: u64 = 1 << 16;
        while self.ready.position() == self.ready.get_ref().len() as u64 {
            let is_end = self.inner.by_ref().take(PIECE).read_to_end(&mut self.rest)? == 0;
            if is_end && self.rest.is_empty() {
                return Ok(0);
            }
            let mut units: Vec<u16> = self.rest.as_chunks::<2>().0.iter().map(|pair| (self.unit)(*pair)).collect();
            if !is_end && units.last().is_some_and(|unit| (0xd800..0xdc00).contains(unit)) {
                units.pop();
            }
            self.rest.drain(..2 * units.len());
            let mut text = String::from_utf16_lossy(&units);
            if is_end && !std::mem::take(&mut self.rest).is_empty() {
                text.push(char::REPLACEMENT_CHARACTER);
            }
            self.ready = Cursor::new(text.into_bytes());
        }
        self.ready.read(bytes)
    }
}

/// The content of a regular file of at most `largest` bytes.
///
/// # Errors
/// As [`open`]; [`Error::Input`] for a larger file.
pub fn read(path: &Path, largest: u64) -> Result<Vec<u8>> {
    let mut content = Vec::new();
    // The reported size may be wrong or change, so the bytes read are limited.
    open(path)?.take(largest + 1).read_to_end(&mut content).map_err(|e| Error::io(path, "read", e))?;
    if content.len() as u64 > largest {
        let problem = format!("more than {} MiB, larger than any file of this kind", largest >> 20);
        return Err(Error::input(Place::file(path), problem, "check that this is the right file"));
    }
    Ok(content)
}

/// Like [`read`], for a JSON object. A file that does not begin and end as one, such as a truncated file, is refused by
/// its first and last bytes before it is read. `kind` names the expected file: `a density file`.
///
/// # Errors
/// As [`read`]; [`Error::Input`] with `help` for anything but `{…}`.
pub fn read_json(path: &Path, largest: u64, kind: &str, help: &str) -> Result<Vec<u8>> {
    let (begin, end) = ends(&mut open(path)?).map_err(|e| Error::io(path, "read", e))?;
    if begin.trim_ascii_start().first() != Some(&b'{') || end.trim_ascii_end().last() != Some(&b'}') {
        let problem = format!("not {kind}: it does not begin with {{ and end with }}");
        return Err(Error::input(Place::file(path), problem, help));
    }
    read(path, largest)
}

/// The first and last bytes of a file, at most 256 each; afterwards the file is at its beginning.
fn ends(file: &mut File) -> std::io::Result<(Vec<u8>, Vec<u8>)> {
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

/// Like [`read`], as text.
///
/// # Errors
/// As [`read`]; [`Error::Input`] for text that is not UTF-8.
pub fn read_text(path: &Path, largest: u64) -> Result<String> {
    String::from_utf8(read(path, largest)?).map_err(|e| {
        let row = row_at(e.as_bytes(), e.utf8_error().valid_up_to());
        Error::input(Place::file(path).row(row), "not UTF-8 text", "save the file as UTF-8")
    })
}

/// The line of a byte of a text, from 1.
pub fn row_at(text: &[u8], at: usize) -> u64 {
    1 + text.iter().take(at).filter(|byte| **byte == b'\n').count() as u64
}

/// SHA-256 of a regular file of any size, in hexadecimal; read in pieces. It is that of the bytes that the command read.
///
/// # Errors
/// As [`open`] and [`unchanged`].
pub fn sha256(path: &Path) -> Result<String> {
    let mut file = open_own(path)?;
    let mut hash = Sha256::new();
    let mut piece = vec![0; 1 << 16];
    loop {
        match file.read(&mut piece) {
            Ok(0) => return unchanged(path).map(|()| hex(&hash.finalize())),
            Ok(count) => hash.update(&piece[..count]),
            Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
            Err(e) => return Err(Error::io(path, "read", e)),
        }
    }
}

/// Parses settings from a text; errors name `place`, and `help` says where the keys are documented.
///
/// # Errors
/// [`Error::Usage`] with the line, for invalid TOML, an unknown key or a value of another type.
pub fn parse_toml<T: DeserializeOwned>(text: &str, place: &Place, help: &str) -> Result<T> {
    toml::from_str(text).map_err(|e| {
        let mut place = place.clone();
        if let Some(span) = e.span() {
            place.row = Some(row_at(text.as_bytes(), span.start));
            if place.item.is_none() {
                place.item = key_before(text, span.start).map(|key| format!("`{key}`"));
            }
        }
        let message = cut_names(e.message());
        let problem = in_words(&message);
        match meant(&message) {
            Some(name) => Error::usage(place, problem, format!("did you mean `{name}`? {help}")),
            None => Error::usage(place, problem, help),
        }
    })
}

/// The key whose value begins at byte `at`.
fn key_before(text: &str, at: usize) -> Option<String> {
    let line = text.get(..at)?.lines().next_back()?;
    let key = line.strip_suffix(['=', ' ']).and_then(|_| line.split('=').next())?.trim();
    (!key.is_empty() && !key.starts_with(['#', '['])).then(|| key.to_owned())
}

/// Replaces the reader's type names by a user's words.
fn in_words(message: &str) -> String {
    let words = [("floating point", "number"), ("f64", "a number"), ("f32", "a number"), ("usize", "a whole number")];
    let whole = ["u8", "u16", "u32", "u64"].map(|name| (name, "a whole number of at least 0"));
    let mut text = message.to_owned();
    for (name, word) in words.into_iter().chain(whole) {
        text = text.replace(&format!("expected {name}"), &format!("expected {word}"));
    }
    text
}

/// The name, of those that the message lists, that is most similar to the unknown one.
fn meant(message: &str) -> Option<&str> {
    let mut names = message.strip_prefix("unknown field `")?.split('`').step_by(2);
    let unknown = names.next()?;
    nearest(unknown, names, 0.75)
}

/// Reads settings from a regular file.
///
/// # Errors
/// As [`parse_toml`]; [`Error::Io`]; [`Error::Input`] if it is not a text file or is too large.
pub fn read_toml<T: DeserializeOwned>(path: &Path, help: &str) -> Result<T> {
    parse_toml(&read_text(path, MAX_SETTINGS_BYTES)?, &Place::file(path), help)
}
