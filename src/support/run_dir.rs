//! A run's folder: one run at a time writes it, and its record stands beside the files of one run only.
//!
//! Results are written under hidden names. Once all are on the disk, the former record goes, the results get their names in
//! quick succession, and the new record gets its own last. From before the first change until after the last,
//! `unfinished.json` lists every file that may be there: the next run removes what it does not write itself, and readers of
//! files that stand for themselves (recordings) refuse the folder. What no record lists is never removed.
//!
//! Parts of a run share the folder with one another and keep whole runs out: [`parts`](crate::run::parts).

use std::collections::BTreeSet;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::support::atomic_file::{AtomicFile, StagedFile, clear_stale, refuse_link, sync_folder};
use crate::support::files::make_folder;
use crate::support::input_file;
use crate::support::live_files::Live;
use crate::support::lock::FolderLock;
use crate::{Error, Place, Result};

/// Record of a study.
pub const STUDY_RECORD: &str = "run.json";
/// Record of a sampling run.
pub const ESTIMATE_RECORD: &str = "estimate.json";
/// Record of a map.
pub const MAP_RECORD: &str = "map.json";
/// Record of a comparison.
pub const COMPARE_RECORD: &str = "compare.json";
/// Record of a dossier.
pub const DOSSIER_RECORD: &str = "dossier.json";

/// Records of runs that write files of the same names, such as `report.html`: a folder holds one of them.
const RECORDS: [&str; 5] = [STUDY_RECORD, ESTIMATE_RECORD, MAP_RECORD, COMPARE_RECORD, DOSSIER_RECORD];

/// The lock of the whole folder.
const LOCK: &str = "run.lock";

/// Lists the files that a run is giving their names, while it does so.
const UNFINISHED: &str = "unfinished.json";

/// Endings of results: whatever a record lists, nothing else is removed.
const ENDINGS: [&str; 10] = [".csv", ".svg", ".json", ".html", ".txt", ".jsonl", ".parquet", ".xosc", ".xodr", ".sh"];

#[derive(Serialize, Deserialize)]
struct Unfinished {
    /// Its record: once that is there, the files are whole.
    record: String,
    files: Vec<String>,
}

/// The right to write a run's folder, until it is dropped.
#[derive(Debug)]
pub struct OutputDir {
    dir: PathBuf,
    record: Option<&'static str>,
    is_new: bool,
    lock: Option<FolderLock>,
    /// What a signal takes away: the lock, and the folder if it is new and empty.
    live: Vec<Live>,
}

impl OutputDir {
    /// Takes a folder for a run that leaves this record; makes it where it is not there. What killed runs left under
    /// hidden names is removed.
    ///
    /// # Errors
    /// [`Error::Busy`] where another process writes it; [`Error::Usage`] where it holds another verb's run;
    /// [`Error::Input`] for a link in the place of lock or record; [`Error::Io`].
    pub fn open(dir: &Path, record: &'static str) -> Result<OutputDir> {
        let mut folder = OutputDir::take(dir, Some(record), FolderLock::acquire)?;
        folder.enter_lock();
        folder.refuse_another_verb(record)?;
        Ok(folder)
    }

    /// The same for files that each are a result by themselves, without a record.
    ///
    /// # Errors
    /// As [`OutputDir::open`].
    pub fn open_without_record(dir: &Path) -> Result<OutputDir> {
        let mut folder = OutputDir::take(dir, None, FolderLock::acquire)?;
        folder.enter_lock();
        Ok(folder)
    }

    /// The same for a part of a run, together with other parts.
    ///
    /// # Errors
    /// As [`OutputDir::open`]; [`Error::Busy`] only where a whole run or a merge is at work.
    pub fn share(dir: &Path) -> Result<OutputDir> {
        OutputDir::take(dir, None, FolderLock::share)
    }

    fn take(dir: &Path, record: Option<&'static str>, lock: impl Fn(&Path) -> Result<FolderLock>) -> Result<OutputDir> {
        let is_new = !dir.exists();
        make_folder(dir)?;
        let lock = Some(lock(&dir.join(LOCK))?);
        let live = if is_new { vec![Live::enter(dir.to_path_buf())] } else { Vec::new() };
        let folder = OutputDir { dir: dir.to_path_buf(), record, is_new, lock, live };
        record.into_iter().chain([UNFINISHED]).try_for_each(|name| refuse_link(&dir.join(name)))?;
        clear_stale(dir, None);
        Ok(folder)
    }

