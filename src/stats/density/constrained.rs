//! A kernel density estimate on the plane A x = b: the density of the parameters given linear equations, or given
//! the values of some of them. Each kernel conditions as a Gaussian does; its weight is how well it fits b
//! (arXiv 2107.05278).

use super::covariance::{cholesky, whiten};
use super::kde::Kde;
use super::normal::Draws;
use crate::stats::random::Stream;
use crate::{Error, Place, Result};

/// A pivot below this fraction of its diagonal element is rounding: the equations depend on each other.
const MIN_PIVOT_FRACTION: f64 = 1e-12;

/// f̂(x | A x = b) as a mixture over the kernels of f̂.
#[derive(Debug, Clone)]
pub struct ConstrainedKde<'a> {
    kde: &'a Kde,
    /// m rows of d numbers.
    rows: Vec<Vec<f64>>,
    right: Vec<f64>,
    /// Lower Cholesky factor of A S Aᵀ with S = diag((h s)²), row by row.
    factor: Vec<f64>,
    /// Weights of the kernels, sum 1.
    probabilities: Vec<f64>,
    /// Parameters that are given: index and value. Set exactly in every draw.
    given: Vec<(usize, f64)>,
}

impl Kde {
    /// The density on A x = b; `rows` are those of A.
    ///
    /// # Errors
    /// [`Error::Usage`] for rows of another length than the parameters, numbers that are not finite, or equations
    /// that depend on each other.
    pub fn constrained(&self, rows: &[Vec<f64>], right: &[f64]) -> Result<ConstrainedKde<'_>> {
        let d = self.dimensions();
        let wrong = |problem: String, help: &str| Err(Error::usage(Place::item("A x = b"), problem, help));
        let numbers = rows.iter().flatten().chain(right);
        if rows.len() != right.len() || rows.is_empty() || rows.iter().any(|r| r.len() != d) {
            let problem = format!("{} equations with {} right sides over {d} parameters", rows.len(), right.len());
            return wrong(problem, "give one number per parameter and one right side per equation");
        }
        if numbers.into_iter().any(|v| !v.is_finite()) {
            return wrong("a number is not finite".to_owned(), "give finite numbers");
        }
        let spread = self.spread();
        let covariance = |a: &[f64], b: &[f64]| -> f64 { (0..d).map(|j| a[j] * spread[j] * spread[j] * b[j]).sum() };
        let m = rows.len();
        let gram: Vec<f64> = rows.iter().flat_map(|a| rows.iter().map(|b| covariance(a, b))).collect();
        let is_regular = |factor: &Vec<f64>| {
            (0..m).map(|i| i * m + i).all(|at| factor[at] * factor[at] > MIN_PIVOT_FRACTION * gram[at])
        };
        let Some(factor) = cholesky(&gram, m).filter(is_regular) else {
            return wrong("the equations depend on each other".to_owned(), "leave out those that follow from others");
        };
        let mut this = ConstrainedKde {
            kde: self,
            rows: rows.to_vec(),
            right: right.to_vec(),
            factor,
            probabilities: Vec::new(),
            given: Vec::new(),
        };
        let exponents: Vec<f64> = self
            .points()
            .iter()
            .map(|point| 0.5 * this.whitened_misfit(point).iter().map(|z| z * z).sum::<f64>())
            .collect();
        let least = exponents.iter().copied().fold(f64::INFINITY, f64::min);
        let weights: Vec<f64> = exponents.iter().map(|e| libm::exp(least - e)).collect();
        let total: f64 = weights.iter().sum();
        this.probabilities = weights.iter().map(|w| w / total).collect();
        Ok(this)
    }

    /// The density given the values of some parameters, by index.
    ///
    /// # Errors
    /// [`Error::Usage`] for an index that is not there or comes twice, a value that is not finite, or none at all.
    pub fn conditional(&self, given: &[(usize, f64)]) -> Result<ConstrainedKde<'_>> {
        let d = self.dimensions();
        let mut rows = Vec::new();
        for (index, _) in given {
            if *index >= d {
                let problem = format!("parameter {} is given, but there are {d}", index + 1);
                return Err(Error::usage(Place::item("given parameters"), problem, "give an index below their number"));
            }
            rows.push((0..d).map(|j| f64::from(u8::from(j == *index))).collect());
        }
        let right: Vec<f64> = given.iter().map(|(_, value)| *value).collect();
        let mut constrained = self.constrained(&rows, &right)?;
        constrained.given = given.to_vec();
        Ok(constrained)
    }
}

impl ConstrainedKde<'_> {
    /// Weights of the kernels on the plane, sum 1.
    pub fn component_probabilities(&self) -> &[f64] {
        &self.probabilities
    }

    /// The draw of an index. Not checked for validity.
    pub fn draw(&self, stream: &Stream, index: u64) -> Vec<f64> {
        let mut draws = Draws::new(*stream, index);
        let target = draws.uniform();
        let mut sum = 0.0;
        // Rounding may leave the sum below the target: then it is the last kernel with a weight.
        let mut chosen = self.probabilities.iter().rposition(|p| *p > 0.0).unwrap_or(0);
        for (k, p) in self.probabilities.iter().enumerate() {
            sum += p;
            if target < sum {
                chosen = k;
                break;
            }
        }
        let spread = self.kde.spread();
        let point = &self.kde.points()[chosen];
        let free: Vec<f64> = point.iter().zip(&spread).map(|(p, s)| p + s * draws.normal()).collect();
        // x + S Aᵀ (A S Aᵀ)⁻¹ (b − A x) has the distribution of x given A x = b.
        let multipliers = backward(&self.factor, &self.whitened_misfit(&free));
        let mut x: Vec<f64> = (0..free.len())
            .map(|j| {
                let pull: f64 = self.rows.iter().zip(&multipliers).map(|(a, m)| a[j] * m).sum();
                free[j] + spread[j] * spread[j] * pull
            })
            .collect();
        for (index, value) in &self.given {
            x[*index] = *value;
        }
        x
    }

    /// L⁻¹ (b − A x).
    fn whitened_misfit(&self, x: &[f64]) -> Vec<f64> {
        let product = |a: &Vec<f64>| a.iter().zip(x).map(|(a, x)| a * x).sum::<f64>();
        let misfit: Vec<f64> = self.rows.iter().zip(&self.right).map(|(a, b)| b - product(a)).collect();
        let mut z = vec![0.0; misfit.len()];
        whiten(&self.factor, &misfit, &mut z);
        z
    }
}

/// L⁻ᵀ b.
fn backward(l: &[f64], b: &[f64]) -> Vec<f64> {
    let m = b.len();
    let mut x = b.to_vec();
    for i in (0..m).rev() {
        let inner: f64 = (i + 1..m).map(|k| l[k * m + i] * x[k]).sum();
        x[i] = (x[i] - inner) / l[i * m + i];
    }
    x
}
