//! Densities that are Gaussian mixtures after a transformation of each parameter: x_j = T_j(z_j), z ~ Σ_k w_k N(μ_k, Σ_k).
//!
//! T_j is increasing and linear between knots, so that hosts and devices can evaluate it exactly, and so that the density
//! of x is that of z over the slopes. Estimators work in z, where f/g of any proposal g is the same as in x.
//!
//! | kind | T_j |
//! |---|---|
//! | mixture | the inverse of a logarithm towards a bound, of a logit between two bounds, or a straight line; then location and scale |
//! | copula | F_j⁻¹ ∘ G_j, with F_j the smoothed distribution of the recorded values and G_j the mixture's own margin |
//!
//! The second is a Gaussian-mixture copula (Tewari, Giering and Raghunathan, "Parametric characterization of multimodal
//! distributions with non-Gaussian modes", ICDM workshops 2011): its margins are exactly F_j. The mixture is fitted to the
//! normal scores Φ⁻¹(F_j(x_j)).

use nalgebra::DMatrix;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::bandwidth::{BandwidthRule, LeaveOneOut};
use super::mixture::Mixture;
use super::mixture_fit::FitOptions;
use super::moments::{scale_of, standard_deviation};
use super::normal::normal_cdf;
use crate::random::{KNOT_LIMIT, PIECES, Stream};
use crate::scenario::parameterization::Parameter;
use crate::{Error, Place, Result};

/// Form of a density.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum DensityKind {
    /// Gaussian kernels around the recorded scenarios, one bandwidth for all
    #[default]
    Kernel,
    /// Gaussian mixture; parameters with bounds by logarithm or logit
    Mixture,
    /// Gaussian-mixture copula with smoothed margins
    Copula,
}

impl DensityKind {
    /// All kinds.
    pub const ALL: [DensityKind; 3] = [DensityKind::Kernel, DensityKind::Mixture, DensityKind::Copula];

    /// Name in files and flags.
    pub fn key(self) -> &'static str {
        match self {
            DensityKind::Kernel => "kernel",
            DensityKind::Mixture => "mixture",
            DensityKind::Copula => "copula",
        }
    }
}

/// A bound is moved outwards by this fraction of the parameter's scale, because recorded values may lie on it.
const CLEARANCE: f64 = 0.01;
/// Minimum slope of a transformation, relative to the parameter's scale.
const MIN_SLOPE: f64 = 1e-9;
/// Tail probabilities below this tell no quantile.
const RESOLVED: f64 = 1e-13;
/// Maximum number of components.
const COMPONENTS: usize = 32;
/// Parts of the points of which each is held out once, to choose the number of components.
const FOLDS: usize = 5;

/// T: one increasing function per parameter, linear between knots.
#[derive(Debug, Clone, PartialEq)]
pub struct Transformation {
    /// Values at the knots, [`PIECES`] + 1 per parameter.
    knots: Vec<Vec<f64>>,
}

/// The z of a knot.
fn knot(at: usize) -> f64 {
    -KNOT_LIMIT + 2.0 * KNOT_LIMIT * at as f64 / PIECES as f64
}

impl Transformation {
    fn new(knots: Vec<Vec<f64>>) -> Result<Transformation> {
        let is_increasing = |of: &[f64]| of.windows(2).all(|pair| pair[0] < pair[1]);
        let is_finite = |of: &[f64]| of.iter().all(|value| value.is_finite() && value.abs() < 1e30);
        match knots.iter().position(|of| of.len() != PIECES + 1 || !is_finite(of) || !is_increasing(of)) {
            None => Ok(Transformation { knots }),
            Some(at) => Err(Error::input(
                Place::item(format!("transformation of parameter {}", at + 1)),
                format!("does not rise over {} finite knots", PIECES + 1),
                "fit it again",
            )),
        }
    }

    /// Knots of `value` at z, made strictly increasing.
    fn tabulated(scale: f64, value: impl Fn(f64) -> f64 + Sync) -> Vec<f64> {
        let mut values: Vec<f64> = (0..=PIECES).into_par_iter().map(|at| value(knot(at))).collect();
        for at in 1..values.len() {
            let least = values[at - 1] + MIN_SLOPE * scale.max(values[at - 1].abs());
            values[at] = values[at].max(least);
        }
        values
    }