    /// A lock that nobody shares is this process's to take away.
    fn enter_lock(&mut self) {
        self.live.push(Live::enter(self.dir.join(LOCK)));
    }

    /// Where it is.
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// Begins its results.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn results(&self) -> Result<Results<'_>> {
        // It was there before the work; where it vanished meanwhile, the result is worth another one.
        make_folder(&self.dir)?;
        Ok(Results { folder: self, staged: Vec::new(), elsewhere: Vec::new(), kept: BTreeSet::new() })
    }

    fn refuse_another_verb(&self, record: &str) -> Result<()> {
        let others = RECORDS.iter().filter(|other| RECORDS.contains(&record) && **other != record);
        for other in others {
            if Listed::read(&self.dir.join(other)).program.starts_with("lanesweep ") {
                let problem = format!("it holds the results of another verb, those of {other}");
                let help = "give another option `out`: both would write files of the same names";
                return Err(Error::usage(Place::file(&self.dir), problem, help));
            }
        }
        Ok(())
    }

    /// What the former run left: the files of its record, and those of a run that ended while they got their names.
    fn former(&self) -> BTreeSet<String> {
        let mut files: BTreeSet<String> =
            self.record.into_iter().flat_map(|name| listed(&self.dir.join(name))).collect();
        files.extend(unfinished(&self.dir).into_iter().flatten());
        files
    }
}

impl Drop for OutputDir {
    fn drop(&mut self) {
        self.live.clear();
        self.lock = None;
        if self.is_new {
            // A run that failed leaves no folder of its own: only an empty one goes.
            let _ = std::fs::remove_dir(&self.dir);
        }
    }
}

/// Results of a run that wait under hidden names; dropped before [`Results::publish`], they leave nothing behind.
pub struct Results<'a> {
    folder: &'a OutputDir,
    staged: Vec<(String, StagedFile)>,
    elsewhere: Vec<StagedFile>,
    kept: BTreeSet<String>,
}

impl Results<'_> {
    /// Their folder.
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

    /// Adds a file whose content is produced on the way.
    ///
    /// # Errors
    /// As [`Results::add`].
    pub fn add_with(&mut self, name: &str, produce: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<()> {
        let path = self.folder.dir.join(name);
        let mut file = AtomicFile::create_inside(&path)?;
        produce(&mut file).map_err(|e| Error::io(&path, "write", e))?;
        self.staged.push((name.to_owned(), file.stage()?.closed()));
        Ok(())
    }

    /// Adds a complete file that a user named: in this folder or elsewhere.
    pub(crate) fn join(&mut self, file: StagedFile) {
        let folder_of = |path: &Path| match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder.canonicalize().ok(),
            _ => Path::new(".").canonicalize().ok(),
        };
        let is_inside = folder_of(file.target()) == self.folder.dir.canonicalize().ok();
        match file.target().file_name().and_then(|name| name.to_str()) {
            Some(name) if is_inside => self.staged.push((name.to_owned(), file)),
            _ => self.elsewhere.push(file),
        }
    }

    /// Keeps the former run's files of these names, as files of this one.
    pub fn keep(&mut self, is_kept: impl Fn(&str) -> bool) {
        let is_there = |name: &String| is_kept(name) && self.folder.dir.join(name).is_file();
        self.kept = self.folder.former().into_iter().filter(is_there).collect();
    }

    /// The names of all files in the folder, sorted: what the record lists.
    pub fn names(&self) -> Vec<String> {
        let names = self.staged.iter().map(|(name, _)| name);
        names.chain(&self.kept).cloned().collect::<BTreeSet<String>>().into_iter().collect()
    }

    /// Puts the results, and the record as the last of them, in the place of the former run's.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Usage`] for two files of one name.
    pub fn publish(mut self, record: &[u8]) -> Result<()> {
        let names = self.names();
        let dir = &self.folder.dir;
        let Some(name) = self.folder.record else {
            return Err(Error::Internal("a folder without a record was to get one".to_owned()));
        };
        let mut seen = BTreeSet::from([name]);
        if let Some((doubled, _)) = self.staged.iter().find(|(name, _)| !seen.insert(name)) {
            let problem = "it would be overwritten: it is a result of this run";
            return Err(Error::usage(Place::file(dir.join(doubled)), problem, "choose another path"));
        }
        let mut last = AtomicFile::create_inside(&dir.join(name))?;
        last.append(record)?;
        let last = last.stage()?;
        let written: BTreeSet<&String> = names.iter().collect();
        let stale: Vec<String> = self.folder.former().into_iter().filter(|file| !written.contains(file)).collect();
        let files = names.iter().chain(&stale).cloned().collect();
        let unfinished = serde_json::to_vec(&Unfinished { record: name.to_owned(), files })
            .map_err(|e| Error::Internal(format!("{UNFINISHED} cannot be written: {e}")))?;
        let mut list = AtomicFile::create_inside(&dir.join(UNFINISHED))?;
        list.append(&unfinished)?;
        list.stage()?.publish()?;
        remove(&dir.join(name))?;
        sync_folder(dir);
        stale.iter().try_for_each(|file| remove(&dir.join(file)))?;
        self.elsewhere.drain(..).try_for_each(StagedFile::publish)?;
        self.staged.drain(..).try_for_each(|(_, file)| file.place())?;
        sync_folder(dir);
        last.publish()?;
        remove(&dir.join(UNFINISHED))
    }

    /// Gives the files their names, without a record.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn publish_each(self) -> Result<()> {
        self.staged.into_iter().try_for_each(|(_, file)| file.place())?;
        sync_folder(&self.folder.dir);
        Ok(())
    }
}

