//! A run or one of its parts in a folder: the lock, the journal, the part file, and the plan that all parts share.

use std::fs::File;
use std::io::{BufRead, BufReader, ErrorKind, Read, Seek, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::Shard;
use super::folder::{Part, read_part, write_part};
use super::journal::Journal;
use super::ledger::{Ledger, MergeableCounts};
use crate::support::files::{make_folder, write_inside};
use crate::support::input_file;
use crate::support::lock::FolderLock;
use crate::support::readable::count;
use crate::support::run_dir::OutputDir;
use crate::{Error, Place, Result};

/// File name of the plan in a run's folder.
pub const PLAN_FILE: &str = "plan.json";

/// File name of the plan that a run in one piece leaves in its folder, so that its lanes can be rerun. It differs from
/// that of a run in parts, whose processes share their plan and hold no common lock.
pub const RUN_PLAN_FILE: &str = "run-plan.json";

/// A running interval of a run: its lock, its journal, its counts.
pub(super) struct RunState<T> {
    /// The interval.
    pub units: Range<u64>,
    /// The counts.
    pub ledger: Ledger<T>,
    /// The run's folder; other parts may use it too.
    pub folder: OutputDir,
    part: Option<FolderLock>,
}

/// The files of a run or of one of its parts in its folder.
pub(super) struct RunDir {
    /// The run's folder.
    pub out: PathBuf,
    /// File name of the whole run's record.
    pub record: &'static str,
    /// Hash of the run.
    pub run_sha256: String,
    /// The shard, or the whole run.
    pub shard: Option<Shard>,
    /// Units of the whole run.
    pub unit_count: u64,
}

/// The units of a shard, or of the whole run.
pub(crate) fn units_of(shard: Option<Shard>, count: u64) -> Range<u64> {
    shard.map_or(0..count, |shard| shard.units(count))
}

impl RunDir {
    fn units(&self) -> Range<u64> {
        units_of(self.shard, self.unit_count)
    }

    /// The path of the part file.
    fn part(&self) -> Option<PathBuf> {
        self.shard.map(|shard| self.out.join(format!("{}.json", shard.stem())))
    }

    /// Whether the part exists, is complete and belongs to this run; then there is nothing to compute.
    ///
    /// # Errors
    /// [`Error::Input`] for a damaged or foreign file in its place.
    pub(super) fn is_done<T: MergeableCounts>(&self) -> Result<bool> {
        let Some(path) = self.part().filter(|path| path.exists()) else { return Ok(false) };
        read_part::<T>(&path, &self.run_sha256, &self.units(), "run this command again").map(|_| true)
    }

    /// Locks the interval, so that no other process computes it, and takes over the counts of an earlier process, cut
    /// at `cuts`.
    ///
    /// # Errors
    /// [`Error::Busy`] if another process computes it; [`Error::Io`]; as [`Ledger::resume`].
    pub(super) fn begin<T: MergeableCounts>(&self, cuts: &[u64], is_journalled: bool) -> Result<RunState<T>> {
        let stem = self.shard.map(|shard| shard.stem());
        let (folder, part) = match &stem {
            None => (OutputDir::open(&self.out, self.record)?, None),
            Some(stem) => {
                let folder = OutputDir::share(&self.out)?;
                let part = FolderLock::acquire(&self.out.join(format!("{stem}.lock")))?;
                self.warn_of_another_split(stem);
                (folder, Some(part))
            }
        };
        let units = self.units();
        let mut ledger = Ledger::new(units.clone(), cuts);
        if is_journalled {
            let run = &self.run_sha256[..16.min(self.run_sha256.len())];
            let name = stem.map_or(format!("run-{run}.journal"), |s| format!("{s}.journal"));
            let (journal, found) = Journal::open(&self.out.join(name), &self.run_sha256, units.clone())?;
            let done = ledger.resume(journal, found)?;
            if done > 0 {
                let (done, all) = (count(done), count(units.end - units.start));
                tracing::info!("{done} of {all} units are done already: this run continues");
            }
        }
        Ok(RunState { units, ledger, folder, part })
    }

    /// Parts of two splits overlap; this warns before the computation, not only at the merge.
    fn warn_of_another_split(&self, stem: &str) {
        let split = |name: &str| name.strip_prefix("part-")?.split_once("-of-").map(|(_, count)| count.to_owned());
        let Some(ours) = split(stem) else { return };
        let names = std::fs::read_dir(&self.out).into_iter().flatten().flatten();
        let names = names.filter_map(|entry| entry.file_name().into_string().ok());
        let other = |name: &String| {
            let stem = name.strip_suffix(".json").unwrap_or("");
            split(stem).is_some_and(|count| count != ours)
        };
        if let Some(name) = names.into_iter().find(other) {
            tracing::warn!(
                "{name} in this folder is of a run cut into another number of shards: they cannot be merged"
            );
        }
    }

    /// Writes the part and deletes its journal.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Internal`] if the ledger is not complete.
    pub(super) fn finish<T: MergeableCounts>(&self, mut state: RunState<T>) -> Result<()> {
        let Some(path) = self.part() else { return Err(Error::Internal("the whole run is no part".to_owned())) };
        if !state.ledger.missing(state.units.clone())?.is_empty() {
            return Err(Error::Internal("a part is not complete".to_owned()));
        }
        let lanes_redone_and_rechecked = state.ledger.redone_and_rechecked();
        let (segments, journal) = state.ledger.finish()?;
        let run_sha256 = self.run_sha256.clone();
        // The folder existed at the start; if it was deleted since, it is recreated to save the part.
        make_folder(&self.out)?;
        write_part(&path, &Part { run_sha256, units: state.units, lanes_redone_and_rechecked, segments })?;
        journal.map_or(Ok(()), Journal::remove)?;
        drop((state.part, state.folder));
        tracing::info!("part written to {}", path.display());
        Ok(())
    }
}

impl<T: MergeableCounts> RunState<T> {
    /// After the result is written, deletes the journal, then releases the lock.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(super) fn forget(self) -> Result<()> {
        let (_, journal) = self.ledger.finish()?;
        journal.map_or(Ok(()), Journal::remove)?;
        drop((self.part, self.folder));
        Ok(())
    }
}

