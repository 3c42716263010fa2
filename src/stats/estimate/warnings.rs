//! Warnings about an estimate. Each warning has one documented threshold.

use std::fmt;

use serde::{Deserialize, Serialize};

use lanesweep_support::readable::significant;

/// One warning, with the figure that causes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "warning", rename_all = "snake_case")]
pub enum Warning {
    /// No failure in the sample: the probability is only bounded from above.
    NoFailures,
    /// Fewer than `Warning::MIN_FAILURES` failures: normal intervals do not hold.
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
    /// The 95 % interval of the bandwidth changes the probability beyond chance and by more than a quarter.
    BandwidthDecides {
        /// P at its lower end.
        narrow: f64,
        /// P at its upper end.
        wide: f64,
    },
    /// Effective sample size over the failures below `Warning::MIN_EFFECTIVE_SIZE`: the variance itself is
    /// badly known.
    LowEffectiveSize {
        /// (Σw)²/Σw² over failures.
        effective_size: f64,
    },
    /// One failure carries more than `Warning::MAX_FRACTION` of the estimate.
    OneWeightDominates {
        /// Its fraction of the estimate.
        share: f64,
    },
    /// The mean weight, 1 in expectation, is off by more than `Warning::MEAN_WEIGHT_ERRORS` standard errors, or by
    /// more than `Warning::MEAN_WEIGHT_OFF`: part of the density has not been sampled.
    MeanWeightOff {
        /// The mean weight.
        mean: f64,
        /// |mean − 1| over its standard error.
        standard_errors: f64,
    },
    /// More than `Warning::MAX_MISSED` of the estimate may have been missed: there are too few draws of the density.
    Missed {
        /// Upper end of the interval of what no draw of the density met.
        bound: f64,
    },
    /// No draws of the density bound what a search missed.
    NotBounded,
    /// More than `Warning::MAX_VOID_FRACTION` of the indices gave no valid point.
    VoidDraws {
        /// Fraction of void indices.
        share: f64,
    },
    /// The time limit ended the sample: the result depends on the machine.
    NotReproducible,
}

impl Warning {
    /// Failures below which [`Warning::FewFailures`] is raised.
    pub(crate) const MIN_FAILURES: u64 = 10;
    /// Effective number of failing scenarios below which [`Warning::FewScenarios`] is raised.
    pub const MIN_SCENARIOS: f64 = 10.0;
    /// Effective sample size over failures below which [`Warning::LowEffectiveSize`] is raised.
    pub(crate) const MIN_EFFECTIVE_SIZE: f64 = 30.0;
    /// Fraction of the estimate above which [`Warning::OneWeightDominates`] is raised.
    pub(crate) const MAX_FRACTION: f64 = 0.1;
    /// Standard errors above which [`Warning::MeanWeightOff`] is raised.
    pub(crate) const MEAN_WEIGHT_ERRORS: f64 = 4.0;
    /// Distance from 1 above which [`Warning::MeanWeightOff`] is raised.
    pub(crate) const MEAN_WEIGHT_OFF: f64 = 0.2;
    /// Fraction of the estimate above which [`Warning::Missed`] is raised.
    pub(crate) const MAX_MISSED: f64 = 0.5;
    /// Fraction of void indices above which [`Warning::VoidDraws`] is raised.
    pub(crate) const MAX_VOID_FRACTION: f64 = 0.001;

    /// Whether the estimate must not be used at all.
    pub(crate) fn is_grave(&self) -> bool {
        match self {
            Warning::MeanWeightOff { .. } => true,
            Warning::OneWeightDominates { share } => *share > 0.5,
            _ => false,
        }
    }

    /// Which uncertainty the warning is about.
    fn about(&self) -> Uncertain {
        match self {
            Warning::FewScenarios { .. } | Warning::DataLeftOut => Uncertain::Data,
            Warning::NotCompared | Warning::AgainstRecorded { .. } => Uncertain::Density,
            Warning::BandwidthDecides { .. } => Uncertain::Bandwidth,
            _ => Uncertain::Draws,
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
            Warning::BandwidthDecides { narrow, wide } => write!(
                f,
                "the bandwidth decides: P is {} to {} over its 95 % interval",
                significant(*narrow, 2),
                significant(*wide, 2)
            ),
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
            Warning::Missed { bound } => write!(
                f,
                "failures of a probability up to {} may have been missed: more draws of the density would tell",
                significant(*bound, 2)
            ),
            Warning::NotBounded => write!(f, "searched, not bounded: nothing tells what the search missed"),
            Warning::VoidDraws { share } => {
                write!(f, "{:.2} % of the draws gave no valid point", 100.0 * share)
            }
            Warning::NotReproducible => write!(f, "the time limit ended the sample: another machine ends elsewhere"),
        }
    }
}

/// What an estimate is uncertain about. More lanes settle the first, a comparison with recorded scenarios shows the second,
/// more recordings settle the third.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Uncertain {
    /// P of the density, from finitely many draws.
    Draws,
    /// The density, and the parameterization below it, in place of traffic.
    Density,
    /// The width of its kernels, which no interval holds.
    Bandwidth,
    /// The recorded scenarios in place of all.
    Data,
}

/// The verdict on the draws in one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// No warning: the interval of the draws holds P of the density as often as its level says.
    Sound,
    /// No warning but that a search alone found the failures.
    Searched,
    /// Warnings, none of them grave.
    Doubtful,
    /// A grave warning.
    Unusable,
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&format!("{self:?}").to_lowercase())
    }
}

