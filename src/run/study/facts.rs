//! What a study's report says beside the lanes' outcomes: a plan file carries it.

use serde::{Deserialize, Serialize};

use super::cases::StudyCases;
use super::histogram::{ParameterHistogram, parameter_histograms};
use crate::Result;
use crate::engine::{Block, Headway};
use crate::run::close_following::close_units;
use crate::run::score::ScoreOptions;
use crate::scenario::Scenario;
use crate::scenario::parameterization::{ModeShape, ParameterizationOptions, Reduction};
use crate::traffic::mining::{Collection, MiningOptions, RecordingSummary, count};

/// One category's scenarios.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CategoryProvenance {
    /// Scenarios found.
    pub found: u64,
    /// Those that passed the filters.
    pub kept: u64,
    /// Explained variance of the decomposition by its first coefficients, where there is one.
    pub svd_explained: Vec<f64>,
    /// Histograms of the parameters.
    pub parameters: Vec<ParameterHistogram>,
    /// Shapes of the decomposition's first directions.
    pub modes: Vec<ModeShape>,
    /// Scenarios (by index among the kept ones) whose recorded headway is below 0.5 s; empty where headways are imposed.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub close_units: Vec<u64>,
}

/// What a report says beside the lanes' outcomes.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StudyProvenance {
    /// What the scenarios are of.
    pub data: String,
    /// Made up by the program, in whole or in part.
    pub synthetic: bool,
    /// The paper's published numbers stand beside the results.
    pub published: bool,
    /// The lanes are run in f64.
    pub reference: bool,
    /// Parts of the input were left out.
    pub incomplete: bool,
    /// SHA-256 of the scenario file, where they were read from one.
    pub scenario_file_sha256: Option<String>,
    /// The recordings that were used.
    pub recordings: Vec<RecordingSummary>,
    /// What was left out, and why.
    pub left_out: Vec<String>,
    /// What the data leave open or what looks wrong in them.
    pub notes: Vec<String>,
    /// One per block of the plan.
    pub categories: Vec<CategoryProvenance>,
    /// How the scenarios were mined.
    pub mining: MiningOptions,
    /// Options of the parameterizations.
    pub parameterization: ParameterizationOptions,
    /// How the counts are scored.
    pub score: ScoreOptions,
}

/// Of every block of the plan.
pub(super) fn category_facts(
    collection: &Collection,
    planned: &StudyCases,
    options: &ParameterizationOptions,
) -> Result<Vec<CategoryProvenance>> {
    let facts = |(block, reduction): (&Block, &Option<Reduction>)| {
        let of = count(&collection.scenarios, block.category);
        let reduction = reduction.as_ref();
        let svd_explained = reduction.map_or(Vec::new(), |r| r.basis.explained().into_iter().take(8).collect());
        let kept: Vec<&Scenario> =
            collection.scenarios.iter().filter(|s| s.category == block.category && s.kept).collect();
        let modes = reduction.map_or(Ok(Vec::new()), |reduction| reduction.mode_shapes(&kept))?;
        let parameters = parameter_histograms(block.category, &kept, options)?;
        let is_observed = Headway::is_observed(&planned.outline().headways);
        let close_units = if is_observed { close_units(kept.iter().copied()) } else { Vec::new() };
        Ok(CategoryProvenance { found: of.found, kept: of.kept, svd_explained, parameters, modes, close_units })
    };
    planned.outline().blocks.iter().zip(&planned.reductions).map(facts).collect()
}
