//! CMA-ES: minimizes a function of a few real variables, of which nothing is known but its values.
//!
//! The (μ/μ_w, λ) strategy with cumulative step-size adaptation, rank-one and rank-μ updates: N. Hansen, "The CMA Evolution
//! Strategy: A Tutorial", arXiv 1604.00772. Equation numbers below are those of its appendix A; the constants are those of
//! its table 1 for positive weights. A point is a function of seed, generation and values: the same on every machine.

use lanesweep::stats::random::{Stream, standard_normal};
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Purpose of the random stream.
const PURPOSE: u32 = 0x434d_4145;

/// A search between two generations. [`CmaEs::ask`] gives points, [`CmaEs::tell`] takes their values.
#[derive(Debug, Clone)]
pub struct CmaEs {
    stream: Stream,
    population: usize,
    generation: u64,
    /// Of the μ best, descending; their sum is 1.
    weights: Vec<f64>,
    rates: Rates,
    mean: DVector<f64>,
    /// σ
    step: f64,
    covariance: DMatrix<f64>,
    /// B and the diagonal of D in C = B D² Bᵀ.
    axes: DMatrix<f64>,
    lengths: DVector<f64>,
    path_step: DVector<f64>,
    path_covariance: DVector<f64>,
    /// Standard normal vectors of the points that were asked for.
    normals: Vec<DVector<f64>>,
}

/// Constants of table 1.
#[derive(Debug, Clone, Copy)]
struct Rates {
    mu_eff: f64,
    c_step: f64,
    damping: f64,
    c_path: f64,
    c_one: f64,
    c_mu: f64,
    /// The expected length of a standard normal vector.
    chi: f64,
    /// (1 − c_step)^2(g + 1)
    fading: f64,
}

impl CmaEs {
    /// A search around `start` with the first standard deviation `step` in every direction. `population` is at least 4;
    /// 4 + 3 ln n is usual for n variables.
    pub fn new(start: &[f64], step: f64, population: usize, seed: u64) -> CmaEs {
        let (n, population) = (start.len(), population.max(4));
        let raw = |rank: usize| libm::log((population as f64 + 1.0) / 2.0) - libm::log(rank as f64);
        let raw: Vec<f64> = (1..=population / 2).map(raw).collect();
        let sum: f64 = raw.iter().sum();
        let weights: Vec<f64> = raw.iter().map(|weight| weight / sum).collect();
        CmaEs {
            stream: Stream { seed, purpose: PURPOSE },
            population,
            generation: 0,
            rates: Rates::new(n as f64, 1.0 / weights.iter().map(|weight| weight * weight).sum::<f64>()),
            weights,
            mean: DVector::from_column_slice(start),
            step,
            covariance: DMatrix::identity(n, n),
            axes: DMatrix::identity(n, n),
            lengths: DVector::repeat(n, 1.0),
            path_step: DVector::zeros(n),
            path_covariance: DVector::zeros(n),
            normals: Vec::new(),
        }
    }

    /// The points of the next generation: x = m + σ B D z (38–40).
    pub fn ask(&mut self) -> Vec<Vec<f64>> {
        let first = self.generation * self.population as u64;
        let normal = |index: u64| {
            let word = |at: usize| self.stream.words(index, at as u32 / 4)[at % 4];
            DVector::from_fn(self.mean.len(), |at, _| f64::from(standard_normal(word(at))))
        };
        self.normals = (0..self.population as u64).map(|at| normal(first + at)).collect();
        let point = |z: &DVector<f64>| (&self.mean + self.step * self.turned(z)).as_slice().to_vec();
        self.normals.iter().map(point).collect()
    }

    /// y = B D z
    fn turned(&self, z: &DVector<f64>) -> DVector<f64> {
        &self.axes * self.lengths.component_mul(z)
    }

    /// Takes the values of the points, in their order. NaN counts as the largest value.
    pub fn tell(&mut self, values: &[f64]) {
        let mut order: Vec<usize> = (0..self.normals.len()).collect();
        let value = |at: usize| values.get(at).copied().filter(|value| !value.is_nan()).unwrap_or(f64::INFINITY);
        order.sort_by(|a, b| value(*a).total_cmp(&value(*b)));
        let n = self.mean.len();
        let best: Vec<(f64, &DVector<f64>)> =
            self.weights.iter().zip(order).map(|(weight, at)| (*weight, &self.normals[at])).collect();
        let mean_z = best.iter().fold(DVector::zeros(n), |sum, (weight, z)| sum + *weight * *z);
        let mean_y = self.turned(&mean_z);
        let Rates { mu_eff, c_step, damping, c_path, c_one, c_mu, chi, fading } = self.rates;
        // (41, 42)
        self.mean += self.step * &mean_y;
        // (43, 44): C^(−1/2) y = B z.
        let length = (c_step * (2.0 - c_step) * mu_eff).sqrt();
        self.path_step = (1.0 - c_step) * &self.path_step + length * (&self.axes * mean_z);
        let path_length = self.path_step.norm();
        self.step *= libm::exp(c_step / damping * (path_length / chi - 1.0));
        // (45): the path stalls while the step grows fast.
        let is_steady = path_length < (1.4 + 2.0 / (n as f64 + 1.0)) * chi * (1.0 - fading).sqrt();
        self.rates.fading *= (1.0 - c_step) * (1.0 - c_step);
        let (moved, stalled) = if is_steady { (1.0, 0.0) } else { (0.0, c_path * (2.0 - c_path)) };
        let length = moved * (c_path * (2.0 - c_path) * mu_eff).sqrt();
        self.path_covariance = (1.0 - c_path) * &self.path_covariance + length * mean_y;
        // (46, 47)
        let rank_mu = best.iter().fold(DMatrix::zeros(n, n), |sum, (weight, z)| {
            let y = self.turned(z);
            sum + *weight * &y * y.transpose()
        });
        let rank_one = &self.path_covariance * self.path_covariance.transpose();
        self.covariance = (1.0 + c_one * stalled - c_one - c_mu) * &self.covariance + c_one * rank_one + c_mu * rank_mu;
        let eigen = SymmetricEigen::new(self.covariance.clone());
        self.axes = eigen.eigenvectors;
        self.lengths = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
        self.generation += 1;
    }
}

impl Rates {
    fn new(n: f64, mu_eff: f64) -> Rates {
        // (55–58)
        let c_step = (mu_eff + 2.0) / (n + mu_eff + 5.0);
        let c_one = 2.0 / ((n + 1.3) * (n + 1.3) + mu_eff);
        let c_mu = 2.0 * (0.25 + mu_eff + 1.0 / mu_eff - 2.0) / ((n + 2.0) * (n + 2.0) + mu_eff);
        Rates {
            mu_eff,
            c_step,
            damping: 1.0 + 2.0 * (((mu_eff - 1.0) / (n + 1.0)).sqrt() - 1.0).max(0.0) + c_step,
            c_path: (4.0 + mu_eff / n) / (n + 4.0 + 2.0 * mu_eff / n),
            c_one,
            c_mu: c_mu.min(1.0 - c_one),
            chi: n.sqrt() * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n)),
            fading: (1.0 - c_step) * (1.0 - c_step),
        }
    }
}