/// Writes a plan into a run's folder, or checks that the same one exists; many shards may do so at once. The first line
/// of a plan identifies it and holds the checksums of the rest. A plan with the same first line and a different rest is
/// damaged and is rewritten. `write` writes the whole plan.
///
/// # Errors
/// [`Error::Input`] if the folder holds the plan of another run; [`Error::Io`].
pub(crate) fn leave_plan(out: &Path, line: &[u8], write: impl Fn(&mut dyn Write) -> std::io::Result<()>) -> Result<()> {
    let (_folder, path) = (OutputDir::share(out)?, out.join(PLAN_FILE));
    let io = |e| Error::io(&path, "read", e);
    match input_file::open(&path) {
        Ok(mut there) => {
            let mut begin = vec![0; line.len()];
            if there.read_exact(&mut begin).is_err() || begin != line {
                let help = "give another option `out`, or the flags that the plan was made with; or move the plan and \
                            its parts away";
                return Err(Error::input(Place::file(&path), "this folder holds the plan of another run", help));
            }
            there.rewind().map_err(io)?;
            let mut same = SameAs { file: BufReader::new(there), is_same: true };
            write(&mut same).map_err(io)?;
            if same.is_same && same.file.fill_buf().map_err(io)?.is_empty() {
                return Ok(());
            }
            tracing::warn!("{} was damaged: it is written again", path.display());
        }
        Err(Error::Io { source, .. }) if source.kind() == ErrorKind::NotFound => {}
        Err(e) => return Err(e),
    }
    write_inside(&path, write)
}

/// A writer that compares its input with a file.
struct SameAs {
    file: BufReader<File>,
    is_same: bool,
}

impl Write for SameAs {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let mut there = vec![0; bytes.len()];
        self.is_same &= self.file.read_exact(&mut there).is_ok() && there == bytes;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}
