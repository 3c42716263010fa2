//! Data of a study's report in addition to the lanes' outcomes, such as histograms of the parameters. A plan file
//! contains it, so that a report needs no scenarios.

use serde::{Deserialize, Serialize};

use super::StudyOptions;
use super::cases::{StudyCases, WINDOW};
use super::folds::folds;
use super::motion_error::{MotionError, MotionSpread};
use crate::score::{CROSS_VALIDATED, ScoreOptions};
use lanesweep_engine::Block;
use lanesweep_model::scenario::parameterization::{
    ModeShape, Parameter, Parameterization, ParameterizationOptions, Reduction, SpeedProfile,
};
use lanesweep_model::scenario::{Category, Scenario};
use lanesweep_stats::density::ParameterSpace;
use lanesweep_support::Result;
use lanesweep_support::readable::plain_step;
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
    /// Histograms of the parameters.
    pub parameters: Vec<ParameterHistogram>,
    /// Shapes of the decomposition's first directions.
    pub modes: Vec<ModeShape>,
    /// Id and fold of each kept scenario, with cross-validation.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub folds: Vec<(String, usize)>,
    /// Error of the motions of each variant, in standard deviations of the recorded series, S first; only with S' that
    /// are given as series or cross-validated.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rmse: Vec<f64>,
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
pub(super) fn category_provenance(
    collection: &Collection,
    planned: &StudyCases,
    options: &StudyOptions,
) -> Result<Vec<CategoryProvenance>> {
    let rmse = motion_errors(planned)?;
    let facts = |(at, (block, reduction)): (usize, (&Block, &Option<Reduction>))| {
        let of = count(&collection.scenarios, block.category);
        let reduction = reduction.as_ref();
        let svd_explained = reduction.map_or(Vec::new(), |r| r.basis.explained().into_iter().take(8).collect());
        let kept: Vec<&Scenario> =
            collection.scenarios.iter().filter(|s| s.category == block.category && s.kept).collect();
        let modes = reduction.map_or(Ok(Vec::new()), |reduction| reduction.mode_shapes(&kept))?;
        let parameters = parameter_histograms(block.category, &kept, &options.parameterization)?;
        let folds = match options.folds {
            Some(count) if block.variants.iter().any(|name| name.ends_with(CROSS_VALIDATED)) => {
                kept.iter().map(|scenario| scenario.id.clone()).zip(folds(&kept, count)?).collect()
            }
            _ => Vec::new(),
        };
        Ok(CategoryProvenance {
            found: of.found,
            kept: of.kept,
            svd_explained,
            parameters,
            modes,
            folds,
            rmse: rmse.get(at).cloned().unwrap_or_default(),
        })
    };
    planned.outline().blocks.iter().zip(&planned.reductions).enumerate().map(facts).collect()
}

/// Errors of every variant of every block; empty without S' that are given as series.
fn motion_errors(planned: &StudyCases) -> Result<Vec<Vec<f64>>> {
    let blocks = &planned.outline().blocks;
    if !planned.has_given() {
        return Ok(Vec::new());
    }
    let mut sums: Vec<(MotionSpread, Vec<MotionError>)> = blocks
        .iter()
        .map(|block| (MotionSpread::default(), vec![MotionError::default(); block.variants.len()]))
        .collect();
    planned.in_windows(0..planned.outline().unit_count(), WINDOW, |plan, units| {
        for (at, inside) in plan.segments(units) {
            let (spread, errors) = &mut sums[at];
            for unit in inside {
                let recorded = plan.case(at, unit, 0);
                spread.add(&recorded, plan.tables());
                for (variant, error) in errors.iter_mut().enumerate() {
                    error.add((&recorded, plan.tables()), (&plan.case(at, unit, variant), plan.tables()));
                }
            }
        }
        Ok(())
    })?;
    let root = |(block, (spread, errors)): (&Block, (MotionSpread, Vec<MotionError>))| {
        errors.iter().map(|error| error.root(block.category, &spread)).collect()
    };
    Ok(blocks.iter().zip(sums).map(root).collect())
}

/// Maximum number of bins of a histogram.
const MAX_BINS: f64 = 40.0;

/// Counts of one parameter in equal bins.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterHistogram {
    /// Name with its unit, as in density files: `v_target_mps`.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Lower end of the first bin, a multiple of the width.
    pub low: f64,
    /// Width of a bin, a round number.
    pub width: f64,
    /// Scenarios per bin.
    pub counts: Vec<u64>,
}

/// Histograms of the parameters of the kinematic parameterization with the most parameters: cut-in 2, cut-out b, LVD i.
/// Empty without scenarios.
///
/// # Errors
/// Those of a scenario that lacks these parameters.
fn parameter_histograms(
    category: Category,
    scenarios: &[&Scenario],
    options: &ParameterizationOptions,
) -> Result<Vec<ParameterHistogram>> {
    // With recorded starts, only cut-in parameterizations without a gradual lane change have a density.
    let accelerates = |id: &Parameterization| {
        id.features().is_some_and(|features| features.speed == SpeedProfile::ConstantAcceleration)
    };
    let ids = Parameterization::of(category).filter(accelerates);
    let Some(space) = ids.filter_map(|id| ParameterSpace::new(id, options, None, false).ok()).next() else {
        return Ok(Vec::new());
    };
    let points = scenarios.iter().map(|scenario| space.point(scenario)).collect::<Result<Vec<_>>>()?;
    let of = |(at, parameter): (usize, &Parameter)| {
        let values: Vec<f64> = points.iter().map(|point| point[at]).collect();
        let (low, width, counts) = bins(values)?;
        Some(ParameterHistogram { name: parameter.name.clone(), unit: parameter.unit.clone(), low, width, counts })
    };
    Ok(space.parameters().iter().enumerate().filter_map(of).collect())
}

/// Lower end, width and counts by the rule of Freedman and Diaconis (1981), with a round number as width; `None`
/// without a finite value.
fn bins(mut values: Vec<f64>) -> Option<(f64, f64, Vec<u64>)> {
    values.retain(|value| value.is_finite());
    values.sort_unstable_by(f64::total_cmp);
    let (&first, &last) = (values.first()?, values.last()?);
    let n = values.len();
    let quartiles = values[n * 3 / 4] - values[n / 4];
    let rule = 2.0 * quartiles / libm::cbrt(n as f64);
    let min_width = ((last - first) / MAX_BINS).max(1e-9 * first.abs().max(last.abs())).max(1e-9);
    // Starts at half the rule's width, because the next round number is up to 2.5 times as large.
    let width = plain_step((0.5 * rule).max(min_width));
    let (from, to) = ((first / width).floor(), (last / width).floor());
    let mut counts = vec![0_u64; (to - from) as usize + 1];
    for value in values {
        counts[(((value / width).floor() - from) as usize).min((to - from) as usize)] += 1;
    }
    Some((from * width, width, counts))
}
