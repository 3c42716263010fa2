//! Rows of a CSV file, one at a time.

use std::cell::Cell;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use std::rc::Rc;

use serde_json::Value;

use super::Row;
use super::writer::text_of_cell;
use crate::support::input_file;
use crate::{Error, Place, Result};

/// Maximum row length, bytes. A quote that is never closed makes the rest of the file one row.
const MAX_ROW_BYTES: u64 = 16 << 20;

pub(super) struct CsvRows {
    path: PathBuf,
    reader: csv::Reader<BudgetedFile>,
    ration: Rc<Cell<u64>>,
    record: csv::StringRecord,
    wanted: Vec<usize>,
}

/// A file that returns an error after a budget of bytes.
struct BudgetedFile {
    file: BufReader<File>,
    left: Rc<Cell<u64>>,
}

impl Read for BudgetedFile {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        if self.left.get() == 0 {
            return Err(std::io::Error::from(std::io::ErrorKind::OutOfMemory));
        }
        let count = self.file.read(bytes)?;
        self.left.set(self.left.get().saturating_sub(count as u64));
        Ok(count)
    }
}

impl CsvRows {
    pub(super) fn open(path: &Path) -> Result<(Vec<String>, CsvRows)> {
        let ration = Rc::new(Cell::new(MAX_ROW_BYTES));
        let file = BudgetedFile { file: BufReader::new(input_file::open(path)?), left: ration.clone() };
        let reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(file);
        let mut rows =
            CsvRows { path: path.to_path_buf(), reader, ration, record: csv::StringRecord::new(), wanted: Vec::new() };
        let header = rows.reader.headers().cloned().map_err(|e| csv_error(path, e))?;
        let columns: Vec<String> =
            header.iter().map(|name| name.trim_start_matches('\u{feff}').trim().to_owned()).collect();
        if let [one] = &columns[..]
            && one.contains([';', '\t'])
        {
            let mark = if one.contains(';') { "semicolons" } else { "tabs" };
            let problem = format!("the fields are separated by {mark}; expected commas");
            return Err(Error::input(
                Place::file(path).row(1),
                problem,
                "write the table with commas and decimal points",
            ));
        }
        rows.want(&(0..columns.len()).collect::<Vec<_>>());
        Ok((columns, rows))
    }

    pub(super) fn want(&mut self, columns: &[usize]) {
        self.wanted = columns.to_vec();
    }

    pub(super) fn step(&mut self) -> Result<bool> {
        self.ration.set(MAX_ROW_BYTES);
        self.reader.read_record(&mut self.record).map_err(|e| csv_error(&self.path, e))
    }

    pub(super) fn cell(&self, wanted: usize) -> super::Cell<'_> {
        match self.record.get(self.wanted[wanted]) {
            None | Some("") => super::Cell::Null,
            Some(text) => super::Cell::text(text_of_cell(text)),
        }
    }

    pub(super) fn next_row(&mut self) -> Result<Option<Row>> {
        if !self.step()? {
            return Ok(None);
        }
        let number = self.record.position().map_or(0, csv::Position::line);
        let value = |at: &usize| match self.record.get(*at) {
            None | Some("") => Value::Null,
            Some(text) => Value::from(text_of_cell(text)),
        };
        Ok(Some(Row { number, values: self.wanted.iter().map(value).collect() }))
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