fn remove(path: &Path) -> Result<()> {
    match std::fs::remove_file(path) {
        Err(e) if e.kind() != ErrorKind::NotFound => Err(Error::io(path, "remove", e)),
        _ => Ok(()),
    }
}

/// What a record says of itself.
#[derive(Default, Deserialize)]
struct Listed {
    #[serde(default)]
    program: String,
    #[serde(default)]
    files: Vec<String>,
}

impl Listed {
    /// One that cannot be read says nothing.
    fn read(record: &Path) -> Listed {
        let text = input_file::read(record, input_file::MAX_TABLE_BYTES).unwrap_or_default();
        serde_json::from_slice(&text).unwrap_or_default()
    }
}

/// The files beside a record that it lists: plain names of results only.
fn listed(record: &Path) -> Vec<String> {
    let files = if record.extension().is_some_and(|ending| ending == "csv") {
        let text = input_file::read_text(record, input_file::MAX_TABLE_BYTES).unwrap_or_default();
        let rows = csv::Reader::from_reader(text.as_bytes()).into_records().flatten();
        rows.flat_map(|row| row.iter().take(2).map(str::to_owned).collect::<Vec<_>>()).collect()
    } else {
        Listed::read(record).files
    };
    files.into_iter().filter(|name| is_result_name(name)).collect()
}

fn is_result_name(name: &str) -> bool {
    let is_plain = Path::new(name).file_name().is_some_and(|file| file == name) && !name.starts_with('.');
    is_plain && ENDINGS.iter().any(|ending| name.ends_with(ending))
}

/// Does a record in this folder list the file, or is it a record?
pub fn is_listed(dir: &Path, name: &str) -> bool {
    let is_of = |record: &str| {
        let path = dir.join(record);
        path.exists() && (name == record || listed(&path).iter().any(|file| file == name))
    };
    RECORDS.iter().any(|record| is_of(record))
}

