//! A run or one of its parts in a folder: the lock, the journal, the part file, the plan that all parts share.

use std::fs::File;
use std::io::{BufRead, BufReader, ErrorKind, Read};
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::journal::Journal;
use super::ledger::{Countable, Fits, Ledger};
use super::part::{Part, read_part, write_part};
use super::shard::Shard;
use crate::support::files::{make_folder, write_inside};
use crate::support::input_file;
use crate::support::lock::FolderLock;
use crate::support::readable::count;
use crate::support::run_dir::OutputDir;
use crate::{Error, Place, Result};

/// Name of the plan in a run's folder.
pub const PLAN_FILE: &str = "plan.json";

/// Name of the plan that a run in one piece leaves in its folder, for its lanes to be run again. Another name than that
/// of a run in parts, whose processes share their plan and hold no common lock.
pub const RUN_PLAN_FILE: &str = "run-plan.json";

/// An interval of a run at work: its lock, its journal, what is counted.
pub struct RunState<T> {
    /// The interval.
    pub units: Range<u64>,
    /// What is counted.
    pub ledger: Ledger<T>,
    /// Where it is done; of a part, together with other parts.
    pub folder: OutputDir,
    part: Option<FolderLock>,
}

/// The place of a run or of one of its parts in its folder.
pub struct RunDir {
    /// The run's folder.
    pub out: PathBuf,
    /// Name of the whole run's record.
    pub record: &'static str,
    /// Hash of the run.
    pub run_sha256: String,
    /// The shard, or the whole run.
    pub shard: Option<Shard>,
    /// Units of the whole run.
    pub unit_count: u64,
}

/// The units of a shard, or of the whole run.
pub fn units_of(shard: Option<Shard>, count: u64) -> Range<u64> {
    shard.map_or(0..count, |shard| shard.units(count))
}

impl RunDir {
    fn units(&self) -> Range<u64> {
        units_of(self.shard, self.unit_count)
    }

    /// The part's file.
    pub fn part(&self) -> Option<PathBuf> {
        self.shard.map(|shard| self.out.join(format!("{}.json", shard.stem())))
    }

    /// Is the part there, whole and of this run? Then nothing is to be done.
    ///
    /// # Errors
    /// [`Error::Input`] for a damaged or foreign file in its place.
    pub fn is_done<T: Countable>(&self, fits: &Fits<T>) -> Result<bool> {
        let Some(path) = self.part().filter(|path| path.exists()) else { return Ok(false) };
        read_part::<T>(&path, &self.run_sha256, &self.units(), "run this command again", fits).map(|_| true)
    }

    /// Takes the place: no other process computes the same. What an earlier one left is taken over, cut at `cuts`.
    ///
    /// # Errors
    /// [`Error::Busy`] where another process is at it; [`Error::Io`]; as [`Ledger::resume`].
    pub fn begin<T: Countable>(&self, cuts: &[u64], is_journalled: bool, fits: &Fits<T>) -> Result<RunState<T>> {
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
            let done = ledger.resume(journal, found, fits)?;
            if done > 0 {
                let (done, all) = (count(done), count(units.end - units.start));
                tracing::info!("{done} of {all} units are done already: this run continues");
            }
        }
        Ok(RunState { units, ledger, folder, part })
    }

    /// Parts of two splits double one another: better said before the work than by the merge.
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

    /// Writes the part and takes its journal away.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Internal`] where the ledger is not complete.
    pub fn finish<T: Countable>(&self, mut state: RunState<T>) -> Result<()> {
        let Some(path) = self.part() else { return Err(Error::Internal("the whole run is no part".to_owned())) };
        if !state.ledger.missing(state.units.clone())?.is_empty() {
            return Err(Error::Internal("a part is not complete".to_owned()));
        }
        let lanes_redone_and_rechecked = state.ledger.redone_and_rechecked();
        let (segments, journal) = state.ledger.finish()?;
        let run_sha256 = self.run_sha256.clone();
        // It was there before the work; where it vanished meanwhile, the part is worth another one.
        make_folder(&self.out)?;
        write_part(&path, &Part { run_sha256, units: state.units, lanes_redone_and_rechecked, segments })?;
        journal.map_or(Ok(()), Journal::remove)?;
        drop((state.part, state.folder));
        tracing::info!("part written to {}", path.display());
        Ok(())
    }
}

