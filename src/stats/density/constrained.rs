//! A kernel density estimate on the plane A x = b: the density of the parameters given linear equations, or given
//! the values of some of them. Each kernel conditions as a Gaussian does; its weight is how well it fits b
//! (arXiv 2107.05278).

use nalgebra::{Cholesky, DMatrix, DVector, DVectorView, Dyn};

use super::kde::Kde;
use super::normal::Draws;
use crate::random::Stream;
use crate::{Error, Place, Result};

/// A pivot below this fraction of its diagonal element is rounding error: the equations are linearly dependent.
const MIN_PIVOT_FRACTION: f64 = 1e-12;

/// f̂(x | A x = b) as a mixture over the kernels of f̂.
#[derive(Debug, Clone)]
pub struct ConstrainedKde<'a> {
    kde: &'a Kde,
    /// A, m × d.
    rows: DMatrix<f64>,
    right: DVector<f64>,
    /// Cholesky factor of A S Aᵀ with S = diag((h s)²).
    factor: Cholesky<f64, Dyn>,
    /// Weights of the kernels, sum 1.
    probabilities: Vec<f64>,
    /// Given parameters: index and value. Set exactly in every draw.
    given: Vec<(usize, f64)>,
}

impl Kde {
    /// The density on A x = b; `rows` are those of A.
    ///
    /// # Errors
    /// [`Error::Usage`] if a row's length differs from the number of parameters, a number is not finite, or the
    /// equations are linearly dependent.
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
        let rows = DMatrix::from_fn(rows.len(), d, |i, j| rows[i][j]);
        let gram = DMatrix::from_fn(rows.nrows(), d, |i, j| rows[(i, j)] * spread[j] * spread[j]) * rows.transpose();
        let is_regular = |factor: &Cholesky<f64, Dyn>| {
            let (pivots, diagonal) = (factor.l_dirty().diagonal(), gram.diagonal());
            pivots.iter().zip(&diagonal).all(|(pivot, all)| pivot * pivot > MIN_PIVOT_FRACTION * all)
        };
        let Some(factor) = Cholesky::new(gram.clone()).filter(is_regular) else {
            return wrong("the equations depend on each other".to_owned(), "leave out those that follow from others");
        };
        let mut this = ConstrainedKde {
            kde: self,
            rows,
            right: DVector::from_column_slice(right),
            factor,
            probabilities: Vec::new(),
            given: Vec::new(),
        };
        let exponent = |point: &Vec<f64>| {
            let mut whitened = this.misfit(point);
            this.factor.l_dirty().solve_lower_triangular_mut(&mut whitened);
            0.5 * whitened.norm_squared()
        };
        let exponents: Vec<f64> = self.points().iter().map(exponent).collect();
        let min = exponents.iter().copied().fold(f64::INFINITY, f64::min);
        let weights: Vec<f64> = exponents.iter().map(|e| libm::exp(min - e)).collect();
        let total: f64 = weights.iter().sum();
        this.probabilities = weights.iter().map(|w| w / total).collect();
        Ok(this)
    }

    /// The density given the values of some parameters, by index.
    ///
    /// # Errors
    /// [`Error::Usage`] for an index that is out of range or duplicate, a value that is not finite, or an empty list.
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
        // If rounding leaves the sum below the target, the last kernel with a positive weight is selected.
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
        let pull = self.rows.tr_mul(&self.factor.solve(&self.misfit(&free)));
        let mut x: Vec<f64> = free.iter().zip(&spread).zip(&pull).map(|((x, s), pull)| x + s * s * pull).collect();
        for (index, value) in &self.given {
            x[*index] = *value;
        }
        x
    }

    /// b − A x.
    fn misfit(&self, x: &[f64]) -> DVector<f64> {
        &self.right - &self.rows * DVectorView::from_slice(x, x.len())
    }
}
