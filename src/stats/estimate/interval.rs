//! Intervals for a probability.

use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, StudentsT};
use statrs::function::gamma::gamma_lr;

use crate::density::normal_quantile;

/// Method of an interval.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum IntervalKind {
    /// Wilson's score interval.
    Wilson,
    /// Zero failures: one-sided, from 0.
    RuleOfThree,
    /// Student's t on ln P.
    LogStudent,
    /// Gamma quantiles: a sum of weighted failures of which no weight is larger than a known one.
    Gamma,
    /// Wilson's, with the effective number of runs of clusters.
    Clusters,
    /// No failures were found, and the only upper bound is 1.
    Nothing,
}

/// An interval for a probability.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// Lower end, ≥ 0.
    pub low: f64,
    /// Upper end, ≤ 1.
    pub high: f64,
    /// Nominal coverage in (0, 1): the fraction of repeats whose interval contains the true value.
    pub level: f64,
    /// Method of the interval.
    pub kind: IntervalKind,
}

impl Interval {
    /// Half the interval's width over the estimate; ∞ at zero.
    pub fn relative_half_width(&self, probability: f64) -> f64 {
        if probability > 0.0 { 0.5 * (self.high - self.low) / probability } else { f64::INFINITY }
    }

    /// Whether a probability lies inside, ends included.
    pub fn holds(&self, probability: f64) -> bool {
        self.low <= probability && probability <= self.high
    }

    /// The trivial interval [0, 1].
    pub(crate) fn nothing(level: f64) -> Interval {
        Interval { low: 0.0, high: 1.0, level, kind: IntervalKind::Nothing }
    }
}

/// Wilson's score interval ("Probable inference", JASA 22, 1927). `failures` and `runs` may be effective numbers.
///
/// ```
/// // With no failure in 1,000 runs the probability is bounded, but not 0.
/// let interval = lanesweep::stats::estimate::wilson(0.0, 1000.0, 0.95);
/// assert!(interval.low == 0.0 && (0.003..0.004).contains(&interval.high));
/// ```
pub fn wilson(failures: f64, runs: f64, level: f64) -> Interval {
    if runs <= 0.0 {
        return Interval::nothing(level);
    }
    let z = normal_quantile(0.5 + 0.5 * level);
    let p = failures / runs;
    let z2 = z * z / runs;
    let middle = (p + 0.5 * z2) / (1.0 + z2);
    let half = z / (1.0 + z2) * (p * (1.0 - p) / runs + 0.25 * z2 / runs).sqrt();
    // With no failures or only failures, the end is exactly 0 or 1; rounding of the difference would change it.
    let low = if failures <= 0.0 { 0.0 } else { (middle - half).max(0.0) };
    let high = if failures >= runs { 1.0 } else { (middle + half).min(1.0) };
    Interval { low, high, level, kind: IntervalKind::Wilson }
}

/// The one-sided upper limit after `runs` runs without a failure, 1 − (1 − level)^{1/runs}: about 3/runs at 95 %.
pub(crate) fn rule_of_three(runs: u64, level: f64) -> Interval {
    if runs == 0 {
        return Interval::nothing(level);
    }
    let high = -libm::expm1(libm::log1p(-level) / runs as f64);
    Interval { low: 0.0, high, level, kind: IntervalKind::RuleOfThree }
}

/// P·exp(∓ t·c) for an estimate with the coefficient of variation c: an interval on the scale of ln P. It stays above 0
/// and is as asymmetric as estimates of small probabilities. t is Student's quantile for the given degrees of freedom
/// (≥ 1; ∞ gives the normal quantile). On the log scale the standard deviation is √ln(1 + c²).
pub(crate) fn log_normal(
    probability: f64,
    coefficient_of_variation: f64,
    degrees_of_freedom: f64,
    level: f64,
) -> Interval {
    if probability.is_nan() || probability <= 0.0 || !coefficient_of_variation.is_finite() {
        return Interval::nothing(level);
    }
    let t = student_quantile(0.5 + 0.5 * level, degrees_of_freedom);
    let sigma = libm::log1p(coefficient_of_variation * coefficient_of_variation).sqrt();
    let ratio = libm::exp(t * sigma);
    Interval { low: probability / ratio, high: (probability * ratio).min(1.0), level, kind: IntervalKind::LogStudent }
}

/// The interval of a weighted sum of failures whose numbers are Poisson (Fay and Feuer, Statistics in Medicine 16, 1997):
/// quantiles of gamma distributions with the mean and variance of the sum, the upper one as if one more failure of the
/// largest possible weight had been found. Its coverage was at least `level` wherever the authors looked, also for few
/// failures and for unequal weights. Without failures the upper end is 3.69 times that weight at 95 %.
pub(crate) fn gamma(probability: f64, variance: f64, largest_weight: f64, level: f64) -> Interval {
    let tail = 0.5 * (1.0 - level);
    let quantile = |mean: f64, variance: f64, p: f64| variance / mean * gamma_quantile(mean * mean / variance, p);
    let low = match probability > 0.0 {
        true if variance > 0.0 => quantile(probability, variance, tail),
        true => probability,
        false => 0.0,
    };
    let high = quantile(probability + largest_weight, variance + largest_weight * largest_weight, 1.0 - tail);
    Interval { low: low.min(probability), high: high.min(1.0), level, kind: IntervalKind::Gamma }
}

