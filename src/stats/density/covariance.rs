//! Means, covariances and triangular factors of weighted points: small dense matrices, row by row.

/// Mean and covariance (row by row, d × d) of weighted points; the weights need not sum to 1. A covariance of the
/// population: divided by the sum of the weights.
pub(crate) fn moments<'a>(points: impl Iterator<Item = (&'a [f64], f64)> + Clone, d: usize) -> (Vec<f64>, Vec<f64>) {
    let mut mean = vec![0.0; d];
    let mut total = 0.0;
    for (point, weight) in points.clone() {
        total += weight;
        for (m, x) in mean.iter_mut().zip(point) {
            *m += weight * x;
        }
    }
    mean.iter_mut().for_each(|m| *m /= total);
    let mut covariance = vec![0.0; d * d];
    for (point, weight) in points {
        for i in 0..d {
            let from_mean = weight * (point[i] - mean[i]);
            for j in 0..=i {
                covariance[i * d + j] += from_mean * (point[j] - mean[j]);
            }
        }
    }
    for i in 0..d {
        for j in 0..=i {
            let value = covariance[i * d + j] / total;
            covariance[i * d + j] = value;
            covariance[j * d + i] = value;
        }
    }
    (mean, covariance)
}

/// L, lower triangular with a positive diagonal, with L Lᵀ = `matrix`; `None` where the matrix is not positive
/// definite in this arithmetic.
pub(crate) fn cholesky(matrix: &[f64], d: usize) -> Option<Vec<f64>> {
    let mut factor = vec![0.0; d * d];
    for i in 0..d {
        for j in 0..=i {
            let below: f64 = (0..j).map(|k| factor[i * d + k] * factor[j * d + k]).sum();
            let rest = matrix[i * d + j] - below;
            factor[i * d + j] = if i > j {
                rest / factor[j * d + j]
            } else if rest > 0.0 && rest.is_finite() {
                rest.sqrt()
            } else {
                return None;
            };
        }
    }
    Some(factor)
}

/// z with L z = `point`.
pub(crate) fn whiten(factor: &[f64], point: &[f64], z: &mut [f64]) {
    let d = point.len();
    for i in 0..d {
        let below: f64 = (0..i).map(|j| factor[i * d + j] * z[j]).sum();
        z[i] = (point[i] - below) / factor[i * d + i];
    }
}

/// L z.
pub(crate) fn colour(factor: &[f64], z: &[f64]) -> Vec<f64> {
    let d = z.len();
    (0..d).map(|i| (0..=i).map(|j| factor[i * d + j] * z[j]).sum()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_factor_times_its_transpose_is_the_matrix_and_whitening_undoes_colouring() {
        let matrix = [4.0, 2.0, 0.6, 2.0, 5.0, -1.0, 0.6, -1.0, 3.0];
        let factor = cholesky(&matrix, 3).expect("positive definite");
        for i in 0..3 {
            for j in 0..3 {
                let product: f64 = (0..3).map(|k| factor[i * 3 + k] * factor[j * 3 + k]).sum();
                assert!((product - matrix[i * 3 + j]).abs() < 1e-14);
            }
        }
        let (point, mut z) = ([1.0, -2.0, 0.5], [0.0; 3]);
        whiten(&factor, &point, &mut z);
        assert!(colour(&factor, &z).iter().zip(&point).all(|(a, b)| (a - b).abs() < 1e-14));
        assert!(cholesky(&[1.0, 2.0, 2.0, 1.0], 2).is_none());
    }
}
