//! Problems of structural reliability whose probabilities are known.

use lanesweep::Result;
use lanesweep::stats::density::Mixture;
use lanesweep::stats::estimate::LimitState;

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
