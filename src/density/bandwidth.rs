//! The bandwidth h of isotropic Gaussian kernels on scaled points: the leave-one-out log-likelihood, largest
//! inside a published interval by golden-section search.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// The published interval that is searched.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BandwidthRule {
    /// [max(0.001, 0.2 h_S), h_S], as with the reduction of scenarios.
    #[default]
    Reduction,
    /// [max(0.001, 0.2 h_S), max(1, 5 h_S)].
    Wide,
}

impl BandwidthRule {
    /// The interval for N points in d dimensions.
    pub fn interval(self, points: usize, dimensions: usize) -> [f64; 2] {
        let silverman = silverman(points, dimensions);
        let upper = match self {
            BandwidthRule::Reduction => silverman,
            BandwidthRule::Wide => (5.0 * silverman).max(1.0),
        };
        [(0.2 * silverman).max(1e-3).min(upper), upper]
    }

    /// Name in files and flags.
    pub fn key(self) -> &'static str {
        match self {
            BandwidthRule::Reduction => "reduction",
            BandwidthRule::Wide => "wide",
        }
    }
}

/// Where the search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SearchEnd {
    /// Inside the interval.
    Inside,
    /// At its lower end: the likelihood grows as kernels get narrower, as with points that repeat.
    Lower,
    /// At its upper end: the likelihood asks for wider kernels than the rule allows.
    Upper,
}

/// What the search found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bandwidth {
    /// h, in units of the scales.
    pub value: f64,
    /// The rule.
    pub rule: BandwidthRule,
    /// h_S of Silverman's rule.
    pub silverman: f64,
    /// Where the search ended.
    pub end: SearchEnd,
}

/// Width of the interval at which the search ends.
const TOLERANCE: f64 = 1e-5;

/// h_S = (4/(d + 2))^{1/(d + 4)} N^{−1/(d + 4)}.
pub fn silverman(points: usize, dimensions: usize) -> f64 {
    let d = dimensions as f64;
    libm::pow(4.0 / (d + 2.0) / points as f64, 1.0 / (d + 4.0))
}

/// Scaled points with the distance of each to its nearest other.
pub struct LeaveOneOut {
    /// N × d, one point after the other.
    points: Vec<f64>,
    dimensions: usize,
    /// Squared.
    nearest: Vec<f64>,
}

impl LeaveOneOut {
    /// Of points that are already divided by their scales; at least 2.
    pub fn new(scaled: &[Vec<f64>]) -> LeaveOneOut {
        let dimensions = scaled.first().map_or(0, Vec::len);
        let points: Vec<f64> = scaled.iter().flatten().copied().collect();
        let nearest = (0..scaled.len())
            .into_par_iter()
            .map(|i| others(&points, dimensions, i).fold(f64::INFINITY, f64::min))
            .collect();
        LeaveOneOut { points, dimensions, nearest }
    }

    /// Σ_i log f̂_{−i}(x_i) at bandwidth `h`, of the density over scaled points. Distances are made again at
    /// every call: N² of them do not fit a memory, and the exponentials cost more. Sums run over each point's
    /// others in order, then over the points in order: the bits do not depend on the number of threads.
    pub fn log_likelihood(&self, h: f64) -> f64 {
        let n = self.nearest.len();
        let factor = 1.0 / (2.0 * h * h);
        let rows: Vec<f64> = (0..n)
            .into_par_iter()
            .map(|i| {
                let nearest = self.nearest[i];
                let sum: f64 = others(&self.points, self.dimensions, i)
                    .map(|squared| (squared - nearest) * factor)
                    // Less than 2e-22 of the largest term each.
                    .filter(|exponent| *exponent < 50.0)
                    .map(|exponent| libm::exp(-exponent))
                    .sum();
                libm::log(sum) - nearest * factor
            })
            .collect();
        let d = self.dimensions as f64;
        let constant = libm::log((n - 1) as f64) + d * libm::log(h) + 0.5 * d * libm::log(2.0 * std::f64::consts::PI);
        rows.iter().sum::<f64>() - n as f64 * constant
    }

    /// The best bandwidth of the rule's interval.
    pub fn search(&self, rule: BandwidthRule) -> Bandwidth {
        let n = self.nearest.len();
        let [lower, upper] = rule.interval(n, self.dimensions);
        let inverse_golden = (5.0_f64.sqrt() - 1.0) / 2.0;
        let (mut a, mut b) = (lower, upper);
        let mut left = b - inverse_golden * (b - a);
        let mut right = a + inverse_golden * (b - a);
        let (mut at_left, mut at_right) = (self.log_likelihood(left), self.log_likelihood(right));
        while b - a > TOLERANCE {
            if at_left >= at_right {
                (b, right, at_right) = (right, left, at_left);
                left = b - inverse_golden * (b - a);
                at_left = self.log_likelihood(left);
            } else {
                (a, left, at_left) = (left, right, at_right);
                right = a + inverse_golden * (b - a);
                at_right = self.log_likelihood(right);
            }
        }
        let end = match (a == lower, b == upper) {
            (true, false) => SearchEnd::Lower,
            (false, true) => SearchEnd::Upper,
            _ => SearchEnd::Inside,
        };
        Bandwidth { value: 0.5 * (a + b), rule, silverman: silverman(n, self.dimensions), end }
    }
}

/// Squared distances of point `i` to all others, in order.
fn others(points: &[f64], dimensions: usize, i: usize) -> impl Iterator<Item = f64> {
    let own = &points[i * dimensions..(i + 1) * dimensions];
    points
        .chunks_exact(dimensions)
        .enumerate()
        .filter(move |(j, _)| *j != i)
        .map(move |(_, other)| other.iter().zip(own).fold(0.0, |sum, (a, b)| sum + (a - b) * (a - b)))
}
