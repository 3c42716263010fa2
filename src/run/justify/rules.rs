//! The rules by which a parameterization is appropriate, not appropriate or undecided.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Coverage;
use super::scores::{Scored, Share};
use crate::run::sampling::ComparedCell;
use crate::run::score::ScoreOptions;
use crate::settings;
use crate::stats::estimate::Ratio;

settings! {
    /// Limits, conventions of this program: a quantity passes where its whole interval lies within them, fails where
    /// the whole interval lies outside, and is undecided otherwise.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
    #[serde(deny_unknown_fields, default)]
    pub struct Rules {
        /// Minimum recall: the fraction of the failures of S that S' also has (0.9). A hidden failure is the error
        /// that an assessment must not make.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub min_recall: f64 = 0.9,
        /// Minimum precision: the fraction of the failures of S' that S also has (0.8). False alarms cost effort, not
        /// safety.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub min_precision: f64 = 0.8,
        /// Minimum fraction of kept scenarios that are points of the parameter space (0.95).
        #[schemars(range(min = 0.0, max = 1.0))]
        pub min_coverage: f64 = 0.95,
    }
}

/// Keys of the limits, with the reason of each default. The user sets them; no standard does.
pub const LIMITS: [(&str, &str); 6] = [
    ("justify.min_recall", "a hidden failure is the error that an assessment must not make"),
    ("justify.min_precision", "false alarms cost effort, not safety"),
    ("justify.min_coverage", "a density says nothing of scenarios that are no points of its space"),
    ("compare.margin", "0.8 to 1.25 are the limits within which two drugs count as equivalent"),
    ("score.min_failures", "coverage of the intervals was measured with ten failures or more"),
    ("score.confidence", "the usual level"),
];

/// Conclusion of one rule or of all rules.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
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
    pub(crate) fn of(findings: &[Finding]) -> Conclusion {
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
            let rule = format!("interval at least {limit}");
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
        let (conclusion, need) =
            ratio.map_or((Conclusion::Undecided, None), |ratio| self::conclude_ratio(&ratio, margin));
        let risk = Finding {
            quantity: "risk ratio P/S",
            value: ratio.and_then(|r| r.ratio),
            interval: ratio.and_then(|r| r.interval()),
            rule: format!("interval within {:.2} to {margin}", 1.0 / margin),
            conclusion,
            need,
        };
        let share = coverage.and_then(|coverage| coverage.of_kept());
        let covered = Finding {
            quantity: "coverage of kept",
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

/// A ratio passes if its whole interval lies within 1/margin to margin, and fails if the whole interval lies outside.
/// [`crate::stats::estimate::RatioVerdict`] asks another question: whether the rates differ at all.
fn conclude_ratio(ratio: &Ratio, margin: f64) -> (Conclusion, Option<Need>) {
    if ratio.agrees() {
        return (Conclusion::Appropriate, None);
    }
    if ratio.interval().is_some_and(|(low, high)| low > margin || high < 1.0 / margin) {
        return (Conclusion::NotAppropriate, None);
    }
    // The logarithm is nearly normal, so its interval narrows like that of a fraction.
    let times = ratio.ratio.zip(ratio.low.zip(ratio.high)).map(|(value, (low, high))| {
        let (log, limit) = (value.ln(), margin.ln());
        let towards_limit = if (log > 0.0) == (log.abs() < limit) { high / value } else { value / low };
        (towards_limit.ln() / (limit - log.abs())).powi(2)
    });
    let need = times.filter(|times| times.is_finite()).map(|times| Need { times: times.max(1.1) });
    (Conclusion::Undecided, need)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::estimate::{RatioMethod, RatioVerdict};

    const MARGIN: f64 = 1.25;

    #[test]
    fn the_default_configuration_has_the_reason_of_every_limit() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/default.toml");
        let file = std::fs::read_to_string(file).unwrap().replace('#', " ");
        let file = file.split_whitespace().collect::<Vec<_>>().join(" ");
        for (key, reason) in LIMITS {
            assert!(file.contains(reason), "{key}: {reason}");
        }
    }

    /// A ratio with enough failing scenarios; `verdict` is that of `compare`.
    fn ratio((low, high): (f64, f64)) -> Ratio {
        let verdict = match () {
            () if low >= 1.0 / MARGIN && high <= MARGIN => RatioVerdict::Agrees,
            () if low > 1.0 => RatioVerdict::TooHigh,
            () if high < 1.0 => RatioVerdict::TooLow,
            () => RatioVerdict::Undecided,
        };
        let (ratio, low, high) = (Some((low * high).sqrt()), Some(low), Some(high));
        Ratio { ratio, low, high, method: RatioMethod::Paired, verdict }
    }

    #[test]
    fn an_interval_that_contains_a_limit_is_undecided_even_where_it_excludes_1() {
        for (interval, expected) in [
            ((0.9, 1.2), Conclusion::Appropriate),
            // The rates differ, and by how much is not shown.
            ((1.05, 1.30), Conclusion::Undecided),
            ((0.60, 0.95), Conclusion::Undecided),
            ((0.5, 2.0), Conclusion::Undecided),
            ((1.26, 1.9), Conclusion::NotAppropriate),
            ((0.3, 0.79), Conclusion::NotAppropriate),
        ] {
            assert_eq!(conclude_ratio(&ratio(interval), MARGIN).0, expected, "{interval:?}");
        }
        assert_eq!(conclude(0.87, (0.80, 0.92), 0.9).0, Conclusion::Undecided);
        assert_eq!(conclude(0.80, (0.75, 0.89), 0.9).0, Conclusion::NotAppropriate);
    }

    #[test]
    fn as_much_data_as_needed_moves_the_interval_off_its_nearest_limit() {
        for interval in [(1.05, 1.30), (1.10, 1.60), (0.60, 0.95), (0.5, 0.9), (0.78, 1.2)] {
            let needed = conclude_ratio(&ratio(interval), MARGIN).1.unwrap().times;
            let (value, half_width) = ((interval.0 * interval.1).sqrt(), (interval.1 / interval.0).sqrt().ln());
            let narrowed = |times: f64| (half_width / times.sqrt()).exp();
            let contains_limit = |times| {
                let (low, high) = (value / narrowed(times), value * narrowed(times));
                [MARGIN, 1.0 / MARGIN].iter().any(|limit| low < *limit && *limit < high)
            };
            assert!(contains_limit(1.0) && !contains_limit(needed * 1.001), "{interval:?}: {needed} times");
        }
    }

    /// Nine failing scenarios cannot show agreement, and a ratio to an S that never fails is above every limit or open.
    #[test]
    fn without_enough_failures_a_ratio_fails_or_is_undecided() {
        let few =
            |low, high| Ratio { ratio: None, low, high, method: RatioMethod::Separate, verdict: RatioVerdict::TooHigh };
        assert_eq!(conclude_ratio(&few(Some(3.0), None), MARGIN), (Conclusion::NotAppropriate, None));
        assert_eq!(conclude_ratio(&few(Some(1.1), None), MARGIN), (Conclusion::Undecided, None));
        assert_eq!(conclude_ratio(&few(None, None), MARGIN), (Conclusion::Undecided, None));
    }
}
