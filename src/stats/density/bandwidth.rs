//! The bandwidth h of isotropic Gaussian kernels on scaled points: maximizes the leave-one-out log-likelihood in a
//! published interval by golden-section search.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Interval that a bandwidth is searched in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BandwidthRule {
    /// From 0.2 times Silverman's bandwidth to Silverman's, as for the reduction of scenarios
    #[default]
    Reduction,
    /// From 0.2 to 5 times Silverman's bandwidth; the upper end is at least 1
    Wide,
}

impl BandwidthRule {
    /// The interval for N points in d dimensions; it begins at 0.001 or above.
    fn interval(self, points: usize, dimensions: usize) -> [f64; 2] {
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

/// Position of the maximum found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SearchEnd {
    /// Inside the interval.
    Inside,
    /// At its lower end: the likelihood grows as kernels become narrower, for example with duplicate points.
    Lower,
    /// At its upper end: the likelihood increases for kernels wider than the rule allows.
    Upper,
}

/// Result of the search.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bandwidth {
    /// h, in units of the scales.
    pub value: f64,
    /// The rule of the interval.
    pub rule: BandwidthRule,
    /// h_S of Silverman's rule.
    pub silverman: f64,
    /// Position of the maximum found.
    pub end: SearchEnd,
    /// What the likelihood says without the rule; none in files of earlier versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub likelihood: Option<BandwidthLikelihood>,
}

/// The leave-one-out likelihood over bandwidths from 0.05 to 5 times Silverman's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BandwidthLikelihood {
    /// Its maximum, in units of the scales.
    pub best: f64,
    /// Lower end of its 95 % interval: ln of the likelihood is 1.92 below the maximum, or the range ends.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Range of bandwidths, in units of Silverman's.
const LIKELIHOOD_RANGE: [f64; 2] = [0.05, 5.0];
/// Half the 95 % quantile of χ² with one degree of freedom.
const LIKELIHOOD_DROP: f64 = 1.920_729_410_347_062;
/// Width of the brackets of maximum and ends, in ln.
const LN_TOLERANCE: f64 = 1e-3;

/// Width of the bracket at which the search ends.
const TOLERANCE: f64 = 1e-5;

/// h_S = (4/(d + 2))^{1/(d + 4)} N^{−1/(d + 4)}.
fn silverman(points: usize, dimensions: usize) -> f64 {
    let d = dimensions as f64;
    libm::pow(4.0 / (d + 2.0) / points as f64, 1.0 / (d + 4.0))
}

/// Scaled points with the distance of each to its nearest neighbour.
pub struct LeaveOneOut {
    /// One column of N numbers per parameter, so that loops over points read consecutive numbers.
    columns: Vec<Vec<f64>>,
    /// Squared, one per point.
    nearest: Vec<f64>,
}

impl LeaveOneOut {
    /// From points that are already divided by their scales; at least 2 points.
    pub fn new(scaled: &[Vec<f64>]) -> LeaveOneOut {
        let dimensions = scaled.first().map_or(0, Vec::len);
        let columns = (0..dimensions).map(|j| scaled.iter().map(|p| p[j]).collect()).collect();
        let mut this = LeaveOneOut { columns, nearest: vec![0.0; scaled.len()] };
        this.nearest = this.each_row(|_, squared| squared.iter().copied().fold(f64::INFINITY, f64::min));
        this
    }

    /// Σ_i log f̂_{−i}(x_i) at bandwidth `h`, of the density over scaled points. Distances are recomputed at every
    /// call, because N² of them exceed the memory and the exponentials cost more. Sums run over the other points of
    /// each point in a fixed order, then over the points in order, so the bits do not depend on the number of threads.
    pub fn log_likelihood(&self, h: f64) -> f64 {
        let n = self.nearest.len();
        let factor = 1.0 / (2.0 * h * h);
        let rows = self.each_row(|i, squared| {
            let nearest = self.nearest[i];
            libm::log(sum_of_exponentials(squared, nearest, factor)) - nearest * factor
        });
        let d = self.columns.len() as f64;
        let constant = libm::log((n - 1) as f64) + d * libm::log(h) + 0.5 * d * libm::log(2.0 * std::f64::consts::PI);
        rows.iter().sum::<f64>() - n as f64 * constant
    }

    /// One number per point, from the squared distances to all points; the distance to itself is infinite.
    fn each_row(&self, number: impl Fn(usize, &[f64]) -> f64 + Sync) -> Vec<f64> {
        let n = self.nearest.len();
        let of_row = |squared: &mut Vec<f64>, i: usize| {
            squared.clear();
            squared.resize(n, 0.0);
            for column in &self.columns {
                let own = column[i];
                squared.iter_mut().zip(column).for_each(|(sum, x)| *sum += (x - own) * (x - own));
            }
            squared[i] = f64::INFINITY;
            number(i, squared)
        };
        (0..n).into_par_iter().map_init(Vec::new, of_row).collect()
    }

