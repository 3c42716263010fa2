//! Weighted maximum likelihood of a Gaussian mixture by expectation maximisation (Dempster, Laird and Rubin 1977), for
//! proposals: few components, full covariances.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::Mixture;
use super::moments::{factor_or_diagonal, moments};
use super::normal::uniform;
use lanesweep_random::Stream;
use lanesweep_support::{Error, Place, Result};

/// Purpose of the random words that select the initial centres.
const PURPOSE: u32 = 0x464D_0001;
/// Components below this weight are dropped.
const MIN_WEIGHT: f64 = 1e-3;
/// Added to every variance, as a fraction of the points' variance of that parameter.
const JITTER: f64 = 1e-6;

/// Parts of the points of which each is held out once, to choose the number of components.
const FOLDS: usize = 2;
/// Maximum number of iterations for each number of components.
const ITERATIONS: usize = 50;
/// Iterations end when the mean log-likelihood grows by less than this.
const TOLERANCE: f64 = 1e-3;

impl Mixture {
    /// The mixture that maximizes the weighted log-likelihood Σ w ln q(x). Covariances are regularised: each is shrunk
    /// towards the covariance of all points by (d + 1)/(d + 1 + its effective sample size), so that few points never
    /// give a degenerate covariance.
    ///
    /// The likelihood of held-out points chooses the number of components among 1, 2, 3, 4, 6, 8, 12, … up to
    /// `components`. `seed` is that of the first centres.
    ///
    /// # Errors
    /// [`Error::Usage`] if there is no point, shapes differ, or weights are negative, not finite or all zero.
    pub(crate) fn fit(points: &[Vec<f64>], weights: &[f64], components: usize, seed: u64) -> Result<Mixture> {
        let total: f64 = weights.iter().sum();
        let d = points.first().map_or(0, Vec::len);
        let well_formed = d > 0
            && points.len() == weights.len()
            && points.iter().all(|p| p.len() == d && p.iter().all(|x| x.is_finite()))
            && weights.iter().all(|w| *w >= 0.0)
            && total.is_finite()
            && total > 0.0;
        if !well_formed {
            return Err(Error::usage(
                Place::item("fit of a mixture"),
                format!("{} points of {d} parameters with weights that sum to {total} cannot be fitted", points.len()),
                "give finite points of one length, and weights that are not all zero",
            ));
        }
        // Points of weight 0 have no effect.
        let kept: Vec<(&[f64], f64)> =
            points.iter().zip(weights).filter(|(_, w)| **w > 0.0).map(|(p, w)| (p.as_slice(), w / total)).collect();
        let sample = Weighted::of(kept, d);
        sample.expectation_maximisation(sample.chosen(components, seed)?, seed)
    }
}

/// Gain of the mean held-out log-likelihood that one more candidate must bring.
const MIN_GAIN: f64 = 1e-3;
/// Candidates in a row without a gain, after which no larger one is tried.
const MAX_WORSE: usize = 2;

/// Points with weights of sum 1, and the data common to all components.
struct Weighted<'a> {
    points: Vec<(&'a [f64], f64)>,
    d: usize,
    covariance: DMatrix<f64>,
    effective: f64,
}

impl<'a> Weighted<'a> {
    fn of(points: Vec<(&'a [f64], f64)>, d: usize) -> Self {
        let (mean, mut covariance) = moments(points.iter().copied(), d);
        for j in 0..d {
            // A constant parameter gets a spread that is small relative to its value.
            let min_variance = (1e-9 * (1.0 + mean[j].abs())).powi(2);
            covariance[(j, j)] = covariance[(j, j)] * (1.0 + JITTER) + min_variance;
        }
        let effective = 1.0 / points.iter().map(|(_, w)| w * w).sum::<f64>();
        Weighted { points, d, covariance, effective }
    }

    fn places(&self) -> Vec<&'a [f64]> {
        self.points.iter().map(|(point, _)| *point).collect()
    }

