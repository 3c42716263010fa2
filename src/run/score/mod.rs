//! Scores: how far S' agrees with S.
//!
//! This module contains recall, precision and F1 ([`ScoreTable`]), intervals of their differences over scenarios, and
//! the best parameterizations. It also contains the paper's claims as data with their verdicts, and the paper's
//! published numbers. It contains nothing about lanes. Counts come from [`lanesweep_engine`]'s partials; scores go to
//! the report.

mod best;
mod claims;
mod difference;
mod headways;
mod paper_claims;
mod published;
mod statistic;

pub use best::{Best, BestScore, best_parameterizations};
pub use claims::{ClaimResult, ClaimRow, ClaimVerdict, check_claims};
pub use difference::{Contrast, ScenarioRate, ScoreInterval, min_contrast};
pub use headways::HeadwayFailures;
pub use paper_claims::Claim;
pub use published::{Misfit, PublishedFailures, published_failures, published_lvd_f1};
pub use statistic::Statistic;

use rayon::prelude::*;

use lanesweep_engine::{Confusion, Headway, LanePlan, Partial, UnitCounts};
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_model::scenario::Category;
use lanesweep_model::scenario::parameterization::Parameterization;
use lanesweep_support::{Error, Place, Result, config_tables, ranges};

/// Ending of the name of a parameterization that replays each scenario by a basis that has not seen it.
pub const CROSS_VALIDATED: &str = "-cv";

/// Recall TP/(TP + FN); `None` if S never fails.
pub fn recall(c: &Confusion) -> Option<f64> {
    ratio(c.tp as f64, c.tp as f64 + c.fn_ as f64)
}

/// Precision TP/(TP + FP); `None` if S' never fails.
pub fn precision(c: &Confusion) -> Option<f64> {
    ratio(c.tp as f64, c.tp as f64 + c.fp as f64)
}

/// F1 = 2TP/(2TP + FP + FN); `None` if neither ever fails, because 0/0 is undefined.
///
/// ```
/// use lanesweep::run::score::f1;
/// use lanesweep::engine::Confusion;
///
/// // S and S' fail together 8 times, S alone twice, S' alone never.
/// let counts = Confusion { tp: 8, fn_: 2, fp: 0, tn: 90 };
/// assert_eq!(f1(&counts), Some(16.0 / 18.0));
/// assert_eq!(f1(&Confusion { tp: 0, fn_: 0, fp: 0, tn: 100 }), None);
/// ```
pub fn f1(c: &Confusion) -> Option<f64> {
    let twice = 2.0 * c.tp as f64;
    ratio(twice, twice + c.fn_ as f64 + c.fp as f64)
}

/// In f64, where no sum overflows; sums below 2^53 are exact.
fn ratio(numerator: f64, denominator: f64) -> Option<f64> {
    (denominator > 0.0).then(|| numerator / denominator)
}

/// The interval of F1 from the counts of each scenario, with scenarios as clusters ([`ScenarioRate::f1`]).
///
/// `None` if S fails in fewer than [`ScoreOptions::min_failures`] scenarios.
pub fn f1_interval<'a>(
    scenarios: impl Iterator<Item = &'a Confusion<u32>> + Clone,
    options: &ScoreOptions,
) -> Option<ScoreInterval> {
    let failing = scenarios.clone().filter(|c| c.tp > 0 || c.fn_ > 0).count();
    let is_enough = failing >= options.min_failures.max(1) as usize;
    is_enough.then(|| ScenarioRate::f1(scenarios).interval(options.confidence))
}

/// One cell of the table.
#[derive(Debug, Clone, PartialEq)]
pub struct ScoreCell {
    /// Index into [`CategoryScores::variants`]; 0 is S itself.
    pub variant: usize,
    /// Driver model.
    pub model: ModelId,
    /// Criterion.
    pub criterion: Criterion,
    /// Counts over (scenario, headway) pairs.
    pub counts: Confusion,
    /// Interval of F1 over scenarios; `None` if S fails in fewer than [`ScoreOptions::min_failures`] of them.
    pub f1_interval: Option<ScoreInterval>,
    /// Number of scenarios in which S fails from some headway.
    pub failing_scenarios: u64,
}

/// Scores of one category.
#[derive(Debug, Clone, PartialEq)]
pub struct CategoryScores {
    /// Kind of scenario.
    pub category: Category,
    /// Number of simulated scenarios.
    pub scenarios: u64,
    /// Simulations of S per model: scenarios × headways.
    pub simulations: u64,
    /// Names of the variants; the first is `S`.
    pub variants: Vec<String>,
    /// Models, in order.
    pub models: Vec<ModelId>,
    /// One per variant × model × criterion, in that order.
    pub cells: Vec<ScoreCell>,
    /// Lanes that ended at the time cap, one per variant × model.
    pub capped: Vec<u64>,
}

impl CategoryScores {
    /// Index of a cell in [`CategoryScores::cells`]; `None` for a model that was not run.
    pub fn index(&self, variant: usize, model: ModelId, criterion: Criterion) -> Option<usize> {
        let model = self.models.iter().position(|m| *m == model)?;
        Some((variant * self.models.len() + model) * Criterion::ALL.len() + criterion.index())
    }

