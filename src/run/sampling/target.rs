//! Rates per hour against a target that the user gives: below, above or undecided, and what would decide.

use serde::{Deserialize, Serialize};

use super::estimate_rows::{EstimateRow, RiskRate};
use super::{Sample, SampleResult};
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;

/// A rate that is to be undercut.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// Failures under this criterion; `None`: injuries.
    pub criterion: Option<Criterion>,
    /// Per hour of driving, > 0.
    pub per_hour: f64,
}

/// Where the interval of a rate lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum TargetVerdict {
    /// The upper end is below the target.
    Below,
    /// The lower end is above the target.
    Above,
    /// The target lies between the ends.
    Undecided,
}

/// A rate against the target.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TargetRow {
    /// Criterion, or curve of injury risk.
    pub of: &'static str,
    /// Driver model.
    pub model: ModelId,
    /// Headway, or `all`.
    pub headway: String,
    /// The target, per hour.
    pub target: f64,
    /// The rate per hour.
    pub rate: RiskRate,
    /// Where its interval lies.
    pub verdict: TargetVerdict,
    /// About how many samples would decide, if the rate is as estimated; `None` if decided, or if no number of samples does.
    pub samples: Option<f64>,
    /// About how many recorded hours would decide, in the same sense.
    pub hours: Option<f64>,
}

impl Sample {
    /// The rates against the targets of the options, over all headways; none where the hours are not known.
    pub fn targets(&self, result: &SampleResult) -> Vec<TargetRow> {
        let (rows, Some(exposure)) = (&result.rows, self.exposure()) else { return Vec::new() };
        let of_target = |target: &Target| {
            let failures = rows.iter().map(|row| (Some(row.criterion), row.criterion.key(), true, row));
            let injuries = result.injuries.iter().map(|of| (None, of.curve, of.uncovered == 0, &of.row));
            let row = |(criterion, of, is_covered, row): (Option<Criterion>, _, bool, &EstimateRow)| {
                let is_shown = row.is_overall(rows) || row.is_rare_beside(rows);
                let rate = row.risk.per_hour.filter(|_| is_shown && criterion == target.criterion)?;
                let draws_alone = [libm::log1p(row.estimate.coefficient_of_variation.powi(2)), 0.0];
                let parts = row.uncertainty.map_or(draws_alone, |of| {
                    [of.draws, 1.0 - of.draws].map(|part| part * of.deviation * of.deviation)
                });
                let has_data = row.failing_scenarios.is_some();
                let (verdict, [samples, hours]) = against(rate, parts, target.per_hour, (has_data, is_covered));
                let lanes = if row.headway == "all" { self.options.headways().len() } else { 1 };
                Some(TargetRow {
                    of,
                    model: row.model,
                    headway: row.headway.clone(),
                    target: target.per_hour,
                    rate,
                    verdict,
                    samples: samples.map(|factor| factor * row.estimate.runs as f64 / lanes as f64),
                    hours: hours.zip(exposure.driven.hours).map(|(factor, hours)| factor * hours),
                })
            };
            failures.chain(injuries).filter_map(row).collect::<Vec<_>>()
        };
        self.options.targets.iter().flat_map(of_target).collect()
    }
}

/// The verdict, and the factors on samples and on recorded hours that would decide. `parts`: variance of ln of the rate due to the draws
/// and to the recordings. `has_data`: the interval covers the recordings, which bound it where nothing failed. Contacts that are not
/// covered keep the upper end where it is.
fn against(
    rate: RiskRate,
    [draws, recordings]: [f64; 2],
    target: f64,
    (has_data, is_covered): (bool, bool),
) -> (TargetVerdict, [Option<f64>; 2]) {
    let RiskRate { estimate, low, high, .. } = rate;
    if high < target {
        return (TargetVerdict::Below, [None; 2]);
    }
    if low > target {
        return (TargetVerdict::Above, [None; 2]);
    }
    let factors = if estimate <= target && !is_covered {
        [None; 2]
    } else if estimate <= 0.0 {
        let factor = Some(high / target);
        if has_data { [None, factor] } else { [factor, None] }
    } else {
        // The half-width on the log scale must shrink to the distance of the target.
        let end = if estimate > target { low } else { high };
        let shrink = libm::log(target / estimate) / libm::log(end / estimate);
        let left = |other: f64| shrink * shrink * (draws + recordings) - other;
        let factor = |part: f64, other: f64| Some(part / left(other)).filter(|f| *f > 0.0 && f.is_finite());
        [factor(draws, recordings), factor(recordings, draws)]
    };
    (TargetVerdict::Undecided, factors)
}

#[cfg(test)]
mod tests {
    use super::*;

    const KNOWN: (bool, bool) = (true, true);

    fn rate(estimate: f64, low: f64, high: f64) -> RiskRate {
        RiskRate { estimate, standard_deviation: 0.0, low, high }
    }

    #[test]
    fn a_bound_on_its_side_of_the_target_decides() {
        let of = |target: f64| against(rate(1e-6, 1e-7, 1e-5), [1.0, 0.5], target, KNOWN).0;
        assert_eq!(
            [2e-5, 1e-5, 1e-7, 9e-8].map(of),
            [TargetVerdict::Below, TargetVerdict::Undecided, TargetVerdict::Undecided, TargetVerdict::Above]
        );
    }

    /// An interval of a factor of 10 to either side, and a target at a factor of √10: half the width, a quarter of the variance.
    #[test]
    fn what_would_decide_shrinks_the_interval_to_the_target() {
        let near = 10_f64.sqrt() * 1e-6;
        let of = |parts| against(rate(1e-6, 1e-7, 1e-5), parts, near, KNOWN).1;
        let close = |factor: Option<f64>, expected: f64| (factor.unwrap() - expected).abs() < 1e-9;
        // The draws must fall from 1.0 to (1.0 + 0.2)/4 − 0.2 = 0.1.
        let [samples, hours] = of([1.0, 0.2]);
        assert!(close(samples, 10.0) && hours.is_none(), "{samples:?} {hours:?}");
        let [samples, hours] = of([0.0, 1.0]);
        assert!(close(hours, 4.0) && samples.is_none(), "{samples:?} {hours:?}");
        assert_eq!(of([1.0, 1.0]), [None, None], "neither alone");
        // Below the lower side, by symmetry.
        let [samples, _] = against(rate(1e-6, 1e-7, 1e-5), [1.0, 0.2], 1e-6 / 10_f64.sqrt(), KNOWN).1;
        assert!(close(samples, 10.0));
        let of = |target, known| against(rate(1e-6, 1e-7, 1e-5), [1.0, 0.2], target, known).1;
        assert_eq!(of(1e-6, KNOWN), [None, None], "a rate at its target");
        assert_eq!(of(near, (true, false)), [None, None], "contacts that are not covered keep the upper end");
    }

    #[test]
    fn without_failures_the_bound_falls_with_what_it_counts() {
        let of = |has_data| against(rate(0.0, 0.0, 3e-6), [0.0; 2], 1e-6, (has_data, true)).1;
        assert!((of(false)[0].unwrap() - 3.0).abs() < 1e-12 && of(false)[1].is_none());
        assert!((of(true)[1].unwrap() - 3.0).abs() < 1e-12 && of(true)[0].is_none());
    }
}