    /// The number of components with the largest held-out likelihood; the smaller one of almost equal candidates.
    fn chosen(&self, components: usize, seed: u64) -> Result<usize> {
        // A component takes its weight, mean and covariance from at least d + 1 points.
        let max = (self.effective / (self.d as f64 + 1.0)).floor().max(1.0) as usize;
        let powers = (0..usize::BITS - 2).flat_map(|bit| [1 << bit, 3 << bit]);
        let mut candidates: Vec<usize> = powers.filter(|k| *k <= components.min(max)).collect();
        candidates.sort_unstable();
        if candidates.len() < 2 {
            return Ok(1);
        }
        let part = |fold: usize, is_held_out: bool| {
            let own = self.points.iter().enumerate().filter(|(at, _)| (at % FOLDS == fold) == is_held_out);
            let own: Vec<(&[f64], f64)> = own.map(|(_, point)| *point).collect();
            let total: f64 = own.iter().map(|(_, weight)| weight).sum();
            Weighted::of(own.into_iter().map(|(point, weight)| (point, weight / total)).collect(), self.d)
        };
        let parts: Vec<[Weighted; 2]> = (0..FOLDS).map(|fold| [part(fold, false), part(fold, true)]).collect();
        let held_out = |[fitted, held_out]: &[Weighted; 2], components: usize| -> Result<f64> {
            let mixture = fitted.expectation_maximisation(components, seed)?;
            let logs = mixture.log_densities(&held_out.places());
            Ok(held_out.points.iter().zip(logs).map(|((_, weight), log)| weight * log).sum::<f64>())
        };
        let (mut best, mut worse) = ((f64::NEG_INFINITY, 1), 0);
        for components in candidates {
            let scores = parts.par_iter().map(|part| held_out(part, components)).collect::<Result<Vec<f64>>>()?;
            let score = scores.iter().sum::<f64>() / scores.len() as f64;
            worse += 1;
            if score > best.0 + MIN_GAIN {
                (best, worse) = ((score, components), 0);
            }
            if worse == MAX_WORSE {
                break;
            }
        }
        Ok(best.1)
    }

    /// L of (1 − λ) S + λ (covariance of all points).
    fn factor(&self, own: DMatrix<f64>, effective: f64) -> DMatrix<f64> {
        let pull = (self.d as f64 + 1.0) / (self.d as f64 + 1.0 + effective);
        let mut matrix = own * (1.0 - pull) + &self.covariance * pull;
        for j in 0..self.d {
            matrix[(j, j)] += JITTER * self.covariance[(j, j)];
        }
        factor_or_diagonal(matrix)
    }

    /// Initial responsibilities: each point belongs to the nearest centre. Centres are selected as in k-means++ (Arthur
    /// and Vassilvitskii 2007), in units of the parameters' spreads, then improved by a few iterations of k-means.
    fn first_assignment(&self, components: usize, seed: u64) -> Vec<usize> {
        let d = self.d;
        let scale: Vec<f64> = self.covariance.diagonal().iter().map(|variance| variance.sqrt()).collect();
        let distance = |a: &[f64], b: &[f64]| -> f64 { (0..d).map(|j| ((a[j] - b[j]) / scale[j]).powi(2)).sum() };
        let stream = Stream { seed, purpose: PURPOSE };
        let choose = |weights: &[f64], k: usize| {
            let goal = uniform(stream.words(k as u64, 0)[0]) * weights.iter().sum::<f64>();
            let mut sum = 0.0;
            weights.iter().position(|s| {
                sum += s;
                sum >= goal
            })
        };
        let weights: Vec<f64> = self.points.iter().map(|p| p.1).collect();
        let mut centres = vec![self.points[choose(&weights, 0).unwrap_or(0)].0.to_vec()];
        let mut nearest: Vec<f64> = self.points.iter().map(|p| distance(p.0, &centres[0])).collect();
        for k in 1..components {
            let weights: Vec<f64> = self.points.iter().zip(&nearest).map(|(p, n)| p.1 * n).collect();
            let centre = self.points[choose(&weights, k).unwrap_or(0)].0.to_vec();
            nearest.iter_mut().zip(&self.points).for_each(|(n, p)| *n = n.min(distance(p.0, &centre)));
            centres.push(centre);
        }
        let mut assignment = vec![0; self.points.len()];
        for _ in 0..5 {
            for (own, point) in assignment.iter_mut().zip(&self.points) {
                let to = |c: usize| distance(point.0, &centres[c]);
                *own = (0..components).min_by(|a, b| to(*a).total_cmp(&to(*b))).unwrap_or(0);
            }
            for (c, centre) in centres.iter_mut().enumerate() {
                let own = self.points.iter().zip(&assignment).filter(|(_, a)| **a == c).map(|(p, _)| *p);
                if own.clone().next().is_some() {
                    centre.copy_from_slice(moments(own, d).0.as_slice());
                }
            }
        }
        assignment
    }

