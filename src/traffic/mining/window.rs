//! Extrema over a trailing window, in linear time (monotone queue).

use std::collections::VecDeque;

/// Minimum over `x[k − window ..= k]` for every `k`. For `k < window` the window is incomplete.
pub(super) fn trailing_min(x: &[f64], window: usize) -> Vec<f64> {
    let mut candidates: VecDeque<usize> = VecDeque::with_capacity(window.min(x.len()) + 2);
    x.iter()
        .enumerate()
        .map(|(k, &value)| {
            while candidates.back().is_some_and(|&j| x[j] >= value) {
                candidates.pop_back();
            }
            candidates.push_back(k);
            while candidates.front().is_some_and(|&j| k - j > window) {
                candidates.pop_front();
            }
            candidates.front().map_or(value, |&j| x[j])
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equals_the_minimum_over_each_window() {
        let x: Vec<f64> = (0..200).map(|i| f64::from((i * 7919) % 101)).collect();
        for window in [0, 1, 2, 25, 300] {
            let least = trailing_min(&x, window);
            for k in 0..x.len() {
                let expected = x[k.saturating_sub(window)..=k].iter().copied().fold(f64::INFINITY, f64::min);
                assert_eq!(least[k], expected, "window {window}, sample {k}");
            }
        }
    }
}
