//! A run directory is empty or ours: one run at a time writes it, and what it holds belongs to exactly one run.
//!
//! `lanesweep-files.json` makes a folder ours. It names the files of the run with the SHA-256 of what lanesweep wrote: a file
//! that has other bytes, or is not named, is the user's and is neither removed nor replaced. Results are written under
//! hidden names. Once all are on disk, the list holds the former and the new files as incomplete, and the former record
//! is removed. Then the results are renamed, the record last, and the list is complete. After a kill in between, the
//! next run removes the listed files that it does not write itself. Readers of recordings refuse an incomplete folder.
//!
//! Parts of a run use the folder together and exclude whole runs: `parts`. What one opens lies in the folder itself, the
//! rest in [`TABLES`] and [`FIGURES`] below it.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::atomic_file::{AtomicFile, Live, StagedFile, clear_stale, folder_of, refuse_link, sync_folder};
use crate::files::{file_name, make_folder, remove_file, write_inside};
use crate::lock::FolderLock;
use crate::table::Table;
use crate::{Error, Place, Result, input_file};

/// Lists the files of the folder's run.
const LIST: &str = "lanesweep-files.json";
/// The lock of the whole folder.
const LOCK: &str = "run.lock";
/// What an unfinished run leaves in a folder that has no list yet; the plan of a run in parts makes a folder ours.
const PLAN: &str = "plan.json";
const WORK: [&str; 3] = [".lock", ".journal", "search.json"];

/// Folders of tables and of figures in that of a run.
pub const TABLES: &str = "tables/";
/// See [`TABLES`].
pub const FIGURES: &str = "figures/";
const INNER: [&str; 2] = [TABLES, FIGURES];

/// The content of [`LIST`].
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct FileList {
    /// The record, which is among the files; none where each file is a result by itself.
    record: Option<String>,
    /// Name and SHA-256; during the renaming those of both runs.
    files: BTreeSet<(String, String)>,
    /// False while the files are being renamed.
    is_complete: bool,
}

impl FileList {
    /// The list of a folder, if it is ours.
    fn read(dir: &Path) -> Option<FileList> {
        let text = input_file::read(&dir.join(LIST), input_file::MAX_TABLE_BYTES).ok()?;
        let list: FileList = serde_json::from_slice(&text).ok()?;
        let is_plain = |name: &str| {
            let name = INNER.iter().find_map(|inner| name.strip_prefix(inner)).unwrap_or(name);
            file_name(Path::new(name)) == name && !name.starts_with('.')
        };
        list.files.iter().all(|(name, _)| is_plain(name)).then_some(list)
    }

    fn write(&self, dir: &Path) -> Result<()> {
        let text = serde_json::to_vec(self).map_err(|e| Error::Internal(format!("{LIST}: {e}")))?;
        write_inside(&dir.join(LIST), |file| file.write_all(&text))
    }

    fn holds(&self, name: &str) -> bool {
        self.files.iter().any(|(file, _)| file == name)
    }
}

/// The right to write a run directory, until it is dropped.
#[derive(Debug)]
pub struct RunFolder {
    dir: PathBuf,
    record: Option<&'static str>,
    is_new: bool,
    lock: Option<FolderLock>,
    /// What a signal removes if it is empty.
    live: Option<Live>,
}

impl RunFolder {
    /// Opens a folder for a run that leaves this record, if any, and creates it if needed. Hidden files of killed runs are
    /// removed.
    ///
    /// # Errors
    /// [`Error::Busy`] if another process writes it; [`Error::Usage`] if it is neither empty nor ours, holds another
    /// verb's run, or a result that was changed since; [`Error::Input`] for a link in the place of lock or list;
    /// [`Error::Io`].
    pub fn open(dir: &Path, record: impl Into<Option<&'static str>>) -> Result<RunFolder> {
        let folder = RunFolder::take(dir, record.into(), FolderLock::acquire)?;
        folder.former()?;
        Ok(folder)
    }

    /// Like [`RunFolder::open`], for a part of a run, together with other parts.
    ///
    /// # Errors
    /// [`Error::Busy`] only if a whole run or a merge is active; [`Error::Input`] as [`RunFolder::open`]; [`Error::Io`].
    pub fn share(dir: &Path) -> Result<RunFolder> {
        RunFolder::take(dir, None, FolderLock::share)
    }

    fn take(dir: &Path, record: Option<&'static str>, lock: impl Fn(&Path) -> Result<FolderLock>) -> Result<RunFolder> {
        let is_new = !dir.exists();
        make_folder(dir)?;
        let lock = Some(lock(&dir.join(LOCK))?);
        let live = is_new.then(|| Live::enter(dir.to_path_buf()));
        let folder = RunFolder { dir: dir.to_path_buf(), record, is_new, lock, live };
        refuse_link(&dir.join(LIST))?;
        clear_stale(dir, None);
        INNER.iter().for_each(|inner| clear_stale(&dir.join(inner), None));
        folder.remove_empty();
        Ok(folder)
    }

