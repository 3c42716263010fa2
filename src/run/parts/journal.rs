//! The journal of an unfinished part: one sealed record per line. The first line identifies the run and the interval.
//! Reading stops at the first torn or damaged record; everything after it is recomputed.

use std::fs::{File, OpenOptions};
use std::io::{BufReader, Read, Seek, SeekFrom, Write};
use std::marker::PhantomData;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::sealed::{check_begin, json_line, seal, unseal};
use lanesweep_support::atomic_file::{is_named, refuse_link};
use lanesweep_support::files::remove_file;
use lanesweep_support::{Error, Place, Result};

/// Minimum time between two records.
const MIN_WAIT: Duration = Duration::from_millis(250);
/// The wait between records is at least this multiple of the time that the last write took, so that journals cost at
/// most 1 %.
const PATIENCE: u32 = 100;
/// Maximum size of a journal that is read, bytes.
const MAX_BYTES: u64 = 4 << 30;
/// Kinds of the sealed lines: the first one, and all others.
const KINDS: [&str; 2] = ["journal", "record"];

/// An open journal. The file is created with the first record: a run that ends earlier leaves none.
pub struct Journal<T> {
    path: PathBuf,
    /// The first line.
    head: Vec<u8>,
    file: Option<File>,
    due: Instant,
    spent: Duration,
    kind: PhantomData<T>,
}

/// Records of an earlier process.
pub struct Records<T> {
    /// The complete records, in the order in which they were written.
    pub records: Vec<T>,
    /// A record was torn or damaged; it and all later records were dropped.
    pub torn: bool,
}

impl<T: Serialize + DeserializeOwned> Journal<T> {
    /// Opens the journal of a run's interval; keeps and returns its complete records.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] if the file is the journal of another run or interval.
    pub fn open(path: &Path, run_sha256: &str, units: Range<u64>) -> Result<(Journal<T>, Records<T>)> {
        let head = seal(KINDS[0], &(run_sha256, units))?.0;
        let due = Instant::now() + MIN_WAIT;
        let mut journal =
            Journal { path: path.to_path_buf(), head, file: None, due, spent: Duration::ZERO, kind: PhantomData };
        let mut found = Records { records: Vec::new(), torn: false };
        refuse_link(path)?;
        let mut file = match OpenOptions::new().read(true).write(true).open(path) {
            Ok(file) => file,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok((journal, found)),
            Err(e) => return Err(Error::io(path, "read", e)),
        };
        let io = |e| Error::io(path, "read", e);
        let about = file.metadata().map_err(io)?;
        if !about.is_file() || about.len() > MAX_BYTES {
            let help = "move it away; what it holds is then computed again";
            return Err(Error::input(Place::file(path), "this is no journal of lanesweep", help));
        }
        let (mut lines, mut begin) = (BufReader::with_capacity(1 << 16, &file), Vec::new());
        lines.by_ref().take(journal.head.len() as u64).read_to_end(&mut begin).map_err(io)?;
        if begin != journal.head {
            if journal.head.starts_with(&begin) {
                // Even the first line is incomplete, so the journal is recreated.
                remove_file(path)?;
                return Ok((journal, Records { torn: true, ..found }));
            }
            let (problem, help) = match check_begin(KINDS[0], &begin) {
                Err(problem) => (problem, "move it away; what it holds is then computed again"),
                Ok(()) => (
                    "this journal belongs to another run or another interval of it, or is damaged".to_owned(),
                    "move it away, or finish that run first: give the command that it was begun with",
                ),
            };
            return Err(Error::input(Place::file(path), problem, help));
        }
        let mut whole = begin.len() as u64;
        // Only one line at a time is in memory.
        while let Some(line) = json_line(&mut lines, MAX_BYTES).map_err(io)? {
            let Ok((record, _)) = unseal(KINDS[1], &line, &Place::default(), "") else { break };
            found.records.push(record);
            whole += line.len() as u64;
        }
        found.torn = whole < about.len();
        let io = |e| Error::io(path, "write", e);
        file.set_len(whole).map_err(io)?;
        file.seek(SeekFrom::End(0)).map_err(io)?;
        journal.file = Some(file);
        Ok((journal, found))
    }

    /// Whether the next record is due.
    pub(super) fn is_due(&self) -> bool {
        Instant::now() >= self.due
    }

    /// Appends records and syncs them to the disk.
    ///
    /// # Errors
    /// [`Error::Io`]: earlier records stay intact, unless the error says that the file was deleted.
    pub fn append(&mut self, records: &[T]) -> Result<()> {
        let started = Instant::now();
        let mut text = Vec::new();
        if self.file.is_none() {
            text.clone_from(&self.head);
        }
        for record in records {
            text.extend(seal(KINDS[1], record)?.0);
        }
        match &self.file {
            // Otherwise the system would continue to write to a deleted file.
            Some(file) if !is_named(&self.path, file) => return Err(self.gone()),
            Some(_) => {}
            None => {
                let created = File::create_new(&self.path).map_err(|e| match e.kind() {
                    std::io::ErrorKind::NotFound => self.gone(),
                    _ => self.failed(e),
                })?;
                self.file = Some(created);
            }
        }
        if let Some(mut file) = self.file.as_ref() {
            file.write_all(&text).and_then(|()| file.sync_data()).map_err(|e| self.failed(e))?;
        }
        let took = started.elapsed();
        self.spent += took;
        self.due = Instant::now() + MIN_WAIT.max(took * PATIENCE);
        Ok(())
    }

    /// Total time spent on appending.
    pub fn spent(&self) -> Duration {
        self.spent
    }

    /// A failed write leaves at most one torn record.
    fn failed(&self, source: std::io::Error) -> Error {
        let kept = "the records before are whole: once this is mended, the same command goes on from them";
        Error::io(&self.path, "write", std::io::Error::new(source.kind(), format!("{source}; {kept}")))
    }

    /// The file or its folder was deleted during the run.
    fn gone(&self) -> Error {
        let folder = self.path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let what = if folder.is_dir() {
            "the journal was removed or replaced".to_owned()
        } else {
            format!("the folder {} vanished", folder.display())
        };
        let why = format!("{what} while the run was at work; what it held is lost: the same command begins anew");
        Error::io(&self.path, "write", std::io::Error::other(why))
    }

    /// Deletes the file, because the part is finished or discarded.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn remove(mut self) -> Result<()> {
        self.file = None;
        remove_file(&self.path)
    }

    /// The path of the file.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }
}