    /// The position of the maximum of a function in an interval, as the last bracket of a golden-section search.
    fn maximum(of: impl Fn(f64) -> f64, [lower, upper]: [f64; 2], tolerance: f64) -> [f64; 2] {
        let inverse_golden = (5.0_f64.sqrt() - 1.0) / 2.0;
        let (mut a, mut b) = (lower, upper);
        let mut left = b - inverse_golden * (b - a);
        let mut right = a + inverse_golden * (b - a);
        let (mut at_left, mut at_right) = (of(left), of(right));
        while b - a > tolerance {
            if at_left >= at_right {
                (b, right, at_right) = (right, left, at_left);
                left = b - inverse_golden * (b - a);
                at_left = of(left);
            } else {
                (a, left, at_left) = (left, right, at_right);
                right = a + inverse_golden * (b - a);
                at_right = of(right);
            }
        }
        [a, b]
    }

    /// The likelihood's own maximum and interval. A maximum at an end of the range (of doubled points, for instance) is told as it is.
    fn likelihood(&self, silverman: f64) -> BandwidthLikelihood {
        let of_ln = |ln_h: f64| self.log_likelihood(libm::exp(ln_h));
        let range = LIKELIHOOD_RANGE.map(|times| libm::log(times * silverman));
        let [a, b] = LeaveOneOut::maximum(of_ln, range, LN_TOLERANCE);
        let best = 0.5 * (a + b);
        let limit = of_ln(best) - LIKELIHOOD_DROP;
        let end = |mut outer: f64| {
            let mut inner = if of_ln(outer) < limit { best } else { outer };
            while (outer - inner).abs() > LN_TOLERANCE {
                let middle = 0.5 * (inner + outer);
                if of_ln(middle) < limit { outer = middle } else { inner = middle }
            }
            libm::exp(outer)
        };
        BandwidthLikelihood { best: libm::exp(best), low: end(range[0]), high: end(range[1]) }
    }

    /// The best bandwidth in the rule's interval.
    pub(super) fn search(&self, rule: BandwidthRule) -> Bandwidth {
        let (n, d) = (self.nearest.len(), self.columns.len());
        let [lower, upper] = rule.interval(n, d);
        let [a, b] = LeaveOneOut::maximum(|h| self.log_likelihood(h), [lower, upper], TOLERANCE);
        let end = match (a == lower, b == upper) {
            (true, false) => SearchEnd::Lower,
            (false, true) => SearchEnd::Upper,
            _ => SearchEnd::Inside,
        };
        let silverman = silverman(n, d);
        Bandwidth { value: 0.5 * (a + b), rule, silverman, end, likelihood: Some(self.likelihood(silverman)) }
    }
}

/// Number of partial sums of a row, so that the compiler can vectorize additions in a fixed order.
const PARTS: usize = 8;

/// Σ exp(−(s − nearest)·factor) over squared distances s.
fn sum_of_exponentials(squared: &[f64], nearest: f64, factor: f64) -> f64 {
    let mut parts = [0.0; PARTS];
    let mut chunks = squared.chunks_exact(PARTS);
    for chunk in &mut chunks {
        for (part, s) in parts.iter_mut().zip(chunk) {
            *part += exp_minus((s - nearest) * factor);
        }
    }
    let rest: f64 = chunks.remainder().iter().map(|s| exp_minus((s - nearest) * factor)).sum();
    parts.iter().sum::<f64>() + rest
}

/// exp(−x) of x ≥ 0 with a relative error of 3e-16; above 700, and of NaN, that of 700. No branch and no call, so that loops
/// over it are vectorized; the same bits on every machine.
#[inline(always)]
pub(super) fn exp_minus(x: f64) -> f64 {
    // ln 2 in two parts; the first one ends in zero bits, so that its product with k is exact.
    const LN_2_HIGH: f64 = 6.931_471_803_691_238e-1;
    const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    /// Adding this to a number below 2⁵¹ leaves its nearest integer in the lowest bits.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    /// 1/j! for j = 0, 1, …
    const TAYLOR: [f64; 14] = {
        let (mut series, mut factorial, mut j) = ([1.0; 14], 1.0, 1);
        while j < 14 {
            factorial *= j as f64;
            series[j] = 1.0 / factorial;
            j += 1;
        }
        series
    };
    let x = if x < 700.0 { x } else { 700.0 };
    // exp(−x) = 2^−k exp(r), |r| ≤ ln 2 / 2.
    let rounded = x * std::f64::consts::LOG2_E + ROUND;
    let k = rounded - ROUND;
    let r = (k * LN_2_HIGH - x) + k * LN_2_LOW;
    let series = TAYLOR.iter().rev().fold(0.0, |sum, c| sum * r + c);
    let scale = f64::from_bits(1023_u64.wrapping_sub(rounded.to_bits()) << 52);
    series * scale
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponential_is_that_of_the_library() {
        for k in 0..500_000 {
            let x = f64::from(k) * 1.4e-3;
            let exact = libm::exp(-x);
            assert!((exp_minus(x) / exact - 1.0).abs() < 4e-16, "{x}: {} {exact}", exp_minus(x));
        }
        assert_eq!(
            [exp_minus(0.0), exp_minus(f64::INFINITY), exp_minus(f64::NAN)],
            [1.0, exp_minus(700.0), exp_minus(700.0)]
        );
    }
}
