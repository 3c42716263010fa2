//! The list of a folder's results: `lanesweep-files.json`. It distinguishes lanesweep's files from all others.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::support::files::write_inside;
use crate::support::input_file;
use crate::{Error, Result};

/// Record of a study.
pub const STUDY_RECORD: &str = "run.json";
/// Record of a sampling run.
pub const ESTIMATE_RECORD: &str = "estimate.json";
/// Record of a map.
pub const MAP_RECORD: &str = "map.json";

/// Records of runs that write files with the same names, such as `report.html`: a folder holds one of them. With the other
/// files that every such run writes: a user's file of such a name is detected before the work starts.
pub(super) const RECORDS: [(&str, &[&str]); 3] = [
    (STUDY_RECORD, &["failures.csv", "f1.csv", "claims.csv", "headways.csv", "report.html"]),
    (ESTIMATE_RECORD, &["estimates.csv", "report.html"]),
    (MAP_RECORD, &["cells.csv", "report.html"]),
];

/// Lists the files of the runs in a folder.
pub(super) const LIST: &str = "lanesweep-files.json";

const VERSION: u64 = 1;

/// The files of one run, or of all runs without a record.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RunFiles {
    /// Name of the run's record.
    pub(super) record: Option<String>,
    /// Names of the other files.
    pub(super) files: Vec<String>,
    /// False while the files are being renamed. If the record exists, all of them are complete.
    pub(super) is_complete: bool,
}

/// The content of [`LIST`].
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct FileList {
    lanesweep_files: u64,
    pub(super) runs: Vec<RunFiles>,
}

/// The part of a run's record that names its files.
#[derive(Deserialize)]
struct RecordFiles {
    program: String,
    files: Vec<String>,
}

impl FileList {
    /// A list of these runs.
    pub(super) fn of(runs: Vec<RunFiles>) -> FileList {
        FileList { lanesweep_files: VERSION, runs }
    }

    /// Reads the list of a folder. Without a readable list (results that were copied without it), the records of the runs
    /// tell their files.
    pub(super) fn read(dir: &Path) -> FileList {
        let read = |name: &str| input_file::read(&dir.join(name), input_file::MAX_TABLE_BYTES).ok();
        let is_plain = |name: &String| {
            Path::new(name).file_name().is_some_and(|file| file == name.as_str()) && !name.starts_with('.')
        };
        let list = read(LIST).and_then(|text| serde_json::from_slice::<FileList>(&text).ok()).filter(|list| {
            list.lanesweep_files == VERSION
                && list.runs.iter().flat_map(|run| run.files.iter().chain(&run.record)).all(is_plain)
        });
        let of_record = |(name, _): &(&str, &[&str])| {
            let record: RecordFiles = serde_json::from_slice(&read(name)?).ok()?;
            let is_ours = record.program.starts_with("lanesweep ") && record.files.iter().all(is_plain);
            is_ours.then(|| RunFiles { record: Some((*name).to_owned()), files: record.files, is_complete: true })
        };
        list.unwrap_or_else(|| FileList::of(RECORDS.iter().filter_map(of_record).collect()))
    }

    pub(super) fn write(mut self, dir: &Path) -> Result<()> {
        self.runs.sort_by(|a, b| a.record.cmp(&b.record));
        let text = serde_json::to_vec(&self).map_err(|e| Error::Internal(format!("{LIST}: {e}")))?;
        write_inside(&dir.join(LIST), |file| file.write_all(&text))
    }

    /// Whether any run lists this file.
    pub(super) fn holds(&self, name: &str) -> bool {
        self.runs.iter().any(|run| run.record.as_deref() == Some(name) || run.files.iter().any(|file| file == name))
    }

    /// Removes a run from the list and returns it.
    pub(super) fn take(&mut self, record: Option<&str>) -> RunFiles {
        let at = self.runs.iter().position(|run| run.record.as_deref() == record);
        at.map_or_else(RunFiles::default, |at| self.runs.remove(at))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_leads_to_plain_names_in_the_folder_only() {
        let dir = tempfile::tempdir().unwrap();
        let list = |name: &str| {
            let run = RunFiles { record: None, files: vec![name.to_owned()], is_complete: true };
            FileList::of(vec![run]).write(dir.path()).unwrap();
            FileList::read(dir.path()).holds(name)
        };
        assert!(list("a.csv"));
        assert!(!["../a.csv", "inner/a.csv", ".a.csv", ""].into_iter().any(list));
    }
}
