//! Crude Monte Carlo: the share of failures among draws of the density itself. Counts are integers and exact.

use std::ops::Range;
use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::draws::{batches, draw};
use super::interval::{Interval, clopper_pearson, rule_of_three, wilson};
use super::problem::{Density, LimitState, judge, purpose};
use super::stop::{StopReason, StopRule};
use super::summary::Estimate;
use crate::Result;
use crate::stats::random::Stream;

/// Which interval goes with a count of failures. With none, it is the rule of three in both cases.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BinomialInterval {
    /// Holds the truth at the nominal level on average.
    Wilson,
    /// Holds it at least at the nominal level.
    ClopperPearson,
}

/// How to sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MonteCarlo {
    /// Seed.
    pub seed: u64,
    /// Level of the interval.
    pub level: f64,
    /// Kind of the interval.
    pub interval: BinomialInterval,
    /// When to end.
    pub stop: StopRule,
}

impl MonteCarlo {
    /// So many samples, the exact interval at 95 %.
    pub fn new(seed: u64, samples: u64) -> MonteCarlo {
        MonteCarlo { seed, level: 0.95, interval: BinomialInterval::ClopperPearson, stop: StopRule::samples(samples) }
    }
}

/// What was counted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counts {
    /// Valid draws, all of them judged.
    pub runs: u64,
    /// Those that failed.
    pub failures: u64,
    /// Indices without a valid point.
    pub voids: u64,
    /// Attempts at valid points.
    pub tries: u64,
}

impl std::ops::Add for Counts {
    type Output = Counts;

    fn add(self, other: Counts) -> Counts {
        Counts {
            runs: self.runs + other.runs,
            failures: self.failures + other.failures,
            voids: self.voids + other.voids,
            tries: self.tries + other.tries,
        }
    }
}

/// Counts over a range of indices. Counts of disjoint ranges add up to those of their union.
///
/// # Errors
/// The limit state's.
pub fn monte_carlo_counts(
    density: &dyn Density,
    limit_state: &dyn LimitState,
    seed: u64,
    indices: Range<u64>,
) -> Result<Counts> {
    let stream = Stream { seed, purpose: purpose::NOMINAL };
    let mut counts = Counts::default();
    for batch in batches(indices) {
        let wanted = batch.end - batch.start;
        let (mut points, mut tries) = (Vec::with_capacity(wanted as usize), 0);
        for drawn in draw(density, stream, batch).into_iter().flatten() {
            tries += u64::from(drawn.tries);
            points.push(drawn.point);
        }
        let runs = points.len() as u64;
        let failures = judge(limit_state, &points)?.iter().filter(|v| **v <= 0.0).count() as u64;
        let voids = wanted - runs;
        counts = counts + Counts { runs, failures, voids, tries: tries + voids * u64::from(super::ATTEMPTS) };
    }
    Ok(counts)
}

/// The estimate of counts.
pub fn from_counts(counts: &Counts, interval: BinomialInterval, level: f64, stopped: StopReason) -> Estimate {
    let Counts { runs, failures, voids, .. } = *counts;
    let probability = if runs > 0 { failures as f64 / runs as f64 } else { 0.0 };
    let interval: Interval = match interval {
        _ if failures == 0 => rule_of_three(runs, level),
        BinomialInterval::Wilson => wilson(failures as f64, runs as f64, level),
        BinomialInterval::ClopperPearson => clopper_pearson(failures, runs, level),
    };
    let variance = probability * (1.0 - probability) / runs.max(1) as f64;
    let mut estimate = Estimate::new("monte_carlo", probability, variance, interval, runs, failures, voids, stopped);
    estimate.trust.about_voids(voids, runs + voids);
    estimate
}

/// Samples until a rule ends it.
///
/// # Errors
/// The limit state's.
pub fn monte_carlo(density: &dyn Density, limit_state: &dyn LimitState, options: &MonteCarlo) -> Result<Estimate> {
    let started = Instant::now();
    let (mut counts, mut samples) = (Counts::default(), 0);
    loop {
        let next = options.stop.next(samples);
        counts = counts + monte_carlo_counts(density, limit_state, options.seed, samples..next)?;
        samples = next;
        let mut estimate = from_counts(&counts, options.interval, options.level, StopReason::Samples);
        if let Some(reason) = options.stop.at(samples, counts.failures, estimate.relative_half_width, started) {
            estimate = from_counts(&counts, options.interval, options.level, reason);
            return Ok(estimate);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::problem::StandardNormal;
    use super::*;

    #[test]
    fn counts_of_parts_add_up_and_a_stop_rule_ends_at_a_checkpoint() {
        let density = StandardNormal { dimensions: 2 };
        let above = |points: &[Vec<f64>]| Ok(points.iter().map(|p| 1.0 - p[0]).collect());
        let whole = monte_carlo_counts(&density, &above, 5, 0..100_000).unwrap();
        let parts = [0..1, 1..77_777, 77_777..100_000]
            .into_iter()
            .map(|r| monte_carlo_counts(&density, &above, 5, r).unwrap())
            .fold(Counts::default(), std::ops::Add::add);
        assert_eq!(whole, parts);
        let stop = StopRule { relative_half_width: Some(0.05), ..StopRule::samples(1 << 30) };
        let estimate = monte_carlo(&density, &above, &MonteCarlo { stop, ..MonteCarlo::new(5, 1) }).unwrap();
        assert_eq!(estimate.stopped, StopReason::RelativeHalfWidth);
        assert!(estimate.relative_half_width <= 0.05 && estimate.runs.is_power_of_two());
        assert!((estimate.variance_reduction - 1.0).abs() < 1e-12);
    }
}
