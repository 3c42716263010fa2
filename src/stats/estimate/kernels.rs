//! Variation of an estimate with other kernels: the contribution of the data to its uncertainty, for estimators whose
//! draws do not come from the kernels themselves.

use rayon::prelude::*;
use serde::Serialize;

use super::importance::{Importance, WeightedFailure, weighted_failures};
use super::limit_state::AT_ONCE;
use super::limit_state::{Density, LimitState, purpose};
use super::ratio::of_clusters;
use super::summary::Estimate;
use super::warnings::Warning;
use crate::density::Mixture;
use lanesweep_support::Result;

/// Number of draws of the proposal for counting the fractions.
const DRAWS: u64 = 4096;
/// Number of points whose kernels are held at once.
const KEPT: usize = 256;

/// A kernel, that is a scenario, with the fraction of the failures that come from it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Carrier {
    /// The kernel, from 0.
    pub kernel: usize,
    /// Fraction of P.
    pub fraction: f64,
}

impl Carrier {
    /// The three kernels that carry most, the largest first, from what each carries.
    pub fn most(carried: impl IntoIterator<Item = f64>) -> Vec<Carrier> {
        let carried: Vec<f64> = carried.into_iter().collect();
        let all: f64 = carried.iter().sum();
        let of = |(kernel, carried): (usize, f64)| Carrier { kernel, fraction: carried / all };
        let mut most: Vec<Carrier> = carried.into_iter().enumerate().filter(|(_, of)| *of > 0.0).map(of).collect();
        most.sort_by(|a, b| b.fraction.total_cmp(&a.fraction));
        most.truncate(3);
        most
    }
}

/// Contributions of kernels of equal weight to the probability of failure.
#[derive(Debug, Clone, PartialEq)]
pub struct KernelShares {
    /// Relative variance of the probability over repeated sampling of the kernels: N/(N − 1)·Σ(s_j − 1/N)², where s_j
    /// is the fraction of failures from kernel j.
    pub relative_variance: f64,
    /// Effective number of kernels that failures come from, 1/Σ s_j².
    pub effective_failing: f64,
    /// Those that carry most.
    pub carriers: Vec<Carrier>,
    /// All kernels.
    pub kernels: usize,
}

/// Counts the fractions of every question over draws of a proposal and about `crude` draws of the density beside them. Each
/// failing draw has its weight, divided among the kernels by their responsibilities. Σ s_j² is corrected for the bias from the
/// draws' noise. `None` for a question without failing draws, or if there is only one kernel.
///
/// # Errors
/// Those of the limit state.
pub fn kernel_shares(
    kernels: &Mixture,
    nominal: &dyn Density,
    proposal: &Mixture,
    limit_state: &dyn LimitState,
    (seed, crude): (u64, u64),
) -> Result<Vec<Option<KernelShares>>> {
    let options = Importance { seed, draws: DRAWS, crude_per_draw: crude.div_ceil(DRAWS).max(1) };
    let purposes = [purpose::SHARES, purpose::BESIDE_SHARES];
    let failing = weighted_failures(nominal, proposal, limit_state, &options, purposes, 0..DRAWS)?;
    let none = Counts { sums: vec![[0.0; 2]; kernels.weights().len()], weight: 0.0, weight_squared: 0.0 };
    let mut counts = vec![none; limit_state.questions()];
    for chunk in failing.chunks(KEPT) {
        let of_part = |part: &[WeightedFailure]| {
            let points: Vec<&[f64]> = part.iter().map(|failing| failing.of.point.as_slice()).collect();
            kernels.responsibilities(&points)
        };
        let explained: Vec<Vec<f64>> = chunk.par_chunks(AT_ONCE).flat_map_iter(of_part).collect();
        // In the order of the indices, so that the bits do not depend on the number of threads.
        for (failing, shares) in chunk.iter().zip(&explained) {
            let asked = counts.iter_mut().zip(&failing.of.fails).filter(|(_, fails)| **fails);
            asked.for_each(|(counts, _)| counts.add(failing.weight, shares));
        }
    }
    Ok(counts.iter().map(Counts::shares).collect())
}