    /// The piece of a z.
    fn piece(z: f64) -> usize {
        // A z that is not finite is in the first piece.
        (((z + KNOT_LIMIT) * PIECES as f64 / (2.0 * KNOT_LIMIT)).floor().max(0.0) as usize).min(PIECES - 1)
    }

    /// x = T(z).
    pub(crate) fn values(&self, z: &[f64]) -> Vec<f64> {
        let value = |(of, z): (&Vec<f64>, &f64)| {
            let at = Self::piece(*z);
            of[at] + (of[at + 1] - of[at]) * ((z - knot(at)) / (knot(at + 1) - knot(at)))
        };
        self.knots.iter().zip(z).map(value).collect()
    }

    /// z = T⁻¹(x).
    pub(crate) fn inverse(&self, values: &[f64]) -> Vec<f64> {
        let z = |(of, x): (&Vec<f64>, &f64)| {
            let at = of[1..PIECES].partition_point(|knot| knot <= x);
            knot(at) + (knot(at + 1) - knot(at)) * ((x - of[at]) / (of[at + 1] - of[at]))
        };
        self.knots.iter().zip(values).map(z).collect()
    }

    /// Σ_j ln dT_j/dz_j.
    pub(crate) fn log_slope(&self, z: &[f64]) -> f64 {
        let slope = |(of, z): (&Vec<f64>, &f64)| {
            let at = Self::piece(*z);
            libm::log((of[at + 1] - of[at]) / (knot(at + 1) - knot(at)))
        };
        self.knots.iter().zip(z).map(slope).sum()
    }

    /// The knots of all parameters, one parameter after the other.
    pub fn table(&self) -> impl Iterator<Item = f64> + '_ {
        self.knots.iter().flatten().copied()
    }
}

/// A fitted mixture and its transformation.
#[derive(Debug, Clone, PartialEq)]
pub struct TransformedMixture {
    /// [`DensityKind::Mixture`] or [`DensityKind::Copula`].
    pub kind: DensityKind,
    /// The density of z.
    pub mixture: Mixture,
    /// x = T(z).
    pub transformation: Transformation,
}

/// Its record in a density file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TransformedRecord {
    kind: DensityKind,
    weights: Vec<f64>,
    means: Vec<Vec<f64>>,
    /// Lower-triangular factors of the covariances, row by row, one per component.
    factors: Vec<Vec<f64>>,
    /// T at the knots, one row per parameter.
    knots: Vec<Vec<f64>>,
}

impl TransformedMixture {
    /// Fits to points of these parameters; the number of components is chosen by the likelihood of held-out fifths. `None`
    /// for [`DensityKind::Kernel`], which has no mixture.
    ///
    /// # Errors
    /// [`Error::Input`] for a parameter that is equal in all points, or on the wrong side of its bound.
    pub(crate) fn fit(
        kind: DensityKind,
        points: &[Vec<f64>],
        parameters: &[Parameter],
    ) -> Result<Option<TransformedMixture>> {
        if kind == DensityKind::Kernel {
            return Ok(None);
        }
        let column = |j: usize| points.iter().map(|point| point[j]).collect::<Vec<f64>>();
        let margins: Vec<Margin> =
            parameters.iter().enumerate().map(|(j, of)| Margin::of(column(j), of)).collect::<Result<_>>()?;
        let first = margins.iter().map(|margin| margin.knots(kind, normal_tails)).collect();
        let first = Transformation::new(first)?;
        let z: Vec<Vec<f64>> = points.iter().map(|point| first.inverse(point)).collect();
        let options = FitOptions { components: COMPONENTS, folds: FOLDS, iterations: 200, tolerance: 1e-5, seed: 0 };
        let mixture = Mixture::fit(&z, &vec![1.0; z.len()], &options)?;
        let transformation = match kind {
            DensityKind::Copula => {
                let of = |(j, margin): (usize, &Margin)| margin.knots(kind, |z| mixture.margin_tails(j, z));
                Transformation::new(margins.iter().enumerate().map(of).collect())?
            }
            _ => first,
        };
        Ok(Some(TransformedMixture { kind, mixture, transformation }))
    }

    /// Draw of an index, not checked for validity.
    pub(crate) fn draw(&self, stream: &Stream, index: u64) -> Vec<f64> {
        self.transformation.values(&self.mixture.draw(stream, index, 0))
    }

