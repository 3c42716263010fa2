//! A finished part as a file: the run it belongs to, the interval, the counts, sealed.

use std::ops::Range;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::ledger::{Fits, MergeableCounts};
use super::sealed::{read_sealed, seal};
use crate::support::files::write_inside;
use crate::{Error, Place, Result};

/// Largest part that is read.
const MAX_BYTES: u64 = 4 << 30;

/// Counts of an interval of units.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part<T> {
    /// Hash of the run: of its plan file's content.
    pub run_sha256: String,
    /// The interval.
    pub units: Range<u64>,
    /// Did the part's host leave lanes of a device to the CPU, and how many were checked: `[redone, rechecked]`.
    pub lanes_redone_and_rechecked: [u64; 2],
    /// The counts, segment by segment.
    pub segments: Vec<T>,
}

/// Writes a part: whole or not at all.
///
/// # Errors
/// [`Error::Io`].
pub fn write_part<T: Serialize>(path: &Path, part: &Part<T>) -> Result<()> {
    let text = seal("part", part)?.0;
    write_inside(path, |file| file.write_all(&text))
}

/// Reads a part of a run. `again` is the command that makes it; `fits` says what is wrong with counts that are not the
/// run's.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] for a damaged part, one of another run, or of another interval.
pub fn read_part<T: MergeableCounts>(
    path: &Path,
    run_sha256: &str,
    units: &Range<u64>,
    again: &str,
    fits: &Fits<T>,
) -> Result<Part<T>> {
    let redo = format!("delete it and make it again: {again}");
    let (part, _): (Part<T>, _) = read_sealed("part", path, MAX_BYTES, &redo)?;
    let wrong = |problem: String, help: &str| Error::input(Place::file(path), problem, help);
    if part.run_sha256 != run_sha256 {
        let help = "use one folder per run: move it away, or give another option `out`";
        return Err(wrong("it is foreign: it belongs to another run than plan.json in this folder".to_owned(), help));
    }
    if part.units != *units {
        let problem = format!("it holds units {:?}, its name stands for {units:?}", part.units);
        return Err(wrong(problem, &redo));
    }
    for segment in &part.segments {
        segment
            .check()
            .and_then(|()| fits(segment))
            .map_err(|problem| wrong(format!("its counts cannot be: {problem}"), &redo))?;
    }
    Ok(part)
}