impl<T: Countable> RunState<T> {
    /// The result stands: the journal goes, then the lock.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn forget(self) -> Result<()> {
        let (_, journal) = self.ledger.finish()?;
        journal.map_or(Ok(()), Journal::remove)?;
        drop((self.part, self.folder));
        Ok(())
    }
}

/// Writes a plan into a run's folder, or finds the same one there: many shards may do so at once. A plan is told by its
/// first line, which holds the checksums of the pages that follow. One with this line and other bytes behind it was damaged
/// and is written again.
///
/// # Errors
/// [`Error::Input`] where the folder holds the plan of another run; [`Error::Io`].
pub fn leave_plan(
    out: &Path,
    line: &[u8],
    mut pages: impl Iterator<Item = std::io::Result<Vec<u8>>> + Clone,
) -> Result<()> {
    let (_folder, path) = (OutputDir::share(out)?, out.join(PLAN_FILE));
    if let Some(mut there) = open_plan(&path, line)? {
        if is_rest(&mut there, pages.clone()).map_err(|e| Error::io(&path, "read", e))? {
            return Ok(());
        }
        tracing::warn!("{} was damaged: it is written again", path.display());
    }
    write_inside(&path, |file| {
        file.write_all(line)?;
        pages.try_for_each(|page| file.write_all(&page?))
    })
}

/// Copies a plan file into a run's folder, or finds the same one there. A shard reads neither in whole: readers find
/// damage in what they use.
///
/// # Errors
/// As [`leave_plan`].
pub fn copy_plan(out: &Path, from: &Path) -> Result<()> {
    let read = |e| Error::io(from, "read", e);
    let (mut plan, mut line) = (BufReader::new(input_file::open(from)?), Vec::new());
    plan.read_until(b'\n', &mut line).map_err(read)?;
    let (_folder, path) = (OutputDir::share(out)?, out.join(PLAN_FILE));
    if let Some(there) = open_plan(&path, &line)? {
        let length = there.get_ref().metadata().map_err(|e| Error::io(&path, "read", e))?.len();
        if length == plan.get_ref().metadata().map_err(read)?.len() {
            return Ok(());
        }
        tracing::warn!("{} was damaged: it is written again", path.display());
    }
    write_inside(&path, |file| {
        file.write_all(&line)?;
        std::io::copy(&mut plan, file).map(drop)
    })
}

/// The plan file of a folder, behind this first line; `None` without a plan.
fn open_plan(path: &Path, line: &[u8]) -> Result<Option<BufReader<File>>> {
    let mut file = match input_file::open(path) {
        Ok(file) => BufReader::new(file),
        Err(Error::Io { source, .. }) if source.kind() == ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(e),
    };
    let mut there = vec![0; line.len()];
    if file.read_exact(&mut there).is_ok() && there == line {
        return Ok(Some(file));
    }
    let problem = "this folder holds the plan of another run";
    let help =
        "give another option `out`, or the flags that the plan was made with; or move the plan and its parts away";
    Err(Error::input(Place::file(path), problem, help))
}

/// Whether a file ends with exactly these pages.
fn is_rest(file: &mut BufReader<File>, pages: impl Iterator<Item = std::io::Result<Vec<u8>>>) -> std::io::Result<bool> {
    let mut there = Vec::new();
    for page in pages {
        let page = page?;
        there.clear();
        file.take(page.len() as u64).read_to_end(&mut there)?;
        if there != page {
            return Ok(false);
        }
    }
    Ok(file.fill_buf()?.is_empty())
}