/// Sums over the failing draws of one question.
#[derive(Clone)]
struct Counts {
    /// Kernel by kernel: Σ w s and Σ (w s)².
    sums: Vec<[f64; 2]>,
    weight: f64,
    weight_squared: f64,
}

impl Counts {
    fn add(&mut self, weight: f64, shares: &[f64]) {
        self.weight += weight;
        self.weight_squared += weight * weight;
        for ([sum, square], share) in self.sums.iter_mut().zip(shares) {
            *sum += weight * share;
            *square += (weight * share) * (weight * share);
        }
    }

    fn shares(&self) -> Option<KernelShares> {
        let n = self.sums.len();
        let pairs = self.weight * self.weight - self.weight_squared;
        if n < 2 || pairs.is_nan() || pairs <= 0.0 {
            return None;
        }
        let between: f64 = self.sums.iter().map(|[sum, square]| sum * sum - square).sum();
        let of_squares = (between / pairs).clamp(1.0 / n as f64, 1.0);
        let relative_variance = n as f64 / (n as f64 - 1.0) * (of_squares - 1.0 / n as f64);
        let carriers = Carrier::most(self.sums.iter().map(|[sum, _]| *sum));
        Some(KernelShares { relative_variance, effective_failing: 1.0 / of_squares, carriers, kernels: n })
    }
}

impl Estimate {
    /// Adds the uncertainty of the data, which is independent of that of the draws. The variance reduction remains that
    /// of the draws.
    pub fn over_kernels(mut self, shares: &KernelShares) -> Estimate {
        let (p, own) = (self.probability, self.interval);
        let scenarios = shares.effective_failing;
        if p > 0.0 {
            self.variance += p * p * shares.relative_variance;
            self.coefficient_of_variation = self.variance.sqrt() / p;
            let failures = self.weights.map_or(f64::INFINITY, |w| w.effective_failures);
            let freedom = failures.min(scenarios) - 1.0;
            let ends = [shares.kernels as f64, f64::INFINITY];
            self.interval = of_clusters(p, self.variance, freedom, ends, own.level);
            self.interval.low = self.interval.low.min(own.low);
            self.interval.high = self.interval.high.max(own.high);
            self.relative_half_width = self.interval.relative_half_width(p);
        }
        self.trust.warn_if(scenarios < Warning::MIN_SCENARIOS, Warning::FewScenarios { scenarios });
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_those_of_the_kernels_that_reach_the_failures() {
        // 40 kernels at 0, of which every fourth is moved to 3: these alone fail beyond 3, half of their draws.
        let points: Vec<Vec<f64>> = (0..40).map(|k| vec![if k % 4 == 0 { 3.0 } else { 0.0 }]).collect();
        let kernels = Mixture::of_kernels(points, &[0.3]).unwrap();
        let beyond = |points: &[Vec<f64>]| Ok(points.iter().map(|x| 3.0 - x[0]).collect());
        let proposal = Mixture::of_kernels(vec![vec![3.2]], &[0.4]).unwrap();
        let shares = kernel_shares(&kernels, &kernels, &proposal, &beyond, (5, 400)).unwrap().remove(0).unwrap();
        // Ten of 40 have a share of 0.1 each: Σ s² = 0.1.
        assert!((shares.effective_failing / 10.0 - 1.0).abs() < 0.01, "{shares:?}");
        assert!((shares.relative_variance / (40.0 / 39.0 * 0.075) - 1.0).abs() < 0.01, "{shares:?}");
        assert!(shares.carriers.iter().all(|of| of.kernel % 4 == 0 && (of.fraction - 0.1).abs() < 0.05), "{shares:?}");
        let never = |points: &[Vec<f64>]| Ok(vec![1.0; points.len()]);
        assert_eq!(kernel_shares(&kernels, &kernels, &proposal, &never, (5, 400)).unwrap(), [None]);
    }
}
