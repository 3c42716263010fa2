//! The statistics that claims are about: functions of the counts of one category, per model and criterion.

use super::table::{CategoryScores, f1, precision, recall};
use crate::criterion::Criterion;
use crate::driver::ModelId;
use crate::sweep::Confusion;

/// A number whose sign (or smallness) a claim is about.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Statistic {
    /// Least F1 of the first minus largest F1 of the second.
    F1Above(&'static [&'static str], &'static [&'static str]),
    /// A bound minus the F1 of a variant.
    F1Below(&'static str, f64),
    /// F1 difference of two variants, claimed to be nearly 0.
    F1Near(&'static str, &'static str),
    /// Recall minus precision, mean over variants: > 0 where false positives dominate.
    FalsePositivesDominate(&'static [&'static str]),
    /// FN minus FP per S failure, mean over variants: > 0 where false negatives dominate.
    FalseNegativesDominate(&'static [&'static str]),
    /// Failure rate of S of this model minus the mean one of others, same criterion.
    FailsMoreOften(&'static [ModelId]),
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
        let rate = |c: Confusion| f64::from(c.both) / f64::from((c.both + c.neither).max(1));
        match *self {
            Statistic::F1Above(better, worse) => {
                let better = better.iter().map(f1_of).collect::<Option<Vec<f64>>>()?;
                let worse = worse.iter().map(f1_of).collect::<Option<Vec<f64>>>()?;
                let least = better.into_iter().fold(f64::INFINITY, f64::min);
                Some(least - worse.into_iter().fold(f64::NEG_INFINITY, f64::max))
            }
            Statistic::F1Below(variant, bound) => Some(bound - f1_of(&variant)?),
            Statistic::F1Near(a, b) => Some(f1_of(&a)? - f1_of(&b)?),
            Statistic::FalsePositivesDominate(variants) => mean(
                variants
                    .iter()
                    .map(|v| {
                        let c = cell(v, model, criterion)?;
                        Some(recall(&c)? - precision(&c)?)
                    })
                    .collect(),
            ),
            Statistic::FalseNegativesDominate(variants) => mean(
                variants
                    .iter()
                    .map(|v| {
                        let c = cell(v, model, criterion)?;
                        let failures = c.both + c.only_s;
                        (failures > 0).then(|| (f64::from(c.only_s) - f64::from(c.only_s_prime)) / f64::from(failures))
                    })
                    .collect(),
            ),
            Statistic::FailsMoreOften(others) => {
                let own = rate(cell("S", model, criterion)?);
                let others = others.iter().map(|m| Some(rate(cell("S", *m, criterion)?))).collect();
                Some(own - mean(others)?)
            }
            Statistic::FailsMoreThan(other) => {
                Some(rate(cell("S", model, criterion)?) - rate(cell("S", model, other)?))
            }
        }
    }

    /// The variants that it needs.
    pub fn variants(&self) -> Vec<&'static str> {
        match *self {
            Statistic::F1Above(a, b) => [a, b].concat(),
            Statistic::F1Below(v, _) => vec![v],
            Statistic::F1Near(a, b) => vec![a, b],
            Statistic::FalsePositivesDominate(v) | Statistic::FalseNegativesDominate(v) => v.to_vec(),
            Statistic::FailsMoreOften(_) | Statistic::FailsMoreThan(_) => vec!["S"],
        }
    }
}
