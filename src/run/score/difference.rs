//! Differences of scores measured on the same scenarios, with intervals over scenarios.
//!
//! Each score is a rate with scenarios as clusters and has its own interval. The intervals are combined with the
//! correlation of the scores (Zou, "Toward using confidence intervals to compare correlations", Psychological Methods
//! 12, 2007). Percentiles of resampled differences have a much lower coverage: see the chapter on validation.

use lanesweep_engine::Confusion;
use lanesweep_stats::estimate::{Clusters, cluster_rate};

/// Ends of an interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScoreInterval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Counts of a score in each scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct ScenarioRate {
    runs: Vec<u64>,
    hits: Vec<u64>,
    is_f1: bool,
}

impl ScenarioRate {
    /// Hits over runs; both have one entry per scenario, in the same order for all rates of a contrast.
    pub(crate) fn new(runs: Vec<u64>, hits: Vec<u64>) -> ScenarioRate {
        ScenarioRate { runs, hits, is_f1: false }
    }

    /// F1 = 2J/(1 + J), a monotonic function of J = TP/(TP + FP + FN), the rate of agreement among all failures.
    pub fn f1<'a>(scenarios: impl Iterator<Item = &'a Confusion<u32>>) -> ScenarioRate {
        let any = |c: &Confusion<u32>| u64::from(c.tp) + u64::from(c.fn_) + u64::from(c.fp);
        let (runs, hits) = scenarios.map(|c| (any(c), u64::from(c.tp))).unzip();
        ScenarioRate { runs, hits, is_f1: true }
    }

    /// The score of a rate.
    fn score(&self, rate: f64) -> f64 {
        if self.is_f1 { 2.0 * rate / (1.0 + rate) } else { rate }
    }

    fn clusters(&self) -> Clusters<'_> {
        Clusters { runs: &self.runs, failures: &self.hits }
    }

    /// The score; `None` for 0/0.
    pub(crate) fn value(&self) -> Option<f64> {
        self.runs.iter().any(|runs| *runs > 0).then(|| self.score(self.clusters().rate()))
    }

    /// Its interval over the scenarios that have a run.
    pub(crate) fn interval(&self, level: f64) -> ScoreInterval {
        let with_runs = self.runs.iter().zip(&self.hits).filter(|(runs, _)| **runs > 0);
        let (runs, hits): (Vec<u64>, Vec<u64>) = with_runs.unzip();
        let rate = cluster_rate(Clusters { runs: &runs, failures: &hits }, level).interval;
        ScoreInterval { low: self.score(rate.low), high: self.score(rate.high) }
    }

    /// Contribution of each scenario to the rate, normalized to length 1; all 0 if every scenario has the same rate.
    fn direction(&self) -> Vec<f64> {
        let rate = self.clusters().rate();
        let influence = self.hits.iter().zip(&self.runs).map(|(&hits, &runs)| hits as f64 - rate * runs as f64);
        let mut direction: Vec<f64> = influence.collect();
        let length = direction.iter().map(|z| z * z).sum::<f64>().sqrt();
        if length > 0.0 {
            direction.iter_mut().for_each(|z| *z /= length);
        }
        direction
    }
}

/// A linear combination of rates, plus a constant.
#[derive(Debug, Clone, PartialEq)]
pub struct Contrast {
    /// Added to the sum.
    pub constant: f64,
    /// Factors and indices of the rates.
    pub terms: Vec<(f64, usize)>,
}

impl Contrast {
    /// One rate minus another.
    pub fn difference(minuend: usize, subtrahend: usize) -> Contrast {
        Contrast { constant: 0.0, terms: vec![(1.0, minuend), (-1.0, subtrahend)] }
    }
}

/// The minimum of some contrasts and its interval; `None` if a rate is 0/0.
///
/// The lower end is the minimum lower end at `level`, because the smallest contrast lies below its own lower end as
/// often as any other. The upper end is the minimum upper end at 1 − (1 − level)/n for n contrasts (Bonferroni),
/// because each of them may be too low by chance.
pub fn min_contrast(rates: &[ScenarioRate], contrasts: &[Contrast], level: f64) -> Option<(f64, ScoreInterval)> {
    let values = rates.iter().map(ScenarioRate::value).collect::<Option<Vec<f64>>>()?;
    let directions: Vec<Vec<f64>> = rates.iter().map(ScenarioRate::direction).collect();
    let correlation = |k: usize, l: usize| match k == l {
        true => 1.0,
        false => directions[k].iter().zip(&directions[l]).map(|(a, b)| a * b).sum(),
    };
    let correlations: Vec<Vec<f64>> =
        (0..rates.len()).map(|k| (0..rates.len()).map(|l| correlation(k, l)).collect()).collect();
    let intervals_at = |level: f64| rates.iter().map(|rate| rate.interval(level)).collect::<Vec<_>>();
    let (own, shared) = (intervals_at(level), intervals_at(1.0 - (1.0 - level) / contrasts.len().max(1) as f64));
    // Distance of an end of a sum's interval from its value: below (`sign` −1) or above.
    let reach = |contrast: &Contrast, intervals: &[ScoreInterval], sign: f64| {
        let part = |&(factor, at): &(f64, usize)| {
            let ScoreInterval { low, high } = intervals[at];
            factor * if factor * sign > 0.0 { high - values[at] } else { values[at] - low }
        };
        let parts: Vec<(f64, usize)> = contrast.terms.iter().map(|term| (part(term), term.1)).collect();
        let with_all = |a: &(f64, usize)| parts.iter().map(|b| a.0 * b.0 * correlations[a.1][b.1]).sum::<f64>();
        parts.iter().map(with_all).sum::<f64>().max(0.0).sqrt()
    };
    let value =
        |contrast: &Contrast| contrast.constant + contrast.terms.iter().map(|(c, at)| c * values[*at]).sum::<f64>();
    let min_over = |of: &dyn Fn(&Contrast) -> f64| contrasts.iter().map(of).fold(f64::INFINITY, f64::min);
    let interval = ScoreInterval {
        low: min_over(&|contrast| value(contrast) - reach(contrast, &own, -1.0)),
        high: min_over(&|contrast| value(contrast) + reach(contrast, &shared, 1.0)),
    };
    (!contrasts.is_empty()).then(|| (min_over(&value), interval))
}
