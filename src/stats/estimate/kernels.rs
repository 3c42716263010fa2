//! Variation of an estimate with other kernels: the contribution of the data to its uncertainty, for estimators whose
//! draws do not come from the kernels themselves.

use rayon::prelude::*;

use super::interval::log_normal;
use super::problem::{Density, LimitState, evaluated, purpose};
use super::summary::Estimate;
use super::trust::Warning;
use crate::Result;
use crate::stats::density::Mixture;
use crate::stats::random::Stream;

/// Number of draws of the proposal for counting the fractions.
const DRAWS: u64 = 4096;
/// Number of points whose kernels are held at once.
const AT_ONCE: usize = 256;

/// Contributions of kernels of equal weight to the probability of failure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KernelShares {
    /// Relative variance of the probability over repeated sampling of the kernels: N/(N − 1)·Σ(s_j − 1/N)², where s_j
    /// is the fraction of failures from kernel j.
    pub relative_variance: f64,
    /// Effective number of kernels that failures come from, 1/Σ s_j².
    pub effective_failing: f64,
}

/// Counts the fractions over draws of a proposal. Each failing draw has the weight f/g, divided among the kernels by
/// their responsibilities. Σ s_j² is corrected for the bias from the draws' noise. `None` if no draw fails or there is
/// only one kernel.
///
/// # Errors
/// Those of the limit state.
pub fn kernel_shares(
    kernels: &Mixture,
    nominal: &dyn Density,
    proposal: &dyn Density,
    limit_state: &dyn LimitState,
    seed: u64,
) -> Result<Option<KernelShares>> {
    let drawn = evaluated(proposal, limit_state, Stream { seed, purpose: purpose::SHARES }, 0..DRAWS)?;
    let failing: Vec<&Vec<f64>> =
        drawn.points.iter().zip(&drawn.values).filter(|(_, v)| **v <= 0.0).map(|(p, _)| p).collect();
    let n = kernels.weights().len();
    let (mut sums, mut squares) = (vec![0.0; n], vec![0.0; n]);
    let (mut weight, mut weight_squared) = (0.0, 0.0);
    for points in failing.chunks(AT_ONCE) {
        let explained = |point: &&Vec<f64>| {
            let ratio = libm::exp(nominal.log_density(point) - proposal.log_density(point));
            (ratio, kernels.responsibilities(point))
        };
        let all: Vec<(f64, Vec<f64>)> = points.par_iter().map(explained).collect();
        // In the order of the indices, so that the bits do not depend on the number of threads.
        for (w, shares) in all {
            weight += w;
            weight_squared += w * w;
            for (j, share) in shares.iter().enumerate() {
                sums[j] += w * share;
                squares[j] += (w * share) * (w * share);
            }
        }
    }
    let pairs = weight * weight - weight_squared;
    if n < 2 || pairs.is_nan() || pairs <= 0.0 {
        return Ok(None);
    }
    let between: f64 = sums.iter().zip(&squares).map(|(sum, square)| sum * sum - square).sum();
    let of_squares = (between / pairs).clamp(1.0 / n as f64, 1.0);
    let relative_variance = n as f64 / (n as f64 - 1.0) * (of_squares - 1.0 / n as f64);
    Ok(Some(KernelShares { relative_variance, effective_failing: 1.0 / of_squares }))
}

impl Estimate {
    /// Adds the uncertainty of the data, which is independent of that of the draws. The variance reduction remains that
    /// of the draws.
    pub(crate) fn over_kernels(mut self, shares: &KernelShares) -> Estimate {
        let (p, own) = (self.probability, self.interval);
        let scenarios = shares.effective_failing;
        if p > 0.0 {
            self.variance += p * p * shares.relative_variance;
            self.coefficient_of_variation = self.variance.sqrt() / p;
            let failures = self.weights.map_or(f64::INFINITY, |w| w.effective_size_failures);
            let freedom = failures.min(scenarios) - 1.0;
            self.interval = log_normal(p, self.coefficient_of_variation, freedom, own.level);
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
    use super::super::defended;
    use super::*;

    #[test]
    fn shares_are_those_of_the_kernels_that_reach_the_failures() {
        // 40 kernels at 0, of which every fourth is moved to 3: these alone fail beyond 3, half of their draws.
        let points: Vec<Vec<f64>> = (0..40).map(|k| vec![if k % 4 == 0 { 3.0 } else { 0.0 }]).collect();
        let kernels = Mixture::of_kernels(points, &[0.3]).unwrap();
        let beyond = |points: &[Vec<f64>]| Ok(points.iter().map(|x| 3.0 - x[0]).collect());
        let proposal = defended(Mixture::of_kernels(vec![vec![3.2]], &[0.4]).unwrap(), &kernels, 0.1).unwrap();
        let shares = kernel_shares(&kernels, &kernels, &proposal, &beyond, 5).unwrap().unwrap();
        // Ten of 40 have a share of 0.1 each: Σ s² = 0.1.
        assert!((shares.effective_failing / 10.0 - 1.0).abs() < 0.01, "{shares:?}");
        assert!((shares.relative_variance / (40.0 / 39.0 * 0.075) - 1.0).abs() < 0.01, "{shares:?}");
        let never = |points: &[Vec<f64>]| Ok(vec![1.0; points.len()]);
        assert_eq!(kernel_shares(&kernels, &kernels, &proposal, &never, 5).unwrap(), None);
    }
}
