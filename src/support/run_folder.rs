//! A run directory: one run at a time writes it, and its record belongs to the files of exactly one run.
//!
//! `lanesweep-files.json` lists the files of every run in the folder; without it, the runs' records do. Files that are not
//! listed are neither removed nor replaced. Results are written under hidden names. Once all are on disk, the list holds the
//! former and the new files as incomplete, and the former record is removed. Then the results are renamed, the new
//! record is renamed last, and the list is complete. After a kill in between, the next run removes the listed files
//! that it does not write itself. Readers of independent files (recordings) refuse an incomplete folder.
//!
//! Parts of a run use the folder together and exclude whole runs: `parts`.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::support::atomic_file::folder_of;
use crate::support::atomic_file::{AtomicFile, Live, StagedFile, clear_stale, refuse_link, sync_folder};
pub use crate::support::file_list::{ESTIMATE_RECORD, MAP_RECORD, STUDY_RECORD};
use crate::support::file_list::{FileList, LIST, RECORDS, RunFiles};
use crate::support::files::{make_folder, remove_file};
use crate::support::lock::FolderLock;
use crate::{Error, Place, Result};

/// The lock of the whole folder.
const LOCK: &str = "run.lock";

/// The right to write a run directory, until it is dropped.
#[derive(Debug)]
pub struct RunFolder {
    dir: PathBuf,
    record: Option<&'static str>,
    is_new: bool,
    lock: Option<FolderLock>,
    /// What a signal removes: the lock, and the folder if it is new and empty.
    live: Vec<Live>,
}

impl RunFolder {
    /// Opens a folder for a run that leaves this record, and creates it if needed. Hidden files of killed runs are
    /// removed.
    ///
    /// # Errors
    /// [`Error::Busy`] if another process writes it; [`Error::Usage`] if it holds another verb's run, or unlisted files
    /// with the names of this run's; [`Error::Input`] for a link in the place of lock or record; [`Error::Io`].
    pub fn open(dir: &Path, record: &'static str) -> Result<RunFolder> {
        let mut folder = RunFolder::take(dir, Some(record), FolderLock::acquire)?;
        folder.enter_lock();
        folder.refuse_another_verb(record)?;
        let usual_files = RECORDS.iter().filter(|(name, _)| *name == record).flat_map(|(_, files)| *files);
        folder.refuse_foreign(usual_files.copied().chain([record]))?;
        Ok(folder)
    }

    /// Like [`RunFolder::open`], for files that are independent results, without a record.
    ///
    /// # Errors
    /// As [`RunFolder::open`].
    pub fn open_without_record(dir: &Path) -> Result<RunFolder> {
        let mut folder = RunFolder::take(dir, None, FolderLock::acquire)?;
        folder.enter_lock();
        Ok(folder)
    }

    /// Like [`RunFolder::open`], for a part of a run, together with other parts.
    ///
    /// # Errors
    /// As [`RunFolder::open`]; [`Error::Busy`] only if a whole run or a merge is active.
    pub fn share(dir: &Path) -> Result<RunFolder> {
        RunFolder::take(dir, None, FolderLock::share)
    }

    fn take(dir: &Path, record: Option<&'static str>, lock: impl Fn(&Path) -> Result<FolderLock>) -> Result<RunFolder> {
        let is_new = !dir.exists();
        make_folder(dir)?;
        let lock = Some(lock(&dir.join(LOCK))?);
        let live = if is_new { vec![Live::enter(dir.to_path_buf())] } else { Vec::new() };
        let folder = RunFolder { dir: dir.to_path_buf(), record, is_new, lock, live };
        record.into_iter().chain([LIST]).try_for_each(|name| refuse_link(&dir.join(name)))?;
        clear_stale(dir, None);
        Ok(folder)
    }

    /// Registers an exclusive lock for removal by a signal.
    fn enter_lock(&mut self) {
        self.live.push(Live::enter(self.dir.join(LOCK)));
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
        let (kept, named) = (BTreeSet::new(), BTreeSet::new());
        let (staged, sha256, elsewhere) = (Vec::new(), BTreeMap::new(), Vec::new());
        Ok(Results { folder: self, staged, sha256, elsewhere, kept, named })
    }

