//! A delimited table with named columns: finds columns by name and returns typed fields. Errors name file, line
//! and column. Independent of traffic.
//!
//! Accepted, because they change no value: Windows line ends, a byte order mark, blank lines, quotes, blanks around a
//! field, columns in another order, additional columns, UTF-16, compression by gzip.

use lanesweep_support::files::file_name;
use lanesweep_support::plain_text::hex;
use std::io::{self, Cursor, Read};
use std::path::{Path, PathBuf};

use csv::{ByteRecord, Reader, ReaderBuilder, Terminator};
use sha2::{Digest, Sha256};

use super::number;
use lanesweep_support::plain_text::nearest;
use lanesweep_support::table::{delimiter_of, has_decimal_commas};
use lanesweep_support::{Error, Place, Result, input_file};

/// Identity of a file's content in the run record.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct FileChecksum {
    /// Name of the file without its folder.
    pub file: String,
    /// Size, bytes.
    pub bytes: u64,
    /// SHA-256 of the whole file, lower-case hexadecimal.
    pub sha256: String,
}

impl FileChecksum {
    /// That of a file, which is read for it.
    pub(super) fn of(path: &Path) -> Result<FileChecksum> {
        let bytes = std::fs::metadata(path).map_err(|e| Error::io(path, "read", e))?.len();
        let file = file_name(path);
        Ok(FileChecksum { file, bytes, sha256: input_file::sha256(path)? })
    }
}

/// A column that the header has, by index.
pub(super) type CsvColumn = usize;

/// An open table, positioned on one of its lines.
pub(super) struct CsvTable {
    path: PathBuf,
    reader: Reader<HashingReader>,
    /// Column names of the format, separated by commas: they are never reported as misspelt.
    known: &'static str,
    /// The column names.
    pub header: Vec<String>,
    record: ByteRecord,
    line: u64,
    /// Line on which the last record ended.
    last_line: u64,
    /// Numbers have commas in place of points.
    pub has_decimal_commas: bool,
    is_plain: bool,
}

/// Size of one read from the file, bytes: the disk, not the call, limits the speed.
const READ_AHEAD_BYTES: usize = 1 << 18;

/// Maximum length of a line, bytes. A line of the format has a few hundred; a longer one means another format or an
/// open quotation mark.
const MAX_LINE_BYTES: u64 = 1 << 20;

const SAVE_AS_UTF8: &str = "save the file as UTF-8 or export it again";

impl CsvTable {
    /// Opens a file and reads its header. The delimiter is the one that the header has most of; a comma in highD's format, whose
    /// columns are `known`.
    ///
    /// # Errors
    /// If it cannot be read, is empty, or has no delimited header in UTF-8.
    pub(super) fn open(path: &Path, known: &'static str) -> Result<Self> {
        let mut file = input_file::open_text(path)?;
        let mut start = Vec::new();
        if known.is_empty() {
            file.by_ref().take(MAX_LINE_BYTES).read_to_end(&mut start).map_err(|e| Error::io(path, "read", e))?;
        }
        let delimiter = if known.is_empty() { delimiter_of(&start) } else { b',' };
        let has_decimal_commas = delimiter != b',' && has_decimal_commas(&start, delimiter);
        let inner = Box::new(Cursor::new(start).chain(file));
        let file = HashingReader { inner, hash: Sha256::new(), bytes: 0, at_end: false, line_from: 0 };
        let reader = ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .delimiter(delimiter)
            // Not CRLF, with which the line number is one too small in files with Windows line ends.
            .terminator(Terminator::Any(b'\n'))
            .buffer_capacity(READ_AHEAD_BYTES)
            .from_reader(file);
        let mut table = CsvTable {
            path: path.to_path_buf(),
            reader,
            known,
            header: Vec::new(),
            record: ByteRecord::new(),
            line: 0,
            last_line: 0,
            has_decimal_commas,
            is_plain: input_file::is_plain(path)?,
        };
        if !table.read_line()? {
            let problem = "the file is empty; expected a header line with column names";
            return Err(Error::input(Place::file(path), problem, "copy or export the file again"));
        }
        let name = |field| String::from_utf8_lossy(field).trim().trim_start_matches('\u{feff}').to_owned();
        table.header = table.record.iter().map(name).collect();
        table.check_header()?;
        Ok(table)
    }

    /// Steps to the next line; false at the end of the file.
    ///
    /// # Errors
    /// If the file cannot be read or the line has another number of fields than the header.
    pub(super) fn next_row(&mut self) -> Result<bool> {
        if !self.read_line()? {
            return Ok(false);
        }
        if self.record.len() == self.header.len() { Ok(true) } else { Err(self.wrong_field_count()) }
    }

    /// The column with this name.
    ///
    /// # Errors
    /// If the header has none, or two; names the most similar column.
    pub(super) fn column(&self, name: &str) -> Result<CsvColumn> {
        self.optional_column(name)?.ok_or_else(|| {
            let strange: Vec<String> = self.strange_names().take(10).map(quoted).collect();
            let more = if self.strange_names().count() > strange.len() { ", …" } else { "" };
            let others = match strange.join(", ") {
                none if none.is_empty() => String::new(),
                names => format!("; the header has names that are not part of the format: {names}{more}"),
            };
            let help = match self.similar_name(name) {
                Some(similar) => format!("rename the column `{similar}` to `{name}`, if that is what it holds"),
                None => format!("add the column `{name}`, or export the file again in the highD format"),
            };
            Error::input(self.header_place().column(name), format!("the column is missing{others}"), help)
        })
    }

