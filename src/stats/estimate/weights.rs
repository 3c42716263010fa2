//! Sums over weighted draws for importance sampling, in constant memory.

use serde::{Deserialize, Serialize};

use super::blocks::Join;
use super::interval::{Interval, gamma, log_normal};
use super::warnings::{Trust, Warning};

/// Sums over draws of a proposal and of the density, for one question. A failing draw has the weight 1/(m + g/f): m draws
/// of the density f belong to every draw of the proposal g, and a point has the same weight whichever it came from (balance
/// heuristic; Veach and Guibas, SIGGRAPH 1995). Without draws of the density the weight is f/g.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct WeightSums {
    /// Draws of the proposal, invalid ones included.
    pub draws: u64,
    /// Draws of the density.
    pub crude: u64,
    /// Failing draws of both.
    pub failures: u64,
    /// Σ w over failing draws.
    pub failing: f64,
    /// Σ w² over failing draws.
    pub failing_squared: f64,
    /// Σ w over failing draws of the density.
    pub crude_failing: f64,
    /// Largest w of a failing draw.
    pub largest_failing: f64,
}

/// Figures about the weights of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct WeightFigures {
    /// Effective number of failures, (Σw)²/Σw².
    pub effective_failures: f64,
    /// Fraction of the estimate from the failure with the largest weight.
    pub largest_fraction: f64,
    /// Fraction of the estimate from draws of the density itself.
    pub crude_fraction: f64,
}

impl Join for WeightSums {
    fn join(a: &Self, b: &Self) -> Self {
        WeightSums {
            draws: a.draws + b.draws,
            crude: a.crude + b.crude,
            failures: a.failures + b.failures,
            failing: a.failing + b.failing,
            failing_squared: a.failing_squared + b.failing_squared,
            crude_failing: a.crude_failing + b.crude_failing,
            largest_failing: a.largest_failing.max(b.largest_failing),
        }
    }
}

impl WeightSums {
    /// Adds a failing draw, of the density or of the proposal. The draw itself is counted elsewhere.
    pub fn add_failure(&mut self, weight: f64, is_crude: bool) {
        self.failures += 1;
        self.failing += weight;
        self.failing_squared += weight * weight;
        self.crude_failing += if is_crude { weight } else { 0.0 };
        self.largest_failing = self.largest_failing.max(weight);
    }

    /// The unbiased estimate Σ w / draws.
    pub fn probability(&self) -> f64 {
        ratio(self.failing, self.draws as f64)
    }

    /// Variance of the estimate.
    pub(crate) fn variance(&self) -> f64 {
        let square = |sum: f64, draws: u64| ratio(sum * sum, draws as f64);
        let means = square(self.failing - self.crude_failing, self.draws) + square(self.crude_failing, self.crude);
        ratio(self.failing_squared - means, (self.draws as f64).powi(2)).max(0.0)
    }

    /// Interval of the estimate. With draws of the density no failure weighs more than one of these, whether it was found
    /// or missed; without, Student's interval on the scale of ln P with the effective number of failures less one.
    pub(crate) fn interval(&self, level: f64) -> Interval {
        let (probability, variance) = (self.probability(), self.variance());
        if self.crude > 0 {
            return gamma(probability.min(1.0), variance, 1.0 / self.crude as f64, level);
        }
        self.interval_of_found(level)
    }

    /// The second of these intervals: of what was found, whatever may have been missed.
    pub fn interval_of_found(&self, level: f64) -> Interval {
        let (probability, variance) = (self.probability(), self.variance());
        if probability <= 0.0 || variance <= 0.0 {
            return Interval::nothing(level);
        }
        log_normal(probability, variance.sqrt() / probability, self.figures().effective_failures - 1.0, level)
    }

    /// Figures about the weights.
    pub fn figures(&self) -> WeightFigures {
        WeightFigures {
            effective_failures: ratio(self.failing * self.failing, self.failing_squared),
            largest_fraction: ratio(self.largest_failing, self.failing),
            crude_fraction: ratio(self.crude_failing, self.failing),
        }
    }
}

/// 0 if the denominator is 0.
fn ratio(above: f64, below: f64) -> f64 {
    if below == 0.0 { 0.0 } else { above / below }
}

impl Trust {
    /// Adds the warnings about weighted failures.
    pub(crate) fn about_weights(&mut self, sums: &WeightSums) {
        let figures = sums.figures();
        if sums.crude > 0 {
            let bound = gamma(0.0, 0.0, 1.0 / sums.crude as f64, 0.95).high;
            self.warn_if(bound > Warning::MAX_MISSED * sums.probability(), Warning::Missed { bound });
        }
        if sums.failures == 0 {
            return;
        }
        let effective_size = figures.effective_failures;
        self.warn_if(effective_size < Warning::MIN_EFFECTIVE_SIZE, Warning::LowEffectiveSize { effective_size });
        let share = figures.largest_fraction;
        self.warn_if(sums.crude == 0 && share > Warning::MAX_FRACTION, Warning::OneWeightDominates { share });
    }
}
