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
    /// Least recall: failures of S that S' has too (0.9). A hidden failure is the error that an assessment must not make.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_recall: f64,
    /// Least precision: failures of S' that S has too (0.8). False alarms cost effort, not safety.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_precision: f64,
    /// Least share of kept scenarios that are points of the parameter space (0.95).
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_coverage: f64,
}

impl Default for Rules {
    fn default() -> Self {
        Rules { min_recall: 0.9, min_precision: 0.8, min_coverage: 0.95 }
    }
}

/// What a rule, or all of them, say.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Conclusion {
    /// Every rule holds.
    Appropriate,
    /// A rule does not hold.
    NotAppropriate,
    /// The data does not decide.
    Undecided,
}

/// What would decide an undecided rule, at the same rates.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Need {
    /// So many times as many scenarios as now.
    pub times: f64,
}

/// What a rule finds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// Quantity.
    pub quantity: &'static str,
    /// Its value.
    pub value: Option<f64>,
    /// Its interval; the upper end is ∞ (null in JSON) for a ratio to S where S never fails.
    pub interval: Option<(f64, f64)>,
    /// The rule in words.
    pub rule: String,
    /// What it says.
    pub conclusion: Conclusion,
    /// What would decide it.
    pub need: Option<Need>,
}

impl Conclusion {
    /// In words.
    pub fn text(self) -> &'static str {
        match self {
            Conclusion::Appropriate => "appropriate",
            Conclusion::NotAppropriate => "not appropriate",
            Conclusion::Undecided => "undecided",
        }
    }

    /// Of one rule: what it says is no conclusion on the parameterization.
    pub fn of_rule(self) -> &'static str {
        match self {
            Conclusion::Appropriate => "passes",
            Conclusion::NotAppropriate => "fails",
            Conclusion::Undecided => "undecided",
        }
    }

    /// Of several rules: the worst.
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
    /// Recall and precision.
    pub(super) fn of_labels(&self, scored: &Scored, options: &ScoreOptions) -> Vec<Finding> {
        let least = u64::from(options.min_failures.max(1));
        let failing = scored.failing_scenarios;
        let share = |quantity, share: Share, limit: f64| {
            // Few scenarios say little, however many headways fail in each.
            let (conclusion, need) = match share.value.zip(share.interval) {
                Some((value, interval)) if failing >= least => conclude(value, interval, limit),
                _ => {
                    // Without any failure nothing tells how many scenarios would have one.
                    let times = least as f64 / failing as f64;
                    (Conclusion::Undecided, (failing > 0).then_some(Need { times: times.max(1.1) }))
                }
            };
            let rule = format!("at least {limit}");
            Finding { quantity, value: share.value, interval: share.interval, rule, conclusion, need }
        };
        vec![share("recall", scored.recall, self.min_recall), share("precision", scored.precision, self.min_precision)]
    }

    /// Risk ratio of the density, and coverage; undecided where there is no density.
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

/// A share passes where its whole interval lies at or above the limit, and fails where it lies below.
fn conclude(value: f64, (low, high): (f64, f64), limit: f64) -> (Conclusion, Option<Need>) {
    if low >= limit {
        (Conclusion::Appropriate, None)
    } else if high < limit {
        (Conclusion::NotAppropriate, None)
    } else {
        // The width of an interval falls with the square root of the number of scenarios.
        let (distance, half_width) =
            if value >= limit { (value - limit, value - low) } else { (limit - value, high - value) };
        let times = (half_width / distance).powi(2);
        (Conclusion::Undecided, times.is_finite().then_some(Need { times: times.max(1.1) }))
    }
}

/// What would decide an undecided ratio: its logarithm is nearly normal, so its interval narrows like that of a share.
fn need_of_ratio(ratio: &Ratio, margin: f64) -> Option<Need> {
    let (value, (low, high)) = ratio.ratio.zip(ratio.low.zip(ratio.high))?;
    if ratio.verdict != RatioVerdict::Undecided || value <= 0.0 || low <= 0.0 {
        return None;
    }
    let log = value.ln();
    // To the limit of agreement from within it, else to 1.
    let distance = if log.abs() < margin.ln() { margin.ln() - log.abs() } else { log.abs() };
    let half_width = if log > 0.0 { (high / value).ln() } else { (value / low).ln() };
    let times = (half_width / distance).powi(2);
    times.is_finite().then_some(Need { times: times.max(1.1) })
}
