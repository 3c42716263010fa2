//! Mean, covariance and triangular factor of weighted points.
//!
//! Also the scale of each parameter before an isotropic kernel: min(σ, IQR/1.349), the robust estimate of a standard
//! deviation (Silverman 1986). σ with ddof 0; quantiles interpolate linearly between order statistics, the
//! first at probability 0 and the last at 1 (R's type 7, NumPy's default).

use nalgebra::{Cholesky, DMatrix, DVector};

/// Mean and covariance (d × d) of weighted points; the weights need not sum to 1. The covariance is divided by the sum
/// of the weights (population covariance).
pub(crate) fn moments<'a>(
    points: impl Iterator<Item = (&'a [f64], f64)> + Clone,
    d: usize,
) -> (DVector<f64>, DMatrix<f64>) {
    let total: f64 = points.clone().map(|(_, weight)| weight).sum();
    let mut mean = DVector::zeros(d);
    for (point, weight) in points.clone() {
        mean.iter_mut().zip(point).for_each(|(mean, x)| *mean += weight * x);
    }
    mean /= total;
    // Column by column, down to the diagonal.
    let mut upper = vec![0.0; d * d];
    let mut from_mean = vec![0.0; d];
    for (point, weight) in points {
        from_mean.iter_mut().zip(point).zip(mean.iter()).for_each(|((from_mean, x), mean)| *from_mean = x - mean);
        for (j, column) in upper.chunks_exact_mut(d.max(1)).enumerate() {
            let weighted = weight * from_mean[j];
            column[..=j].iter_mut().zip(&from_mean).for_each(|(sum, from_mean)| *sum += weighted * from_mean);
        }
    }
    let mut covariance = DMatrix::from_vec(d, d, upper) / total;
    covariance.fill_lower_triangle_with_upper_triangle();
    (mean, covariance)
}

/// L, lower triangular, with L Lᵀ = `covariance`. If the covariance is not numerically positive definite, the square
/// root of its diagonal.
pub(crate) fn factor_or_diagonal(covariance: DMatrix<f64>) -> DMatrix<f64> {
    let diagonal = covariance.diagonal();
    Cholesky::new(covariance).map_or_else(|| DMatrix::from_diagonal(&diagonal.map(f64::sqrt)), Cholesky::unpack)
}

/// Interquartile range of the standard normal distribution, as the published program rounds it.
const NORMAL_IQR: f64 = 1.349;

/// Scale of one parameter; 0 if all values are equal. If the middle half of the values is constant, the IQR is 0 and σ
/// is used.
pub(super) fn scale_of(values: &[f64]) -> f64 {
    let sigma = standard_deviation(values);
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let robust = (quantile(&sorted, 0.75) - quantile(&sorted, 0.25)) / NORMAL_IQR;
    if robust > 0.0 { sigma.min(robust) } else { sigma }
}

/// Standard deviation with ddof 0; exactly 0 for equal values.
pub fn standard_deviation(values: &[f64]) -> f64 {
    if values.iter().all(|v| *v == values[0]) {
        return 0.0;
    }
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / n).sqrt()
}

/// Quantile of values in rising order, at least one.
fn quantile(sorted: &[f64], probability: f64) -> f64 {
    let position = probability.clamp(0.0, 1.0) * (sorted.len() - 1) as f64;
    let below = position as usize;
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + (sorted[above] - sorted[below]) * (position - below as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_interpolate_between_order_statistics() {
        assert_eq!(quantile(&[1.0, 2.0, 3.0, 4.0], 0.25), 1.75);
        assert_eq!(quantile(&[1.0, 2.0, 3.0, 4.0], 1.0), 4.0);
        assert_eq!(quantile(&[7.0], 0.3), 7.0);
    }

    #[test]
    fn an_outlier_does_not_widen_the_scale_and_equal_values_have_none() {
        let mut values: Vec<f64> = (0..101).map(f64::from).collect();
        let before = scale_of(&values);
        values[100] = 1e6;
        assert!((scale_of(&values) / (50.0 / 1.349) - 1.0).abs() < 0.03 && before < standard_deviation(&values));
        assert_eq!(scale_of(&[0.1; 7]), 0.0);
        let mut mostly_equal = vec![0.0; 20];
        mostly_equal[0] = 1.0;
        assert_eq!(scale_of(&mostly_equal), standard_deviation(&mostly_equal));
    }
}
