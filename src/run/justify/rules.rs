//! The rules by which a parameterization is appropriate, not appropriate or undecided.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Coverage;
use super::scores::{Scored, Share};
use crate::run::sampling::ComparedCell;
use crate::run::score::ScoreOptions;
use crate::stats::estimate::{Ratio, RatioVerdict};

/// Limits; a quantity passes where its whole interval does.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Rules {
    /// Minimum recall: the fraction of the failures of S that S' also has (0.9). A hidden failure is the error that an
    /// assessment must not make.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_recall: f64,
    /// Minimum precision: the fraction of the failures of S' that S also has (0.8). False alarms cost effort, not
    /// safety.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_precision: f64,
    /// Minimum fraction of kept scenarios that are points of the parameter space (0.95).
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_coverage: f64,
}

impl Default for Rules {
    fn default() -> Self {
        Rules { min_recall: 0.9, min_precision: 0.8, min_coverage: 0.95 }
    }
}

/// Conclusion of one rule or of all rules.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Conclusion {
    /// Every rule holds.
    Appropriate,
    /// A rule does not hold.
    NotAppropriate,
    /// The data is not sufficient for a decision.
    Undecided,
}

/// What would decide an undecided rule, at the same rates.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Need {
    /// Required number of scenarios as a multiple of the present number.
    pub times: f64,
}

/// Finding of a rule.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// Quantity.
    pub quantity: &'static str,
    /// Its value.
    pub value: Option<f64>,
    /// Its interval; the upper end is ∞ (null in JSON) for a ratio to S if S never fails.
    pub interval: Option<(f64, f64)>,
    /// The rule in words.
    pub rule: String,
    /// Conclusion of the rule.
    pub conclusion: Conclusion,
    /// What would decide the rule, if it is undecided.
    pub need: Option<Need>,
}

impl Conclusion {
    /// Text for reports.
    pub fn text(self) -> &'static str {
        match self {
            Conclusion::Appropriate => "appropriate",
            Conclusion::NotAppropriate => "not appropriate",
            Conclusion::Undecided => "undecided",
        }
    }

    /// Text for a single rule, which is not a conclusion about the parameterization.
    pub fn of_rule(self) -> &'static str {
        match self {
            Conclusion::Appropriate => "passes",
            Conclusion::NotAppropriate => "fails",
            Conclusion::Undecided => "undecided",
        }
    }

    /// The worst conclusion of several rules.
    pub fn of(findings: &[Finding]) -> Conclusion {
        let any = |conclusion| findings.iter().any(|finding| finding.conclusion == conclusion);
        if any(Conclusion::NotAppropriate) {
            Conclusion::NotAppropriate
        } else if any(Conclusion::Undecided) {
            Conclusion::Undecided
        } else {
            Conclusion::Appropriate
        }
    }
}

impl Rules {
    /// Findings on recall and precision.
    pub(super) fn of_labels(&self, scored: &Scored, options: &ScoreOptions) -> Vec<Finding> {
        let min_failures = u64::from(options.min_failures.max(1));
        let failing = scored.failing_scenarios;
        let share = |quantity, share: Share, limit: f64| {
            // Few scenarios give little evidence, independent of the number of headways that fail in each.
            let (conclusion, need) = match share.value.zip(share.interval) {
                Some((value, interval)) if failing >= min_failures => conclude(value, interval, limit),
                _ => {
                    // Without any failure the required number of scenarios is unknown.
                    let times = min_failures as f64 / failing as f64;
                    (Conclusion::Undecided, (failing > 0).then_some(Need { times: times.max(1.1) }))
                }
            };
            let rule = format!("at least {limit}");
            Finding { quantity, value: share.value, interval: share.interval, rule, conclusion, need }
        };
        vec![share("recall", scored.recall, self.min_recall), share("precision", scored.precision, self.min_precision)]
    }

    /// Findings on the risk ratio of the density and on coverage; undecided if there is no density.
    pub(super) fn of_density(
        &self,
        compared: Option<&ComparedCell>,
        coverage: Option<&Coverage>,
        margin: f64,
    ) -> Vec<Finding> {
        let ratio = compared.map(|cell| cell.sampled.ratio);
        let risk = Finding {
            quantity: "risk ratio P/S",
            value: ratio.and_then(|r| r.ratio),
            interval: ratio.and_then(|r| r.interval()),
            rule: format!("interval within {:.2} to {margin}", 1.0 / margin),
            conclusion: match ratio.map(|r| r.verdict) {
                Some(RatioVerdict::Agrees) => Conclusion::Appropriate,
                Some(RatioVerdict::TooHigh | RatioVerdict::TooLow) => Conclusion::NotAppropriate,
                Some(RatioVerdict::Undecided) | None => Conclusion::Undecided,
            },
            need: ratio.and_then(|ratio| self::need_of_ratio(&ratio, margin)),
        };
        let share = coverage.filter(|c| c.kept > 0).map(|c| c.points as f64 / c.kept as f64);
        let covered = Finding {
            quantity: "coverage",
            value: share,
            interval: None,
            rule: format!("at least {}", self.min_coverage),
            conclusion: match share {
                Some(share) if share >= self.min_coverage => Conclusion::Appropriate,
                Some(_) => Conclusion::NotAppropriate,
                None => Conclusion::Undecided,
            },
            need: None,
        };
        vec![risk, covered]
    }
}

/// A fraction passes if its whole interval is at or above the limit, and fails if it is below.
fn conclude(value: f64, (low, high): (f64, f64), limit: f64) -> (Conclusion, Option<Need>) {
    if low >= limit {
        (Conclusion::Appropriate, None)
    } else if high < limit {
        (Conclusion::NotAppropriate, None)
    } else {
        // The width of an interval decreases with the square root of the number of scenarios.
        let (distance, half_width) =
            if value >= limit { (value - limit, value - low) } else { (limit - value, high - value) };
        let times = (half_width / distance).powi(2);
        (Conclusion::Undecided, times.is_finite().then_some(Need { times: times.max(1.1) }))
    }
}

/// What would decide an undecided ratio. Its logarithm is nearly normal, so its interval narrows like that of a
/// fraction.
fn need_of_ratio(ratio: &Ratio, margin: f64) -> Option<Need> {
    let (value, (low, high)) = ratio.ratio.zip(ratio.low.zip(ratio.high))?;
    if ratio.verdict != RatioVerdict::Undecided || value <= 0.0 || low <= 0.0 {
        return None;
    }
    let log = value.ln();
    // Distance to the limit of agreement if the ratio is inside it, else to 1.
    let distance = if log.abs() < margin.ln() { margin.ln() - log.abs() } else { log.abs() };
    let half_width = if log > 0.0 { (high / value).ln() } else { (value / low).ln() };
    let times = (half_width / distance).powi(2);
    times.is_finite().then_some(Need { times: times.max(1.1) })
}
