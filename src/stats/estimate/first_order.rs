//! First-order sensitivity indices by pick-freeze.

use crate::stats::density::normal_quantile;

/// A first-order index: the fraction of the variance of a result that one input alone explains. The interval is normal
/// and not cut to 0…1, so that an index of 0 may be estimated below 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FirstOrder {
    /// The index.
    pub index: f64,
    /// Lower end of its interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// The index of one input from pairs of results: both of a pair have the same value of this input, and independent values
/// of all others. Sums follow the order of the pairs. `None` if the results do not vary.
///
/// Janon, Klein, Lagnoux, Nodet and Prieur, "Asymptotic normality and efficiency of two Sobol index estimators", ESAIM:
/// Probability and Statistics 18 (2014): the estimator T_N (Monod's) with its asymptotic variance.
///
/// ```
/// // The second input adds as much variance as the first one: each explains half.
/// let pairs: Vec<[f64; 2]> = (0..4096).map(|k| [k & 1, k >> 1 & 1].map(|other| f64::from((k >> 2 & 1) + other))).collect();
/// let found = lanesweep::stats::estimate::first_order(&pairs, 0.95).unwrap();
/// assert!((found.index - 0.5).abs() < 1e-12);
/// ```
pub fn first_order(pairs: &[[f64; 2]], level: f64) -> Option<FirstOrder> {
    let n = pairs.len() as f64;
    let mean_of = |of: &dyn Fn([f64; 2]) -> f64| pairs.iter().map(|pair| of(*pair)).sum::<f64>() / n;
    let mean = mean_of(&|[y, z]| (y + z) / 2.0);
    let product = |[y, z]: [f64; 2]| (y - mean) * (z - mean);
    let square = |[y, z]: [f64; 2]| ((y - mean) * (y - mean) + (z - mean) * (z - mean)) / 2.0;
    let (variance, covariance) = (mean_of(&square), mean_of(&product));
    if variance.is_nan() || variance <= 0.0 {
        return None;
    }
    let index = covariance / variance;
    let spread = mean_of(&|pair| (product(pair) - index * square(pair)).powi(2));
    let half = normal_quantile(0.5 + 0.5 * level) * (spread / n).sqrt() / variance;
    Some(FirstOrder { index, low: index - half, high: index + half })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Stream, unit_uniform};
    use std::f64::consts::PI;

    /// Ishigami's function with a = 7, b = 0.1.
    fn ishigami([x, y, z]: [f64; 3]) -> f64 {
        libm::sin(x) + 7.0 * libm::sin(y).powi(2) + 0.1 * z.powi(4) * libm::sin(x)
    }

    fn indices(seed: u64, pairs: u64) -> [FirstOrder; 3] {
        let of = |purpose, k| {
            let words = Stream { seed, purpose }.words(k, 0);
            [0, 1, 2].map(|at| PI * (2.0 * f64::from(unit_uniform(words[at])) - 1.0))
        };
        [0, 1, 2].map(|input: usize| {
            let pair = |k| {
                let (first, mut second) = (of(1, k), of(2, k));
                second[input] = first[input];
                [first, second].map(ishigami)
            };
            first_order(&(0..pairs).map(pair).collect::<Vec<_>>(), 0.95).unwrap()
        })
    }

    /// The closed forms.
    fn truth() -> [f64; 3] {
        let (a, b) = (7.0, 0.1);
        let first = 0.5 * (1.0_f64 + b * PI.powi(4) / 5.0).powi(2);
        let all = a * a / 8.0 + b * PI.powi(4) / 5.0 + b * b * PI.powi(8) / 18.0 + 0.5;
        [first / all, a * a / 8.0 / all, 0.0]
    }

    /// The intervals of 400 repeats hold the closed form as often as stated; the first repeat is printed.
    #[test]
    fn intervals_of_the_ishigami_function_hold_its_indices() {
        let truth = truth();
        let mut held = [0; 3];
        for seed in 0..400 {
            let found = indices(seed, 1024);
            for (held, (found, truth)) in held.iter_mut().zip(found.iter().zip(truth)) {
                *held += u32::from((found.low..=found.high).contains(&truth));
            }
        }
        println!("held of 400 repeats with 1,024 pairs: {held:?}");
        assert!(held.iter().all(|held| (368..=394).contains(held)), "{held:?}");
    }

    /// One row per input, for `benches/runs/2026-11-28-uncertain-inputs`:
    /// `cargo test --release --lib --package lanesweep-stats first_order::tests::rows -- --ignored --nocapture`.
    #[test]
    #[ignore = "prints rows"]
    fn rows_of_the_ishigami_function() {
        println!("input,truth,index,low,high,pairs");
        for (at, (found, truth)) in indices(157, 1 << 16).iter().zip(truth()).enumerate() {
            let FirstOrder { index, low, high } = found;
            println!("x{},{truth:.6},{index:.6},{low:.6},{high:.6},{}", at + 1, 1 << 16);
        }
    }

    #[test]
    fn a_constant_has_no_index() {
        assert_eq!(first_order(&[[1.0, 1.0]; 9], 0.95), None);
        assert_eq!(first_order(&[], 0.95), None);
    }
}
