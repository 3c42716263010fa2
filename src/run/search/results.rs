//! Evaluated candidates: in memory, and in a journal. A search that is started again reads them in place of evaluating;
//! the run that concludes reads those of all shards.

use std::collections::{BTreeSet, HashMap};
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{Candidate, Evaluated};
use crate::run::parts::{Journal, Shard, run_of_journal};
use crate::support::input_file;
use crate::support::lock::FolderLock;
use crate::support::run_folder::SEARCH_RECORD;
use crate::{Error, Result};

/// A record: a candidate and its result, `None` for one that cannot be fitted.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Tried {
    pub candidate: Candidate,
    pub evaluated: Option<Evaluated>,
}

/// What has been evaluated.
pub(super) struct Results {
    known: HashMap<String, Option<Evaluated>>,
    /// Candidates of this run: the folder may hold those of a larger one.
    asked: BTreeSet<String>,
    journal: Option<Journal<Tried>>,
    _shard: Option<FolderLock>,
}

impl Results {
    /// Opens the journal in a folder; without a folder, results are only remembered. Without a shard, the journals of all
    /// shards are read too, so no shard may be running.
    ///
    /// # Errors
    /// Those of [`Journal::open`]; [`Error::Busy`] if another process evaluates the shard.
    pub(super) fn open(folder: Option<&Path>, shard: Option<Shard>, search_sha256: &str) -> Result<Results> {
        let mut results = Results { known: HashMap::new(), asked: BTreeSet::new(), journal: None, _shard: None };
        let Some(folder) = folder else { return Ok(results) };
        let stem = shard.map_or("search".to_owned(), |shard| format!("search-{}-of-{}", shard.index, shard.of));
        let own = format!("{stem}.journal");
        let mut names = BTreeSet::from([own.clone()]);
        if shard.is_some() {
            results._shard = Some(FolderLock::acquire(&folder.join(format!("{stem}.lock")))?);
        } else {
            let listed = std::fs::read_dir(folder).map_err(|e| Error::io(folder, "list", e))?;
            let listed = listed.flatten().filter_map(|entry| entry.file_name().into_string().ok());
            names.extend(listed.filter(|name| name.starts_with("search-") && name.ends_with(".journal")));
        }
        let finished = finished_search(folder);
        for name in names {
            let path = folder.join(&name);
            // The record has what a finished search found; an unfinished one may continue.
            if finished.as_deref().is_some_and(|finished| finished != search_sha256)
                && run_of_journal(&path) == finished
            {
                std::fs::remove_file(&path).map_err(|e| Error::io(&path, "remove", e))?;
            }
            // A result names its candidate; there are no units.
            let (journal, found) = Journal::open(&path, search_sha256, 0..0)?;
            if found.torn {
                tracing::warn!("{}: the last record is not whole; it is computed again", journal.path().display());
            }
            for Tried { candidate, evaluated } in found.records {
                results.known.insert(key_of(&candidate)?, evaluated);
            }
            if name == own {
                results.journal = Some(journal);
            }
        }
        Ok(results)
    }

    /// The result of a candidate, if it is known.
    ///
    /// # Errors
    /// [`Error::Internal`].
    pub(super) fn find(&mut self, candidate: &Candidate) -> Result<Option<&Option<Evaluated>>> {
        let key = key_of(candidate)?;
        let found = self.known.get(&key);
        self.asked.insert(key);
        Ok(found)
    }

    /// Adds results.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(super) fn add(&mut self, tried: Vec<Tried>) -> Result<()> {
        if let Some(journal) = self.journal.as_mut().filter(|_| !tried.is_empty()) {
            journal.append(&tried)?;
        }
        for Tried { candidate, evaluated } in tried {
            self.known.insert(key_of(&candidate)?, evaluated);
        }
        Ok(())
    }

    /// The results of this run, by the text of their candidates.
    pub(super) fn all(&self) -> Vec<Evaluated> {
        self.asked.iter().filter_map(|key| self.known.get(key)?.clone()).collect()
    }

    /// Number of candidates of this run, those that could not be fitted included.
    pub(super) fn len(&self) -> usize {
        self.asked.len()
    }
}

/// Hash of the search whose record is in the folder.
fn finished_search(folder: &Path) -> Option<String> {
    #[derive(Deserialize)]
    struct Record {
        search_sha256: String,
    }
    let text = input_file::read(&folder.join(SEARCH_RECORD), input_file::MAX_TABLE_BYTES).ok()?;
    serde_json::from_slice::<Record>(&text).ok().map(|record| record.search_sha256)
}

fn key_of(candidate: &Candidate) -> Result<String> {
    serde_json::to_string(candidate).map_err(|e| Error::Internal(format!("a candidate as JSON: {e}")))
}
