//! Input of an estimator: a density that draws points, and a limit state that evaluates them.
//!
//! Points are processed in bulk: drawn in parallel, evaluated in one batch.

use std::ops::Range;

use rayon::prelude::*;

use crate::stats::density::Mixture;
use crate::stats::density::normal::normal;
use crate::stats::random::Stream;
use crate::{Error, Place, Result};

/// Maximum number of attempts at a valid point; after these the index is void. With a valid fraction of one half, one
/// index in 2⁶⁴ is void; with 5 %, one in 27.
pub const ATTEMPTS: u32 = 64;

/// Purposes of the estimators' random words; no two estimators use the same draws.
pub(crate) mod purpose {
    /// Draws of the density itself: crude Monte Carlo, pilots, the first level of subset simulation.
    pub const NOMINAL: u32 = 0x4553_0001;
    /// The choice between the parts of a proposal: added to the purpose of its draws.
    pub const CHOICE: u32 = 0x1000_0000;
    /// Final draws of a proposal.
    pub const PROPOSAL: u32 = 0x4553_0002;
    /// Draws of a level of cross-entropy: the level is added.
    pub const CROSS_ENTROPY: u32 = 0x4553_1000;
    /// Moves of Markov chains: the level is added.
    pub const CHAIN: u32 = 0x4553_2000;
    /// Draws of one of several techniques: its number is added.
    pub const TECHNIQUE: u32 = 0x4553_3000;
    /// Draws that determine which kernels failures come from.
    pub const SHARES: u32 = 0x4553_0004;
    /// The estimate of a valid fraction.
    pub const VALIDITY: u32 = 0x4553_0003;
}

/// A valid point and the number of attempts.
#[derive(Debug, Clone, PartialEq)]
pub struct Draw {
    /// The point, one number per parameter, each in its own unit.
    pub point: Vec<f64>,
    /// Attempts used, the valid one included, 1 … [`ATTEMPTS`].
    pub tries: u32,
}

/// A density over parameters that may be truncated to a valid region (for example without negative speeds). The density
/// of the draws is then f / P_valid inside and 0 outside.
pub trait Density: Sync {
    /// Number of parameters.
    fn dimensions(&self) -> usize;

    /// ln of f, **not** divided by P_valid [1 / product of the units]; −∞ at invalid points.
    fn log_density(&self, point: &[f64]) -> f64;

    /// One attempt at the point of an index: a draw of f before truncation. A pure function of its arguments.
    fn attempt(&self, stream: &Stream, index: u64, attempt: u32) -> Vec<f64>;

    /// Whether a point is inside the valid region.
    fn is_valid(&self, _point: &[f64]) -> bool {
        true
    }

    /// P_valid = ∫ f over the valid points, in (0, 1].
    fn validity_fraction(&self) -> f64 {
        1.0
    }

    /// Whether f is the standard normal density, for which chains have better moves.
    fn is_standard_normal(&self) -> bool {
        false
    }

    /// The point of an index, or `None` for a void index: [`ATTEMPTS`] attempts gave no valid point.
    fn draw(&self, stream: &Stream, index: u64) -> Option<Draw> {
        (0..ATTEMPTS).find_map(|attempt| {
            let point = self.attempt(stream, index, attempt);
            self.is_valid(&point).then_some(Draw { point, tries: attempt + 1 })
        })
    }
}

impl Density for Mixture {
    fn dimensions(&self) -> usize {
        Mixture::dimensions(self)
    }

    fn log_density(&self, point: &[f64]) -> f64 {
        Mixture::log_density(self, point)
    }

    fn attempt(&self, stream: &Stream, index: u64, attempt: u32) -> Vec<f64> {
        Mixture::draw(self, stream, index, attempt)
    }
}

/// Independent standard normal parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StandardNormal {
    /// Number of parameters.
    pub dimensions: usize,
}

