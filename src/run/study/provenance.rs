//! Data of a study's report in addition to the lanes' outcomes, such as the counts of scenarios. A plan file
//! contains it, so that a report needs no scenarios.

use serde::{Deserialize, Serialize};

use super::cases::StudyCases;
use crate::score::ScoreOptions;
use lanesweep_engine::Block;
use lanesweep_model::scenario::parameterization::{ParameterizationOptions, Reduction};
use lanesweep_traffic::mining::{Collection, MiningOptions, RecordingSummary, count};

/// One category's scenarios.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CategoryProvenance {
    /// Number of scenarios found.
    pub found: u64,
    /// Number that passed the filters.
    pub kept: u64,
    /// Explained variance of the decomposition by its first coefficients; empty without a decomposition.
    pub svd_explained: Vec<f64>,
    /// Id and fold of each kept scenario, with cross-validation.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub folds: Vec<(String, usize)>,
}

/// Data of a report in addition to the lanes' outcomes.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StudyProvenance {
    /// Origin of the scenarios.
    pub data: String,
    /// The program generated the data, in whole or in part.
    pub synthetic: bool,
    /// The report shows the paper's published numbers with the results.
    pub published: bool,
    /// The lanes are run in f64.
    pub reference: bool,
    /// Parts of the input were skipped.
    pub incomplete: bool,
    /// SHA-256 of the scenario file; `None` if the scenarios were not read from one.
    pub scenario_file_sha256: Option<String>,
    /// The recordings used.
    pub recordings: Vec<RecordingSummary>,
    /// What was skipped, with the reason.
    pub left_out: Vec<String>,
    /// Limitations and irregularities of the data.
    pub notes: Vec<String>,
    /// One per block of the plan.
    pub categories: Vec<CategoryProvenance>,
    /// Mining options of the scenarios.
    pub mining: MiningOptions,
    /// Options of the parameterizations.
    pub parameterization: ParameterizationOptions,
    /// Options of the scores.
    pub score: ScoreOptions,
}

/// The data of every block of the plan.
pub(super) fn category_provenance(collection: &Collection, planned: &StudyCases) -> Vec<CategoryProvenance> {
    let facts = |(block, reduction): (&Block, &Option<Reduction>)| {
        let of = count(&collection.scenarios, block.category);
        let reduction = reduction.as_ref();
        let svd_explained = reduction.map_or(Vec::new(), |r| r.basis.explained().into_iter().take(8).collect());
        let units = block.first_unit..block.first_unit + block.units.len();
        let held = units.filter_map(|unit| planned.scenario(unit));
        let folds = held.filter_map(|scenario| Some((scenario.id.clone(), scenario.fold?))).collect();
        CategoryProvenance { found: of.found, kept: of.kept, svd_explained, folds }
    };
    planned.outline().blocks.iter().zip(&planned.reductions).map(facts).collect()
}
