//! A part of a run over a given proposal: weighted sums of an interval of samples, per driver model.

use std::path::Path;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::atomic_file::AtomicFile;
use crate::criterion::Criterion;
use crate::driver::ModelId;
use crate::estimate::{BlockSums, WeightSums};
use crate::sweep::hex;
use crate::{Error, Place, Result, input_file};

const VERSION: u64 = 1;
/// Largest part that is read: a few nodes per model.
const LARGEST_BYTES: u64 = 16 << 20;

/// The sums of a part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WeightedPart {
    /// SHA-256 over density, proposal, profile, criterion, headway, models, seed, samples: parts of one run share it.
    pub run_sha256: String,
    /// Criterion.
    pub criterion: Criterion,
    /// Headway, by name.
    pub headway: String,
    /// Samples of the whole run.
    pub samples: u64,
    /// Sums, model by model; all over the same samples.
    pub sums: Vec<(ModelId, BlockSums<WeightSums>)>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    lanesweep_weighted_part: u64,
    /// SHA-256 of the part as compact JSON.
    sha256: String,
    part: WeightedPart,
}

impl WeightedPart {
    /// Joins other samples of the same run.
    ///
    /// # Errors
    /// [`Error::Input`] for another run's; [`Error::Usage`] where a sample is in both.
    pub fn merge(&mut self, other: WeightedPart) -> Result<()> {
        let models = |part: &WeightedPart| part.sums.iter().map(|(model, _)| *model).collect::<Vec<_>>();
        if self.run_sha256 != other.run_sha256 || models(self) != models(&other) {
            let help = "join only parts of one run: same density, proposal, flags and seed";
            return Err(Error::input(Place::item("part of a sampling run"), "it belongs to another run", help));
        }
        for ((_, ours), (_, theirs)) in self.sums.iter_mut().zip(other.sums) {
            ours.merge(theirs)?;
        }
        Ok(())
    }

    /// Samples that are in.
    pub fn covered(&self) -> u64 {
        self.sums.first().map_or(0, |(_, sums)| sums.ranges().iter().map(|r| r.end - r.start).sum())
    }
}

fn text_of<T: Serialize>(value: &T) -> Result<Vec<u8>> {
    serde_json::to_vec(value).map_err(|e| Error::Internal(format!("a part cannot be written: {e}")))
}

/// Writes a part: whole or not at all.
///
/// # Errors
/// [`Error::Io`] if the folder cannot be written to.
pub fn write_weighted_part(path: &Path, part: &WeightedPart) -> Result<()> {
    let sha256 = hex(&Sha256::digest(text_of(part)?));
    let file = File { lanesweep_weighted_part: VERSION, sha256, part: part.clone() };
    let mut out = AtomicFile::create(path)?;
    out.append(&text_of(&file)?)?;
    out.stage()?.publish()
}

/// Reads a part; `None` where the file is another kind of part.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] for one of another version, or damaged.
pub fn read_weighted_part(path: &Path) -> Result<Option<WeightedPart>> {
    let io = |e| Error::io(path, "read", e);
    let redo = "make the part again with `lanesweep sample --lanes`";
    let wrong = |problem: String| Error::input(Place::file(path), problem, redo);
    if std::fs::metadata(path).map_err(io)?.len() > LARGEST_BYTES {
        return Ok(None);
    }
    let text = input_file::read(path, LARGEST_BYTES)?;
    let Ok(value) = serde_json::from_slice::<serde_json::Value>(&text) else { return Ok(None) };
    match value.get("lanesweep_weighted_part").map(serde_json::Value::as_u64) {
        None => return Ok(None),
        Some(Some(VERSION)) => (),
        Some(_) => return Err(wrong(format!("its version is not {VERSION}, which this program reads"))),
    }
    let file: File = serde_json::from_slice(&text).map_err(|e| wrong(format!("it is damaged: {e}")))?;
    if hex(&Sha256::digest(text_of(&file.part)?)) != file.sha256 {
        return Err(wrong("its checksum does not fit: it was changed or damaged".to_owned()));
    }
    if let Some(problem) = file.part.sums.iter().find_map(|(_, sums)| sums.check().err()) {
        return Err(wrong(format!("its sums cannot be: {problem}")));
    }
    Ok(Some(file.part))
}