    /// The fitted mixture.
    fn expectation_maximisation(&self, components: usize, seed: u64) -> Result<Mixture> {
        let n = self.points.len();
        let mut responsibilities = vec![vec![0.0; n]; components];
        for (i, own) in self.first_assignment(components, seed).into_iter().enumerate() {
            responsibilities[own][i] = 1.0;
        }
        let mut mixture = self.maximise(&responsibilities)?;
        let mut last = f64::NEG_INFINITY;
        let places = self.places();
        for _ in 0..ITERATIONS {
            responsibilities = vec![vec![0.0; n]; mixture.weights().len()];
            let mut log_likelihood = 0.0;
            let explained = mixture.responsibilities_and_log_densities(&places);
            for (i, ((_, weight), (parts, log_density))) in self.points.iter().zip(explained).enumerate() {
                log_likelihood += weight * log_density;
                responsibilities.iter_mut().zip(parts).for_each(|(responsibility, part)| responsibility[i] = part);
            }
            if log_likelihood - last < TOLERANCE {
                break;
            }
            last = log_likelihood;
            mixture = self.maximise(&responsibilities)?;
        }
        Ok(mixture)
    }

    /// Weights, means and factors for given responsibilities.
    fn maximise(&self, responsibilities: &[Vec<f64>]) -> Result<Mixture> {
        let (mut weights, mut means, mut factors) = (Vec::new(), Vec::new(), Vec::new());
        for responsibility in responsibilities {
            let own = self.points.iter().zip(responsibility).map(|(p, s)| (p.0, p.1 * s)).filter(|p| p.1 > 0.0);
            let weight: f64 = own.clone().map(|p| p.1).sum();
            if weight < MIN_WEIGHT {
                continue;
            }
            let effective = weight * weight / own.clone().map(|p| p.1 * p.1).sum::<f64>();
            let (mean, covariance) = moments(own, self.d);
            weights.push(weight);
            means.push(mean.as_slice().to_vec());
            factors.push(self.factor(covariance, effective));
        }
        let each = (0..factors.len()).collect();
        Mixture::new(weights, means, factors, each)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn three() -> Mixture {
        Mixture::new(
            vec![0.5, 0.3, 0.2],
            vec![vec![0.0, 0.0], vec![8.0, 0.0], vec![0.0, 9.0]],
            [[1.0, 0.0, 0.8, 0.6], [0.5, 0.0, 0.0, 1.5]].map(|l| DMatrix::from_row_slice(2, 2, &l)).to_vec(),
            vec![0, 1, 1],
        )
        .expect("well formed")
    }

    #[test]
    fn a_fit_finds_the_number_the_places_and_the_shapes_of_components() {
        let stream = Stream { seed: 1, purpose: 2 };
        let points: Vec<Vec<f64>> = (0..4000).map(|i| three().draw(&stream, i, 0)).collect();
        let fitted = Mixture::fit(&points, &vec![2.5; 4000], 4, 0).expect("a fit");
        assert_eq!(fitted.weights().len(), 3);
        for k in 0..3 {
            let truth = three();
            let near = |c: &usize| (0..2).map(|j| (fitted.mean(*c)[j] - truth.mean(k)[j]).powi(2)).sum::<f64>();
            let own = (0..3).min_by(|a, b| near(a).total_cmp(&near(b))).unwrap();
            assert!(near(&own).sqrt() < 0.15);
            assert!((fitted.weights()[own] - truth.weights()[k]).abs() < 0.03);
            let off = (fitted.factor(own) - truth.factor(k)).amax();
            assert!(off < 0.12, "{:?}", fitted.factor(own));
        }
    }

    #[test]
    fn weights_move_the_fit_as_repetitions_would() {
        let stream = Stream { seed: 4, purpose: 2 };
        let points: Vec<Vec<f64>> = (0..500).map(|i| three().draw(&stream, i, 0)).collect();
        let weights: Vec<f64> = (0..500).map(|i| f64::from(1 + i % 3)).collect();
        let weighted = Mixture::fit(&points, &weights, 1, 0).unwrap();
        let total: f64 = weights.iter().sum();
        let mean: f64 = points.iter().zip(&weights).map(|(p, w)| p[0] * w).sum::<f64>() / total;
        assert!((weighted.mean(0)[0] - mean).abs() < 1e-12);
    }

    #[test]
    fn one_point_or_a_parameter_without_spread_still_gives_a_density() {
        let fitted = Mixture::fit(&[vec![3.0, 4.0]], &[1.0], 4, 0).unwrap();
        assert!(fitted.log_density(&[3.0, 4.0]).is_finite());
        let flat: Vec<Vec<f64>> = (0..50).map(|i| vec![f64::from(i), 7.0]).collect();
        assert!(Mixture::fit(&flat, &[1.0; 50], 4, 0).is_ok());
        assert!(Mixture::fit(&flat, &[0.0; 50], 4, 0).is_err());
        assert!(Mixture::fit(&[], &[], 4, 0).is_err());
    }
}
