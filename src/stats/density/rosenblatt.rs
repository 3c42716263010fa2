//! Independent standard normal numbers → a point of a mixture (Rosenblatt, "Remarks on a multivariate transformation",
//! Annals of Mathematical Statistics 23, 1952): what libraries of structural reliability work in.

use super::Mixture;
use super::bandwidth::exp_minus;
use super::mixture_density::LANES;
use super::normal::normal_cdf;

/// Newton's steps, each within the bracket that bisection keeps; more than are ever taken.
const STEPS: usize = 200;

impl Mixture {
    /// The point whose distribution function, parameter by parameter given those before, is Φ(u). The map is smooth and
    /// increasing in each parameter, and independent standard normal numbers become draws of the mixture.
    ///
    /// # Panics
    /// If `u` has another length than the mixture has parameters.
    pub fn from_standard_normal(&self, u: &[f64]) -> Vec<f64> {
        assert_eq!(u.len(), self.dimensions(), "a number for every parameter");
        pulp::Arch::new().dispatch(Transform { mixture: self, u })
    }
}

/// The transformation of one point. A type, because closures are not inlined into what is compiled for wider vectors.
struct Transform<'a> {
    mixture: &'a Mixture,
    u: &'a [f64],
}

impl pulp::NullaryFnOnce for Transform<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn call(self) -> Vec<f64> {
        let Transform { mixture, u } = self;
        let d = u.len();
        // ln of the weight of each component given the parameters so far.
        let mut log_weights = vec![0.0; mixture.weights().len()];
        let mut weights = log_weights.clone();
        let mut means = log_weights.clone();
        let mut deviations = log_weights.clone();
        for (log_weight, weight) in log_weights.iter_mut().zip(mixture.weights()) {
            *log_weight = libm::log(*weight);
        }
        let mut point: Vec<f64> = Vec::with_capacity(d);
        for (j, &u) in u.iter().enumerate() {
            let top = log_weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            for (weight, log_weight) in weights.iter_mut().zip(&log_weights) {
                *weight = exp_minus(top - log_weight);
            }
            for run in &mixture.runs {
                let factor = mixture.factor_of[run.start];
                let deviation = mixture.factor(run.start)[(j, j)];
                // Row j of L⁻¹: the component's (x − mean)/deviation is `before` + x/deviation − its whitened mean.
                let row = &mixture.inverses[factor][j * (j + 1) / 2..];
                let before: f64 = row.iter().zip(&point).map(|(l, x)| l * x).sum();
                for k in run.clone() {
                    means[k] = deviation * (mixture.whitened_means[k * d + j] - before);
                }
                deviations[run.clone()].fill(deviation);
            }
            let x = quantile(&weights, &means, &deviations, u);
            for run in &mixture.runs {
                let deviation = deviations[run.start];
                let log_deviation = libm::log(deviation);
                for k in run.clone() {
                    let z = (x - means[k]) / deviation;
                    log_weights[k] -= 0.5 * z * z + log_deviation;
                }
            }
            point.push(x);
        }
        point
    }
}

/// x with Σ w Φ((x − mean)/deviation) = Φ(u) Σ w, from the tail in which u lies, so that far tails keep their digits.
#[inline(always)]
fn quantile(weights: &[f64], means: &[f64], deviations: &[f64], u: f64) -> f64 {
    let total: f64 = weights.iter().sum();
    let side = if u > 0.0 { -1.0 } else { 1.0 };
    let tail_of_u = normal_cdf(side * u);
    let wanted = libm::log(tail_of_u);
    // What all others together add to the tail is less than its rounding.
    let negligible = 0.25 * f64::EPSILON * tail_of_u * total / weights.len() as f64;
    let mut kernels: Vec<Kernels> = Vec::with_capacity(weights.len().div_ceil(LANES));
    let mut kept = 0;
    let (mut low, mut high, mut narrowest) = (f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY);
    for ((&weight, &mean), &deviation) in weights.iter().zip(means).zip(deviations) {
        if weight > negligible {
            let at = kept % LANES;
            if at == 0 {
                kernels.push(Kernels { weights: [0.0; LANES], means: [mean; LANES], deviations: [deviation; LANES] });
            }
            let of = &mut kernels[kept / LANES];
            (of.weights[at], of.means[at], of.deviations[at]) = (weight, mean, deviation);
            kept += 1;
            let end = mean + u * deviation;
            (low, high, narrowest) = (low.min(end), high.max(end), narrowest.min(deviation));
        }
    }
    let mut x = 0.5 * (low + high);
    for _ in 0..STEPS {
        let [tail, slope] = sums(&kernels, side, x);
        // ln of the tail is nearly linear where the tail is far.
        let off = libm::log(tail / total) - wanted;
        if off == 0.0 || high - low <= 4.0 * f64::EPSILON * x.abs().max(high.abs()) {
            return x;
        }
        if (off < 0.0) == (side > 0.0) {
            low = x
        } else {
            high = x
        }
        let next = x - off * tail / (side * slope);
        let is_inside = next > low && next < high;
        // Newton's steps square the error: what is left after a step this small is below the rounding.
        if is_inside && (next - x).abs() <= 1e-9 * narrowest {
            return next;
        }
        x = if is_inside { next } else { 0.5 * (low + high) };
    }
    x
}

/// Kernels side by side; unused lanes have weight 0.
struct Kernels {
    weights: [f64; LANES],
    means: [f64; LANES],
    deviations: [f64; LANES],
}