/// The files of a folder whose run ended while they got their names; `None` where none did.
pub fn unfinished(dir: &Path) -> Option<Vec<String>> {
    let text = input_file::read(&dir.join(UNFINISHED), input_file::MAX_TABLE_BYTES).ok()?;
    let found: Unfinished = serde_json::from_slice(&text).ok()?;
    // Between the record's name and the end: all is there.
    if is_result_name(&found.record) && dir.join(&found.record).exists() {
        return None;
    }
    Some(found.files.into_iter().filter(|name| is_result_name(name)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn folder(dir: &Path) -> OutputDir {
        OutputDir::open(dir, MAP_RECORD).unwrap()
    }

    fn publish(folder: &OutputDir, names: &[&str], text: &str) {
        let mut results = folder.results().unwrap();
        names.iter().for_each(|name| results.add(name, text.as_bytes()).unwrap());
        let record = serde_json::json!({"program": "lanesweep 0", "files": results.names(), "text": text});
        results.publish(record.to_string().as_bytes()).unwrap();
    }

    fn names(dir: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(dir).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_run_takes_the_place_of_the_one_before_and_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out");
        fs::create_dir(&out).unwrap();
        fs::write(out.join("map-of-germany.svg"), "mine").unwrap();
        publish(&folder(&out), &["a.csv", "b.svg"], "first");
        publish(&folder(&out), &["b.svg", "c.csv"], "second");
        assert_eq!(names(&out), ["b.svg", "c.csv", "map-of-germany.svg", "map.json"]);
        assert_eq!(fs::read_to_string(out.join("b.svg")).unwrap(), "second");
        assert!(is_listed(&out, "b.svg") && is_listed(&out, "map.json") && !is_listed(&out, "map-of-germany.svg"));
    }

    #[test]
    fn a_forged_record_removes_no_file_but_results_in_the_folder_itself() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out");
        fs::create_dir_all(out.join("inner")).unwrap();
        let others = [dir.path().join("a.csv"), out.join("inner/a.csv"), out.join("notes.md"), out.join(".a.csv")];
        others.iter().for_each(|path| fs::write(path, "mine").unwrap());
        let forged =
            serde_json::json!({"files": ["../a.csv", "inner/a.csv", "notes.md", ".a.csv", dir.path().join("a.csv")]});
        fs::write(out.join("map.json"), forged.to_string()).unwrap();
        publish(&folder(&out), &["b.csv"], "text");
        assert!(others.iter().all(|path| path.exists()));
    }

    #[test]
    fn a_run_that_ended_while_its_files_got_their_names_leaves_nothing_beside_the_next() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path();
        // As left by one that had begun to replace another: no record, files of both.
        let list = Unfinished { record: "map.json".to_owned(), files: vec!["a.csv".to_owned(), "b.csv".to_owned()] };
        for (name, text) in [("a.csv", "first"), ("b.csv", "second"), ("other.csv", "mine")] {
            fs::write(out.join(name), text).unwrap();
        }
        fs::write(out.join(UNFINISHED), serde_json::to_vec(&list).unwrap()).unwrap();
        assert_eq!(unfinished(out).unwrap(), ["a.csv", "b.csv"]);
        publish(&folder(out), &["c.csv"], "third");
        assert_eq!(names(out), ["c.csv", "map.json", "other.csv"]);
        // One that had its record already is whole.
        fs::write(out.join(UNFINISHED), serde_json::to_vec(&list).unwrap()).unwrap();
        assert!(unfinished(out).is_none());
    }

    #[test]
    fn a_folder_holds_one_verbs_run_and_one_process() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out");
        let held = folder(&out);
        assert!(matches!(OutputDir::open(&out, STUDY_RECORD), Err(Error::Busy { .. })));
        assert!(matches!(OutputDir::share(&out), Err(Error::Busy { .. })));
        publish(&held, &["report.html"], "map");
        drop(held);
        let error = OutputDir::open(&out, STUDY_RECORD).unwrap_err();
        assert!(matches!(error, Error::Usage { .. }) && error.to_string().contains("map.json"), "{error}");
        assert!(OutputDir::open(&out, "index.csv").is_ok(), "its files have other names");
    }

    #[test]
    fn a_run_that_fails_leaves_no_folder_and_no_file() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out");
        let failed = folder(&out);
        let mut results = failed.results().unwrap();
        results.add("a.csv", b"half").unwrap();
        drop(results);
        drop(failed);
        assert!(!out.exists());
    }

    #[cfg(unix)]
    #[test]
    fn links_in_a_folder_from_somebody_else_lead_nowhere() {
        let dir = tempfile::tempdir().unwrap();
        let (out, precious) = (dir.path().join("out"), dir.path().join("precious"));
        fs::create_dir(&out).unwrap();
        fs::write(&precious, "mine").unwrap();
        for name in [LOCK, MAP_RECORD, UNFINISHED, "a.csv"] {
            std::os::unix::fs::symlink(&precious, out.join(name)).unwrap();
            let refused = match OutputDir::open(&out, MAP_RECORD) {
                Ok(folder) => folder.results().unwrap().add("a.csv", b"text").unwrap_err(),
                Err(error) => error,
            };
            assert!(refused.to_string().contains("this is a link"), "{name}: {refused}");
            fs::remove_file(out.join(name)).unwrap();
        }
        assert_eq!(fs::read_to_string(&precious).unwrap(), "mine");
    }
}
