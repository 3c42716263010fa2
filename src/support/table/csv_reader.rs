//! Rows of a CSV file, one at a time.

use std::io::{Cursor, Read, Take};
use std::path::{Path, PathBuf};

use super::writer::text_of_cell;
use super::{Cell, TableRows};
use crate::{Error, Place, Result, input_file};

/// Maximum row length, bytes. A quote that is never closed makes the rest of the file one row.
const MAX_ROW_BYTES: u64 = 16 << 20;
/// What separates the fields is seen in the first bytes.
const START_BYTES: u64 = 1 << 16;

pub(super) struct CsvRows {
    path: PathBuf,
    /// Gives at most [`MAX_ROW_BYTES`] for each row: a longer row ends early.
    reader: csv::Reader<Take<Box<dyn Read + Send>>>,
    record: csv::StringRecord,
    wanted: Vec<usize>,
    decimal_commas: bool,
    /// The reader counts a Windows line end to the next row.
    lines_off: u64,
}

/// The delimiter that the first line has most of; a comma if it has none.
pub fn delimiter_of(start: &[u8]) -> u8 {
    let line = start.split(|&byte| byte == b'\n').next().unwrap_or_default();
    let count = |delimiter: &u8| line.iter().filter(|&byte| byte == delimiter).count();
    [b'|', b'\t', b';', b','].into_iter().max_by_key(count).unwrap_or(b',')
}

/// Whether more fields of the first lines look like numbers with a decimal comma than with a point, as names of lanes may (`1.2`).
pub fn has_decimal_commas(start: &[u8], delimiter: u8) -> bool {
    let is_decimal = |field: &[u8], mark: u8| {
        let field = field.trim_ascii();
        let digits = field.strip_prefix(b"-").unwrap_or(field);
        let is_number = digits.iter().all(|byte| byte.is_ascii_digit() || *byte == mark);
        is_number && digits.iter().filter(|byte| **byte == mark).count() == 1 && digits.len() > 1
    };
    let fields = start.split(|byte| *byte == b'\n' || *byte == delimiter).map(|field| {
        let field = field.trim_ascii();
        field.strip_prefix(b"\"").and_then(|inner| inner.strip_suffix(b"\"")).unwrap_or(field)
    });
    let count = |mark| fields.clone().filter(|field| is_decimal(field, mark)).count();
    count(b',') > count(b'.')
}

/// Whether a text is a number with a decimal comma, and perhaps a unit.
fn is_decimal_comma(text: &str) -> bool {
    let is_whole = |left: &str| left.trim_start_matches(['+', '-']).bytes().all(|byte| byte.is_ascii_digit());
    text.split_once(',').is_some_and(|(left, right)| {
        is_whole(left) && right.starts_with(|c: char| c.is_ascii_digit()) && !right.contains(',')
    })
}

impl CsvRows {
    pub(super) fn open(path: &Path) -> Result<(Vec<String>, CsvRows)> {
        let (mut text, mut start) = (input_file::open_text(path)?, Vec::new());
        text.by_ref().take(START_BYTES).read_to_end(&mut start).map_err(|e| Error::io(path, "read", e))?;
        let delimiter = delimiter_of(&start);
        let decimal_commas = delimiter != b',' && has_decimal_commas(&start, delimiter);
        let has_windows_ends =
            start.split_inclusive(|byte| *byte == b'\n').next().is_some_and(|line| line.ends_with(b"\r\n"));
        let whole: Box<dyn Read + Send> = Box::new(Cursor::new(start).chain(text));
        let file = whole.take(MAX_ROW_BYTES);
        let reader = csv::ReaderBuilder::new().trim(csv::Trim::All).delimiter(delimiter).from_reader(file);
        let (path, record) = (path.to_path_buf(), csv::StringRecord::new());
        let mut rows = CsvRows { path, reader, record, wanted: Vec::new(), decimal_commas, lines_off: 0 };
        let header = rows.reader.headers().cloned();
        let header = rows.within(header)?;
        rows.lines_off = u64::from(has_windows_ends);
        let columns: Vec<String> =
            header.iter().map(|name| name.trim_start_matches('\u{feff}').trim().to_owned()).collect();
        rows.wanted = (0..columns.len()).collect();
        Ok((columns, rows))
    }
}

impl TableRows for CsvRows {
    fn want(&mut self, columns: &[usize]) -> Result<()> {
        self.wanted = columns.to_vec();
        Ok(())
    }

    fn step(&mut self) -> Result<bool> {
        loop {
            self.reader.get_mut().set_limit(MAX_ROW_BYTES);
            let read = self.reader.read_record(&mut self.record);
            let is_row = self.within(read)?;
            // Spreadsheets write rows of empty fields below a table.
            if !is_row || self.record.iter().any(|field| !field.is_empty()) {
                return Ok(is_row);
            }
        }
    }

    fn cell(&self, wanted: usize) -> Cell<'_> {
        match self.record.get(self.wanted[wanted]) {
            None | Some("") => Cell::Null,
            Some(text) if self.decimal_commas && is_decimal_comma(text) => Cell::text(text.replacen(',', ".", 1)),
            Some(text) => Cell::text(text_of_cell(text)),
        }
    }

    fn number(&self) -> u64 {
        self.record.position().map_or(0, |position| position.line() + self.lines_off)
    }

    fn width(&self) -> usize {
        self.wanted.len()
    }
}

impl CsvRows {
    /// Returns what was read, or the error for a row that is too long.
    fn within<T>(&self, read: csv::Result<T>) -> Result<T> {
        if self.reader.get_ref().limit() == 0 {
            let problem = format!("a row is longer than {} MiB", MAX_ROW_BYTES >> 20);
            return Err(Error::input(Place::file(&self.path), problem, "look for a quote that is not closed"));
        }
        read.map_err(|e| self.error(e))
    }

    fn error(&self, error: csv::Error) -> Error {
        let (file, line) = (Place::file(&self.path), error.position().map(|position| position.line() + self.lines_off));
        let place = line.map_or(file.clone(), |line| file.clone().row(line));
        match error.into_kind() {
            csv::ErrorKind::Io(source) => Error::io(&self.path, "read", source),
            csv::ErrorKind::Utf8 { .. } => Error::input(place, "not UTF-8 text", "save the file as UTF-8"),
            csv::ErrorKind::UnequalLengths { expected_len, len, .. } => Error::input(
                place,
                format!("{len} fields, but the header has {expected_len}"),
                "give every row one field per column; texts with commas need quotes",
            ),
            other => Error::input(file, format!("not CSV: {other:?}"), "write one row a line"),
        }
    }
}
