//! Studies: scenarios and parameterizations become a plan of lanes; the plan is run whole or in shards, resumed, merged
//! and scored. [`Study`] is the entry point.

mod cases;
mod evaluation;
mod external_replays;
mod folds;
mod plan;
pub(crate) mod plan_file;
mod provenance;
mod read;
mod reference;
mod robustness;
mod run;

pub use cases::StudyCases;
pub(crate) use cases::WINDOW;
pub use evaluation::{CategoryNumbers, StudyEvaluation};
pub use external_replays::ExternalReplay;
pub use plan::{StudyOptions, outline_study, plan_study};
pub use plan_file::{StudyHead, plan_of_parts};
use provenance::category_provenance;
pub use provenance::{CategoryProvenance, StudyProvenance};

pub use reference::{Difference, ReferenceComparison};
pub use robustness::robust_lanes;
pub use run::{STUDY_RECORD, StudyResult};

use std::ops::Range;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::parts::{Shard, read_sealed_line, seal, units_of};
use crate::score::{ScoreOptions, ScoreTable, score};
use lanesweep_engine::{LanePlan, Partial};
use lanesweep_model::profile::Profile;
use lanesweep_model::scenario::Category;
use lanesweep_support::run_folder::Results;
use lanesweep_support::{Error, Place, Result, option};
use lanesweep_traffic::mining::{Collection, MiningOptions, counts, counts_text};

/// Maximum size of the first line that is read, bytes: checksums of the pages of scenarios, data of the recordings.
const MAX_HEAD_BYTES: u64 = 1 << 30;

/// The first line of the file. The scenarios follow it.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StudyPlanFile {
    facts: StudyProvenance,
    plan: StudyHead,
}

/// A study ready to be run: whole, or one shard of it. [`Study::builder`] plans one from scenarios.
///
/// The [crate] runs one in memory. Here two shards run in a folder, the first of them interrupted and resumed; together they give the counts of the whole:
///
/// ```
/// use lanesweep::Error;
/// use lanesweep::engine::{CpuBackend, Executor};
/// # use lanesweep::model::profile::Profile;
/// use lanesweep::run::parts::{Job, Shard};
/// use lanesweep::run::study::Study;
/// # use lanesweep::traffic::mining::{MiningOptions, mine_generated};
/// # use lanesweep::traffic::trajectory::generator::GeneratorOptions;
///
/// # fn main() -> lanesweep::Result<()> {
/// # let recordings = GeneratorOptions { recordings: 1, ..GeneratorOptions::default() };
/// # let mined = mine_generated(&recordings, &MiningOptions::default(), || Ok(()))?;
/// # let folder = tempfile::tempdir().unwrap();
/// # let folder = folder.path();
/// let study = Study::builder(&mined, Profile::load("paper")?).plan()?;
/// let backend = CpuBackend::lane_arithmetic();
/// // Small chunks, as the run ends early only between them.
/// let executor = Executor { chunk_lanes: Some(1000), ..Executor::new(&backend) };
/// executor.cancel.request();
/// let first = study.run_shard(folder, Shard { index: 0, of: 2 }, &executor);
/// assert!(matches!(first, Err(Error::Interrupted { .. })));
/// executor.cancel.withdraw();
/// // The plan in the folder is enough from now on, in another process too.
/// for index in 0..2 {
///     let shard = Shard { index, of: 2 };
///     Study::read(&folder.join("plan.json"), Some(shard))?.run_shard(folder, shard, &executor)?;
/// }
/// let (merged, result) = Study::merge_parts(folder, &|shard| format!("run shard {shard}"))?;
/// assert_eq!(result.counts, study.run(&executor)?.counts);
/// assert_eq!(merged.score(&result.counts)?, study.score(&result.counts)?);
/// # Ok(())
/// # }
/// ```
pub struct Study {
    cases: StudyCases,
    facts: StudyProvenance,
    /// The file that it was read from, with the hash of the run.
    file: Option<(PathBuf, String)>,
}

/// Plans a [`Study`] of scenarios.
pub struct StudyBuilder<'a> {
    collection: &'a Collection,
    profile: Profile,
    /// Categories, models, headways, parameterizations [default: all, with the paper's headways].
    pub options: StudyOptions,
    /// Mining options of the scenarios, for the record.
    pub mining: MiningOptions,
    /// Options of the scores.
    pub score: ScoreOptions,
    /// Origin of the scenarios, for the report.
    pub data: String,
    /// SHA-256 of the file that the scenarios were read from, for the record.
    pub scenario_file_sha256: Option<String>,
    /// Shows the paper's published numbers with the results.
    pub published: bool,
    /// The lanes run in f64, by [`CpuBackend::reference`](lanesweep_engine::CpuBackend::reference).
    pub reference: bool,
}

