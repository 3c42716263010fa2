//! A finished part as a sealed file with its run, interval and counts. A folder of parts, and whether it covers every
//! unit exactly once.

use std::ops::Range;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::Shard;
use super::ledger::MergeableCounts;
use super::sealed::{read_sealed, seal};
use lanesweep_support::files::write_inside;
use lanesweep_support::{Error, Place, Result, option};

/// Maximum number of parts listed by name in an error.
const NAMED: usize = 10;

/// Finds the parts in a folder by their names, in the order of their units. They must cover `units` units exactly once.
/// `again` returns the command that makes a shard.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] with the missing or duplicate parts and the commands that make them.
fn collect(dir: &Path, units: u64, again: impl Fn(Shard) -> String) -> Result<Vec<(Shard, PathBuf)>> {
    let io = |e| Error::io(dir, "list", e);
    let mut parts: Vec<(Shard, PathBuf)> = Vec::new();
    for entry in std::fs::read_dir(dir).map_err(io)? {
        let path = entry.map_err(io)?.path();
        let Some(stem) = path.file_name().and_then(|n| n.to_str()).and_then(|n| n.strip_suffix(".json")) else {
            continue;
        };
        if !stem.starts_with("part-") {
            continue;
        }
        match Shard::of_stem(stem) {
            Some(shard) if (1..=Shard::MAX_SHARDS).contains(&shard.of) && shard.index < shard.of => {
                parts.push((shard, path));
            }
            _ => {
                let problem = "its name is that of no part: part-00003-of-00020.json is";
                return Err(Error::input(Place::file(path), problem, "move it away, or give it its name back"));
            }
        }
    }
    if parts.is_empty() {
        let help = format!("make the parts first, such as:\n{}", again(Shard { index: 0, of: 1 }));
        return Err(Error::input(Place::file(dir), "there is no part here", help));
    }
    parts.sort_by_key(|(shard, _)| (shard.units(units).start, shard.units(units).end, shard.of));
    check_cover(dir, units, &parts, again)?;
    Ok(parts)
}

/// Reads all parts of a folder and checks that they belong to this run and together have all units, each once.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] with the missing, duplicate, foreign or damaged parts, and the command from `again`.
pub(super) fn read_parts<T: MergeableCounts>(
    dir: &Path,
    run_sha256: &str,
    units: u64,
    again: &dyn Fn(Shard) -> String,
) -> Result<Vec<Part<T>>> {
    let read = |(shard, path): &(Shard, PathBuf)| read_part(path, run_sha256, &shard.units(units), &again(*shard));
    collect(dir, units, again)?.iter().map(read).collect()
}

fn check_cover(dir: &Path, units: u64, parts: &[(Shard, PathBuf)], again: impl Fn(Shard) -> String) -> Result<()> {
    let mut at = 0;
    let mut before: Option<&(Shard, PathBuf)> = None;
    let mut gaps: Vec<Range<u64>> = Vec::new();
    // If there are more shards than units, some are empty: these neither cover nor duplicate units.
    for part in parts.iter().filter(|(shard, _)| !shard.units(units).is_empty()) {
        let own = part.0.units(units);
        if own.start < at {
            let other = before.map_or(String::new(), |(_, path)| path.display().to_string());
            let problem =
                format!("units {} to {} are doubled: they are also in {other}", own.start, at.min(own.end) - 1);
            return Err(Error::input(Place::file(&part.1), problem, "move one of the two away"));
        }
        if own.start > at {
            gaps.push(at..own.start);
        }
        at = own.end;
        before = Some(part);
    }
    if at < units {
        gaps.push(at..units);
    }
    if gaps.is_empty() {
        return Ok(());
    }
    let missing: u64 = gaps.iter().map(|gap| gap.end - gap.start).sum();
    let problem = format!("{missing} of {units} units are missing");
    // The command is known only if all parts have the same number of shards.
    let of = parts[0].0.of;
    if parts.iter().any(|(shard, _)| shard.of != of) {
        let list: Vec<String> = gaps.iter().take(NAMED).map(|gap| format!("{}..{}", gap.start, gap.end)).collect();
        return Err(Error::input(
            Place::file(dir),
            problem,
            format!("make shards that hold units {}", list.join(", ")),
        ));
    }
    let is_there = |index: u64| parts.iter().any(|(shard, _)| shard.index == index);
    let absent: Vec<Shard> = (0..of)
        .filter(|&index| !is_there(index))
        .map(|index| Shard { index, of })
        .filter(|shard| !shard.units(units).is_empty())
        .collect();
    let mut help: Vec<String> = absent.iter().take(NAMED).map(|shard| again(*shard)).collect();
    if absent.len() > NAMED {
        help.push(format!("… and {} more shards", absent.len() - NAMED));
    }
    Err(Error::input(Place::file(dir), problem, format!("make them:\n{}", help.join("\n"))))
}

/// Maximum size of a part that is read, bytes.
const MAX_BYTES: u64 = 4 << 30;

/// Counts of an interval of units.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part<T> {
    /// Hash of the run, that is, of its plan file's content.
    pub run_sha256: String,
    /// The interval.
    pub units: Range<u64>,
    /// Lanes that the part's host recomputed with the fallback, and lanes that it rechecked: `[redone, rechecked]`.
    pub lanes_redone_and_rechecked: [u64; 2],
    /// The counts, segment by segment.
    pub segments: Vec<T>,
}

/// Writes a part atomically.
///
/// # Errors
/// [`Error::Io`].
pub fn write_part<T: Serialize>(path: &Path, part: &Part<T>) -> Result<()> {
    let text = seal("part", part)?.0;
    write_inside(path, |file| file.write_all(&text))
}

/// Reads a part of a run. `again` is the command that makes it.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] for a damaged part, one of another run, or of another interval.
pub fn read_part<T: MergeableCounts>(
    path: &Path,
    run_sha256: &str,
    units: &Range<u64>,
    again: &str,
) -> Result<Part<T>> {
    let redo = format!("delete it and make it again:\n{again}");
    let (part, _): (Part<T>, _) = read_sealed("part", path, MAX_BYTES, &redo)?;
    let wrong = |problem: String, help: &str| Error::input(Place::file(path), problem, help);
    if part.run_sha256 != run_sha256 {
        let help = format!("use one folder per run: move it away, or give another {}", option("out"));
        return Err(wrong("it is foreign: it belongs to another run than plan.json in this folder".to_owned(), &help));
    }
    if part.units != *units {
        let problem = format!("it holds units {:?}, its name stands for {units:?}", part.units);
        return Err(wrong(problem, &redo));
    }
    Ok(part)
}
