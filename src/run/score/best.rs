//! The parameterization that agrees best with S, per category and driver model, and how certain this is.

use super::claims::units_of;
use super::difference::{Contrast, ScenarioRate, ScoreInterval, min_contrast};
use super::{CategoryScores, ScoreTable, f1};
use lanesweep_engine::{LanePlan, Partial, UnitCounts};
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_model::scenario::Category;

/// The best parameterization of one category for one model.
#[derive(Debug, Clone, PartialEq)]
pub struct Best {
    /// Kind of scenario.
    pub category: Category,
    /// Driver model.
    pub model: ModelId,
    /// Failures of S.
    pub failures: u64,
    /// Scenarios in which S fails.
    pub failing_scenarios: u64,
    /// The result; `None` if S fails in fewer scenarios than [`super::ScoreOptions::min_failures`].
    pub score: Option<BestScore>,
    /// So many times as many scenarios would tell it from all rivals, or give a result, if nothing else changes. 1: these
    /// do. `None`: more than 20.
    pub data_for_decision: Option<f64>,
}

/// Nobody collects so many times as much data.
const MAX_TIMES: f64 = 20.0;

/// Scores of a best parameterization.
#[derive(Debug, Clone, PartialEq)]
pub struct BestScore {
    /// Its name.
    pub variant: String,
    /// Its F1, the maximum in the category.
    pub f1: f64,
    /// Interval of F1 over scenarios.
    pub interval: ScoreInterval,
    /// Number of runs that fail in S alone.
    pub missed: u64,
    /// Number of runs that fail in it alone.
    pub invented: u64,
    /// Parameterizations whose F1 is not significantly different.
    pub rivals: Vec<String>,
}

/// The best parameterization per category and model of a table, for a criterion. `counts` are the counts that the table
/// scores.
pub fn best_parameterizations(
    table: &ScoreTable,
    plan: &LanePlan,
    counts: &Partial,
    criterion: Criterion,
) -> Vec<Best> {
    let of = |scores: &CategoryScores, model: ModelId| {
        let s = &scores.cells[scores.index(0, model, criterion)?];
        let min_failures = u64::from(table.options.min_failures.max(1));
        let units = units_of(plan, counts, scores.category);
        let score = || best_score(scores, units, (model, criterion), table.options.confidence);
        let found = (s.failing_scenarios >= min_failures).then(score).flatten();
        let too_few = || (None, min_failures as f64 / s.failing_scenarios as f64);
        let (score, times) = found.map_or_else(too_few, |(score, times)| (Some(score), times));
        Some(Best {
            category: scores.category,
            model,
            failures: s.counts.tp,
            failing_scenarios: s.failing_scenarios,
            score,
            data_for_decision: (times <= MAX_TIMES).then_some(times),
        })
    };
    let pairs = table.categories.iter().flat_map(|scores| scores.models.iter().map(move |model| (scores, *model)));
    pairs.filter_map(|(scores, model)| of(scores, model)).collect()
}

/// The best, and the multiple of the scenarios that tells it from all rivals; infinite if a rival has the same F1.
fn best_score(
    scores: &CategoryScores,
    units: &[UnitCounts],
    (model, criterion): (ModelId, Criterion),
    level: f64,
) -> Option<(BestScore, f64)> {
    let places = scores.judged().into_iter().filter_map(|variant| scores.index(variant, model, criterion));
    let scored: Vec<(usize, f64)> = places.filter_map(|at| Some((at, f1(&scores.cells[at].counts)?))).collect();
    // The first of equals: parameterizations are in the order of the paper.
    let &(best, value) = scored.iter().rev().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let rate = |at: usize| ScenarioRate::f1(units.iter().filter_map(|unit| unit.cells.get(at)));
    let name = |at: usize| scores.variants[scores.cells[at].variant].clone();
    // The best is selected with the same data, so every other one is compared at a fraction of the error level
    // (Bonferroni).
    let shared = 1.0 - (1.0 - level) / scored.len().saturating_sub(1).max(1) as f64;
    let (mut rivals, mut more_data) = (Vec::new(), 1.0_f64);
    for &(other, theirs) in scored.iter().filter(|(at, _)| *at != best) {
        let contrast = [Contrast::difference(0, 1)];
        let (_, interval) = min_contrast(&[rate(best), rate(other)], &contrast, shared)?;
        if interval.low <= 0.0 {
            rivals.push(name(other));
            let distance = value - theirs;
            // The width of an interval decreases with the square root of the number of scenarios.
            let times = ((distance - interval.low) / distance).powi(2);
            more_data = more_data.max(if distance > 0.0 { times } else { f64::INFINITY });
        }
    }
    let (interval, counts) = (rate(best).interval(level), scores.cells[best].counts);
    let (missed, invented) = (counts.fn_, counts.fp);
    Some((BestScore { variant: name(best), f1: value, interval, missed, invented, rivals }, more_data))
}
