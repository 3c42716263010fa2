//! Evaluated candidates in files: a line of JSON each, appended as they come. A search that is started again reads them in
//! place of evaluating; shards read one another's.

use std::collections::HashMap;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::{Candidate, Evaluated};
use crate::run::parts::Shard;
use crate::support::input_file;
use crate::{Error, Place, Result};

#[derive(Serialize, Deserialize, PartialEq)]
struct Head {
    lanesweep_search: u64,
    search_sha256: String,
}

/// A line: a candidate and its result; `None` for one that cannot be fitted.
#[derive(Serialize, Deserialize)]
struct Line {
    candidate: Candidate,
    evaluated: Option<Evaluated>,
}

/// What has been evaluated, and the file that new results go to.
pub(super) struct Journal {
    known: HashMap<String, Option<Evaluated>>,
    out: Option<(PathBuf, File)>,
}

/// Maximum size of a journal that is read, bytes: 10⁶ candidates.
const MAX_JOURNAL_BYTES: u64 = 1 << 30;

/// File name of a shard's journal.
pub(super) fn name_of(shard: Option<Shard>) -> String {
    shard.map_or("search.jsonl".to_owned(), |shard| format!("search-{}-of-{}.jsonl", shard.index, shard.of))
}

impl Journal {
    /// Opens the journals of a folder; without one, results are only remembered.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] for the journal of another search.
    pub fn open(folder: Option<&Path>, shard: Option<Shard>, search_sha256: &str) -> Result<Journal> {
        let mut journal = Journal { known: HashMap::new(), out: None };
        let Some(folder) = folder else { return Ok(journal) };
        let own = folder.join(name_of(shard));
        let head = Head { lanesweep_search: 1, search_sha256: search_sha256.to_owned() };
        let listed = std::fs::read_dir(folder).map_err(|e| Error::io(folder, "list", e))?;
        let is_journal = |path: &PathBuf| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            name.starts_with("search") && name.ends_with(".jsonl")
        };
        let mut files: Vec<PathBuf> = listed.flatten().map(|entry| entry.path()).filter(is_journal).collect();
        files.sort();
        let mut end_of_own = 0;
        for path in files {
            let bytes = input_file::read(&path, MAX_JOURNAL_BYTES)?;
            let mut whole = 0;
            for (at, line) in bytes.split_inclusive(|byte| *byte == b'\n').enumerate() {
                // A process that was ended may have left half a line.
                if !line.ends_with(b"\n") {
                    break;
                }
                let damaged = || Error::input(Place::file(&path).row(at as u64 + 1), "the line is damaged", REMOVE);
                if at == 0 {
                    let found: Head = serde_json::from_slice(line).map_err(|_| damaged())?;
                    if found != head {
                        let problem = "it belongs to a search with other data or options";
                        return Err(Error::input(Place::file(&path), problem, "choose another folder, or remove it"));
                    }
                } else {
                    let Line { candidate, evaluated } = serde_json::from_slice(line).map_err(|_| damaged())?;
                    journal.known.insert(key_of(&candidate)?, evaluated);
                }
                whole += line.len() as u64;
            }
            if path == own {
                end_of_own = whole;
            }
        }
        let mut file = File::options()
            .create(true)
            .truncate(false)
            .write(true)
            .open(&own)
            .map_err(|e| Error::io(&own, "open", e))?;
        let end = |file: &mut File| -> std::io::Result<()> {
            file.set_len(end_of_own)?;
            std::io::Seek::seek(file, std::io::SeekFrom::End(0)).map(drop)?;
            if end_of_own == 0 {
                serde_json::to_writer(&mut *file, &head)?;
                file.write_all(b"\n")?;
            }
            Ok(())
        };
        end(&mut file).map_err(|e| Error::io(&own, "write", e))?;
        journal.out = Some((own, file));
        Ok(journal)
    }

    /// The result of a candidate, if it is known.
    ///
    /// # Errors
    /// [`Error::Internal`].
    pub fn find(&self, candidate: &Candidate) -> Result<Option<&Option<Evaluated>>> {
        Ok(self.known.get(&key_of(candidate)?))
    }

    /// Adds results.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn add(&mut self, results: &[(Candidate, Option<Evaluated>)]) -> Result<()> {
        let mut text = Vec::new();
        for (candidate, evaluated) in results {
            let line = Line { candidate: candidate.clone(), evaluated: evaluated.clone() };
            serde_json::to_writer(&mut text, &line).map_err(|e| Error::Internal(format!("a result as JSON: {e}")))?;
            text.push(b'\n');
            self.known.insert(key_of(candidate)?, evaluated.clone());
        }
        let Some((path, file)) = &mut self.out else { return Ok(()) };
        file.write_all(&text).map_err(|e| Error::io(path, "write", e))
    }

    /// All results, by the text of their candidates.
    pub fn all(&self) -> Vec<&Evaluated> {
        let mut all: Vec<(&String, &Evaluated)> =
            self.known.iter().filter_map(|(key, evaluated)| Some((key, evaluated.as_ref()?))).collect();
        all.sort_by(|a, b| a.0.cmp(b.0));
        all.into_iter().map(|(_, evaluated)| evaluated).collect()
    }

    /// Number of candidates, those that could not be fitted included.
    pub fn len(&self) -> usize {
        self.known.len()
    }
}

const REMOVE: &str = "remove the line, or the file: what it held is evaluated again";

fn key_of(candidate: &Candidate) -> Result<String> {
    serde_json::to_string(candidate).map_err(|e| Error::Internal(format!("a candidate as JSON: {e}")))
}