    /// Removes folders of tables and figures without any.
    fn remove_empty(&self) {
        for inner in INNER {
            let _ = std::fs::remove_dir(self.dir.join(inner.trim_end_matches('/')));
        }
    }

    /// Path of the folder.
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// Starts the results of the run.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn results(&self) -> Result<Results<'_>> {
        // It existed before the work. If it vanished meanwhile, create it anew to save the result.
        make_folder(&self.dir)?;
        let (staged, sha256, elsewhere) = (Vec::new(), BTreeMap::new(), Vec::new());
        Ok(Results { folder: self, staged, sha256, tables: Vec::new(), elsewhere, named: BTreeSet::new() })
    }

    /// The list of the former run, or of one that ended during renaming, with the files that exist. A folder that is
    /// not ours must be empty.
    fn former(&self) -> Result<FileList> {
        let Some(mut list) = FileList::read(&self.dir) else {
            // It was there when it was locked.
            let vanished = || std::io::Error::other(format!("the folder {} vanished", self.dir.display()));
            let entries = std::fs::read_dir(&self.dir);
            let entries = entries.map_err(|e| if e.kind() == ErrorKind::NotFound { vanished() } else { e });
            let entries = entries.map_err(|e| Error::io(&self.dir, "read", e))?;
            let names = entries.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned());
            // Hidden files are ours; so is a folder of tables or figures with nothing else.
            let is_hidden = |name: &str| name.starts_with('.');
            let holds_hidden = |name: &str| {
                let entries = || std::fs::read_dir(self.dir.join(name)).into_iter().flatten().flatten();
                INNER.iter().any(|inner| inner.trim_end_matches('/') == name)
                    && entries().all(|entry| is_hidden(&entry.file_name().to_string_lossy()))
            };
            let is_work =
                |name: &String| is_hidden(name) || holds_hidden(name) || WORK.iter().any(|end| name.ends_with(end));
            return match names.filter(|name| !is_work(name)).min() {
                Some(name) if !self.dir.join(PLAN).exists() => {
                    Err(self.refusal(&format!("it holds {name} and no {LIST}")))
                }
                _ => Ok(FileList::default()),
            };
        };
        if list.record.as_deref() != self.record {
            let record = list.record.map_or(String::new(), |record| format!(", those of {record}"));
            return Err(self.refusal(&format!("it holds the results of another verb{record}")));
        }
        list.files.retain(|(name, _)| self.dir.join(name).symlink_metadata().is_ok());
        for (name, _) in &list.files {
            let path = self.dir.join(name);
            refuse_link(&path)?;
            input_file::claim_output(&path)?;
            if !list.files.contains(&(name.clone(), input_file::sha256(&path)?)) {
                return Err(self.refusal(&format!("{name} was changed after lanesweep wrote it")));
            }
        }
        Ok(list)
    }

    fn refusal(&self, problem: &str) -> Error {
        let help = "give a new or empty folder; a run replaces only what an earlier one left as it was";
        Error::usage(Place::file(&self.dir), problem, help)
    }
}

impl Drop for RunFolder {
    fn drop(&mut self) {
        self.remove_empty();
        self.live = None;
        self.lock = None;
        if self.is_new {
            // A failed run leaves no new folder: this removes only an empty one.
            let _ = std::fs::remove_dir(&self.dir);
        }
    }
}

/// The files of a run, for its record.
#[derive(Debug, Clone, Default, Serialize)]
pub struct ResultFiles {
    /// Sorted names.
    pub files: Vec<String>,
    /// SHA-256 of each file that this run has written itself, by its name.
    pub files_sha256: BTreeMap<String, String>,
    /// The tables, by their names without folder and ending.
    #[serde(skip)]
    pub tables: Vec<NamedTable>,
}

/// A table of a result and its name.
pub type NamedTable = (String, Table);

/// Results of a run under hidden names; dropping them before [`Results::publish`] removes them.
pub struct Results<'a> {
    folder: &'a RunFolder,
    staged: Vec<(String, StagedFile)>,
    sha256: BTreeMap<String, String>,
    tables: Vec<NamedTable>,
    elsewhere: Vec<StagedFile>,
    /// Files in this folder whose paths the user gave; they may replace any file.
    named: BTreeSet<String>,
}

