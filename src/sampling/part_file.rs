//! A part of a sampling run as a file: counts of an interval of samples, with version and checksum.

use std::path::Path;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::tally::SampleTally;
use crate::atomic_file::AtomicFile;
use crate::criterion::Criterion;
use crate::sweep::hex;
use crate::{Error, Place, Result, input_file};

const VERSION: u64 = 1;
/// Largest part that is read: counts, worst lanes and a map are far smaller.
const LARGEST_BYTES: u64 = 64 << 20;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    lanesweep_part: u64,
    /// SHA-256 of the tally as compact JSON.
    sha256: String,
    criterion: Criterion,
    tally: SampleTally,
}

fn checksum(tally: &SampleTally) -> Result<String> {
    let text = serde_json::to_vec(tally).map_err(|e| Error::Internal(format!("a part cannot be written: {e}")))?;
    Ok(hex(&Sha256::digest(text)))
}

/// Writes a part: whole or not at all. `criterion` is that of its worst lanes and map.
///
/// # Errors
/// [`Error::Io`] if the folder cannot be written to.
pub fn write_part(path: &Path, criterion: Criterion, tally: &SampleTally) -> Result<()> {
    let file = File { lanesweep_part: VERSION, sha256: checksum(tally)?, criterion, tally: tally.clone() };
    let text = serde_json::to_vec(&file).map_err(|e| Error::Internal(format!("a part cannot be written: {e}")))?;
    let mut out = AtomicFile::create(path)?;
    out.append(&text)?;
    out.stage()?.publish()
}

/// Reads a part.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] for anything but a whole, unchanged part of this version.
pub fn read_part(path: &Path) -> Result<(Criterion, SampleTally)> {
    let io = |e| Error::io(path, "read", e);
    let redo = "make the part again with `lanesweep sample --lanes`";
    let wrong = |problem: String| Error::input(Place::file(path), problem, redo);
    if std::fs::metadata(path).map_err(io)?.len() > LARGEST_BYTES {
        return Err(wrong("it is larger than any part".to_owned()));
    }
    let text = input_file::read(path, LARGEST_BYTES)?;
    let value: serde_json::Value =
        serde_json::from_slice(&text).map_err(|e| wrong(format!("it is no whole JSON: {e}")))?;
    match value.get("lanesweep_part").map(serde_json::Value::as_u64) {
        Some(Some(VERSION)) => (),
        None => return Err(wrong("it is no part: `lanesweep_part` is missing".to_owned())),
        Some(other) => {
            let found = other.map_or("unreadable".to_owned(), |v| v.to_string());
            return Err(wrong(format!("its version is {found}, this program reads {VERSION}")));
        }
    }
    // From the text and not the value: integers beyond 2^53 stay exact either way, but errors name the line.
    let file: File = serde_json::from_slice(&text).map_err(|e| wrong(format!("it is damaged: {e}")))?;
    if checksum(&file.tally)? != file.sha256 {
        return Err(wrong("its checksum does not fit: it was changed or damaged".to_owned()));
    }
    file.tally.check().map_err(|problem| wrong(format!("its counts cannot be: {problem}")))?;
    Ok((file.criterion, file.tally))
}