    fn refuse_another_verb(&self, record: &str) -> Result<()> {
        let is_one = |name: &str| RECORDS.iter().any(|(record, _)| *record == name);
        let of_another = |run: &&RunFiles| {
            let other = run.record.as_deref().unwrap_or_default();
            is_one(record) && is_one(other) && other != record
        };
        if let Some(run) = FileList::read(&self.dir).runs.iter().find(of_another) {
            let other = run.record.as_deref().unwrap_or_default();
            let problem = format!("it holds the results of another verb, those of {other}");
            let help = "give another option `out`: both would write files of the same names";
            return Err(Error::usage(Place::file(&self.dir), problem, help));
        }
        Ok(())
    }

    /// Refuses to replace files that no run in this folder wrote.
    fn refuse_foreign<'n>(&self, names: impl Iterator<Item = &'n str>) -> Result<()> {
        let list = FileList::read(&self.dir);
        let is_foreign = |name: &&str| !list.holds(name) && self.dir.join(name).symlink_metadata().is_ok();
        let Some(name) = { names }.find(is_foreign) else { return Ok(()) };
        refuse_link(&self.dir.join(name))?;
        let problem = format!("it would be overwritten, and {LIST} does not list it as a result of an earlier run");
        let help = "move it away, or give another option `out`";
        Err(Error::usage(Place::file(self.dir.join(name)), problem, help))
    }

    /// The files that the former run left, including those of a run that ended during renaming.
    fn former(&self) -> BTreeSet<String> {
        FileList::read(&self.dir).take(self.record).files.into_iter().collect()
    }

    /// Writes the list of this folder's run.
    fn list(&self, files: BTreeSet<String>, is_complete: bool) -> Result<()> {
        let mut list = FileList::read(&self.dir);
        list.take(self.record);
        let record = self.record.map(str::to_owned);
        list.runs.push(RunFiles { record, files: files.into_iter().collect(), is_complete });
        list.write(&self.dir)
    }
}

impl Drop for RunFolder {
    fn drop(&mut self) {
        self.live.clear();
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
}

/// Results of a run under hidden names; dropping them before [`Results::publish`] removes them.
pub struct Results<'a> {
    folder: &'a RunFolder,
    staged: Vec<(String, StagedFile)>,
    sha256: BTreeMap<String, String>,
    elsewhere: Vec<StagedFile>,
    kept: BTreeSet<String>,
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
        let mut file = AtomicFile::create_inside(&path)?;
        produce(&mut file).map_err(|e| Error::io(&path, "write", e))?;
        let file = file.stage()?.closed();
        self.sha256.insert(name.to_owned(), file.sha256()?);
        self.staged.push((name.to_owned(), file));
        Ok(())
    }

    /// Adds a complete file that a user named, in this folder or elsewhere.
    pub fn join(&mut self, file: StagedFile) {
        let is_inside = folder_of(file.target()).canonicalize().ok() == self.folder.dir.canonicalize().ok();
        match file.target().file_name().and_then(|name| name.to_str()) {
            Some(name) if is_inside => {
                self.named.insert(name.to_owned());
                self.staged.push((name.to_owned(), file));
            }
            _ => self.elsewhere.push(file),
        }
    }

    /// Keeps the former run's files of these names as files of this run.
    pub fn keep(&mut self, is_kept: impl Fn(&str) -> bool) {
        let is_there = |name: &String| is_kept(name) && self.folder.dir.join(name).is_file();
        self.kept = self.folder.former().into_iter().filter(is_there).collect();
    }

    /// The sorted names of all files in the folder.
    pub fn names(&self) -> Vec<String> {
        let names = self.staged.iter().map(|(name, _)| name);
        names.chain(&self.kept).cloned().collect::<BTreeSet<String>>().into_iter().collect()
    }

    /// All files in the folder, for the record.
    pub fn files(&self) -> ResultFiles {
        ResultFiles { files: self.names(), files_sha256: self.sha256.clone() }
    }

    /// Replaces the former run's results by these; the record is renamed last.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Usage`] for two files of one name, or an unlisted file in the way.
    pub fn publish(mut self, record: &[u8]) -> Result<()> {
        let names: BTreeSet<String> = self.names().into_iter().collect();
        let (folder, dir) = (self.folder, &self.folder.dir);
        let Some(name) = folder.record else {
            return Err(Error::Internal("a folder without a record was to get one".to_owned()));
        };
        let mut seen = BTreeSet::from([name]);
        if let Some((doubled, _)) = self.staged.iter().find(|(name, _)| !seen.insert(name)) {
            let problem = "it would be overwritten: it is a result of this run";
            return Err(Error::usage(Place::file(dir.join(doubled)), problem, "choose another path"));
        }
        self.refuse_foreign([name])?;
        let mut last = AtomicFile::create_inside(&dir.join(name))?;
        last.append(record)?;
        let last = last.stage()?;
        let stale: Vec<String> = folder.former().into_iter().filter(|file| !names.contains(file)).collect();
        folder.list(names.iter().chain(&stale).cloned().collect(), false)?;
        remove_file(&dir.join(name))?;
        sync_folder(dir);
        stale.iter().try_for_each(|file| remove_file(&dir.join(file)))?;
        self.elsewhere.drain(..).try_for_each(StagedFile::publish)?;
        self.staged.drain(..).try_for_each(|(_, file)| file.place())?;
        sync_folder(dir);
        last.publish()?;
        folder.list(names, true)
    }

    /// Renames the files beside those of earlier runs, without a record.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Usage`] for an unlisted file in the way.
    pub fn publish_each(self) -> Result<()> {
        self.refuse_foreign([])?;
        let folder = self.folder;
        let mut files = folder.former();
        files.extend(self.names());
        folder.list(files, true)?;
        self.staged.into_iter().try_for_each(|(_, file)| file.place())?;
        sync_folder(&folder.dir);
        Ok(())
    }

    fn refuse_foreign<const N: usize>(&self, record: [&str; N]) -> Result<()> {
        let staged = self.staged.iter().map(|(name, _)| name.as_str()).filter(|name| !self.named.contains(*name));
        self.folder.refuse_foreign(staged.chain(record))
    }
}

