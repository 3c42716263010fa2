//! The input that a sampling run of a distribution file keeps, so that its lanes can be reproduced.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{DistributionSamples, Names, Rename, parse_distribution};
use crate::engine::LanePlan;
use crate::run::grid::MapParameter;
use crate::run::reopen::{DISTRIBUTION_FILE, Reopened, SampleRecord};
use crate::scenario::Category;
use crate::support::input_file;
use crate::support::run_dir::ESTIMATE_RECORD;
use crate::{Error, Place, Result};

const VERSION: u64 = 1;

/// A distribution file with the mapping of its parameters.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SampledFile {
    lanesweep_distribution: u64,
    /// The file's path.
    pub file: String,
    /// Its text.
    pub text: String,
    /// Kind of scenario.
    pub category: Category,
    /// Their name, our name, factor.
    renames: Vec<(String, String, f64)>,
    set: Vec<(String, f64)>,
}

impl SampledFile {
    /// Reads a file; parameters missing in it are `set`.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Input`].
    pub fn read(path: &Path, category: Category, renames: &[Rename], set: &[(String, f64)]) -> Result<SampledFile> {
        Ok(SampledFile {
            lanesweep_distribution: VERSION,
            file: path.display().to_string(),
            text: input_file::read_text(path, input_file::MAX_XML_BYTES)?,
            category,
            renames: renames.iter().map(|r| (r.theirs.clone(), r.ours.clone(), r.factor)).collect(),
            set: set.to_vec(),
        })
    }

    /// The random parameters of the file.
    ///
    /// # Errors
    /// As [`DistributionSamples::of`].
    pub fn samples(&self) -> Result<DistributionSamples> {
        let path = Path::new(&self.file);
        let file = parse_distribution(&self.text, path)?;
        let rename = |(theirs, ours, factor): &(String, String, f64)| Rename {
            theirs: theirs.clone(),
            ours: ours.clone(),
            factor: *factor,
        };
        let renames: Vec<Rename> = self.renames.iter().map(rename).collect();
        let fixed = |(name, value): &(String, f64)| {
            let parameter = MapParameter::find(self.category, name, "option `set`")?;
            Ok((parameter, parameter.check(*value, "option `set`")?))
        };
        let fixed = self.set.iter().map(fixed).collect::<Result<Vec<_>>>()?;
        DistributionSamples::of(&file, &Names { category: self.category, renames: &renames, path }, fixed)
    }

    /// Description of the data.
    pub fn data(&self) -> String {
        format!("distributions of {}", Path::new(&self.file).file_name().unwrap_or_default().to_string_lossy())
    }

    /// The content of [`DISTRIBUTION_FILE`].
    ///
    /// # Errors
    /// None for a file that this program has read.
    pub fn to_json(&self) -> Result<Vec<u8>> {
        let unwritten = |e: serde_json::Error| Error::Internal(format!("a distribution cannot be kept: {e}"));
        serde_json::to_vec_pretty(self).map_err(unwritten)
    }
}

/// Opens the finished run of a folder, including runs of distributions; see [`Reopened::run`].
///
/// # Errors
/// As [`Reopened::run`].
pub fn reopen(dir: &Path, key: &str) -> Result<Reopened> {
    Reopened::run(dir, key, plan_of)
}

/// The plan of a run of distributions, and a description of its data.
fn plan_of(dir: &Path, record: &SampleRecord) -> Result<(LanePlan, String)> {
    let path = dir.join(DISTRIBUTION_FILE);
    let wrong = |problem: String| {
        let help = "give the folder (option `out`) of a `lanesweep sample` run of a distribution by this version";
        Error::input(Place::file(&path), problem, help)
    };
    let again = "run `lanesweep sample` with option `distribution` into this folder again";
    let text = input_file::read_json(&path, input_file::MAX_TABLE_BYTES, "the record of a distribution", again)?;
    let sampled: SampledFile =
        serde_json::from_slice(&text).map_err(|e| wrong(format!("it is not the record of a distribution: {e}")))?;
    if sampled.lanesweep_distribution != VERSION {
        return Err(wrong(format!("its version is {}, this program reads {VERSION}", sampled.lanesweep_distribution)));
    }
    let profile = &record.profile;
    profile.check(&Place::file(dir.join(ESTIMATE_RECORD)))?;
    let requested = (record.samples, record.seed);
    let (plan, _) = sampled.samples()?.plan(requested, profile, &record.models, &record.plan_headways)?;
    if record.plan_sha256.as_deref() != Some(plan.hash()) {
        return Err(wrong("its plan does not match the distributions and the profile beside it".to_owned()));
    }
    Ok((plan, sampled.data()))
}