/// x with P(shape, x) = p. Bisection up to a shape of 1,000, then Wilson and Hilferty's cube, whose error is below 1e-5
/// there.
fn gamma_quantile(shape: f64, p: f64) -> f64 {
    if shape > 1000.0 {
        let z = normal_quantile(p);
        return shape * (1.0 - 1.0 / (9.0 * shape) + z / (3.0 * shape.sqrt())).powi(3);
    }
    let (mut low, mut high) = (-745.0, libm::log(shape + 40.0 * (shape.sqrt() + 1.0)));
    for _ in 0..70 {
        let middle = 0.5 * (low + high);
        if gamma_lr(shape, libm::exp(middle)) < p {
            low = middle;
        } else {
            high = middle;
        }
    }
    libm::exp(0.5 * (low + high))
}

/// Quantile of Student's t. Above 1,000 degrees of freedom the normal quantile is used, with a relative error of 0.2 %.
pub(super) fn student_quantile(p: f64, degrees_of_freedom: f64) -> f64 {
    if degrees_of_freedom > 1000.0 {
        return normal_quantile(p);
    }
    StudentsT::new(0.0, 1.0, degrees_of_freedom.max(1.0)).map_or_else(|_| normal_quantile(p), |t| t.inverse_cdf(p))
}

/// Ratio of the normal quantile to Student's at a level: at most 1.
pub(super) fn student_factor(degrees_of_freedom: f64, level: f64) -> f64 {
    let p = 0.5 + 0.5 * level;
    normal_quantile(p) / student_quantile(p, degrees_of_freedom)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64, relative: f64) -> bool {
        (a - b).abs() <= relative * b.abs()
    }

    #[test]
    fn intervals_agree_with_published_ones() {
        // Newcombe, Statistics in Medicine 17 (1998), table I: 81 of 263, 15 of 148, 1 of 29.
        for (k, n, low, high) in
            [(81.0, 263.0, 0.2553, 0.3662), (15.0, 148.0, 0.0624, 0.1605), (1.0, 29.0, 0.0061, 0.1718)]
        {
            let score = wilson(k, n, 0.95);
            for (got, published) in [(score.low, low), (score.high, high)] {
                assert!((got - published).abs() < 5e-5, "{k} of {n}: {got}, published {published}");
            }
        }
    }

    #[test]
    fn zero_failures_are_bounded_by_three_over_n() {
        assert!(close(rule_of_three(1_000_000, 0.95).high, 2.995_732_e-6, 1e-5));
        assert_eq!(wilson(0.0, 10.0, 0.95).low, 0.0);
    }

    #[test]
    fn the_interval_of_equal_weights_is_the_exact_one_of_poisson_counts() {
        // Garwood's interval (Biometrika 28, 1936) of 5 and of 100 counts.
        for (count, low, high) in [(5.0, 1.6235, 11.668), (100.0, 81.36, 121.63)] {
            let interval = gamma(1e-4 * count, 1e-8 * count, 1e-4, 0.95);
            assert!(close(interval.low, 1e-4 * low, 1e-4) && close(interval.high, 1e-4 * high, 1e-4), "{interval:?}");
        }
        // Nothing found in a million draws.
        assert!(close(gamma(0.0, 0.0, 1e-6, 0.95).high, 3.689e-6, 1e-3));
        // Both ways to compute a quantile meet.
        assert!(close(gamma_quantile(999.9, 0.975), gamma_quantile(1000.1, 0.975), 3e-4));
        assert!(close(gamma_quantile(1000.0, 0.025), 938.985, 1e-4), "{}", gamma_quantile(1000.0, 0.025));
        // An exact sum and failures that may have been missed: no more than these are added.
        let exact = gamma(1e-5, 0.0, 1e-7, 0.95);
        assert!(exact.low == 1e-5 && (1.02e-5..1.05e-5).contains(&exact.high), "{exact:?}");
    }

    #[test]
    fn an_interval_on_the_log_scale_is_lopsided_and_widens_with_few_degrees_of_freedom() {
        let normal = log_normal(1e-6, 0.3, f64::INFINITY, 0.95);
        assert!(normal.low > 0.0 && normal.high - 1e-6 > 1e-6 - normal.low);
        assert!(log_normal(1e-6, 0.3, 4.0, 0.95).high > normal.high);
        assert!(close(log_normal(1.0e-3, 1.0, 4.0, 0.95).high, 1e-3 * (2.776_445 * 0.832_554_6_f64).exp(), 1e-4));
        assert_eq!(log_normal(0.0, 0.3, 4.0, 0.95).kind, IntervalKind::Nothing);
    }
}
