//! Sums over weighted draws for importance sampling, in constant memory.

use serde::{Deserialize, Serialize};

use super::blocks::Join;
use super::problem::ATTEMPTS;
use super::summary::WeightFigures;
use super::trust::{Trust, Warning};

/// One index of a weighted sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WeightedDraw {
    /// f/(P_valid g), with g before truncation; 0 if void.
    pub weight: f64,
    /// Response: 1 if it fails, else 0; or any number in between, such as a probability of injury.
    pub response: f64,
    /// Attempts at a valid point.
    pub tries: u32,
    /// Whether there was no valid point.
    pub is_void: bool,
    /// Whether f/g exceeds [`Warning::THIN_RATIO`].
    pub is_thin: bool,
}

impl WeightedDraw {
    /// An index without a valid point.
    pub fn void() -> WeightedDraw {
        WeightedDraw { weight: 0.0, response: 0.0, tries: ATTEMPTS, is_void: true, is_thin: false }
    }
}

/// Sums over weighted draws. The weights lack the factor valid draws / tries, which estimates the proposal's P_valid.
/// With it the estimate is Σ w r / tries, as if invalid attempts were draws of weight 0.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct WeightSums {
    /// Valid draws.
    pub draws: u64,
    /// Void indices.
    pub voids: u64,
    /// Attempts.
    pub tries: u64,
    /// Draws with a response above 0.
    pub failures: u64,
    /// Number of these draws that are thin.
    pub thin_failures: u64,
    /// Σ w.
    pub weight: f64,
    /// Σ w².
    pub weight_squared: f64,
    /// Σ w r.
    pub failing: f64,
    /// Σ w² r².
    pub failing_squared: f64,
    /// Σ w² r.
    pub mixed: f64,
    /// Σ w r over thin draws.
    pub thin_failing: f64,
    /// Largest w.
    pub largest: f64,
    /// Largest w r.
    pub largest_failing: f64,
}

impl From<WeightedDraw> for WeightSums {
    fn from(draw: WeightedDraw) -> WeightSums {
        let (w, wr) = (draw.weight, draw.weight * draw.response);
        let fails = draw.response > 0.0;
        WeightSums {
            draws: u64::from(!draw.is_void),
            voids: u64::from(draw.is_void),
            tries: u64::from(draw.tries),
            failures: u64::from(fails),
            thin_failures: u64::from(fails && draw.is_thin),
            weight: w,
            weight_squared: w * w,
            failing: wr,
            failing_squared: wr * wr,
            mixed: w * wr,
            thin_failing: if draw.is_thin { wr } else { 0.0 },
            largest: w,
            largest_failing: wr,
        }
    }
}

impl Join for WeightSums {
    fn join(a: &Self, b: &Self) -> Self {
        WeightSums {
            draws: a.draws + b.draws,
            voids: a.voids + b.voids,
            tries: a.tries + b.tries,
            failures: a.failures + b.failures,
            thin_failures: a.thin_failures + b.thin_failures,
            weight: a.weight + b.weight,
            weight_squared: a.weight_squared + b.weight_squared,
            failing: a.failing + b.failing,
            failing_squared: a.failing_squared + b.failing_squared,
            mixed: a.mixed + b.mixed,
            thin_failing: a.thin_failing + b.thin_failing,
            largest: a.largest.max(b.largest),
            largest_failing: a.largest_failing.max(b.largest_failing),
        }
    }
}

impl WeightSums {
    /// Unbiased estimate Σ w r / tries.
    pub fn unbiased(&self) -> f64 {
        ratio(self.failing, self.tries as f64)
    }

    /// Variance of the unbiased estimate, with every attempt as a draw; it includes the uncertainty of the proposal's
    /// valid fraction.
    pub fn unbiased_variance(&self) -> f64 {
        let p = self.unbiased();
        (ratio(self.failing_squared, (self.tries as f64).powi(2)) - ratio(p * p, self.tries as f64)).max(0.0)
    }

    /// Figures about the weights.
    pub fn figures(&self) -> WeightFigures {
        let tries = self.tries as f64;
        let mean_weight = ratio(self.weight, tries);
        let mean_weight_variance =
            (ratio(self.weight_squared, tries * tries) - ratio(mean_weight * mean_weight, tries)).max(0.0);
        let p = ratio(self.failing, self.weight);
        let spread = self.failing_squared - 2.0 * p * self.mixed + p * p * self.weight_squared;
        WeightFigures {
            effective_size: ratio(self.weight * self.weight, self.weight_squared),
            effective_size_failures: ratio(self.failing * self.failing, self.failing_squared),
            largest_share: ratio(self.largest, self.weight),
            largest_share_failures: ratio(self.largest_failing, self.failing),
            mean_weight,
            mean_weight_error: mean_weight_variance.sqrt(),
            thin_share: ratio(self.thin_failing, self.failing),
            thin_failures: self.thin_failures,
            self_normalised: p,
            self_normalised_variance: ratio(spread.max(0.0), self.weight * self.weight),
        }
    }
}

/// 0 if the denominator is 0.
fn ratio(above: f64, below: f64) -> f64 {
    if below == 0.0 { 0.0 } else { above / below }
}

impl Trust {
    /// Adds the warnings about the weights.
    pub(crate) fn about_weights(&mut self, figures: &WeightFigures, failures: u64) {
        let off = (figures.mean_weight - 1.0).abs();
        let standard_errors = if figures.mean_weight_error > 0.0 {
            off / figures.mean_weight_error
        } else if off > 1e-9 {
            f64::INFINITY
        } else {
            0.0
        };
        self.warn_if(
            off > Warning::MEAN_WEIGHT_OFF || standard_errors > Warning::MEAN_WEIGHT_ERRORS,
            Warning::MeanWeightOff { mean: figures.mean_weight, standard_errors },
        );
        if failures == 0 {
            return;
        }
        let effective_size = figures.effective_size_failures;
        self.warn_if(effective_size < Warning::MIN_EFFECTIVE_SIZE, Warning::LowEffectiveSize { effective_size });
        let share = figures.largest_share_failures;
        self.warn_if(share > Warning::MAX_FRACTION, Warning::OneWeightDominates { share });
        let (share, failures) = (figures.thin_share, figures.thin_failures);
        self.warn_if(share > Warning::MAX_THIN_FRACTION, Warning::ModeMissed { share, failures });
    }
}