impl StudyBuilder<'_> {
    /// Plans the study.
    ///
    /// # Errors
    /// [`Error::Input`] if no scenario of these categories was kept, or if scenarios are too long for their sample
    /// rate.
    pub fn plan(self) -> Result<Study> {
        let StudyBuilder { collection, profile, options, mining, score, data, .. } = self;
        score.validate()?;
        let cases = outline_study(&collection.scenarios, &profile, &options)?;
        if cases.outline().unit_count() == 0 {
            return Err(Error::input(
                Place::item(data),
                format!("no scenario to simulate ({})", counts_text(&counts(&collection.scenarios))),
                format!("use more recordings, or relax the filters ([mining] in {})", option("config")),
            ));
        }
        let kept = collection.scenarios.iter().filter(|s| s.kept && s.category != Category::Lvd);
        let mut widths_m: Vec<f64> = kept.map(|scenario| scenario.lane_width).collect();
        widths_m.sort_by(f64::total_cmp);
        let (width_m, moved_m) = (widths_m.get(widths_m.len() / 2).copied(), options.parameterization.lane_change_m);
        if let Some(width_m) = width_m.filter(|width_m| !(0.7..=1.4).contains(&(moved_m / width_m))) {
            tracing::warn!(
                "`parameterization.lane_change_m` is {moved_m} m, the median lane {width_m} m wide: a lane change moves from middle to middle"
            );
        }
        let facts = StudyProvenance {
            data,
            synthetic: collection.synthetic,
            published: self.published,
            reference: self.reference,
            incomplete: !collection.problems.is_empty(),
            scenario_file_sha256: self.scenario_file_sha256,
            categories: category_provenance(collection, &cases),
            left_out: collection.problems.iter().chain(cases.left_out()).map(Error::to_string).collect(),
            notes: collection.notes.clone(),
            recordings: collection.recordings.clone(),
            mining: collection.mining.clone().unwrap_or(mining),
            parameterization: options.parameterization,
            score,
        };
        Ok(Study { cases, facts, file: None })
    }
}

impl Study {
    /// Kind of the sealed plan file.
    pub(super) const KIND: &str = "study plan";

    /// Begins a study of the kept scenarios.
    pub fn builder(collection: &Collection, profile: Profile) -> StudyBuilder<'_> {
        StudyBuilder {
            collection,
            profile,
            options: StudyOptions::default(),
            mining: MiningOptions::default(),
            score: ScoreOptions::default(),
            data: "scenarios".to_owned(),
            scenario_file_sha256: None,
            published: false,
            reference: false,
        }
    }

    /// The plan without cases: counts, keys, hash.
    pub fn plan(&self) -> &LanePlan {
        self.cases.outline()
    }

    /// The cases, window by window.
    pub fn cases(&self) -> &StudyCases {
        &self.cases
    }

    /// Data of a report in addition to the outcomes.
    pub fn facts(&self) -> &StudyProvenance {
        &self.facts
    }

    /// Scores the counts of the whole study.
    ///
    /// # Errors
    /// As [`score`].
    pub fn score(&self, counts: &Partial) -> Result<ScoreTable> {
        score(self.plan(), counts, &self.facts.score)
    }

    /// The first line of the plan file, and the hash of the run. The line contains the checksums of the rest.
    pub(crate) fn seal(&self) -> Result<(Vec<u8>, String)> {
        seal(Study::KIND, &StudyPlanFile { facts: self.facts.clone(), plan: self.cases.head().clone() })
    }

    /// Adds the plan file to the results, unless it is larger than `max_bytes`; returns whether it did.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn keep(&self, results: &mut Results, name: &str, max_bytes: u64) -> Result<bool> {
        let line = self.seal()?.0;
        let is_kept = line.len() as u64 + self.cases.head().scenario_bytes() <= max_bytes;
        if is_kept {
            results.add_with(name, |file| self.cases.write_file(&line, file))?;
        }
        Ok(is_kept)
    }

    /// Reads a plan file; for a shard, only its scenarios.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Input`] for any other or incomplete file, or another version or engine.
    pub fn read(path: &Path, shard: Option<Shard>) -> Result<Study> {
        Study::read_units(path, |count| units_of(shard, count))
    }

    /// The same for an interval of the scenarios that `wanted` selects by their number; reads nothing else of the file.
    fn read_units(path: &Path, wanted: impl FnOnce(u64) -> Range<u64>) -> Result<Study> {
        let (file, run_sha256, mut scenarios) = read_sealed_line(Study::KIND, path, MAX_HEAD_BYTES, HOW_TO_REMAKE)?;
        let StudyPlanFile { facts, plan } = file;
        let cases = plan.read(&mut scenarios, &Place::file(path), wanted)?;
        Ok(Study { cases, facts, file: Some((path.to_path_buf(), run_sha256)) })
    }
}

const HOW_TO_REMAKE: &str = "make it by `study --plan-only` of this version";
