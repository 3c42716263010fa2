//! A mixture of Gaussians, used for kernel density estimates, importance proposals and defensive mixtures.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::mixture_density::whitened;
use super::normal::{normal, uniform};
use lanesweep_random::Stream;
use lanesweep_support::{Error, Place, Result};

/// Maximum number of blocks of four words per attempt at a draw.
const BLOCKS_PER_ATTEMPT: u32 = 8;

/// Maximum number of parameters of a mixture: one attempt uses 32 words, the first of which selects the component.
pub(super) const MAX_DIMENSIONS: usize = 4 * BLOCKS_PER_ATTEMPT as usize - 1;

/// Σ_k w_k N(μ_k, L_k L_kᵀ) over vectors of parameters, each in its own unit.
#[derive(Debug, Clone, PartialEq)]
pub struct Mixture {
    dimensions: usize,
    /// One per component, > 0, sum 1.
    weights: Vec<f64>,
    /// One per component: μ_k.
    means: Vec<Vec<f64>>,
    /// Lower-triangular L with zeros above the diagonal; the diagonal is > 0.
    factors: Vec<DMatrix<f64>>,
    /// One per factor: the rows of L⁻¹ up to its diagonal, one after the other.
    pub(super) inverses: Vec<Vec<f64>>,
    /// Index into `factors`, one per component; kernels share one factor.
    pub(super) factor_of: Vec<usize>,
    /// Cumulative weights up to and including each component; the last is 1.
    cumulative: Vec<f64>,
    /// L⁻¹ μ of all components, one after the other.
    pub(super) whitened_means: Vec<f64>,
    /// ln of each component's weighted height, w (2π)^{−d/2} / det L.
    pub(super) log_heights: Vec<f64>,
    /// Ranges of consecutive components with the same factor: a point is whitened once for each.
    pub(super) runs: Vec<Range<usize>>,
}

/// The rows of L⁻¹ up to the diagonal, of a lower-triangular L with a positive diagonal.
fn inverse(factor: &DMatrix<f64>) -> Vec<f64> {
    let d = factor.nrows();
    let mut columns = DMatrix::identity(d, d);
    factor.solve_lower_triangular_mut(&mut columns);
    (0..d).flat_map(|i| (0..=i).map(move |j| (i, j))).map(|at| columns[at]).collect()
}

impl Mixture {
    /// Checks shapes and scales the weights to sum 1, unless they do so up to rounding.
    ///
    /// # Errors
    /// [`Error::Usage`] if there is no component, shapes differ, there are more than `MAX_DIMENSIONS` parameters, a
    /// weight is negative or not finite, or a diagonal element is not positive.
    pub fn new(
        weights: Vec<f64>,
        means: Vec<Vec<f64>>,
        factors: Vec<DMatrix<f64>>,
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
        if dimensions > MAX_DIMENSIONS {
            return wrong(format!("{dimensions} parameters are more than {MAX_DIMENSIONS}"));
        }
        let total: f64 = weights.iter().sum();
        if weights.iter().any(|w| !w.is_finite() || *w < 0.0) || total.is_nan() || total <= 0.0 {
            return wrong(format!("its weights sum to {total}"));
        }
        if means.iter().any(|m| m.len() != dimensions || m.iter().any(|v| !v.is_finite())) {
            return wrong("a mean has another length or is not finite".to_owned());
        }
        for factor in &factors {
            let is_square = factor.shape() == (dimensions, dimensions) && factor.iter().all(|v| v.is_finite());
            if !is_square || factor.diagonal().iter().any(|spread| *spread <= 0.0) {
                return wrong("a spread is not positive".to_owned());
            }
        }
        if factor_of.iter().any(|&f| f >= factors.len()) {
            return wrong("a component has no spread".to_owned());
        }
        // Scaled weights sum to 1 up to rounding and are kept, so that a mixture read from a file is unchanged.
        let is_scaled = (total - 1.0).abs() <= 2.0 * weights.len() as f64 * f64::EPSILON;
        let weights = if is_scaled { weights } else { weights.iter().map(|w| w / total).collect() };
        let n = weights.len();
        let mut cumulative = Vec::with_capacity(n);
        let mut sum = 0.0;
        for weight in &weights {
            sum += weight;
            cumulative.push(sum);
        }
        // No draw may select a component after the last one with a positive weight.
        if let Some(last) = weights.iter().rposition(|w| *w > 0.0) {
            cumulative[last..].fill(1.0);
        }
        let log_constant = -0.5 * dimensions as f64 * libm::log(2.0 * std::f64::consts::PI);
        let log_determinants: Vec<f64> =
            factors.iter().map(|factor| factor.diagonal().iter().map(|spread| libm::log(*spread)).sum()).collect();
        let mut whitened_means = Vec::with_capacity(n * dimensions);
        let mut log_heights = Vec::with_capacity(n);
        let mut runs: Vec<Range<usize>> = Vec::new();
        let inverses: Vec<Vec<f64>> = factors.iter().map(inverse).collect();
        for k in 0..n {
            whitened_means.extend(whitened(&inverses[factor_of[k]], &means[k]));
            log_heights.push(libm::log(weights[k]) + log_constant - log_determinants[factor_of[k]]);
            match runs.last_mut() {
                Some(run) if factor_of[run.start] == factor_of[k] => run.end = k + 1,
                _ => runs.push(k..k + 1),
            }
        }
        Ok(Mixture {
            dimensions,
            weights,
            means,
            factors,
            inverses,
            factor_of,
            cumulative,
            whitened_means,
            log_heights,
            runs,
        })
    }

