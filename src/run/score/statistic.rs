//! The statistics that claims are about: functions of the counts of one category, per model and criterion.

use super::table::{CategoryScores, f1};
use crate::engine::Confusion;
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;

/// A number whose sign (or smallness) a claim is about.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Statistic {
    /// Least F1 of the first minus largest F1 of the second.
    F1Above(&'static [&'static str], &'static [&'static str]),
    /// A bound minus the F1 of a variant.
    F1Below(&'static str, f64),
    /// F1 difference of two variants, claimed to be nearly 0.
    F1Near(&'static str, &'static str),
    /// (FP − FN)/(2TP + FP + FN), mean over variants: > 0 where false positives dominate. Has the sign of
    /// recall − precision and stays defined where S' never fails.
    FalsePositivesDominate(&'static [&'static str]),
    /// The same with the other sign: > 0 where false negatives dominate.
    FalseNegativesDominate(&'static [&'static str]),
    /// Least failure rate of S among the first models minus the largest among the others, same criterion.
    FailsMoreOften(&'static [ModelId], &'static [ModelId]),
    /// Failure rate of S in this criterion minus that in another one, same model.
    FailsMoreThan(Criterion),
}

impl Statistic {
    /// Its value on one set of counts (the whole sample or a bootstrap draw); `None` where it is 0/0.
    pub fn value(
        &self,
        scores: &CategoryScores,
        counts: &dyn Fn(usize) -> Confusion,
        model: ModelId,
        criterion: Criterion,
    ) -> Option<f64> {
        let cell = |variant: &str, model: ModelId, criterion: Criterion| -> Option<Confusion> {
            scores.index(scores.variant(variant)?, model, criterion).map(counts)
        };
        let f1_of = |variant: &&str| f1(&cell(variant, model, criterion)?);
        let mean = |values: Option<Vec<f64>>| values.map(|v| v.iter().sum::<f64>() / v.len() as f64);
        let rate = |c: Confusion| c.tp as f64 / (c.tp as f64 + c.tn as f64).max(1.0);
        match *self {
            Statistic::F1Above(better, worse) => {
                let better = better.iter().map(f1_of).collect::<Option<Vec<f64>>>()?;
                let worse = worse.iter().map(f1_of).collect::<Option<Vec<f64>>>()?;
                let least = better.into_iter().fold(f64::INFINITY, f64::min);
                Some(least - worse.into_iter().fold(f64::NEG_INFINITY, f64::max))
            }
            Statistic::F1Below(variant, bound) => Some(bound - f1_of(&variant)?),
            Statistic::F1Near(a, b) => Some(f1_of(&a)? - f1_of(&b)?),
            Statistic::FalsePositivesDominate(variants) => {
                mean(variants.iter().map(|v| excess(&cell(v, model, criterion)?)).collect())
            }
            Statistic::FalseNegativesDominate(variants) => {
                mean(variants.iter().map(|v| excess(&cell(v, model, criterion)?)).collect()).map(|e| -e)
            }
            Statistic::FailsMoreOften(often, seldom) => {
                let rates = |models: &[ModelId]| -> Option<Vec<f64>> {
                    models.iter().map(|m| Some(rate(cell("S", *m, criterion)?))).collect()
                };
                let least = rates(often)?.into_iter().fold(f64::INFINITY, f64::min);
                Some(least - rates(seldom)?.into_iter().fold(f64::NEG_INFINITY, f64::max))
            }
            Statistic::FailsMoreThan(other) => {
                Some(rate(cell("S", model, criterion)?) - rate(cell("S", model, other)?))
            }
        }
    }

    /// Failures of S that this cell has to judge the claim by: those of every model and criterion compared.
    pub fn failures(&self, scores: &CategoryScores, model: ModelId, criterion: Criterion) -> u64 {
        let of = |model: ModelId, criterion: Criterion| {
            scores.index(0, model, criterion).map_or(0, |at| scores.cells[at].counts.tp)
        };
        match *self {
            Statistic::FailsMoreOften(often, seldom) => often.iter().chain(seldom).map(|m| of(*m, criterion)).sum(),
            Statistic::FailsMoreThan(other) => of(model, criterion) + of(model, other),
            _ => of(model, criterion),
        }
    }

    /// Scenarios with such a failure, at least: those of the model and criterion that fails in most.
    pub fn failing_scenarios(&self, scores: &CategoryScores, model: ModelId, criterion: Criterion) -> u64 {
        let of = |model: ModelId, criterion: Criterion| {
            scores.index(0, model, criterion).map_or(0, |at| scores.cells[at].failing_scenarios)
        };
        match *self {
            Statistic::FailsMoreOften(often, seldom) => {
                often.iter().chain(seldom).map(|m| of(*m, criterion)).max().unwrap_or(0)
            }
            Statistic::FailsMoreThan(other) => of(model, criterion).max(of(model, other)),
            _ => of(model, criterion),
        }
    }

    /// The models that it compares beyond the cell's own.
    pub fn models(&self) -> Vec<ModelId> {
        match *self {
            Statistic::FailsMoreOften(often, seldom) => [often, seldom].concat(),
            _ => Vec::new(),
        }
    }

    /// The variants that it needs.
    pub fn variants(&self) -> Vec<&'static str> {
        match *self {
            Statistic::F1Above(a, b) => [a, b].concat(),
            Statistic::F1Below(v, _) => vec![v],
            Statistic::F1Near(a, b) => vec![a, b],
            Statistic::FalsePositivesDominate(v) | Statistic::FalseNegativesDominate(v) => v.to_vec(),
            Statistic::FailsMoreOften(..) | Statistic::FailsMoreThan(_) => vec!["S"],
        }
    }
}

/// (FP − FN)/(2TP + FP + FN); `None` where neither S nor S' ever fails.
fn excess(c: &Confusion) -> Option<f64> {
    let (fn_, fp) = (c.fn_ as f64, c.fp as f64);
    let all = 2.0 * c.tp as f64 + fn_ + fp;
    (all > 0.0).then(|| (fp - fn_) / all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_excess_past_2_to_the_32_is_that_of_its_shares() {
        let c = Confusion { tp: 3 << 31, fn_: 1 << 31, fp: 5 << 31, tn: 0 };
        assert_eq!(excess(&c), Some(4.0 / 12.0));
    }
}