    /// ln of the density of x [1 / product of the units].
    pub(crate) fn log_density(&self, values: &[f64]) -> f64 {
        let z = self.transformation.inverse(values);
        self.mixture.log_density(&z) - self.transformation.log_slope(&z)
    }

    pub(super) fn record(&self) -> TransformedRecord {
        let components = 0..self.mixture.weights().len();
        TransformedRecord {
            kind: self.kind,
            weights: self.mixture.weights().to_vec(),
            means: components.clone().map(|k| self.mixture.mean(k).to_vec()).collect(),
            factors: components.map(|k| self.mixture.factor(k).transpose().as_slice().to_vec()).collect(),
            knots: self.transformation.knots.clone(),
        }
    }

    /// From its record, for `d` parameters.
    ///
    /// # Errors
    /// [`Error::Input`] or [`Error::Usage`] if lengths differ or a number is out of range.
    pub(super) fn from_record(record: TransformedRecord, d: usize) -> Result<TransformedMixture> {
        let wrong = |problem: &str| Err(Error::input(Place::item("density"), problem.to_owned(), "fit it again"));
        if record.kind == DensityKind::Kernel {
            return wrong("a mixture of kind kernel");
        }
        if record.knots.len() != d || record.factors.iter().any(|factor| factor.len() != d * d) {
            return wrong("a mixture of other parameters");
        }
        let n = record.factors.len();
        let factors = record.factors.iter().map(|factor| DMatrix::from_row_slice(d, d, factor)).collect();
        let mixture = Mixture::new(record.weights, record.means, factors, (0..n).collect())?;
        if mixture.dimensions() != d {
            return wrong("a mixture of other parameters");
        }
        Ok(TransformedMixture { kind: record.kind, mixture, transformation: Transformation::new(record.knots)? })
    }
}

/// P(Z ≤ z) and P(Z > z) of a standard normal Z.
fn normal_tails(z: f64) -> [f64; 2] {
    [normal_cdf(z), normal_cdf(-z)]
}

impl Mixture {
    /// P(Z_j ≤ z) and P(Z_j > z) of one parameter.
    fn margin_tails(&self, j: usize, z: f64) -> [f64; 2] {
        (0..self.weights().len()).fold([0.0; 2], |[low, high], k| {
            let spread = self.factor(k).row(j).norm();
            let of = normal_tails((z - self.mean(k)[j]) / spread);
            [low + self.weights()[k] * of[0], high + self.weights()[k] * of[1]]
        })
    }
}

/// A bound-free, standardized form of one parameter's recorded values.
struct Margin {
    bounds: [Option<f64>; 2],
    /// Scale of the parameter.
    unit: f64,
    /// Mean and standard deviation of the free values.
    mean: f64,
    deviation: f64,
    /// (free value − mean)/deviation, in rising order.
    sorted: Vec<f64>,
    /// Standard deviation of the smoothing.
    smoothing: f64,
}

impl Margin {
    fn of(values: Vec<f64>, parameter: &Parameter) -> Result<Margin> {
        let unit = scale_of(&values);
        let clear = |bound: Option<f64>, sign: f64| bound.map(|bound| bound + sign * CLEARANCE * unit);
        let bounds = [clear(parameter.lower, -1.0), clear(parameter.upper, 1.0)];
        let mut margin = Margin { bounds, unit, mean: 0.0, deviation: 1.0, sorted: Vec::new(), smoothing: 1.0 };
        let free: Vec<f64> = values.iter().map(|value| margin.free(*value)).collect();
        margin.mean = free.iter().sum::<f64>() / free.len() as f64;
        margin.deviation = standard_deviation(&free);
        if !(unit > 0.0 && margin.deviation.is_finite() && margin.deviation > 0.0) {
            return Err(Error::input(
                Place::item("density").column(parameter.name.clone()),
                "has no spread within its bounds, so it has no density",
                "use scenarios that differ in it, or a parameterization without it",
            ));
        }
        margin.sorted = free.iter().map(|value| (value - margin.mean) / margin.deviation).collect();
        margin.sorted.sort_by(f64::total_cmp);
        let scale = scale_of(&margin.sorted);
        let scaled: Vec<Vec<f64>> = margin.sorted.iter().map(|value| vec![value / scale]).collect();
        margin.smoothing = scale * LeaveOneOut::new(&scaled).search(BandwidthRule::Reduction).value;
        Ok(margin)
    }

