//! Warnings about an estimate. Each warning has one documented threshold.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::support::readable::significant;

/// One warning, with the figure that causes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "warning", rename_all = "snake_case")]
pub enum Warning {
    /// No failure in the sample: the probability is only bounded from above.
    NoFailures,
    /// Fewer than [`Warning::MIN_FAILURES`] failures: normal intervals do not hold.
    FewFailures {
        /// How many.
        failures: u64,
    },
    /// The failures come from effectively fewer than [`Warning::MIN_SCENARIOS`] scenarios: other data would give
    /// another probability, and how much so is itself badly known.
    FewScenarios {
        /// (Σk)²/Σk² over the failures around each scenario.
        scenarios: f64,
    },
    /// The interval covers the draws alone, but the density is fitted to data.
    DataLeftOut,
    /// The rate was not compared with that of recorded scenarios: the error of the parameterization is unknown.
    NotCompared,
    /// The rate differs from that of the recorded scenarios (S) beyond the margin, or too few failures tell whether it does.
    AgainstRecorded {
        /// What is compared: `S'/S` (replays under the parameterization) or `P/S` (samples).
        name: String,
        /// Its value.
        ratio: Option<f64>,
        /// Lower end of its interval.
        low: Option<f64>,
        /// Upper end.
        high: Option<f64>,
        /// The interval excludes 1.
        is_decided: bool,
    },
    /// Effective sample size over the failures below [`Warning::MIN_EFFECTIVE_SIZE`]: the variance itself is
    /// badly known.
    LowEffectiveSize {
        /// (Σw)²/Σw² over failures.
        effective_size: f64,
    },
    /// One failure carries more than [`Warning::MAX_FRACTION`] of the estimate.
    OneWeightDominates {
        /// Its fraction of the estimate.
        share: f64,
    },
    /// The mean weight, 1 in expectation, is off by more than [`Warning::MEAN_WEIGHT_ERRORS`] standard errors, or by
    /// more than [`Warning::MEAN_WEIGHT_OFF`]: part of the density has not been sampled.
    MeanWeightOff {
        /// The mean weight.
        mean: f64,
        /// |mean − 1| over its standard error.
        standard_errors: f64,
    },
    /// Failures where the proposal is thin (below a fifth of the density) carry more than
    /// [`Warning::MAX_THIN_FRACTION`] of the estimate: the proposal misses a way to fail.
    ModeMissed {
        /// Their fraction of the estimate.
        share: f64,
        /// Number of these failures.
        failures: u64,
    },
    /// The sample with which the search tested its proposal differs by more than [`Warning::SEARCH_ERRORS`] standard
    /// errors.
    DisagreesWithSearch {
        /// Its probability.
        search: f64,
        /// Distance of the logarithms in standard errors.
        errors: f64,
    },
    /// The search came less deep than [`Warning::DEPTH`] times the probability: as much may have escaped.
    Shallow {
        /// Everything more likely than this was searched.
        depth: f64,
        /// The estimate.
        probability: f64,
    },
    /// The search found too few failures for a proposal: there may be none.
    NothingFound {
        /// Everything more likely than this was searched.
        depth: f64,
    },
    /// More than [`Warning::MAX_VOID_FRACTION`] of the indices gave no valid point.
    VoidDraws {
        /// Fraction of void indices.
        share: f64,
    },
    /// The time limit ended the sample: the result depends on the machine.
    NotReproducible,
}

impl Warning {
    /// Failures below which [`Warning::FewFailures`] is raised.
    pub const MIN_FAILURES: u64 = 10;
    /// Effective number of failing scenarios below which [`Warning::FewScenarios`] is raised.
    pub const MIN_SCENARIOS: f64 = 10.0;
    /// Effective sample size over failures below which [`Warning::LowEffectiveSize`] is raised.
    pub const MIN_EFFECTIVE_SIZE: f64 = 30.0;
    /// Fraction of the estimate above which [`Warning::OneWeightDominates`] is raised.
    pub const MAX_FRACTION: f64 = 0.1;
    /// Standard errors above which [`Warning::MeanWeightOff`] is raised.
    pub const MEAN_WEIGHT_ERRORS: f64 = 4.0;
    /// Distance from 1 above which [`Warning::MeanWeightOff`] is raised.
    pub const MEAN_WEIGHT_OFF: f64 = 0.2;
    /// Density over proposal above which a point counts as thinly covered. With a defensive mixture weight of 0.1, such
    /// a point was more likely drawn from the defensive part.
    pub const THIN_RATIO: f64 = 5.0;
    /// Fraction of the estimate above which [`Warning::ModeMissed`] is raised.
    pub const MAX_THIN_FRACTION: f64 = 0.1;
    /// Standard errors above which [`Warning::DisagreesWithSearch`] is raised.
    pub const SEARCH_ERRORS: f64 = 4.0;
    /// Depth over the probability above which [`Warning::Shallow`] is raised.
    pub const DEPTH: f64 = 3.0;
    /// Fraction of void indices above which [`Warning::VoidDraws`] is raised.
    pub const MAX_VOID_FRACTION: f64 = 0.001;

