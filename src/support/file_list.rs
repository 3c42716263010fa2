//! The list of a folder's results: `lanesweep-files.json`. It distinguishes lanesweep's files from all others.

use std::path::Path;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::support::files::write_inside;
use crate::support::input_file;
use crate::support::plain_text::hex;
use crate::{Error, Place, Result};

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
#[serde(deny_unknown_fields)]
pub(super) struct FileList {
    lanesweep_files: u64,
    pub(super) runs: Vec<RunFiles>,
    /// SHA-256 of the runs' text. It identifies lists of this program; it is not a signature.
    sha256: String,
}

impl FileList {
    /// A list of these runs; the checksum is computed when it is written.
    pub(super) fn of(runs: Vec<RunFiles>) -> FileList {
        FileList { lanesweep_files: VERSION, runs, sha256: String::new() }
    }

    /// Reads the list of a folder; empty if there is none.
    ///
    /// # Errors
    /// [`Error::Input`] for a damaged list; [`Error::Io`].
    pub(super) fn read(dir: &Path) -> Result<FileList> {
        let path = dir.join(LIST);
        if path.symlink_metadata().is_err() {
            return Ok(FileList::of(Vec::new()));
        }
        let text = input_file::read(&path, input_file::MAX_TABLE_BYTES)?;
        let is_plain = |name: &String| Path::new(name).file_name().is_some_and(|file| file == name.as_str());
        let list = serde_json::from_slice::<FileList>(&text).ok().filter(|list| {
            let mut names = list.runs.iter().flat_map(|run| run.files.iter().chain(&run.record));
            let is_ours = list.lanesweep_files == VERSION && list.checksum().is_ok_and(|sum| sum == list.sha256);
            is_ours && names.all(|name| is_plain(name) && !name.starts_with('.'))
        });
        list.ok_or_else(|| {
            let problem = "this is no whole list of the files that lanesweep wrote here";
            Error::input(
                Place::file(path),
                problem,
                "move it away with the results beside it, or give another option `out`",
            )
        })
    }

    fn checksum(&self) -> Result<String> {
        let text = serde_json::to_vec(&self.runs).map_err(|e| Error::Internal(format!("{LIST}: {e}")))?;
        Ok(hex(&Sha256::digest(text)))
    }

    pub(super) fn write(mut self, dir: &Path) -> Result<()> {
        self.runs.sort_by(|a, b| a.record.cmp(&b.record));
        self.sha256 = self.checksum()?;
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
    fn even_with_a_checksum_a_list_leads_to_plain_names_in_the_folder_only() {
        let dir = tempfile::tempdir().unwrap();
        let list = |name: &str| {
            let run = RunFiles { record: None, files: vec![name.to_owned()], is_complete: true };
            FileList::of(vec![run]).write(dir.path()).unwrap();
            FileList::read(dir.path())
        };
        assert!(list("a.csv").unwrap().holds("a.csv"));
        for name in ["../a.csv", "inner/a.csv", ".a.csv", ""] {
            let error = list(name).unwrap_err();
            assert!(matches!(error, Error::Input { .. }) && error.to_string().contains(LIST), "{name}: {error}");
        }
    }
}
