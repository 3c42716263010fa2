//! Mean, covariance and triangular factor of weighted points.

use nalgebra::{Cholesky, DMatrix, DVector, DVectorView};

/// Mean and covariance (d × d) of weighted points; the weights need not sum to 1. A covariance of the population: divided
/// by the sum of the weights.
pub(crate) fn moments<'a>(
    points: impl Iterator<Item = (&'a [f64], f64)> + Clone,
    d: usize,
) -> (DVector<f64>, DMatrix<f64>) {
    let total: f64 = points.clone().map(|(_, weight)| weight).sum();
    let mut mean = DVector::zeros(d);
    for (point, weight) in points.clone() {
        mean.axpy(weight, &DVectorView::from_slice(point, d), 1.0);
    }
    mean /= total;
    let mut covariance = DMatrix::zeros(d, d);
    for (point, weight) in points {
        let from_mean = DVectorView::from_slice(point, d) - &mean;
        covariance.ger(weight, &from_mean, &from_mean, 1.0);
    }
    covariance /= total;
    // Rounding depends on the order of a product's factors.
    covariance.fill_lower_triangle_with_upper_triangle();
    (mean, covariance)
}

/// L, lower triangular, with L Lᵀ = `covariance`; the root of its diagonal where it is not positive definite in this
/// arithmetic.
pub(crate) fn factor_or_diagonal(covariance: DMatrix<f64>) -> DMatrix<f64> {
    let diagonal = covariance.diagonal();
    Cholesky::new(covariance).map_or_else(|| DMatrix::from_diagonal(&diagonal.map(f64::sqrt)), Cholesky::unpack)
}