    /// The columns with these names.
    ///
    /// # Errors
    /// As [`CsvTable::column`].
    pub(super) fn columns<const N: usize>(&self, names: [&str; N]) -> Result<[CsvColumn; N]> {
        let mut found = [0; N];
        for (column, name) in found.iter_mut().zip(names) {
            *column = self.column(name)?;
        }
        Ok(found)
    }

    /// The column with this name, if the header has it.
    ///
    /// # Errors
    /// If the header has it twice.
    pub(super) fn optional_column(&self, name: &str) -> Result<Option<CsvColumn>> {
        let mut found = (0..self.header.len()).filter(|index| self.header[*index] == name);
        match (found.next(), found.next()) {
            (first, None) => Ok(first),
            _ => {
                let place = self.header_place().column(name);
                Err(Error::input(place, "the header names this column twice", "remove or rename one of the two"))
            }
        }
    }

    /// A header name that looks like a spelling of `name` (`lane_id` for `laneId`).
    pub(super) fn similar_name(&self, name: &str) -> Option<&str> {
        nearest(name, self.strange_names(), 0.75)
    }

    /// The bytes of a field.
    pub(super) fn bytes(&self, column: CsvColumn) -> &[u8] {
        // Every line has as many fields as the header, so the field exists.
        let field = self.record.get(column).unwrap_or_default();
        // Windows line ends leave this in the last field.
        field.strip_suffix(b"\r").unwrap_or(field)
    }

    /// A field as text, without blanks around it.
    ///
    /// # Errors
    /// If it is not UTF-8.
    pub(super) fn text(&self, column: CsvColumn) -> Result<&str> {
        let bad = |_| self.bad(column, format!("{} is not UTF-8 text", self.shown(column)), SAVE_AS_UTF8);
        std::str::from_utf8(self.bytes(column)).map(str::trim).map_err(bad)
    }

    /// A field as a number between ±10¹², so that derived values stay finite.
    ///
    /// # Errors
    /// If it is not a number, infinite, NaN or out of range.
    pub(super) fn real(&self, column: CsvColumn) -> Result<f64> {
        let value = number::real(self.bytes(column)).ok_or_else(|| self.not_a_number(column, "a number"))?;
        if value.abs() <= number::REAL_LIMIT {
            return Ok(value);
        }
        let what = if value.is_finite() { "out of range" } else { "not finite; expected a finite number" };
        let help = "correct the value, or remove the vehicle from the recording";
        Err(self.bad(column, format!("{} is {what}", self.shown(column)), help))
    }

    /// A field as a finite number above zero.
    ///
    /// # Errors
    /// If it is not such a number.
    pub(super) fn positive(&self, column: CsvColumn) -> Result<f64> {
        let value = self.real(column)?;
        if value > 0.0 {
            return Ok(value);
        }
        Err(self.bad(column, format!("{} is not above zero", self.shown(column)), "correct the value"))
    }

    /// A field as a whole number.
    ///
    /// # Errors
    /// If it is not a whole number.
    pub(super) fn integer(&self, column: CsvColumn) -> Result<i64> {
        number::integer(self.bytes(column)).ok_or_else(|| self.not_a_number(column, "a whole number"))
    }

    /// The error for a field of the present line.
    pub(super) fn bad(&self, column: CsvColumn, problem: impl Into<String>, help: impl Into<String>) -> Error {
        Error::input(self.field(column), problem, help)
    }

    /// The place of a field of the present line.
    pub(super) fn field(&self, column: CsvColumn) -> Place {
        self.place().column(&self.header[column])
    }

    /// The present line.
    pub(super) fn place(&self) -> Place {
        Place::file(&self.path).row(self.line)
    }

    /// The place of the whole file.
    pub(super) fn file_place(&self) -> Place {
        Place::file(&self.path)
    }

    /// The place of the header.
    pub(super) fn header_place(&self) -> Place {
        self.file_place().row(1)
    }

    /// A field as messages show it.
    pub(super) fn shown(&self, column: CsvColumn) -> String {
        quoted(&String::from_utf8_lossy(self.bytes(column)))
    }

    /// Closes the file; the checksum covers the bytes read, which is the whole file after the last row.
    ///
    /// # Errors
    /// If a file that was unpacked or converted cannot be read again.
    pub(super) fn finish(self) -> Result<FileChecksum> {
        if !self.is_plain {
            return FileChecksum::of(&self.path);
        }
        let file = file_name(&self.path);
        let hashing = self.reader.into_inner();
        Ok(FileChecksum { file, bytes: hashing.bytes, sha256: hex(&hashing.hash.finalize()) })
    }

