//! F1 over several cells: the mean of every parameterization, with its interval over scenarios.

use super::claims::units_of;
use super::difference::{Contrast, ScenarioRate, ScoreInterval, min_contrast};
use super::{CategoryScores, ScoreOptions, f1};
use lanesweep_engine::{LanePlan, Partial};
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;

/// Mean F1 over the cells whose F1 is defined for every parameterization.
#[derive(Debug, Clone, PartialEq)]
pub struct MeanF1 {
    /// The criteria of the cells.
    pub criteria: Vec<Criterion>,
    /// Number of failing scenarios of S in the cell that has fewest; 0 without cells.
    pub fewest_failing: u64,
    /// Mean and interval, one per parameterization; empty without cells. No interval if a cell has too few scenarios.
    pub values: Vec<(f64, Option<ScoreInterval>)>,
}

impl MeanF1 {
    /// Over all models and these criteria, from the scores and the counts of each scenario.
    pub(crate) fn of(
        scores: &CategoryScores,
        (plan, counts): (&LanePlan, &Partial),
        criteria: &[Criterion],
        options: &ScoreOptions,
    ) -> MeanF1 {
        let units = units_of(plan, counts, scores.category);
        let variants = 1..scores.variants.len();
        let cells = scores.models.iter().flat_map(|&model| criteria.iter().map(move |&criterion| (model, criterion)));
        let value = |variant: usize, (model, criterion): (ModelId, Criterion)| {
            scores.index(variant, model, criterion).and_then(|at| f1(&scores.cells[at].counts))
        };
        let is_shared = |cell: &(ModelId, Criterion)| variants.clone().all(|variant| value(variant, *cell).is_some());
        let cells: Vec<(ModelId, Criterion)> = cells.filter(is_shared).collect();
        let fewest = cells.iter().map(|&(model, criterion)| scores.failing_scenarios(model, criterion)).min();
        let fewest_failing = fewest.unwrap_or(0);
        let is_enough = fewest_failing >= u64::from(options.min_failures.max(1));
        let share = 1.0 / cells.len() as f64;
        let mean = |variant: usize| {
            let rates = cells.iter().filter_map(|&(model, criterion)| {
                let at = scores.index(variant, model, criterion)?;
                Some(ScenarioRate::f1(units.iter().filter_map(move |unit| unit.cells.get(at))))
            });
            let rates: Vec<ScenarioRate> = if is_enough { rates.collect() } else { Vec::new() };
            let contrast = Contrast { constant: 0.0, terms: (0..rates.len()).map(|at| (share, at)).collect() };
            let interval = is_enough.then(|| min_contrast(&rates, &[contrast], options.confidence)).flatten();
            let sum: f64 = cells.iter().filter_map(|&cell| value(variant, cell)).sum();
            (share * sum, interval.map(|(_, interval)| interval))
        };
        let values = if cells.is_empty() { Vec::new() } else { variants.clone().map(mean).collect() };
        MeanF1 { criteria: criteria.to_vec(), fewest_failing, values }
    }
}

/// All pairs of recall and precision with this F1: P = F·R/(2R − F).
pub fn equal_f1(f: f64) -> Vec<(f64, f64)> {
    let min_recall = f / (2.0 - f);
    let value = |k: u32| {
        let r = 1.0 + (min_recall - 1.0) * f64::from(k) / 20.0;
        (r, (f * r / (2.0 * r - f)).min(1.0))
    };
    (0..=20).rev().map(value).collect()
}

/// The points that no other point with at most the same x exceeds, from left to right.
pub fn pareto_front(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.total_cmp(&a.1)));
    let mut front: Vec<(f64, f64)> = Vec::new();
    for point in sorted {
        if front.last().is_none_or(|last| point.1 > last.1) {
            front.push(point);
        }
    }
    front
}