impl Results<'_> {
    /// Path of the folder.
    pub fn dir(&self) -> &Path {
        &self.folder.dir
    }

    /// Adds a file.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] for a link in its place.
    pub fn add(&mut self, name: &str, content: &[u8]) -> Result<()> {
        self.add_with(name, |file| file.write_all(content))
    }

    /// Adds a file whose content is streamed.
    ///
    /// # Errors
    /// As [`Results::add`].
    pub fn add_with(&mut self, name: &str, produce: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<()> {
        let path = self.folder.dir.join(name);
        if let Some(inner) = INNER.iter().find(|inner| name.starts_with(**inner)) {
            let inner = self.folder.dir.join(inner.trim_end_matches('/'));
            // A link would lead elsewhere.
            if inner.symlink_metadata().is_ok_and(|about| !about.is_dir()) {
                refuse_link(&inner)?;
            }
            make_folder(&inner)?;
        }
        let mut file = AtomicFile::create_inside(&path)?;
        produce(&mut file).map_err(|e| Error::io(&path, "write", e))?;
        let file = file.stage()?.closed();
        self.sha256.insert(name.to_owned(), input_file::sha256(&file.path)?);
        self.staged.push((name.to_owned(), file));
        Ok(())
    }

    /// Adds a table as a CSV file.
    ///
    /// # Errors
    /// As [`Results::add`].
    pub fn add_table(&mut self, name: &str, table: Table) -> Result<()> {
        self.add(name, table.csv().as_bytes())?;
        let stem = name.rsplit('/').next().unwrap_or(name).trim_end_matches(".csv");
        self.keep_table(stem, table);
        Ok(())
    }

    /// Adds a table that the record holds, without a file.
    pub fn keep_table(&mut self, name: &str, table: Table) {
        self.tables.push((name.to_owned(), table));
    }

    /// Adds a complete file of this folder.
    pub fn add_staged(&mut self, file: StagedFile) {
        self.staged.push((file_name(&file.target), file.closed()));
    }

    /// Adds a complete file that a user named, in this folder or elsewhere.
    pub fn join(&mut self, file: StagedFile) {
        if folder_of(&file.target).canonicalize().ok() == self.folder.dir.canonicalize().ok() {
            self.named.insert(file_name(&file.target));
            self.add_staged(file);
        } else {
            self.elsewhere.push(file);
        }
    }

    /// The sorted names of all files in the folder.
    pub fn names(&self) -> Vec<String> {
        self.staged.iter().map(|(name, _)| name.clone()).collect::<BTreeSet<String>>().into_iter().collect()
    }

    /// All files in the folder, for the record; takes the tables.
    pub fn files(&mut self) -> ResultFiles {
        let tables = std::mem::take(&mut self.tables);
        ResultFiles { files: self.names(), files_sha256: self.sha256.clone(), tables }
    }

    /// Replaces the former run's results by these; the record is renamed last.
    ///
    /// # Errors
    /// As [`Results::publish_all`].
    pub fn publish(mut self, record: &[u8]) -> Result<()> {
        let Some(name) = self.folder.record else {
            return Err(Error::Internal("a folder without a record was to get one".to_owned()));
        };
        self.add(name, record)?;
        self.publish_all()
    }

    /// The same, where each file is a result by itself.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Usage`] for two files of one name, or a file of the user's in the way.
    pub fn publish_all(mut self) -> Result<()> {
        let (folder, dir) = (self.folder, &self.folder.dir);
        let former = folder.former()?;
        let mut list = FileList { record: folder.record.map(str::to_owned), files: BTreeSet::new(), is_complete: true };
        for (name, file) in &self.staged {
            let is_ours = former.holds(name) || self.named.contains(name) || dir.join(name).symlink_metadata().is_err();
            if !is_ours || list.holds(name) {
                let problem = "this run would replace it, and no earlier run wrote it";
                return Err(Error::usage(Place::file(dir.join(name)), problem, "choose another name or folder"));
            }
            let sha256 = self.sha256.remove(name).map_or_else(|| input_file::sha256(&file.path), Ok)?;
            list.files.insert((name.clone(), sha256));
        }
        let both = former.files.union(&list.files).cloned().collect();
        FileList { record: list.record.clone(), files: both, is_complete: false }.write(dir)?;
        folder.record.map_or(Ok(()), |record| remove_file(&dir.join(record)))?;
        sync_folder(dir);
        let stale = former.files.iter().filter(|(name, _)| !list.holds(name));
        stale.map(|(name, _)| dir.join(name)).try_for_each(|path| remove_file(&path))?;
        self.elsewhere.into_iter().try_for_each(StagedFile::publish)?;
        let last = self.staged.pop();
        self.staged.into_iter().try_for_each(|(_, file)| file.place())?;
        [dir.clone()].into_iter().chain(INNER.map(|inner| dir.join(inner))).for_each(|dir| sync_folder(&dir));
        last.map_or(Ok(()), |(_, file)| file.publish())?;
        list.write(dir)
    }
}

/// Whether this is a result of the run in the folder.
pub fn is_listed(dir: &Path, name: &str) -> bool {
    FileList::read(dir).is_some_and(|list| list.holds(name))
}

/// The files of a run that ended during renaming; `None` if it is complete.
pub fn unfinished(dir: &Path) -> Option<Vec<String>> {
    let is_cut =
        |list: &FileList| !list.is_complete && list.record.as_ref().is_some_and(|name| !dir.join(name).exists());
    Some(FileList::read(dir).filter(is_cut)?.files.into_iter().map(|(name, _)| name).collect())
}