impl Density for StandardNormal {
    fn dimensions(&self) -> usize {
        self.dimensions
    }

    fn log_density(&self, point: &[f64]) -> f64 {
        let square: f64 = point.iter().map(|x| x * x).sum();
        -0.5 * (square + self.dimensions as f64 * libm::log(2.0 * std::f64::consts::PI))
    }

    fn attempt(&self, stream: &Stream, index: u64, attempt: u32) -> Vec<f64> {
        normals(stream, index, attempt.wrapping_mul(self.dimensions.div_ceil(4) as u32), self.dimensions)
    }

    fn is_standard_normal(&self) -> bool {
        true
    }
}

/// Standard normal numbers of an index, starting at a block.
pub(crate) fn normals(stream: &Stream, index: u64, first_block: u32, count: usize) -> Vec<f64> {
    let blocks = 0..count.div_ceil(4) as u32;
    blocks.flat_map(|b| stream.words(index, first_block + b)).take(count).map(normal).collect()
}

/// A mixture truncated by a validity rule.
pub struct Truncated<V> {
    mixture: Mixture,
    is_valid: V,
    validity: f64,
}

impl<V: Fn(&[f64]) -> bool + Sync> Truncated<V> {
    /// Truncates the mixture and estimates P_valid from `draws` draws. No interval includes its relative error √((1 −
    /// P_valid) / (P_valid · draws)): choose `draws` so that it is negligible.
    ///
    /// # Errors
    /// [`Error::Usage`] if no draw is valid.
    pub fn new(mixture: Mixture, is_valid: V, seed: u64, draws: u64) -> Result<Self> {
        let stream = Stream { seed, purpose: purpose::VALIDITY };
        let valid =
            (0..draws).into_par_iter().filter(|index| is_valid(&mixture.draw(&stream, *index, 0))).count() as u64;
        Self::with_validity(mixture, is_valid, valid as f64 / draws as f64)
    }

    /// Truncates the mixture with a known P_valid.
    ///
    /// # Errors
    /// [`Error::Usage`] if the fraction is not in (0, 1].
    pub fn with_validity(mixture: Mixture, is_valid: V, validity: f64) -> Result<Self> {
        if validity > 0.0 && validity <= 1.0 {
            return Ok(Truncated { mixture, is_valid, validity });
        }
        Err(Error::usage(
            Place::item("truncated density"),
            format!("the share of valid draws is {validity}"),
            "check the bounds of the parameters: they must leave something of the density",
        ))
    }

    /// The mixture before truncation.
    pub fn mixture(&self) -> &Mixture {
        &self.mixture
    }
}

impl<V: Fn(&[f64]) -> bool + Sync> Density for Truncated<V> {
    fn dimensions(&self) -> usize {
        self.mixture.dimensions()
    }

    fn log_density(&self, point: &[f64]) -> f64 {
        if (self.is_valid)(point) { self.mixture.log_density(point) } else { f64::NEG_INFINITY }
    }

    fn attempt(&self, stream: &Stream, index: u64, attempt: u32) -> Vec<f64> {
        self.mixture.draw(stream, index, attempt)
    }

    fn is_valid(&self, point: &[f64]) -> bool {
        (self.is_valid)(point)
    }

    fn validity_fraction(&self) -> f64 {
        self.validity
    }
}

/// Decides whether a point fails.
pub trait LimitState: Sync {
    /// One value per point, in order: ≤ 0 fails. Continuous at the limit if possible: cross-entropy and subset
    /// simulation follow the values down to 0; the other estimators use only the sign. +∞ may stand for "far from any
    /// failure".
    ///
    /// # Errors
    /// Any error that prevents the evaluation.
    fn evaluate(&self, points: &[Vec<f64>]) -> Result<Vec<f64>>;
}

impl<F: Fn(&[Vec<f64>]) -> Result<Vec<f64>> + Sync> LimitState for F {
    fn evaluate(&self, points: &[Vec<f64>]) -> Result<Vec<f64>> {
        self(points)
    }
}