/// Whether this is a result of a run in the folder, or its record.
pub fn is_listed(dir: &Path, name: &str) -> bool {
    FileList::read(dir).holds(name)
}

/// The files of runs that ended during renaming; `None` if all runs are complete.
pub fn unfinished(dir: &Path) -> Option<Vec<String>> {
    let is_cut = |run: &RunFiles| !run.is_complete && run.record.as_ref().is_some_and(|name| !dir.join(name).exists());
    let cut: Vec<RunFiles> = FileList::read(dir).runs.into_iter().filter(is_cut).collect();
    (!cut.is_empty()).then(|| cut.into_iter().flat_map(|run| run.files).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn folder(dir: &Path) -> RunFolder {
        RunFolder::open(dir, MAP_RECORD).unwrap()
    }

    fn publish(folder: &RunFolder, names: &[&str], text: &str) {
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
        assert_eq!(names(&out), ["b.svg", "c.csv", LIST, "map-of-germany.svg", "map.json"]);
        assert_eq!(fs::read_to_string(out.join("b.svg")).unwrap(), "second");
        assert!(is_listed(&out, "b.svg") && is_listed(&out, "map.json") && !is_listed(&out, "map-of-germany.svg"));
    }

    fn refusal(result: Result<RunFolder>) -> String {
        let error = result.unwrap_err();
        assert!(matches!(error, Error::Usage { .. } | Error::Input { .. }), "{error}");
        error.to_string()
    }

    #[test]
    fn what_a_foreign_record_names_stays_and_the_record_is_refused_by_name() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path();
        fs::write(out.join("a.csv"), "mine").unwrap();
        let foreign = r#"{"program":"QGIS 3","files":["a.csv"]}"#;
        fs::write(out.join(MAP_RECORD), foreign).unwrap();
        assert!(refusal(RunFolder::open(out, MAP_RECORD)).contains(MAP_RECORD));
        assert_eq!(fs::read_to_string(out.join(MAP_RECORD)).unwrap(), foreign);
        fs::remove_file(out.join(MAP_RECORD)).unwrap();
        fs::write(out.join("report.html"), "mine").unwrap();
        assert!(refusal(RunFolder::open(out, MAP_RECORD)).contains("report.html"), "before the work starts");
        fs::remove_file(out.join("report.html")).unwrap();
        let folder = folder(out);
        let mut results = folder.results().unwrap();
        results.add("a.csv", b"text").unwrap();
        let error = results.publish(b"{}").unwrap_err();
        assert!(error.to_string().contains("a.csv") && error.to_string().contains("does not list it"), "{error}");
        assert_eq!(names(out), ["a.csv", LOCK]);
        assert_eq!(fs::read_to_string(out.join("a.csv")).unwrap(), "mine");
    }

    #[test]
    fn without_a_readable_list_the_record_tells_which_files_are_the_runs() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path();
        publish(&folder(out), &["a.csv", "b.csv"], "first");
        fs::write(out.join("mine.csv"), "mine").unwrap();
        let whole = fs::read_to_string(out.join(LIST)).unwrap();
        for changed in [None, Some("{}"), Some("mine"), Some(&whole[..40]), Some(&whole.replace("a.csv", "../a.csv"))] {
            let _ = changed.map_or_else(|| fs::remove_file(out.join(LIST)), |text| fs::write(out.join(LIST), text));
            assert!(is_listed(out, "a.csv") && !is_listed(out, "mine.csv"), "{changed:?}");
            publish(&folder(out), &["a.csv", "b.csv"], "second");
        }
        fs::remove_file(out.join(LIST)).unwrap();
        publish(&folder(out), &["b.csv"], "third");
        assert_eq!(names(out), ["b.csv", LIST, "map.json", "mine.csv"]);
    }

    #[test]
    fn a_run_that_ended_while_its_files_got_their_names_leaves_nothing_beside_the_next() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path();
        // A run that ended while it replaced another: no record, files of both.
        let cut = || {
            let files = vec!["a.csv".to_owned(), "b.csv".to_owned()];
            let run = RunFiles { record: Some("map.json".to_owned()), files, is_complete: false };
            FileList::of(vec![run]).write(out).unwrap();
        };
        for (name, text) in [("a.csv", "first"), ("b.csv", "second"), ("other.csv", "mine")] {
            fs::write(out.join(name), text).unwrap();
        }
        cut();
        assert_eq!(unfinished(out).unwrap(), ["a.csv", "b.csv"]);
        publish(&folder(out), &["c.csv"], "third");
        assert_eq!(names(out), ["c.csv", LIST, "map.json", "other.csv"]);
        // A run that already has its record is complete.
        cut();
        assert!(unfinished(out).is_none());
    }

    #[test]
    fn files_without_a_record_stay_beside_one_another_and_replace_no_foreign_file() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path();
        let add = |name: &str, text: &str| {
            let folder = RunFolder::open_without_record(out).unwrap();
            let mut results = folder.results().unwrap();
            results.add(name, text.as_bytes()).unwrap();
            results.publish_each()
        };
        add("a.json", "first").unwrap();
        add("b.json", "second").unwrap();
        add("a.json", "third").unwrap();
        fs::write(out.join("c.json"), "mine").unwrap();
        assert!(add("c.json", "fourth").unwrap_err().to_string().contains("c.json"));
        let texts: Vec<String> =
            ["a.json", "b.json", "c.json"].map(|n| fs::read_to_string(out.join(n)).unwrap()).into();
        assert_eq!(texts, ["third", "second", "mine"]);
    }

    #[test]
    fn a_folder_holds_one_verbs_run_and_one_process() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out");
        let held = folder(&out);
        assert!(matches!(RunFolder::open(&out, STUDY_RECORD), Err(Error::Busy { .. })));
        assert!(matches!(RunFolder::share(&out), Err(Error::Busy { .. })));
        publish(&held, &["report.html"], "map");
        drop(held);
        let error = RunFolder::open(&out, STUDY_RECORD).unwrap_err();
        assert!(matches!(error, Error::Usage { .. }) && error.to_string().contains("map.json"), "{error}");
        assert!(RunFolder::open(&out, "index.csv").is_ok(), "its files have other names");
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
        for name in [LOCK, MAP_RECORD, LIST, "a.csv"] {
            std::os::unix::fs::symlink(&precious, out.join(name)).unwrap();
            let refused = match RunFolder::open(&out, MAP_RECORD) {
                Ok(folder) => folder.results().unwrap().add("a.csv", b"text").unwrap_err(),
                Err(error) => error,
            };
            assert!(refused.to_string().contains("this is a link"), "{name}: {refused}");
            fs::remove_file(out.join(name)).unwrap();
        }
        assert_eq!(fs::read_to_string(&precious).unwrap(), "mine");
    }
}
