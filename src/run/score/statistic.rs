//! The statistics of claims: the minimum of some differences of scores, per model and criterion.

use super::CategoryScores;
use super::difference::{Contrast, ScenarioRate, ScoreInterval, min_contrast};
use lanesweep_engine::{Confusion, UnitCounts};
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;

/// A number whose sign (or closeness to 0) a claim is about.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Statistic {
    /// Minimum F1 of the first variants minus maximum F1 of the second.
    F1Above(&'static [&'static str], &'static [&'static str]),
    /// A bound minus the F1 of a variant.
    F1Below(&'static str, f64),
    /// F1 difference of two variants, claimed to be nearly 0.
    F1Near(&'static str, &'static str),
    /// ±(FP − FN)/(2TP + FP + FN), mean over variants, with the sign of the factor: > 0 if false positives (1), or false
    /// negatives (−1), dominate. It has the sign of recall − precision and is defined even if S' never fails.
    ErrorsDominate(&'static [&'static str], f64),
    /// Minimum failure rate of S among the first models minus the maximum among the others, same criterion.
    FailsMoreOften(&'static [ModelId], &'static [ModelId]),
    /// Failure rate of S in this criterion minus that in another one, same model.
    FailsMoreThan(Criterion),
}

/// One category's scenarios with the counts of each.
#[derive(Clone, Copy)]
pub(super) struct Scenarios<'a> {
    pub scores: &'a CategoryScores,
    pub units: &'a [UnitCounts],
}

impl<'a> Scenarios<'a> {
    /// The counts of a cell in every scenario; `None` if it was not run.
    fn counts(
        self,
        variant: &str,
        model: ModelId,
        criterion: Criterion,
    ) -> Option<impl Iterator<Item = &'a Confusion<u32>> + Clone> {
        let at = self.scores.index(self.scores.variant(variant)?, model, criterion)?;
        Some(self.units.iter().filter_map(move |unit| unit.cells.get(at)))
    }

    /// One kind of error over 2TP + FP + FN.
    fn share(
        self,
        variant: &str,
        (model, criterion): (ModelId, Criterion),
        error: fn(&Confusion<u32>) -> u32,
    ) -> Option<ScenarioRate> {
        let all = |c: &Confusion<u32>| 2 * u64::from(c.tp) + u64::from(c.fn_) + u64::from(c.fp);
        let (runs, hits) = self.counts(variant, model, criterion)?.map(|c| (all(c), u64::from(error(c)))).unzip();
        Some(ScenarioRate::new(runs, hits))
    }

    /// Failures of S.
    fn failures(self, model: ModelId, criterion: Criterion) -> Option<ScenarioRate> {
        let of = |c: &Confusion<u32>| (u64::from(c.tp) + u64::from(c.tn), u64::from(c.tp));
        let (runs, hits) = self.counts("S", model, criterion)?.map(of).unzip();
        Some(ScenarioRate::new(runs, hits))
    }

    /// Number of scenarios in which S fails in one of these cells.
    pub(super) fn failing(self, cells: &[(ModelId, Criterion)]) -> u64 {
        let places: Vec<usize> = cells.iter().filter_map(|&(m, c)| self.scores.index(0, m, c)).collect();
        let fails = |unit: &&UnitCounts| places.iter().any(|&at| unit.cells.get(at).is_some_and(|c| c.tp > 0));
        self.units.iter().filter(fails).count() as u64
    }
}

impl Statistic {
    /// The value with its interval; `None` if it is 0/0 or was not run.
    pub(super) fn value(&self, of: Scenarios, cell: (ModelId, Criterion), level: f64) -> Option<(f64, ScoreInterval)> {
        let (model, criterion) = cell;
        let f1 = |variant: &&str| Some(ScenarioRate::f1(of.counts(variant, model, criterion)?));
        let pairs = |first: usize, second: usize| {
            let pair = move |k: usize| (first..first + second).map(move |l| Contrast::difference(k, l));
            (0..first).flat_map(pair).collect::<Vec<_>>()
        };
        let (rates, contrasts) = match *self {
            Statistic::F1Above(better, worse) => {
                let rates = better.iter().chain(worse).map(f1).collect::<Option<Vec<_>>>()?;
                (rates, pairs(better.len(), worse.len()))
            }
            Statistic::F1Below(variant, bound) => {
                (vec![f1(&variant)?], vec![Contrast { constant: bound, terms: vec![(-1.0, 0)] }])
            }
            Statistic::F1Near(a, b) => (vec![f1(&a)?, f1(&b)?], pairs(1, 1)),
            Statistic::ErrorsDominate(variants, sign) => {
                let rates = variants.iter().flat_map(|v| [of.share(v, cell, |c| c.fp), of.share(v, cell, |c| c.fn_)]);
                let factor = |at: usize| sign / variants.len() as f64 * if at.is_multiple_of(2) { 1.0 } else { -1.0 };
                let terms = (0..2 * variants.len()).map(|at| (factor(at), at)).collect();
                (rates.collect::<Option<Vec<_>>>()?, vec![Contrast { constant: 0.0, terms }])
            }
            Statistic::FailsMoreOften(often, seldom) => {
                let models = often.iter().chain(seldom);
                let rates = models.map(|m| of.failures(*m, criterion)).collect::<Option<Vec<_>>>()?;
                (rates, pairs(often.len(), seldom.len()))
            }
            Statistic::FailsMoreThan(other) => {
                (vec![of.failures(model, criterion)?, of.failures(model, other)?], pairs(1, 1))
            }
        };
        min_contrast(&rates, &contrasts, level)
    }

    /// The cells of S whose failures count for a cell of the claim: those of every compared model and criterion.
    pub(super) fn judged_by(&self, (model, criterion): (ModelId, Criterion)) -> Vec<(ModelId, Criterion)> {
        match *self {
            Statistic::FailsMoreOften(often, seldom) => often.iter().chain(seldom).map(|m| (*m, criterion)).collect(),
            Statistic::FailsMoreThan(other) => vec![(model, criterion), (model, other)],
            _ => vec![(model, criterion)],
        }
    }

    /// The required variants.
    pub(super) fn variants(&self) -> Vec<&'static str> {
        match *self {
            Statistic::F1Above(a, b) => [a, b].concat(),
            Statistic::F1Below(v, _) => vec![v],
            Statistic::F1Near(a, b) => vec![a, b],
            Statistic::ErrorsDominate(v, _) => v.to_vec(),
            Statistic::FailsMoreOften(..) | Statistic::FailsMoreThan(_) => vec!["S"],
        }
    }
}