    /// Steps to the next line that is not blank.
    fn read_line(&mut self) -> Result<bool> {
        loop {
            let from = self.reader.position().byte();
            self.reader.get_mut().line_from = from;
            if !self.reader.read_byte_record(&mut self.record).map_err(|error| self.unreadable(error))? {
                return Ok(false);
            }
            // The reader is on the line after the record, unless the record has no line end.
            let end_line = self.reader.position().line().saturating_sub(u64::from(!self.ends_open()));
            (self.line, self.last_line) = (end_line.saturating_sub(self.inner_line_ends()), end_line);
            if self.record.len() != 1 || !self.record[0].trim_ascii().is_empty() {
                return Ok(true);
            }
        }
    }

    fn unreadable(&self, error: csv::Error) -> Error {
        match error.into_kind() {
            csv::ErrorKind::Io(source) if source.kind() == ENDLESS_LINE => Error::input(
                Place::file(&self.path).row(self.last_line + 1),
                format!("neither line nor quotation ends here within {} MiB", MAX_LINE_BYTES >> 20),
                "remove an open quotation mark, or copy or export the file again",
            ),
            csv::ErrorKind::Io(source) => Error::io(&self.path, "read", source),
            // Only reading can fail: bytes are not decoded, and the number of fields is free.
            other => Error::Internal(format!("{}: {other:?}", self.path.display())),
        }
    }

    /// Whether the last record ends with the file instead of a line end.
    fn ends_open(&self) -> bool {
        let hashing = self.reader.get_ref();
        hashing.at_end && self.reader.position().byte() == hashing.bytes
    }

    /// Number of line ends inside quoted fields of the record.
    fn inner_line_ends(&self) -> u64 {
        self.record.as_slice().iter().filter(|&&byte| byte == b'\n').count() as u64
    }

    /// Header names that are not part of the format.
    fn strange_names(&self) -> impl Iterator<Item = &str> {
        self.header.iter().map(String::as_str).filter(|name| !self.known.split(',').any(|known| known == *name))
    }

    fn check_header(&self) -> Result<()> {
        let is_other = |separator: &&char| matches!(&self.header[..], [only] if only.contains(**separator));
        let refused = |problem: &str, help: &str| Err(Error::input(self.header_place(), problem, help));
        if self.record.iter().any(|field| field.contains(&0)) {
            let problem = "the header contains zero bytes; expected UTF-8 text with comma-separated column names";
            return refused(problem, "save the file as UTF-8 (it may be UTF-16) or export it again");
        }
        let Some(separator) = [';', '\t'].iter().find(is_other) else { return Ok(()) };
        let problem = format!("the fields are separated by {separator:?}; expected commas");
        refused(&problem, "export the file with commas between the fields and points in the numbers")
    }

    fn wrong_field_count(&mut self) -> Error {
        let (place, found, expected) = (self.place(), self.record.len(), self.header.len());
        let has_open_quote = self.inner_line_ends() > 0;
        let (more, help) = if has_open_quote {
            let help = "remove the quotation mark; the format needs none";
            (": a quotation mark is opened and not closed on this line", help)
        } else if found > expected {
            ("", "remove the surplus fields (a comma inside a number counts as a separator)")
        } else if self.ends_open() || matches!(self.reader.read_byte_record(&mut self.record), Ok(false)) {
            (". It is the last line: the file is truncated", "copy or export the file again")
        } else {
            ("", "complete the line or remove it")
        };
        let problem = format!("the line has {found} fields; expected {expected}, as many as the header{more}");
        Error::input(place, problem, help)
    }

    fn not_a_number(&self, column: CsvColumn, expected: &str) -> Error {
        let field = self.bytes(column);
        if field.trim_ascii().is_empty() {
            return self.bad(column, format!("the field is empty; expected {expected}"), "fill in the value");
        }
        let help = if std::str::from_utf8(field).is_ok() { "correct the value" } else { SAVE_AS_UTF8 };
        self.bad(column, format!("{} is not {expected}", self.shown(column)), help)
    }
}

/// Text of a user's file in messages: quoted, without control characters, truncated.
pub(super) fn quoted(text: &str) -> String {
    const SHOWN: usize = 40;
    let end = if text.chars().nth(SHOWN).is_some() { "…" } else { "" };
    format!("`{}{end}`", text.chars().take(SHOWN).flat_map(char::escape_debug).collect::<String>())
}

/// Hashes and counts the bytes read, so that no file is read twice.
struct HashingReader {
    inner: Box<dyn Read + Send>,
    hash: Sha256,
    bytes: u64,
    at_end: bool,
    /// Offset of the present line, bytes.
    line_from: u64,
}

/// Kind of the error for a line that is too long; reading a file never gives it.
const ENDLESS_LINE: io::ErrorKind = io::ErrorKind::FileTooLarge;

impl Read for HashingReader {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        // The line has no end so far, and memory would have to hold all of it.
        if self.bytes - self.line_from.min(self.bytes) > MAX_LINE_BYTES {
            return Err(ENDLESS_LINE.into());
        }
        let count = self.inner.read(buffer)?;
        self.hash.update(&buffer[..count]);
        self.bytes += count as u64;
        self.at_end = count == 0;
        Ok(count)
    }
}