    /// Without bounds.
    fn free(&self, value: f64) -> f64 {
        match self.bounds {
            [None, None] => value / self.unit,
            [Some(lower), None] => libm::log((value - lower) / self.unit),
            [None, Some(upper)] => -libm::log((upper - value) / self.unit),
            [Some(lower), Some(upper)] => libm::log((value - lower) / (upper - value)),
        }
    }

    /// The value of a standardized free value.
    fn value(&self, standard: f64) -> f64 {
        let free = self.mean + self.deviation * standard;
        match self.bounds {
            [None, None] => free * self.unit,
            [Some(lower), None] => lower + self.unit * libm::exp(free.min(60.0)),
            [None, Some(upper)] => upper - self.unit * libm::exp((-free).min(60.0)),
            [Some(lower), Some(upper)] => lower + (upper - lower) / (1.0 + libm::exp(-free)),
        }
    }

    /// T at the knots, where z has these tail probabilities.
    fn knots(&self, kind: DensityKind, tails: impl Fn(f64) -> [f64; 2] + Sync) -> Vec<f64> {
        // Further out, the probabilities tell no quantile: the outermost slopes go on.
        let is_resolved = |at: &usize| tails(knot(*at)).into_iter().all(|tail| tail > RESOLVED);
        let resolved: Vec<usize> = (0..=PIECES).filter(is_resolved).collect();
        let (DensityKind::Copula, Some(first), Some(last)) = (kind, resolved.first(), resolved.last()) else {
            return Transformation::tabulated(self.unit, |z| self.value(z));
        };
        let quantile = |at: usize| self.smoothed_quantile(tails(knot(at)));
        let slope = |a: usize, b: usize| (quantile(b) - quantile(a)) / (knot(b) - knot(a)).max(f64::MIN_POSITIVE);
        let inner = (last - first).min(4);
        let ([first, last], slopes) = ([*first, *last], [slope(*first, first + inner), slope(last - inner, *last)]);
        let ends = [quantile(first), quantile(last)];
        Transformation::tabulated(self.unit, |z| {
            let standard = match z {
                _ if z < knot(first) => ends[0] + slopes[0] * (z - knot(first)),
                _ if z > knot(last) => ends[1] + slopes[1] * (z - knot(last)),
                _ => self.smoothed_quantile(tails(z)),
            };
            self.value(standard)
        })
    }

    /// The quantile of the smoothed distribution; `tails` are the probabilities below and above it.
    fn smoothed_quantile(&self, [below, above]: [f64; 2]) -> f64 {
        let is_low = below < above;
        let reach = 9.0 * self.smoothing;
        let (mut low, mut high) =
            ((self.sorted[0] - reach).min(-9.0), (self.sorted[self.sorted.len() - 1] + reach).max(9.0));
        for _ in 0..50 {
            let middle = 0.5 * (low + high);
            let is_too_high = if is_low { self.tail(middle, 1.0) > below } else { self.tail(middle, -1.0) < above };
            if is_too_high { high = middle } else { low = middle }
        }
        0.5 * (low + high)
    }

