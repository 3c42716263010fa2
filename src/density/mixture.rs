//! A mixture of Gaussians: kernel density estimates, importance proposals and defensive mixtures all are one.

use crate::{Error, Place, Result};

/// Σ_k w_k N(μ_k, L_k L_kᵀ) over vectors of parameters, each in its own unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Mixture {
    dimensions: usize,
    /// One per component, > 0, sum 1.
    weights: Vec<f64>,
    /// One per component: μ_k.
    means: Vec<Vec<f64>>,
    /// Lower-triangular L, row by row, with zeros above the diagonal; the diagonal is > 0.
    factors: Vec<Vec<f64>>,
    /// Index into `factors`, one per component: kernels share one.
    factor_of: Vec<usize>,
}

impl Mixture {
    /// Checks shapes and scales the weights to sum 1.
    ///
    /// # Errors
    /// [`Error::Usage`] where there is no component, shapes differ, a weight is negative or not finite, or a
    /// diagonal is not positive.
    pub fn new(
        weights: Vec<f64>,
        means: Vec<Vec<f64>>,
        factors: Vec<Vec<f64>>,
        factor_of: Vec<usize>,
    ) -> Result<Mixture> {
        let wrong = |problem: String| {
            Err(Error::usage(Place::item("mixture"), problem, "give finite numbers, positive weights and spreads"))
        };
        let dimensions = means.first().map_or(0, Vec::len);
        if dimensions == 0 || means.len() != weights.len() || means.len() != factor_of.len() {
            return wrong(format!(
                "{} means of {dimensions} parameters, {} weights, {} factors do not make one",
                means.len(),
                weights.len(),
                factor_of.len()
            ));
        }
        let total: f64 = weights.iter().sum();
        if weights.iter().any(|w| !w.is_finite() || *w < 0.0) || total.is_nan() || total <= 0.0 {
            return wrong(format!("its weights sum to {total}"));
        }
        if means.iter().any(|m| m.len() != dimensions || m.iter().any(|v| !v.is_finite())) {
            return wrong("a mean has another length or is not finite".to_owned());
        }
        for factor in &factors {
            let is_square = factor.len() == dimensions * dimensions && factor.iter().all(|v| v.is_finite());
            if !is_square || (0..dimensions).any(|j| factor[j * dimensions + j] <= 0.0) {
                return wrong("a spread is not positive".to_owned());
            }
        }
        if factor_of.iter().any(|&f| f >= factors.len()) {
            return wrong("a component has no spread".to_owned());
        }
        let weights = weights.iter().map(|w| w / total).collect();
        Ok(Mixture { dimensions, weights, means, factors, factor_of })
    }

    /// Equally weighted kernels with one diagonal spread.
    ///
    /// # Errors
    /// As [`Mixture::new`].
    pub fn of_kernels(points: Vec<Vec<f64>>, spread: &[f64]) -> Result<Mixture> {
        let d = spread.len();
        let mut factor = vec![0.0; d * d];
        for (j, s) in spread.iter().enumerate() {
            factor[j * d + j] = *s;
        }
        let n = points.len();
        Mixture::new(vec![1.0; n], points, vec![factor], vec![0; n])
    }

    /// Number of parameters.
    pub fn dimensions(&self) -> usize {
        self.dimensions
    }

    /// Weights, one per component, sum 1.
    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Mean of a component.
    pub fn mean(&self, component: usize) -> &[f64] {
        &self.means[component]
    }

    /// L of a component, row by row.
    pub fn factor(&self, component: usize) -> &[f64] {
        &self.factors[self.factor_of[component]]
    }
}