    /// Number of scenarios in which S fails a criterion with a model; 0 for a model that was not run.
    pub fn failing_scenarios(&self, model: ModelId, criterion: Criterion) -> u64 {
        self.index(0, model, criterion).and_then(|at| self.cells.get(at)).map_or(0, |cell| cell.failing_scenarios)
    }

    /// Variants by which parameterizations are judged: a basis that has seen the scenarios that it replays is none where
    /// there is one that has not.
    pub fn judged(&self) -> Vec<usize> {
        let has_held_out = |at: &usize| self.variants.contains(&format!("{}{CROSS_VALIDATED}", self.variants[*at]));
        (1..self.variants.len()).filter(|at| !has_held_out(at)).collect()
    }

    /// Whether decompositions are judged on scenarios that they have not seen.
    pub fn is_cross_validated(&self) -> bool {
        self.variants.iter().any(|variant| variant.ends_with(CROSS_VALIDATED))
    }

    /// Whether a decomposition is judged on the scenarios that it was fitted on.
    pub fn is_in_sample(&self) -> bool {
        let found =
            self.judged().into_iter().filter_map(|at| Parameterization::find(self.category, &self.variants[at]));
        found.map(|id| id.coefficients()).any(|coefficients| coefficients.is_some())
    }

    /// Index of a variant by its name.
    pub(crate) fn variant(&self, name: &str) -> Option<usize> {
        self.variants.iter().position(|v| v == name)
    }
}

/// Scores of a whole study.
#[derive(Debug, Clone, PartialEq)]
pub struct ScoreTable {
    /// One per category of the plan.
    pub categories: Vec<CategoryScores>,
    /// Headways of the simulations.
    pub headways: Vec<Headway>,
    /// Options of the scores.
    pub options: ScoreOptions,
}

/// Scores a complete partial.
///
/// # Errors
/// [`Error::Input`] if units are missing, the partial belongs to another plan, or its counts contradict each other or
/// the plan.
pub fn score(plan: &LanePlan, partial: &Partial, options: &ScoreOptions) -> Result<ScoreTable> {
    if !partial.is_complete(plan) {
        let problem = if partial.plan_hash() == plan.hash() {
            format!("{} of {} units are there", partial.units().len(), plan.unit_count())
        } else {
            format!("it belongs to plan {}, not to {}", partial.plan_hash(), plan.hash())
        };
        return Err(Error::input(Place::item("partial result"), problem, "compute the missing units first"));
    }
    if !partial.fits(plan) {
        let problem = "a unit has other variants, models or criteria than the plan";
        return Err(Error::input(Place::item("partial result"), problem, "score it with the plan of its sweep"));
    }
    let criteria = Criterion::ALL.len();
    let mut categories = Vec::new();
    for block in &plan.blocks {
        let first = block.first_unit as usize;
        let units: &[UnitCounts] = &partial.units()[first..first + block.units.len() as usize];
        let width = block.variants.len() * plan.models.len() * criteria;
        let mut totals = vec![Confusion::default(); width];
        let mut capped = vec![0_u64; block.variants.len() * plan.models.len()];
        for unit in units {
            totals.iter_mut().zip(&unit.cells).for_each(|(total, cell)| total.add(cell));
            capped.iter_mut().zip(&unit.capped).for_each(|(total, &count)| *total += u64::from(count));
        }
        let cells = (0..width)
            .into_par_iter()
            .map(|at| {
                let counts = units.iter().map(|unit| &unit.cells[at]);
                ScoreCell {
                    variant: at / (plan.models.len() * criteria),
                    model: plan.models[at / criteria % plan.models.len()],
                    criterion: Criterion::ALL[at % criteria],
                    counts: totals[at],
                    failing_scenarios: counts.clone().filter(|c| c.tp + c.fn_ > 0).count() as u64,
                    f1_interval: f1_interval(counts, options),
                }
            })
            .collect();
        categories.push(CategoryScores {
            category: block.category,
            scenarios: block.units.len(),
            simulations: block.units.len() * plan.headways.len() as u64,
            variants: block.variants.clone(),
            models: plan.models.clone(),
            cells,
            capped,
        });
    }
    Ok(ScoreTable { categories, headways: plan.headways.clone(), options: options.clone() })
}

config_tables! {
    /// How scores are made.
    pub struct ScoreOptions {
        /// Seed that chooses the lanes to check on the CPU. No score depends on it.
        #[schemars(extend("x-flag" = "seed", "x-verbs" = ["study"], "x-heading" = "Run"))]
        pub seed: u64 = 157,
        /// Coverage of the intervals (0.95).
        #[schemars(extend("minimum" = 0.5, "exclusiveMaximum" = 1.0))]
        pub confidence: f64 = 0.95,
        /// Below so many failures in S F1 has no interval; below so many scenarios with one a claim is not evaluated
        /// (10).
        #[schemars(range(min = 0, max = 4_294_967_295_u32))]
        pub min_failures: u32 = 10,
    }
}

impl ScoreOptions {
    /// Checks the ranges; the error names the option.
    pub(crate) fn validate(&self) -> Result<()> {
        ranges::check("score", self)
    }
}