/// The sum of the kernels below x (above it, if `side` is −1), and that of their densities there.
#[inline(always)]
fn sums(kernels: &[Kernels], side: f64, x: f64) -> [f64; 2] {
    let (mut tails, mut slopes) = ([0.0; LANES], [0.0; LANES]);
    for of in kernels {
        for lane in 0..LANES {
            let z = side * (x - of.means[lane]) / of.deviations[lane];
            let bell = exp_minus(0.5 * z * z);
            let inverse = 1.0 / (z.abs() + 4.0);
            let beyond = bell * inverse * TAIL.iter().rev().fold(0.0, |sum, c| sum * ((z.abs() - 4.0) * inverse) + c);
            tails[lane] += of.weights[lane] * if z > 0.0 { 1.0 - beyond } else { beyond };
            slopes[lane] += of.weights[lane] * bell / of.deviations[lane];
        }
    }
    [tails.iter().sum(), slopes.iter().sum::<f64>() / (2.0 * std::f64::consts::PI).sqrt()]
}

/// Φ(−z) exp(z²/2) (z + 4) as powers of (z − 4)/(z + 4), for z ≥ 0: interpolation at 24 Chebyshev points, within 5e-16.
const TAIL: [f64; 24] = [
    0.7552851304157514,
    -0.6078966419718921,
    0.3871374007422269,
    -0.18652185795965176,
    0.06039657489034808,
    -0.007540188966996623,
    -0.0034796923564507777,
    0.0016308184627789688,
    0.00013334420755153713,
    -0.00023109498674854848,
    -1.9076685133202144e-06,
    3.514498813160344e-05,
    7.145802592193101e-07,
    -5.921289422115028e-06,
    -6.249141680900659e-07,
    1.0242368988565404e-06,
    2.6468456126470355e-07,
    -1.5916439391794904e-07,
    -7.874694430470838e-08,
    1.7419125179458914e-08,
    1.6051942514282524e-08,
    -4.1774838524334276e-10,
    -1.6858481937278877e-09,
    -1.493647950995503e-10,
];

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    #[test]
    fn the_map_is_the_factor_of_a_gaussian_and_the_inverse_of_a_mixtures_distribution_function() {
        let factor = DMatrix::from_row_slice(2, 2, &[2.0, 0.0, -0.6, 0.5]);
        let one = Mixture::new(vec![1.0], vec![vec![3.0, -1.0]], vec![factor], vec![0]).unwrap();
        for u in [[0.0, 0.0], [1.3, -0.2], [-6.0, 7.5]] {
            let x = one.from_standard_normal(&u);
            assert!((x[0] - 3.0 - 2.0 * u[0]).abs() < 1e-12 && (x[1] + 1.0 + 0.6 * u[0] - 0.5 * u[1]).abs() < 1e-12);
        }
        // Of two heaps the distribution function is known, far into both tails.
        let heaps = Mixture::of_kernels(vec![vec![0.0], vec![10.0], vec![10.5]], &[0.5]).unwrap();
        let mut last = f64::NEG_INFINITY;
        for u in (-80..=80).map(|u| f64::from(u) / 10.0) {
            let x = heaps.from_standard_normal(&[u])[0];
            let side = if u > 0.0 { -1.0 } else { 1.0 };
            let tail: f64 = [0.0, 10.0, 10.5].iter().map(|mean| normal_cdf(side * (x - mean) / 0.5) / 3.0).sum();
            assert!((tail / normal_cdf(side * u) - 1.0).abs() < 1e-9, "{u}: {x}");
            assert!(x > last, "increasing at {u}");
            last = x;
        }
    }

    #[test]
    fn the_tail_is_that_of_the_library() {
        let standard = Kernels {
            weights: [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            means: [0.0; LANES],
            deviations: [1.0; LANES],
        };
        for z in (-3700..=3700).map(|z| f64::from(z) / 100.0) {
            let [tail, slope] = sums(std::slice::from_ref(&standard), 1.0, z);
            assert!((tail / normal_cdf(z) - 1.0).abs() < 1e-14 + z * z * 3e-16, "{z}: {tail}");
            assert!(
                (slope / (libm::exp(-0.5 * z * z) / (2.0 * std::f64::consts::PI).sqrt()) - 1.0).abs() < 1e-13,
                "{z}"
            );
        }
    }

    #[test]
    fn standard_normal_numbers_become_draws_of_the_mixture() {
        // Correlated within and between kernels: moments of 20,000 points against those of the mixture.
        let factor = DMatrix::from_row_slice(2, 2, &[0.5, 0.0, 0.3, 0.2]);
        let means = vec![vec![0.0, 0.0], vec![2.0, 3.0], vec![4.0, -1.0]];
        let mixture = Mixture::new(vec![0.5, 0.3, 0.2], means.clone(), vec![factor.clone()], vec![0; 3]).unwrap();
        let stream = lanesweep_random::Stream { seed: 3, purpose: 1 };
        let n = 20_000;
        let normals = |index| {
            let mut draws = super::super::Draws::new(stream, index);
            [draws.normal(), draws.normal()]
        };
        let drawn: Vec<Vec<f64>> = (0..n).map(|index| mixture.from_standard_normal(&normals(index))).collect();
        let mean = |of: &dyn Fn(&Vec<f64>) -> f64| drawn.iter().map(of).sum::<f64>() / n as f64;
        let expected: f64 = [0.5, 0.3, 0.2].iter().zip(&means).map(|(w, m)| w * (m[0] * m[1] + 0.15)).sum();
        assert!((mean(&|x| x[0] * x[1]) - expected).abs() < 0.05, "{} beside {expected}", mean(&|x| x[0] * x[1]));
        assert!(
            (mean(&|x| f64::from(u8::from(x[0] > 3.0))) - 0.2 * normal_cdf(2.0) - 0.3 * normal_cdf(-2.0)).abs() < 0.01
        );
    }
}