/// The values of a batch, checked: one per point, none of them NaN.
pub(crate) fn evaluate_checked(limit_state: &dyn LimitState, points: &[Vec<f64>]) -> Result<Vec<f64>> {
    if points.is_empty() {
        return Ok(Vec::new());
    }
    let values = limit_state.evaluate(points)?;
    if values.len() != points.len() {
        return Err(Error::Internal(format!("{} points were given {} values", points.len(), values.len())));
    }
    match values.iter().position(|v| v.is_nan()) {
        Some(at) => Err(Error::Internal(format!("the limit state of {:?} is not a number", points[at]))),
        None => Ok(values),
    }
}

/// Maximum number of points drawn and evaluated at a time: bounds the memory of any sample.
pub(crate) const BATCH: u64 = 1 << 16;

/// The draws of a range of indices, in order.
pub(crate) fn draw(density: &dyn Density, stream: Stream, indices: Range<u64>) -> Vec<Option<Draw>> {
    indices.into_par_iter().map(|index| density.draw(&stream, index)).collect()
}

/// Valid points of a range of indices with their values, in index order, and the tries of all.
pub(crate) struct Evaluated {
    pub points: Vec<Vec<f64>>,
    pub values: Vec<f64>,
    pub voids: u64,
}

/// Draws and evaluates a range of indices of any length, keeping the points.
pub(crate) fn evaluated(
    density: &dyn Density,
    limit_state: &dyn LimitState,
    stream: Stream,
    indices: Range<u64>,
) -> Result<Evaluated> {
    let draws = draw(density, stream, indices.clone());
    let points: Vec<Vec<f64>> = draws.into_iter().flatten().map(|d| d.point).collect();
    let mut values = Vec::with_capacity(points.len());
    for batch in points.chunks(BATCH as usize) {
        values.extend(evaluate_checked(limit_state, batch)?);
    }
    let voids = indices.end - indices.start - points.len() as u64;
    Ok(Evaluated { points, values, voids })
}

/// Splits a range into batches.
pub(crate) fn batches(indices: Range<u64>) -> impl Iterator<Item = Range<u64>> {
    let mut at = indices.start;
    std::iter::from_fn(move || {
        let from = at;
        // Batches end at multiples of their size, so that sums over blocks join at once.
        at = (at / BATCH + 1).saturating_mul(BATCH).min(indices.end);
        (from < indices.end).then_some(from..at)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_truncated_density_draws_inside_only_and_knows_its_share() {
        let mixture = Mixture::of_kernels(vec![vec![0.0, 0.0]], &[1.0, 1.0]).unwrap();
        let half = Truncated::new(mixture, |x: &[f64]| x[0] > 0.0, 1, 100_000).unwrap();
        assert!((half.validity_fraction() - 0.5).abs() < 0.01);
        let stream = Stream { seed: 2, purpose: 3 };
        let draws: Vec<Draw> = (0..10_000).filter_map(|i| half.draw(&stream, i)).collect();
        assert!(draws.iter().all(|d| d.point[0] > 0.0));
        let tries: u32 = draws.iter().map(|d| d.tries).sum();
        assert!((f64::from(tries) / 10_000.0 - 2.0).abs() < 0.1);
        assert_eq!(half.log_density(&[-1.0, 0.0]), f64::NEG_INFINITY);
    }

    #[test]
    fn an_index_without_a_valid_point_is_void() {
        let mixture = Mixture::of_kernels(vec![vec![0.0]], &[1.0]).unwrap();
        let never = Truncated::with_validity(mixture.clone(), |_: &[f64]| false, 0.5).unwrap();
        assert!(never.draw(&Stream { seed: 2, purpose: 3 }, 0).is_none());
        assert!(Truncated::new(mixture, |_: &[f64]| false, 1, 100).is_err());
    }
}
