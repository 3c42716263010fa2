//! Derivatives of sampled series: central differences, and the Savitzky–Golay filter (a cubic fitted to a window around
//! each sample; Savitzky and Golay, "Smoothing and differentiation of data by simplified least squares procedures",
//! Analytical Chemistry 36, 1964).

use nalgebra::{Matrix4, Vector4};

/// Central differences, one-sided at the ends, per second.
pub(in crate::trajectory) fn central(values: &[f64], rate_hz: f64) -> Vec<f64> {
    let last = values.len() - 1;
    let at = |k: usize| {
        let (from, to) = (k.saturating_sub(1), (k + 1).min(last));
        if to > from { (values[to] - values[from]) * rate_hz / (to - from) as f64 } else { 0.0 }
    };
    (0..values.len()).map(at).collect()
}

/// The series, its first and its second derivative per second. The window is made odd and no longer than the series; the
/// cubic of the outermost windows holds at the ends.
pub(super) fn savitzky_golay(values: &[f64], window: usize, rate_hz: f64) -> [Vec<f64>; 3] {
    let longest = if values.len().is_multiple_of(2) { values.len().saturating_sub(1) } else { values.len() };
    let window = (window | 1).max(5).min(longest);
    if window < 5 {
        let first = central(values, rate_hz);
        let second = central(&first, rate_hz);
        return [values.to_vec(), first, second];
    }
    let half = (window / 2) as i64;
    // Normal equations of a cubic over −half..=half, scaled to −1..=1.
    let mut normal = Matrix4::zeros();
    for offset in -half..=half {
        let x = offset as f64 / half as f64;
        let powers = Vector4::new(1.0, x, x * x, x * x * x);
        normal += powers * powers.transpose();
    }
    let inverse = normal.try_inverse().unwrap_or_else(Matrix4::identity);
    let last = values.len() as i64 - 1;
    let mut result = [Vec::new(), Vec::new(), Vec::new()];
    for k in 0..=last {
        let middle = k.clamp(half, last - half);
        let mut sums = Vector4::zeros();
        for offset in -half..=half {
            let x = offset as f64 / half as f64;
            sums += values[(middle + offset) as usize] * Vector4::new(1.0, x, x * x, x * x * x);
        }
        let c = inverse * sums;
        let x = (k - middle) as f64 / half as f64;
        let per_second = rate_hz / half as f64;
        result[0].push(c[0] + x * (c[1] + x * (c[2] + x * c[3])));
        result[1].push((c[1] + x * (2.0 * c[2] + x * 3.0 * c[3])) * per_second);
        result[2].push((2.0 * c[2] + x * 6.0 * c[3]) * per_second * per_second);
    }
    result
}
