//! Rules that end a sample. They are evaluated only after fixed numbers of samples, so that neither the speed of a
//! machine nor its number of threads changes the end.

use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

/// When to end. A plan file stores only the number of samples, because the draws do not depend on the other rules.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StopRule {
    /// Maximum number of samples, ≥ 1. Always a limit.
    pub samples: u64,
    /// End at the first checkpoint at which half the interval's width over the estimate is at most this, with at least
    /// [`StopRule::MIN_FAILURES`] failures.
    #[serde(skip)]
    pub relative_half_width: Option<f64>,
    /// End at the first checkpoint after this time. The result then depends on the machine and says so.
    #[serde(skip)]
    pub time_limit: Option<Duration>,
}

/// Reason for the end of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StopReason {
    /// The requested number of samples was reached.
    Samples,
    /// The interval was narrow enough.
    RelativeHalfWidth,
    /// The time limit was reached; another machine would end elsewhere.
    TimeLimit,
}

impl StopReason {
    /// Whether the same call ends at the same sample on every machine.
    pub fn is_reproducible(self) -> bool {
        self != StopReason::TimeLimit
    }
}

impl StopRule {
    /// Minimum number of failures for this rule: with fewer, intervals can be narrow by chance.
    pub const MIN_FAILURES: u64 = 10;

    /// Whether only the number of samples ends it.
    pub fn is_fixed(&self) -> bool {
        self.relative_half_width.is_none() && self.time_limit.is_none()
    }

    /// `samples` samples and no other rule.
    pub fn samples(samples: u64) -> StopRule {
        StopRule { samples, relative_half_width: None, time_limit: None }
    }

    /// Whether to end at this checkpoint.
    pub fn at(&self, samples: u64, failures: u64, relative_half_width: f64, started: Instant) -> Option<StopReason> {
        let is_narrow = self.relative_half_width.is_some_and(|goal| relative_half_width <= goal);
        if is_narrow && failures >= Self::MIN_FAILURES {
            Some(StopReason::RelativeHalfWidth)
        } else if samples >= self.samples {
            Some(StopReason::Samples)
        } else if self.time_limit.is_some_and(|limit| started.elapsed() >= limit) {
            Some(StopReason::TimeLimit)
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_narrow_interval_of_few_failures_does_not_end_a_sample() {
        let rule = StopRule { relative_half_width: Some(0.3), ..StopRule::samples(100_000) };
        let now = Instant::now();
        assert_eq!(rule.at(4096, 9, 0.1, now), None);
        assert_eq!(rule.at(4096, 10, 0.3, now), Some(StopReason::RelativeHalfWidth));
        assert_eq!(rule.at(100_000, 3, 9.0, now), Some(StopReason::Samples));
    }

    #[test]
    fn a_time_limit_ends_at_a_checkpoint_and_is_not_reproducible() {
        let rule = StopRule { time_limit: Some(Duration::ZERO), ..StopRule::samples(100_000) };
        let reason = rule.at(4096, 0, 9.0, Instant::now()).unwrap();
        assert!(!reason.is_reproducible());
    }
}