    /// Probability below (`side` = 1) or above (−1) in the smoothed distribution. One more normal distribution, with the
    /// spread of all values and the weight of one of them, keeps values beyond the recorded ones possible.
    fn tail(&self, at: f64, side: f64) -> f64 {
        let reach = 9.0 * self.smoothing;
        let from = self.sorted.partition_point(|value| *value < at - reach);
        let until = self.sorted.partition_point(|value| *value <= at + reach);
        let certain = if side > 0.0 { from } else { self.sorted.len() - until };
        let near = self.sorted[from..until].iter().map(|value| normal_cdf(side * (at - value) / self.smoothing));
        (certain as f64 + near.sum::<f64>() + normal_cdf(side * at)) / (self.sorted.len() + 1) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parameter(lower: Option<f64>, upper: Option<f64>) -> Parameter {
        Parameter { name: "v".to_owned(), unit: "m/s".to_owned(), lower, lower_excluded: false, upper }
    }

    /// Two groups, one of them near a bound.
    fn points() -> (Vec<Vec<f64>>, Vec<Parameter>) {
        let stream = Stream { seed: 5, purpose: 1 };
        let normal = Mixture::of_kernels(vec![vec![0.0; 3]], &[1.0; 3]).unwrap();
        let point = |i: u64| {
            let z = normal.draw(&stream, i, 0);
            match i % 3 {
                0 => vec![20.0 + 2.0 * z[0] + z[1], libm::exp(0.8 * z[1]), 1.0 / (1.0 + libm::exp(-z[2] - 0.5 * z[0]))],
                _ => vec![35.0 + z[0], libm::exp(1.5 + 0.2 * z[1] - 0.1 * z[0]), 1.0 / (1.0 + libm::exp(2.0 - z[2]))],
            }
        };
        let bounds = [parameter(None, None), parameter(Some(0.0), None), parameter(Some(0.0), Some(1.0))];
        ((0..900).map(point).collect(), bounds.to_vec())
    }

    fn fitted(kind: DensityKind) -> TransformedMixture {
        let (points, parameters) = points();
        TransformedMixture::fit(kind, &points, &parameters).unwrap().unwrap()
    }

    #[test]
    fn a_transformation_and_its_inverse_cancel_also_beyond_the_knots() {
        for kind in [DensityKind::Mixture, DensityKind::Copula] {
            let transformation = fitted(kind).transformation;
            for z in [-11.0, -8.0, -3.33, 0.0, 0.1, 2.5, 7.99, 9.5] {
                let back = transformation.inverse(&transformation.values(&[z; 3]));
                assert!(back.iter().all(|found| (found - z).abs() < 1e-5), "{kind:?} {z}: {back:?}");
            }
        }
    }

    #[test]
    fn the_density_of_the_values_integrates_to_one() {
        for kind in [DensityKind::Mixture, DensityKind::Copula] {
            let fitted = fitted(kind);
            // Importance sampling over a box that holds nearly everything.
            let (from, to) = ([5.0, -0.05, -0.05], [45.0, 12.0, 1.05]);
            let volume: f64 = from.iter().zip(&to).map(|(from, to)| to - from).product();
            let (mut sum, n) = (0.0, 200_000);
            for i in 0..n {
                let words = Stream { seed: 3, purpose: 2 }.words(i, 0);
                let at = |j: usize| from[j] + (to[j] - from[j]) * (f64::from(words[j]) + 0.5) / 4_294_967_296.0;
                sum += libm::exp(fitted.log_density(&[at(0), at(1), at(2)]));
            }
            let total = sum * volume / n as f64;
            assert!((total - 1.0).abs() < 0.05, "{kind:?}: {total}");
        }
    }

    #[test]
    fn draws_keep_bounds_and_the_margins_of_a_copula_are_those_of_the_data() {
        let (points, _) = points();
        let stream = Stream { seed: 8, purpose: 3 };
        for kind in [DensityKind::Mixture, DensityKind::Copula] {
            let fitted = fitted(kind);
            let draws: Vec<Vec<f64>> = (0..20_000).map(|i| fitted.draw(&stream, i)).collect();
            assert!(draws.iter().all(|x| x[1] > -0.05 && x[2] > -0.05 && x[2] < 1.05), "{kind:?}");
            for j in 0..3 {
                // The largest distance between the distribution functions.
                let below =
                    |set: &[Vec<f64>], x: f64| set.iter().filter(|p| p[j] <= x).count() as f64 / set.len() as f64;
                let off = points.iter().step_by(20).map(|p| (below(&points, p[j]) - below(&draws, p[j])).abs());
                let off = off.fold(0.0, f64::max);
                let limit = if kind == DensityKind::Copula { 0.05 } else { 0.1 };
                assert!(off < limit, "{kind:?}, parameter {j}: {off}");
            }
        }
    }

    #[test]
    fn a_record_gives_the_same_density_and_a_broken_one_an_error() {
        let fitted = fitted(DensityKind::Copula);
        let read = TransformedMixture::from_record(fitted.record(), 3).unwrap();
        let at = [22.0, 1.5, 0.4];
        assert_eq!(read.log_density(&at).to_bits(), fitted.log_density(&at).to_bits());
        assert!(TransformedMixture::from_record(fitted.record(), 2).is_err());
        let falling = TransformedRecord { knots: vec![vec![0.0; PIECES + 1]; 3], ..fitted.record() };
        assert!(TransformedMixture::from_record(falling, 3).is_err());
    }
}
