//! Evaluated candidates in files: a line of JSON each, appended as they come. A search that is started again reads them in
//! place of evaluating; shards read one another's.

use std::collections::{BTreeSet, HashMap};
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::{Candidate, Evaluated};
use crate::run::parts::Shard;
use crate::support::input_file;
use crate::support::plain_text::sha256;
use crate::{Error, Place, Result};

#[derive(Serialize, Deserialize, PartialEq)]
struct Head {
    lanesweep_search: u64,
    search_sha256: String,
}

/// A line: a candidate and its result, `None` for one that cannot be fitted, and the checksum of both.
#[derive(Serialize, Deserialize)]
struct Line {
    candidate: Candidate,
    evaluated: Option<Evaluated>,
    sha256: String,
}

impl Line {
    fn checksum(candidate: &Candidate, evaluated: &Option<Evaluated>) -> Result<String> {
        let text = serde_json::to_string(&(candidate, evaluated));
        Ok(sha256(text.map_err(|e| Error::Internal(format!("a result as JSON: {e}")))?))
    }
}

/// What has been evaluated, and the file that new results go to.
pub(super) struct Journal {
    known: HashMap<String, Option<Evaluated>>,
    /// Candidates of this run: the folder may hold those of a larger one.
    asked: BTreeSet<String>,
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
        let mut journal = Journal { known: HashMap::new(), asked: BTreeSet::new(), out: None };
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
                    let none = |_| Error::input(Place::file(&path), "it is no journal of a search", "move it away");
                    let found: Head = serde_json::from_slice(line).map_err(none)?;
                    if found != head {
                        let problem = "it belongs to a search with other data or options";
                        return Err(Error::input(Place::file(&path), problem, "choose another folder, or remove it"));
                    }
                } else {
                    let Line { candidate, evaluated, sha256 } = serde_json::from_slice(line).map_err(|_| damaged())?;
                    if Line::checksum(&candidate, &evaluated)? != sha256 {
                        return Err(damaged());
                    }
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
    pub fn find(&mut self, candidate: &Candidate) -> Result<Option<&Option<Evaluated>>> {
        let key = key_of(candidate)?;
        let found = self.known.get(&key);
        self.asked.insert(key);
        Ok(found)
    }

    /// Adds results.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn add(&mut self, results: &[(Candidate, Option<Evaluated>)]) -> Result<()> {
        let mut text = Vec::new();
        for (candidate, evaluated) in results {
            let sha256 = Line::checksum(candidate, evaluated)?;
            let line = Line { candidate: candidate.clone(), evaluated: evaluated.clone(), sha256 };
            serde_json::to_writer(&mut text, &line).map_err(|e| Error::Internal(format!("a result as JSON: {e}")))?;
            text.push(b'\n');
            self.known.insert(key_of(candidate)?, evaluated.clone());
        }
        let Some((path, file)) = &mut self.out else { return Ok(()) };
        file.write_all(&text).map_err(|e| Error::io(path, "write", e))
    }

    /// The results of this run, by the text of their candidates.
    pub fn all(&self) -> Vec<&Evaluated> {
        self.asked.iter().filter_map(|key| self.known.get(key)?.as_ref()).collect()
    }

    /// Number of candidates of this run, those that could not be fitted included.
    pub fn len(&self) -> usize {
        self.asked.len()
    }
}

const REMOVE: &str = "remove the line, or the file: what it held is evaluated again";

fn key_of(candidate: &Candidate) -> Result<String> {
    serde_json::to_string(candidate).map_err(|e| Error::Internal(format!("a candidate as JSON: {e}")))
}
