//! Problems of structural reliability whose probabilities are known.

use lanesweep::Result;
use lanesweep::stats::density::{Mixture, normal_quantile};
use lanesweep::stats::estimate::{
    Density, Estimate, Goal, Importance, LimitState, Search, SearchRun, from_weight_sums, importance_sums, search,
};
use lanesweep::stats::random::Stream;

/// Φ(−β).
pub fn tail(beta: f64) -> f64 {
    0.5 * libm::erfc(beta / std::f64::consts::SQRT_2)
}

/// β − Σ x/√d: fails with probability Φ(−β) under independent standard normal parameters.
pub fn linear(beta: f64) -> impl LimitState {
    move |points: &[Vec<f64>]| -> Result<Vec<f64>> {
        Ok(points.iter().map(|x| beta - x.iter().sum::<f64>() / (x.len() as f64).sqrt()).collect())
    }
}

/// |x₀| beyond β: two ways to fail, far apart.
pub fn two_sided(beta: f64) -> impl LimitState {
    move |points: &[Vec<f64>]| -> Result<Vec<f64>> { Ok(points.iter().map(|x| beta - x[0].abs()).collect()) }
}

/// The four-branch series system (Waarts 2000) with its curved branches `near` and its straight ones `far` standard
/// deviations away; 3 and 3.5 are the usual ones.
pub fn four_branch(near: f64, far: f64) -> impl LimitState {
    move |points: &[Vec<f64>]| -> Result<Vec<f64>> {
        let value = |x: &Vec<f64>| {
            let (u, v) = ((x[0] + x[1]) / std::f64::consts::SQRT_2, (x[0] - x[1]) / std::f64::consts::SQRT_2);
            (near + 0.2 * v * v - u.abs()).min(far - v.abs())
        };
        Ok(points.iter().map(value).collect())
    }
}

/// Its probability: 1 − ∫ φ(v) (1 − 2 Φ(−near − 0.2 v²)) dv over |v| < far, summed as failure so that small ones
/// keep their digits.
pub fn four_branch_probability(near: f64, far: f64) -> f64 {
    let steps = 20_000;
    let width = 2.0 * far / f64::from(steps);
    let inner: f64 = (0..steps)
        .map(|i| {
            let v = -far + (f64::from(i) + 0.5) * width;
            libm::exp(-0.5 * v * v) / (2.0 * std::f64::consts::PI).sqrt() * 2.0 * tail(near + 0.2 * v * v) * width
        })
        .sum();
    inner + 2.0 * tail(far)
}

/// Independent standard normal parameters as a mixture of one: chains walk it as they walk any density.
pub fn unit_mixture(dimensions: usize) -> Mixture {
    Mixture::of_kernels(vec![vec![0.0; dimensions]], &vec![1.0; dimensions]).expect("well formed")
}

/// Independent standard normal parameters, drawn without choosing a kernel.
pub struct StandardNormal {
    pub dimensions: usize,
}

impl Density for StandardNormal {
    fn log_densities(&self, points: &[&[f64]]) -> Vec<f64> {
        let constant = self.dimensions as f64 * libm::log(2.0 * std::f64::consts::PI);
        points.iter().map(|point| -0.5 * (point.iter().map(|x| x * x).sum::<f64>() + constant)).collect()
    }

    fn attempt(&self, stream: &Stream, index: u64, attempt: u32) -> Vec<f64> {
        let blocks = self.dimensions.div_ceil(4) as u32;
        let words = (0..blocks).flat_map(|block| stream.words(index, attempt.wrapping_mul(blocks) + block));
        words.take(self.dimensions).map(|word| normal_quantile((f64::from(word) + 0.5) / 2_f64.powi(32))).collect()
    }

    fn mixture(&self) -> Mixture {
        unit_mixture(self.dimensions)
    }
}

/// Importance sampling beside draws of the density, question by question.
pub fn importance(
    nominal: &dyn Density,
    proposal: &Mixture,
    limit_state: &dyn LimitState,
    options: &Importance,
    level: f64,
) -> Result<Vec<Estimate>> {
    let sums = importance_sums(nominal, proposal, limit_state, options, 0..options.draws)?;
    Ok(sums.iter().map(|sums| from_weight_sums(&sums.total().unwrap_or_default(), level)).collect())
}

/// As `sample --estimator is` does: a search for a proposal, then draws of it. Their number is fixed before the first.
pub fn adaptive(
    nominal: &dyn Density,
    limit_state: &dyn LimitState,
    options: &Search,
    goal: &Goal,
    seed: u64,
    level: f64,
) -> Result<(Vec<Estimate>, SearchRun)> {
    let run = search(nominal, limit_state, options, seed)?;
    let draws = goal.draws(&run.questions, seed, level);
    let estimates = importance(nominal, &run.proposal_or(nominal), limit_state, &draws, level)?;
    Ok((estimates.into_iter().map(|estimate| estimate.after_search(run.points)).collect(), run))
}
