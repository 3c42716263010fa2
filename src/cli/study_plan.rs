//! What a study is once its data are mined: the plan, and what its report says beside the lanes' outcomes. Made from
//! data or read from a plan file.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::mining::{MiningOptions, RecordingSummary};
use crate::parameterization::{ModeShape, ParameterizationOptions};
use crate::parts::{read_sealed, seal, sealed_size, write_sealed};
use crate::report::distributions::ParameterHistogram;
use crate::report::files::write_atomically_with;
use crate::score::ScoreOptions;
use crate::sweep::{LanePlan, PlanContent};
use crate::{Place, Result};

/// Largest plan that is read.
pub(super) const LARGEST_PLAN_BYTES: u64 = 8 << 30;
/// Kind of the sealed file.
pub(super) const KIND: &str = "study plan";

/// One category's scenarios.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CategoryFacts {
    pub found: u64,
    pub kept: u64,
    pub svd_explained: Vec<f64>,
    pub parameters: Vec<ParameterHistogram>,
    pub modes: Vec<ModeShape>,
}

/// What a report says beside the lanes' outcomes.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct StudyFacts {
    pub data: String,
    pub synthetic: bool,
    pub published: bool,
    pub reference: bool,
    /// Parts of the input were left out.
    pub incomplete: bool,
    pub scenario_file_sha256: Option<String>,
    pub recordings: Vec<RecordingSummary>,
    pub left_out: Vec<String>,
    /// One per block of the plan.
    pub categories: Vec<CategoryFacts>,
    pub mining: MiningOptions,
    pub parameterization: ParameterizationOptions,
    pub score: ScoreOptions,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StudyPlanFile {
    facts: StudyFacts,
    plan: PlanContent,
}

/// A study ready to be swept.
pub(super) struct PlannedStudy {
    pub plan: LanePlan,
    pub facts: StudyFacts,
}

impl PlannedStudy {
    /// As the text of a plan file, with the hash of the run.
    pub fn seal(&self) -> Result<(Vec<u8>, String)> {
        seal(KIND, &StudyPlanFile { facts: self.facts.clone(), plan: PlanContent::of(&self.plan)? })
    }

    /// Writes the plan file, unless it would be larger; gives its size where it was written.
    ///
    /// # Errors
    /// [`crate::Error::Io`].
    pub fn keep(&self, path: &Path, most_bytes: u64) -> Result<Option<u64>> {
        let content = StudyPlanFile { facts: self.facts.clone(), plan: PlanContent::of(&self.plan)? };
        let Some((bytes, sha256)) = sealed_size(KIND, &content, most_bytes)? else { return Ok(None) };
        write_atomically_with(path, |out| write_sealed(out, KIND, &content, &sha256))?;
        Ok(Some(bytes))
    }

    /// From a plan file, with the hash of the run.
    ///
    /// # Errors
    /// [`crate::Error::Io`]; [`crate::Error::Input`] for anything but a whole plan of this version.
    pub fn read(path: &Path) -> Result<(PlannedStudy, String)> {
        let (file, run_sha256) = read_sealed(KIND, path, LARGEST_PLAN_BYTES, AGAIN)?;
        Ok((PlannedStudy::of(file, &Place::file(path))?, run_sha256))
    }

    fn of(file: StudyPlanFile, place: &Place) -> Result<PlannedStudy> {
        let StudyPlanFile { facts, plan } = file;
        facts.score.validate()?;
        let plan = plan.into_plan(place)?;
        if facts.categories.len() != plan.blocks.len() {
            let problem = "it does not have the facts of every category";
            return Err(crate::Error::input(place.clone(), problem, AGAIN));
        }
        Ok(PlannedStudy { plan, facts })
    }
}

const AGAIN: &str = "make it with `lanesweep study … --plan-only --out DIR` of this version";
