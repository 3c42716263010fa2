//! Densities of a mixture at several points at once. A search spends most of its time here.
//!
//! The sums of a point run over the components in their order, whatever the points beside it and the vectors of the
//! processor, so a point has the same bits alone, among others and on every machine.

use super::Mixture;
use super::bandwidth::exp_minus;
use super::mixture::MAX_DIMENSIONS;

/// Numbers that one vector loop handles.
pub(super) const LANES: usize = 8;

/// z = L⁻¹ x of N points. `inverse` holds the rows of L⁻¹ up to the diagonal, one after the other.
#[inline(always)]
fn whiten<const N: usize>(inverse: &[f64], x: &[[f64; N]], z: &mut [[f64; N]]) {
    let mut start = 0;
    for (i, z) in z.iter_mut().enumerate() {
        *z = [0.0; N];
        for (l, x) in inverse[start..=start + i].iter().zip(x) {
            for lane in 0..N {
                z[lane] += l * x[lane];
            }
        }
        start += i + 1;
    }
}

/// L⁻¹ x of one point.
pub(super) fn whitened(inverse: &[f64], point: &[f64]) -> Vec<f64> {
    let x: Vec<[f64; 1]> = point.iter().map(|x| [*x]).collect();
    let mut z = vec![[0.0]; point.len()];
    whiten(inverse, &x, &mut z);
    z.concat()
}

/// The density of each component at some points.
struct Parts {
    /// Component by component, relative to the largest of a point.
    parts: Vec<[f64; LANES]>,
    /// Their sum over the components.
    sums: [f64; LANES],
    /// ln of the largest.
    tops: [f64; LANES],
}

impl Parts {
    fn new(components: usize) -> Self {
        Parts { parts: vec![[0.0; LANES]; components], sums: [0.0; LANES], tops: [0.0; LANES] }
    }

    /// The fraction of each component in the density of a point.
    fn fractions(&self, lane: usize) -> Vec<f64> {
        self.parts.iter().map(|part| part[lane] / self.sums[lane]).collect()
    }

    /// ln of the density of a point; −∞ where a coordinate is not finite, because its parts are −∞ or NaN.
    fn log_density(&self, lane: usize) -> f64 {
        self.tops[lane] + libm::log(self.sums[lane])
    }
}

/// The evaluation of points that are given parameter by parameter. A type, because closures are not inlined into what is
/// compiled for wider vectors.
struct Evaluate<'a> {
    mixture: &'a Mixture,
    x: &'a [[f64; LANES]],
    of: &'a mut Parts,
}

impl pulp::NullaryFnOnce for Evaluate<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Evaluate { mixture, x, of } = self;
        let d = x.len();
        let mut z = [[0.0; LANES]; MAX_DIMENSIONS];
        let z = &mut z[..d];
        // Local arrays stay in registers.
        let mut tops = [f64::NEG_INFINITY; LANES];
        for run in &mixture.runs {
            whiten(&mixture.inverses[mixture.factor_of[run.start]], x, z);
            let means = mixture.whitened_means[run.start * d..run.end * d].chunks_exact(d);
            let own = of.parts[run.clone()].iter_mut().zip(means).zip(&mixture.log_heights[run.clone()]);
            for ((part, mean), height) in own {
                let mut distances = [0.0; LANES];
                for (z, mean) in z.iter().zip(mean) {
                    for lane in 0..LANES {
                        let away = z[lane] - mean;
                        distances[lane] += away * away;
                    }
                }
                let mut logs = [0.0; LANES];
                for lane in 0..LANES {
                    logs[lane] = height - 0.5 * distances[lane];
                    tops[lane] = if logs[lane] > tops[lane] { logs[lane] } else { tops[lane] };
                }
                *part = logs;
            }
        }
        let mut sums = [0.0; LANES];
        for part in &mut of.parts {
            let mut relative = *part;
            for lane in 0..LANES {
                relative[lane] = exp_minus(tops[lane] - relative[lane]);
                sums[lane] += relative[lane];
            }
            *part = relative;
        }
        (of.tops, of.sums) = (tops, sums);
    }
}

impl Mixture {
    /// ln of the density at a point, as [`Mixture::log_densities`].
    pub fn log_density(&self, point: &[f64]) -> f64 {
        self.log_densities(&[point])[0]
    }

    /// ln of the density at each point [1 / product of the units]; −∞ where a coordinate is not finite.
    ///
    /// # Panics
    /// If a point has another length than the mixture has parameters.
    pub fn log_densities(&self, points: &[&[f64]]) -> Vec<f64> {
        self.per_point(points, |of, lane| of.log_density(lane))
    }

    /// The fraction of each component in the density at each finite point, sum 1.
    pub fn responsibilities(&self, points: &[&[f64]]) -> Vec<Vec<f64>> {
        self.per_point(points, Parts::fractions)
    }

    /// [`Mixture::responsibilities`] and [`Mixture::log_densities`] of each point.
    pub(super) fn responsibilities_and_log_densities(&self, points: &[&[f64]]) -> Vec<(Vec<f64>, f64)> {
        self.per_point(points, |of, lane| (of.fractions(lane), of.log_density(lane)))
    }

    /// One result per point. Unused lanes of the last [`Parts`] repeat the last point.
    fn per_point<R>(&self, points: &[&[f64]], result: impl Fn(&Parts, usize) -> R) -> Vec<R> {
        let mut of = Parts::new(self.weights().len());
        let mut x = vec![[0.0; LANES]; self.dimensions()];
        let mut results = Vec::with_capacity(points.len());
        for points in points.chunks(LANES) {
            for lane in 0..LANES {
                let point = points[lane.min(points.len() - 1)];
                assert_eq!(point.len(), x.len(), "a number for every parameter");
                x.iter_mut().zip(point).for_each(|(x, value)| x[lane] = *value);
            }
            pulp::Arch::new().dispatch(Evaluate { mixture: self, x: &x, of: &mut of });
            results.extend((0..points.len()).map(|lane| result(&of, lane)));
        }
        results
    }
}