    /// Whether the estimate must not be used at all.
    pub fn is_grave(&self) -> bool {
        match self {
            Warning::MeanWeightOff { .. }
            | Warning::ModeMissed { .. }
            | Warning::DisagreesWithSearch { .. }
            | Warning::NothingFound { .. } => true,
            Warning::Shallow { depth, probability } => *depth > 10.0 * Warning::DEPTH * probability,
            Warning::OneWeightDominates { share } => *share > 0.5,
            Warning::LowEffectiveSize { effective_size } => *effective_size < 5.0,
            _ => false,
        }
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Warning::NoFailures => write!(f, "no failure was found: the probability is only bounded from above"),
            Warning::FewFailures { failures: 1 } => write!(f, "only 1 failure was found"),
            Warning::FewFailures { failures } => write!(f, "only {failures} failures were found"),
            Warning::FewScenarios { scenarios } => {
                let min = Warning::MIN_SCENARIOS;
                write!(f, "the failures come from effectively {scenarios:.1} scenarios; at least {min} are needed")
            }
            Warning::DataLeftOut => write!(f, "the interval is that of the draws: other scenarios would change more"),
            Warning::NotCompared => write!(
                f,
                "not compared with recorded scenarios (the density file does not hold them, they cannot be replayed, or a \
                 condition is given): the error of the parameterization is not known"
            ),
            Warning::AgainstRecorded { ratio: None, is_decided, .. } => match is_decided {
                true => write!(f, "no recorded scenario fails, but more of the density than chance explains"),
                false => write!(f, "no recorded scenario fails: nothing tells what the parameterization changes"),
            },
            Warning::AgainstRecorded { name, ratio: Some(ratio), low, high, is_decided } => {
                let end = |value: &Option<f64>| value.map_or("∞".to_owned(), |v| significant(v, 3));
                let interval = format!("{name} is {} ({}…{})", significant(*ratio, 3), end(low), end(high));
                let by = if name.starts_with('P') { "density" } else { "parameterization" };
                match is_decided {
                    true => write!(f, "{interval}: the {by} changes the rate of failure of the recorded scenarios"),
                    false => write!(
                        f,
                        "{interval}: too few recorded scenarios fail to tell whether the {by} keeps their rate"
                    ),
                }
            }
            Warning::LowEffectiveSize { effective_size } => {
                write!(f, "the failures count as no more than {effective_size:.1} equally weighted ones")
            }
            Warning::OneWeightDominates { share } => {
                write!(f, "one failure carries {:.0} % of the estimate", 100.0 * share)
            }
            Warning::MeanWeightOff { mean, standard_errors } => write!(
                f,
                "the mean weight is {mean:.3} ({standard_errors:.1} standard errors from 1): part of the density was not sampled"
            ),
            Warning::ModeMissed { share, failures } => write!(
                f,
                "{failures} failures where the proposal is thin carry {:.0} % of the estimate: it misses a way to fail",
                100.0 * share
            ),
            Warning::DisagreesWithSearch { search, errors } => write!(
                f,
                "the test sample of the search gave {}, {errors:.1} standard errors away",
                significant(*search, 3)
            ),
            Warning::Shallow { depth, .. } => write!(
                f,
                "the search saw only what is more likely than {}: as many failures may have escaped it",
                significant(*depth, 2)
            ),
            Warning::NothingFound { depth } => write!(
                f,
                "the search found too few failures for an estimate; it saw what is more likely than {}",
                significant(*depth, 2)
            ),
            Warning::VoidDraws { share } => {
                write!(f, "{:.2} % of the draws gave no valid point", 100.0 * share)
            }
            Warning::NotReproducible => write!(f, "the time limit ended the sample: another machine ends elsewhere"),
        }
    }
}

/// The verdict in one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// No warning.
    Sound,
    /// Warnings, none of them grave.
    Doubtful,
    /// A grave warning.
    Unusable,
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Verdict::Sound => "sound",
            Verdict::Doubtful => "doubtful",
            Verdict::Unusable => "unusable",
        })
    }
}

/// All warnings of an estimate. An empty list is no proof: a failure mode without a draw causes no warning.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Trust {
    /// Warnings, in the order of their discovery.
    pub warnings: Vec<Warning>,
}

impl Trust {
    /// The verdict.
    pub fn verdict(&self) -> Verdict {
        if self.warnings.iter().any(Warning::is_grave) {
            Verdict::Unusable
        } else if self.warnings.is_empty() {
            Verdict::Sound
        } else {
            Verdict::Doubtful
        }
    }

    /// Adds a warning if its condition holds.
    pub fn warn_if(&mut self, condition: bool, warning: Warning) {
        if condition {
            self.warnings.push(warning);
        }
    }

    /// The warnings about the number of failures.
    pub(crate) fn about_failures(&mut self, failures: u64) {
        self.warn_if(failures == 0, Warning::NoFailures);
        self.warn_if((1..Warning::MIN_FAILURES).contains(&failures), Warning::FewFailures { failures });
    }

    /// The warning about void indices.
    pub(crate) fn about_voids(&mut self, voids: u64, draws: u64) {
        let share = voids as f64 / draws.max(1) as f64;
        self.warn_if(share > Warning::MAX_VOID_FRACTION, Warning::VoidDraws { share });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_verdict_follows_the_gravest_warning() {
        let of = |warnings: Vec<Warning>| Trust { warnings }.verdict();
        assert_eq!(of(vec![]), Verdict::Sound);
        assert_eq!(of(vec![Warning::FewFailures { failures: 3 }]), Verdict::Doubtful);
        let missed = Warning::ModeMissed { share: 0.4, failures: 2 };
        assert_eq!(of(vec![Warning::NoFailures, missed]), Verdict::Unusable);
        assert_eq!(of(vec![Warning::OneWeightDominates { share: 0.3 }]), Verdict::Doubtful);
        assert_eq!(of(vec![Warning::OneWeightDominates { share: 0.7 }]), Verdict::Unusable);
    }
}