/// All warnings of an estimate.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Trust {
    /// Warnings, in the order of their discovery.
    pub warnings: Vec<Warning>,
}

impl Trust {
    /// The verdict on the draws.
    pub fn draws(&self) -> Verdict {
        if self.of(Uncertain::Draws).any(Warning::is_grave) {
            Verdict::Unusable
        } else if self.of(Uncertain::Draws).any(|warning| *warning != Warning::NotBounded) {
            Verdict::Doubtful
        } else if self.of(Uncertain::Draws).next().is_some() {
            Verdict::Searched
        } else {
            Verdict::Sound
        }
    }

    /// The verdict on the density: `agrees` with recorded scenarios, `differs`, or `open`.
    pub fn density(&self) -> &'static str {
        match self.of(Uncertain::Density).any(|of| matches!(of, Warning::AgainstRecorded { is_decided: true, .. })) {
            true => "differs",
            false if self.of(Uncertain::Density).next().is_some() => "open",
            false => "agrees",
        }
    }

    /// The verdict on the data: `enough` scenarios fail, `few` or `none` do, or they are `left out` of the interval.
    pub fn data(&self) -> &'static str {
        match self.of(Uncertain::Data).next() {
            _ if self.warnings.contains(&Warning::NoFailures) => "none",
            None => "enough",
            Some(Warning::DataLeftOut) => "left out",
            Some(_) => "few",
        }
    }

    /// What the estimate may be used for.
    pub fn usable(&self) -> String {
        let few = self.warnings.iter().find_map(|warning| match warning {
            Warning::FewScenarios { scenarios } => Some(*scenarios),
            _ => None,
        });
        let whose = match (few, self.density()) {
            _ if self.draws() == Verdict::Unusable => return "nothing: too much missed".to_owned(),
            _ if self.data() == "none" => return "upper bound only".to_owned(),
            _ if self.of(Uncertain::Bandwidth).next().is_some() => "bandwidth decides".to_owned(),
            (Some(scenarios), _) if scenarios < 2.0 => "carried by one scenario".to_owned(),
            (Some(scenarios), _) => format!("carried by {:.0} scenarios", scenarios.floor()),
            (None, "agrees") => "recordings' rate".to_owned(),
            (None, "differs") => "recordings differ".to_owned(),
            _ => "density's rate".to_owned(),
        };
        match self.draws() {
            Verdict::Sound => whose,
            _ if self.warnings.contains(&Warning::NotBounded) => whose + ", not bounded",
            _ => whose + ", few draws",
        }
    }

    fn of(&self, about: Uncertain) -> impl Iterator<Item = &Warning> {
        self.warnings.iter().filter(move |warning| warning.about() == about)
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

    /// The warning about the mean of f/g over all draws of g, given as logarithms; its expectation is 1.
    pub(crate) fn about_mean_weight(&mut self, log_ratios: &[f64]) {
        let n = log_ratios.len().max(1) as f64;
        let mean = log_ratios.iter().map(|log| libm::exp(*log)).sum::<f64>() / n;
        let square = log_ratios.iter().map(|log| libm::exp(2.0 * log)).sum::<f64>() / n;
        let error = ((square - mean * mean).max(0.0) / n).sqrt();
        let off = (mean - 1.0).abs();
        let standard_errors = if error > 0.0 { off / error } else { f64::INFINITY };
        self.warn_if(
            off > Warning::MEAN_WEIGHT_OFF || (off > 1e-9 && standard_errors > Warning::MEAN_WEIGHT_ERRORS),
            Warning::MeanWeightOff { mean, standard_errors },
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_uncertainty_has_its_own_word() {
        let of = |warnings: Vec<Warning>| Trust { warnings };
        let none = of(vec![]);
        assert_eq!((none.draws(), none.density(), none.data()), (Verdict::Sound, "agrees", "enough"));
        assert_eq!(none.usable(), "recordings' rate");
        let bound = of(vec![Warning::NoFailures, Warning::NotCompared]);
        assert_eq!((bound.data(), bound.usable()), ("none", "upper bound only".to_owned()));
        let few = of(vec![Warning::FewScenarios { scenarios: 2.0 }, Warning::NotCompared]);
        assert_eq!((few.draws(), few.density(), few.data()), (Verdict::Sound, "open", "few"));
        assert_eq!(few.usable(), "carried by 2 scenarios");
        let wide = of(vec![Warning::BandwidthDecides { narrow: 1e-5, wide: 1e-3 }, Warning::NotCompared]);
        assert_eq!(
            (wide.draws(), wide.density(), wide.usable()),
            (Verdict::Sound, "open", "bandwidth decides".to_owned())
        );
        assert_eq!(of(vec![Warning::FewFailures { failures: 3 }]).draws(), Verdict::Doubtful);
        let searched = of(vec![Warning::NotBounded]);
        assert_eq!(
            (searched.draws(), searched.usable()),
            (Verdict::Searched, "recordings' rate, not bounded".to_owned())
        );
        assert_eq!(of(vec![Warning::OneWeightDominates { share: 0.3 }]).draws(), Verdict::Doubtful);
        assert_eq!(
            of(vec![Warning::NoFailures, Warning::OneWeightDominates { share: 0.7 }]).draws(),
            Verdict::Unusable
        );
    }
}
