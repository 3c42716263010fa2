//! What a study is once its data are mined: the plan, and what its report says beside the lanes' outcomes. Made from
//! data or read from a plan file.

use std::ops::Range;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::engine::LanePlan;
use crate::report::distributions::ParameterHistogram;
use crate::run::parts::{read_sealed_line, seal};
use crate::run::score::ScoreOptions;
use crate::run::study::{Study, StudyHead};
use crate::scenario::parameterization::{ModeShape, ParameterizationId, ParameterizationOptions};
use crate::support::run_dir::Results;
use crate::traffic::mining::{MiningOptions, RecordingSummary};
use crate::{Place, Result};

/// Largest first line that is read: checksums of a page of scenarios, facts of the recordings.
const MAX_HEAD_BYTES: u64 = 1 << 30;
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
    /// What the data leave open or what looks wrong in them.
    pub notes: Vec<String>,
    /// One per block of the plan.
    pub categories: Vec<CategoryFacts>,
    pub mining: MiningOptions,
    pub parameterization: ParameterizationOptions,
    pub score: ScoreOptions,
}

/// The first line of the file. The records of the scenarios follow it.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StudyPlanFile {
    facts: StudyFacts,
    plan: StudyHead,
}

/// A study ready to be swept.
pub(super) struct PlannedStudy {
    pub study: Study,
    pub facts: StudyFacts,
}

impl PlannedStudy {
    /// The plan without cases: counts, keys, hash.
    pub fn plan(&self) -> &LanePlan {
        self.study.outline()
    }

    /// The first line of the plan file, with the hash of the run. The line holds the checksums of all that follows.
    pub fn seal(&self) -> Result<(Vec<u8>, String)> {
        seal(KIND, &StudyPlanFile { facts: self.facts.clone(), plan: self.study.head().clone() })
    }

    /// Adds the plan file to the results, unless it would be larger than so many bytes; tells whether it did.
    ///
    /// # Errors
    /// [`crate::Error::Io`].
    pub fn keep(&self, results: &mut Results, name: &str, max_bytes: u64) -> Result<bool> {
        let (head, records) = (self.seal()?.0, self.study.records()?);
        if (head.len() + records.len()) as u64 > max_bytes {
            return Ok(false);
        }
        results.add_with(name, |out| out.write_all(&head).and_then(|()| out.write_all(records)))?;
        Ok(true)
    }

    /// From a plan file, with the hash of the run.
    ///
    /// # Errors
    /// [`crate::Error::Io`]; [`crate::Error::Input`] for anything but a whole plan of this version and engine.
    pub fn read(path: &Path) -> Result<(PlannedStudy, String)> {
        PlannedStudy::read_some(path, |count| 0..count)
    }

    /// The same with some of its scenarios only, of so many: nothing else of the file is read.
    ///
    /// # Errors
    /// As [`PlannedStudy::read`].
    pub fn read_some(path: &Path, wanted: impl FnOnce(u64) -> Range<u64>) -> Result<(PlannedStudy, String)> {
        let (file, run_sha256, mut records) = read_sealed_line(KIND, path, MAX_HEAD_BYTES, AGAIN)?;
        let StudyPlanFile { facts, plan } = file;
        let place = Place::file(path);
        facts.score.validate()?;
        let study = plan.read(&mut records, &place, wanted)?;
        check_variants(study.outline(), &place)?;
        if facts.categories.len() != study.outline().blocks.len() {
            let problem = "it does not have the facts of every category";
            return Err(crate::Error::input(place, problem, AGAIN));
        }
        Ok((PlannedStudy { study, facts }, run_sha256))
    }
}

/// A checksum tells damage, not forgery: what reaches a page and a terminal must be what this program writes.
fn check_variants(plan: &LanePlan, place: &Place) -> Result<()> {
    for block in &plan.blocks {
        for (at, name) in block.variants.iter().enumerate() {
            let is_known = if at == 0 { name == "S" } else { ParameterizationId::find(block.category, name).is_some() };
            if !is_known || block.variants[..at].contains(name) {
                let problem = format!("`{name}` is no variant {at} of a {} study", block.category.label());
                return Err(crate::Error::input(place.clone(), problem, AGAIN));
            }
        }
    }
    Ok(())
}

const AGAIN: &str = "make it with `lanesweep study … --plan-only --out DIR` of this version";

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::profile::Profile;
    use crate::run::study::{StudyOptions, plan_study};
    use crate::traffic::mining::mine_generated;
    use crate::traffic::trajectory::generator::GeneratorOptions;

    #[test]
    fn a_plan_with_variants_that_no_study_has_is_refused_before_they_are_printed() {
        let generated = GeneratorOptions { recordings: 1, ..GeneratorOptions::default() };
        let mined = mine_generated(&generated, &MiningOptions::default(), || ()).unwrap().scenarios;
        let made = || plan_study(&mined, &Profile::load("paper").unwrap(), &StudyOptions::default()).unwrap().plan;
        assert!(check_variants(&made(), &Place::item("plan")).is_ok());
        for (at, forged) in [(0, "1"), (1, "\u{1b}]0;owned\u{7}"), (1, "<script>"), (1, "S"), (2, "1")] {
            let mut plan = made();
            plan.blocks[0].variants[at] = forged.to_owned();
            assert!(check_variants(&plan, &Place::item("plan")).is_err(), "{forged} as variant {at}");
        }
    }
}
