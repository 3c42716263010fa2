//! The journal of an unfinished part: one record per line, each with its checksum. The first line identifies the run
//! and the interval. Reading stops at the first torn or damaged record; everything after it is recomputed.

use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::marker::PhantomData;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::sealed::json_line;
use lanesweep_engine::ENGINE_VERSION;
use lanesweep_support::atomic_file::{is_named, refuse_link};
use lanesweep_support::files::remove_file;
use lanesweep_support::plain_text::hex;
use lanesweep_support::{Error, Place, Result};

/// Minimum time between two records.
const MIN_WAIT: Duration = Duration::from_millis(250);
/// The wait between records is at least this multiple of the time that the last write took, so that journals cost at
/// most 1 %.
const PATIENCE: u32 = 100;
/// Maximum length of the first line, bytes.
const MAX_HEAD_BYTES: u64 = 4096;
/// A larger file without a complete first line is not a journal torn at its start, bytes.
const MAX_FIRST_BYTES: u64 = 16 << 20;
/// Maximum size of a journal that is read, bytes.
const MAX_BYTES: u64 = 4 << 30;
/// Hexadecimal characters of a checksum.
const CHECKSUM: usize = 64;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    lanesweep_journal: u64,
    engine: u64,
    run_sha256: String,
    units: Range<u64>,
}

/// An open journal. The file is created with the first record: a run that ends earlier leaves none.
pub struct Journal<T> {
    path: PathBuf,
    head: Head,
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
        let engine = ENGINE_VERSION;
        let head = Head { lanesweep_journal: 4, engine, run_sha256: run_sha256.to_owned(), units };
        let due = Instant::now() + MIN_WAIT;
        let mut journal =
            Journal { path: path.to_path_buf(), head, file: None, due, spent: Duration::ZERO, kind: PhantomData };
        refuse_link(path)?;
        let mut file = match OpenOptions::new().read(true).write(true).open(path) {
            Ok(file) => file,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
                return Ok((journal, Records { records: Vec::new(), torn: false }));
            }
            Err(e) => return Err(Error::io(path, "read", e)),
        };
        let io = |e| Error::io(path, "read", e);
        let about = file.metadata().map_err(io)?;
        if !about.is_file() || about.len() > MAX_BYTES {
            let help = "move it away; what it holds is then computed again";
            return Err(Error::input(Place::file(path), "this is no journal of lanesweep", help));
        }
        let (records, whole) = journal.parse(&mut BufReader::with_capacity(1 << 16, &file))?;
        if whole == 0 && (about.len() > MAX_FIRST_BYTES || !begins_as_journal(&file).map_err(io)?) {
            let help = "move it away: it holds nothing that a run could continue from";
            return Err(Error::input(Place::file(path), "this is no journal of lanesweep", help));
        }
        let torn = whole < about.len();
        let io = |e| Error::io(path, "write", e);
        file.set_len(whole).map_err(io)?;
        file.seek(SeekFrom::End(0)).map_err(io)?;
        if whole > 0 {
            journal.file = Some(file);
        } else {
            // Even the first line is incomplete, so the journal is recreated.
            std::fs::remove_file(path).map_err(io)?;
        }
        Ok((journal, Records { records, torn }))
    }

    /// The complete records and their end in the file; only one line at a time is in memory.
    fn parse(&self, file: &mut impl BufRead) -> Result<(Vec<T>, u64)> {
        let (mut records, mut whole) = (Vec::new(), 0);
        let longest = |whole: u64| if whole == 0 { MAX_HEAD_BYTES } else { MAX_BYTES };
        while let Some(line) = json_line(file, longest(whole)).map_err(|e| Error::io(&self.path, "read", e))? {
            let Some(body) = checked(&line) else { break };
            if whole == 0 {
                let help = "move it away, or finish that run first: give the command that it was begun with";
                let Ok(head) = serde_json::from_slice::<Head>(body) else {
                    let problem = "this journal is of another version of lanesweep";
                    return Err(Error::input(Place::file(&self.path), problem, help));
                };
                if head.engine != self.head.engine {
                    let problem = format!(
                        "this journal is of engine {}, this program has engine {ENGINE_VERSION}: their lanes differ, \
                         and are never mixed",
                        head.engine
                    );
                    return Err(Error::input(Place::file(&self.path), problem, help));
                }
                if head != self.head {
                    let problem = "this journal belongs to another run or another interval of it";
                    return Err(Error::input(Place::file(&self.path), problem, help));
                }
            } else {
                let Ok(record) = serde_json::from_slice(body) else { break };
                records.push(record);
            }
            whole += line.len() as u64;
        }
        Ok((records, whole))
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
            text = line_of(&self.head)?;
        }
        for record in records {
            text.extend(line_of(record)?);
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

/// Formats a record as `checksum content` and a line end.
fn line_of<R: Serialize>(record: &R) -> Result<Vec<u8>> {
    let body =
        serde_json::to_vec(record).map_err(|e| Error::Internal(format!("a journal record cannot be written: {e}")))?;
    let mut line = hex(&Sha256::digest(&body)).into_bytes();
    line.push(b' ');
    line.extend(body);
    line.push(b'\n');
    Ok(line)
}

/// Whether a file may be a journal that was torn at its start: its available bytes begin with a checksum.
fn begins_as_journal(mut file: &File) -> std::io::Result<bool> {
    let mut begin = Vec::new();
    file.rewind()?;
    file.take(CHECKSUM as u64).read_to_end(&mut begin)?;
    Ok(begin.iter().all(|byte| byte.is_ascii_hexdigit()))
}

/// The content of a complete line.
fn checked(line: &[u8]) -> Option<&[u8]> {
    let line = line.strip_suffix(b"\n")?;
    let (checksum, body) = line.split_at_checked(CHECKSUM)?;
    let body = body.strip_prefix(b" ")?;
    (hex(&Sha256::digest(body)).as_bytes() == checksum).then_some(body)
}