    /// Combines several mixtures: Σ weight · mixture, with the weights scaled to sum 1; mixtures of weight 0 are
    /// skipped. With weights 1 − δ and δ it is the defensive mixture of a proposal and its density (Hesterberg,
    /// "Weighted average importance sampling and defensive mixture distributions", Technometrics 37, 1995).
    ///
    /// # Errors
    /// As [`Mixture::new`].
    pub fn join(parts: &[(f64, &Mixture)]) -> Result<Mixture> {
        let (mut weights, mut means, mut factors, mut factor_of) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for (share, part) in parts.iter().filter(|(share, _)| *share != 0.0) {
            weights.extend(part.weights.iter().map(|w| share * w));
            means.extend(part.means.iter().cloned());
            factor_of.extend(part.factor_of.iter().map(|f| f + factors.len()));
            factors.extend(part.factors.iter().cloned());
        }
        Mixture::new(weights, means, factors, factor_of)
    }

    /// Kernels of equal weight with a common diagonal spread.
    ///
    /// # Errors
    /// As [`Mixture::new`].
    pub fn of_kernels(points: Vec<Vec<f64>>, spread: &[f64]) -> Result<Mixture> {
        let factor = DMatrix::from_diagonal(&DVector::from_column_slice(spread));
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

    /// L of a component.
    pub fn factor(&self, component: usize) -> &DMatrix<f64> {
        &self.factors[self.factor_of[component]]
    }

    /// L⁻¹ x of a point, with the L of a component.
    pub(crate) fn whitened(&self, component: usize, point: &[f64]) -> Vec<f64> {
        whitened(&self.inverses[self.factor_of[component]], point)
    }

    /// Whether all components have one covariance.
    pub(crate) fn shares_factor(&self) -> bool {
        self.runs.len() == 1
    }

    /// The same mixture with every covariance multiplied by `factor` > 0.
    ///
    /// # Errors
    /// As [`Mixture::new`].
    pub(crate) fn scaled(&self, factor: f64) -> Result<Mixture> {
        let factors = self.factors.iter().map(|own| own * factor.sqrt()).collect();
        Mixture::new(self.weights.clone(), self.means.clone(), factors, self.factor_of.clone())
    }

    /// The point of an index: a pure function of (stream, index, attempt). Attempts are independent draws at one index,
    /// for densities that reject some. Word 0 of the attempt's 32 words selects the component, word 1 + j gives the
    /// normal number of parameter j. The words are blocks 8·attempt … 8·attempt + 7 of the index.
    pub fn draw(&self, stream: &Stream, index: u64, attempt: u32) -> Vec<f64> {
        let words: Vec<u32> = (0..self.dimensions.div_ceil(4) as u32 + 1)
            .take(BLOCKS_PER_ATTEMPT as usize)
            .flat_map(|block| stream.words(index, attempt * BLOCKS_PER_ATTEMPT + block))
            .collect();
        let choice = uniform(words[0]);
        let component = self.cumulative.partition_point(|c| *c < choice);
        let z = DVector::from_iterator(self.dimensions, words[1..=self.dimensions].iter().map(|word| normal(*word)));
        let away = self.factor(component) * z;
        self.mean(component).iter().zip(&away).map(|(mean, away)| away + mean).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STREAM: Stream = Stream { seed: 7, purpose: 1 };

    fn dmatrix(d: usize, rows: &[f64]) -> DMatrix<f64> {
        DMatrix::from_row_slice(d, d, rows)
    }

    fn two_humps() -> Mixture {
        Mixture::new(
            vec![3.0, 1.0],
            vec![vec![0.0, 1.0], vec![5.0, -2.0]],
            vec![dmatrix(2, &[1.0, 0.0, 0.5, 2.0]), dmatrix(2, &[0.5, 0.0, 0.0, 0.1])],
            vec![0, 1],
        )
        .expect("well formed")
    }

    #[test]
    fn the_density_of_one_gaussian_is_the_textbook_s() {
        let one =
            Mixture::new(vec![1.0], vec![vec![1.0, 2.0]], vec![dmatrix(2, &[2.0, 0.0, 0.0, 3.0])], vec![0]).unwrap();
        let expected = -0.5 * (0.25 + 4.0 / 9.0) - libm::log(2.0 * std::f64::consts::PI * 6.0);
        assert!((one.log_density(&[2.0, 4.0]) - expected).abs() < 1e-14);
        assert_eq!(one.log_density(&[f64::NAN, 0.0]), f64::NEG_INFINITY);
    }

    #[test]
    fn a_mixture_made_of_its_own_weights_is_the_same_one() {
        for seed in 0..200_u64 {
            let n = 1 + seed as usize * 7 % 300;
            let weights =
                (0..n as u64).map(|i| libm::exp(((i * 2_654_435_761 + seed * 97) % 1000) as f64 / 90.0 - 8.0));
            let means: Vec<Vec<f64>> = (0..n).map(|i| vec![i as f64]).collect();
            let one = Mixture::new(weights.collect(), means.clone(), vec![dmatrix(1, &[1.0])], vec![0; n]).unwrap();
            let again = Mixture::new(one.weights().to_vec(), means, vec![dmatrix(1, &[1.0])], vec![0; n]).unwrap();
            assert_eq!(one, again, "{n} weights");
        }
    }

    #[test]
    fn a_density_integrates_to_one_and_stays_finite_far_out() {
        let mixture = two_humps();
        let (step, mut sum) = (0.02, 0.0);
        for i in -600..=600 {
            for j in -700..=700 {
                sum += libm::exp(mixture.log_density(&[f64::from(i) * step, f64::from(j) * step])) * step * step;
            }
        }
        assert!((sum - 1.0).abs() < 1e-6, "{sum}");
        assert!(mixture.log_density(&[1e6, 1e6]).is_finite());
    }

    #[test]
    fn thousands_of_kernels_sum_as_one_by_one() {
        let stream = Stream { seed: 3, purpose: 9 };
        let points: Vec<Vec<f64>> = (0..3000).map(|i| two_humps().draw(&stream, i, 0)).collect();
        let spread = [0.3, 0.4];
        let kernels = Mixture::of_kernels(points.clone(), &spread).unwrap();
        let at = [0.7, 0.1];
        let plain: f64 = points
            .iter()
            .map(|p| {
                let z: f64 = (0..2).map(|j| ((at[j] - p[j]) / spread[j]).powi(2)).sum();
                libm::exp(-0.5 * z) / (2.0 * std::f64::consts::PI * spread[0] * spread[1])
            })
            .sum();
        assert!((kernels.log_density(&at) - libm::log(plain / 3000.0)).abs() < 1e-12);
    }

    #[test]
    fn draws_have_the_mixture_s_moments_and_attempts_differ() {
        let mixture = two_humps();
        let n = 200_000;
        let points: Vec<Vec<f64>> = (0..n).map(|i| mixture.draw(&STREAM, i, 0)).collect();
        let mean = |f: &dyn Fn(&[f64]) -> f64| points.iter().map(|p| f(p)).sum::<f64>() / n as f64;
        assert!((mean(&|p| p[0]) - 1.25).abs() < 0.02);
        assert!((mean(&|p| p[1]) - 0.25).abs() < 0.02);
        // Σ w (μ₀μ₁ + cov); the second component has no covariance.
        assert!((mean(&|p| p[0] * p[1]) - (0.75 * 0.5 - 0.25 * 10.0)).abs() < 0.05);
        assert_ne!(mixture.draw(&STREAM, 0, 0), mixture.draw(&STREAM, 0, 1));
        assert_eq!(mixture.draw(&STREAM, 5, 2), mixture.draw(&STREAM, 5, 2));
    }

    #[test]
    fn a_defensive_mixture_bounds_the_ratio_to_its_nominal_part() {
        let nominal = two_humps();
        let narrow = Mixture::of_kernels(vec![vec![9.0, 9.0]], &[0.1, 0.1]).unwrap();
        let defensive = Mixture::join(&[(0.9, &narrow), (0.1, &nominal)]).unwrap();
        for i in 0..1000 {
            let x = nominal.draw(&STREAM, i, 0);
            assert!(nominal.log_density(&x) - defensive.log_density(&x) <= libm::log(10.0) + 1e-12);
        }
    }

    #[test]
    fn the_largest_number_of_parameters_can_be_drawn_and_one_more_is_refused() {
        let of = |d: usize| Mixture::of_kernels(vec![vec![0.0; d]], &vec![1.0; d]);
        let point = of(MAX_DIMENSIONS).unwrap().draw(&STREAM, 0, 0);
        assert_eq!(point.len(), MAX_DIMENSIONS);
        assert!(of(MAX_DIMENSIONS + 1).is_err());
    }
}
