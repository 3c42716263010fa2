//! Rows of a CSV file, one at a time.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::writer::text_of_cell;
use super::{Cell, Row, TableRows};
use crate::support::input_file;
use crate::{Error, Place, Result};

/// Maximum row length, bytes. A quote that is never closed makes the rest of the file one row.
const MAX_ROW_BYTES: u64 = 16 << 20;

pub(super) struct CsvRows {
    path: PathBuf,
    reader: csv::Reader<BudgetedFile>,
    record: csv::StringRecord,
    wanted: Vec<usize>,
}

/// A file that returns an error after a budget of bytes.
struct BudgetedFile {
    file: BufReader<File>,
    left: u64,
}

impl Read for BudgetedFile {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        if self.left == 0 {
            return Err(std::io::Error::from(std::io::ErrorKind::OutOfMemory));
        }
        let count = self.file.read(bytes)?;
        self.left = self.left.saturating_sub(count as u64);
        Ok(count)
    }
}

impl CsvRows {
    pub(super) fn open(path: &Path) -> Result<(Vec<String>, CsvRows)> {
        let file = BudgetedFile { file: BufReader::new(input_file::open(path)?), left: MAX_ROW_BYTES };
        let reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(file);
        let (path, record) = (path.to_path_buf(), csv::StringRecord::new());
        let mut rows = CsvRows { path, reader, record, wanted: Vec::new() };
        let header = rows.reader.headers().cloned().map_err(|e| csv_error(&rows.path, e))?;
        let columns: Vec<String> =
            header.iter().map(|name| name.trim_start_matches('\u{feff}').trim().to_owned()).collect();
        if let [one] = &columns[..]
            && one.contains([';', '\t'])
        {
            let mark = if one.contains(';') { "semicolons" } else { "tabs" };
            let problem = format!("the fields are separated by {mark}; expected commas");
            let help = "write the table with commas and decimal points";
            return Err(Error::input(Place::file(&rows.path).row(1), problem, help));
        }
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
        self.reader.get_mut().left = MAX_ROW_BYTES;
        self.reader.read_record(&mut self.record).map_err(|e| csv_error(&self.path, e))
    }

    fn cell(&self, wanted: usize) -> Cell<'_> {
        match self.record.get(self.wanted[wanted]) {
            None | Some("") => Cell::Null,
            Some(text) => Cell::text(text_of_cell(text)),
        }
    }

    fn next_row(&mut self) -> Result<Option<Row>> {
        if !self.step()? {
            return Ok(None);
        }
        let number = self.record.position().map_or(0, csv::Position::line);
        let value = |at| if let Cell::Text(text) = self.cell(at) { Value::from(text) } else { Value::Null };
        Ok(Some(Row { number, values: (0..self.wanted.len()).map(value).collect() }))
    }
}

fn csv_error(path: &Path, error: csv::Error) -> Error {
    let place = |position: &Option<csv::Position>| {
        position.as_ref().map_or(Place::file(path), |position| Place::file(path).row(position.line()))
    };
    let line = error.position().map(csv::Position::line);
    match error.into_kind() {
        csv::ErrorKind::Io(source) if source.kind() == std::io::ErrorKind::OutOfMemory => Error::input(
            line.map_or(Place::file(path), |line| Place::file(path).row(line)),
            format!("a row is longer than {} MiB", MAX_ROW_BYTES >> 20),
            "look for a quote that is not closed",
        ),
        csv::ErrorKind::Io(source) => Error::io(path, "read", source),
        csv::ErrorKind::Utf8 { pos, .. } => Error::input(place(&pos), "not UTF-8 text", "save the file as UTF-8"),
        csv::ErrorKind::UnequalLengths { pos, expected_len, len } => Error::input(
            place(&pos),
            format!("{len} fields, but the header has {expected_len}"),
            "give every row one field per column; texts with commas need quotes",
        ),
        other => Error::input(Place::file(path), format!("not CSV: {other:?}"), "write one row a line"),
    }
}
