//! Input of an estimator: a density that draws points, and a limit state that evaluates them.
//!
//! Points are processed in bulk: drawn in parallel, evaluated in one batch.

use std::ops::Range;

use rayon::prelude::*;

use crate::density::Mixture;
use lanesweep_random::Stream;
use lanesweep_support::{Error, Place, Result};

/// Maximum number of attempts at a valid point; after these the index is void. With a valid fraction of one half, one
/// index in 2⁶⁴ is void; with 5 %, one in 27.
pub const ATTEMPTS: u32 = 64;

/// Purposes of the estimators' random words; no two estimators use the same draws.
pub(crate) mod purpose {
    /// Draws of the density itself.
    pub(crate) const NOMINAL: u32 = 0x4553_0001;
    /// Final draws of a proposal.
    pub(crate) const PROPOSAL: u32 = 0x4553_0002;
    /// Draws of the density beside these.
    pub(crate) const BESIDE_PROPOSAL: u32 = 0x4553_0005;
    /// Draws of a search: 64 times the round and the number of the mixture within the round are added.
    pub(crate) const SEARCH: u32 = 0x4553_4000;
    /// Draws that determine which kernels failures come from.
    pub(crate) const SHARES: u32 = 0x4553_0004;
    /// Draws of the density beside these.
    pub(crate) const BESIDE_SHARES: u32 = 0x4553_0006;
}

/// A density over parameters that may be truncated to a valid region (for example without negative speeds). The density
/// of the draws is then f / P_valid inside and 0 outside.
pub trait Density: Sync {
    /// ln of f at each point, **not** divided by P_valid [1 / product of the units]; −∞ at invalid points.
    fn log_densities(&self, points: &[&[f64]]) -> Vec<f64>;

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

    /// f as a mixture of Gaussians: a search then knows the scales of its kernels.
    fn mixture(&self) -> Mixture;

    /// The point of an index, or `None` for a void index: [`ATTEMPTS`] attempts gave no valid point.
    fn draw(&self, stream: &Stream, index: u64) -> Option<Vec<f64>> {
        (0..ATTEMPTS).map(|attempt| self.attempt(stream, index, attempt)).find(|point| self.is_valid(point))
    }
}

impl Density for Mixture {
    fn log_densities(&self, points: &[&[f64]]) -> Vec<f64> {
        Mixture::log_densities(self, points)
    }

    fn attempt(&self, stream: &Stream, index: u64, attempt: u32) -> Vec<f64> {
        Mixture::draw(self, stream, index, attempt)
    }

    fn mixture(&self) -> Mixture {
        self.clone()
    }
}

/// A mixture truncated by a validity rule.
pub struct Truncated<V> {
    mixture: Mixture,
    is_valid: V,
    validity: f64,
}

impl<V: Fn(&[f64]) -> bool + Sync> Truncated<V> {
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
    pub fn kernels(&self) -> &Mixture {
        &self.mixture
    }
}

impl<V: Fn(&[f64]) -> bool + Sync> Density for Truncated<V> {
    fn log_densities(&self, points: &[&[f64]]) -> Vec<f64> {
        let logs = points.iter().zip(self.mixture.log_densities(points));
        logs.map(|(point, log)| if (self.is_valid)(point) { log } else { f64::NEG_INFINITY }).collect()
    }

    fn attempt(&self, stream: &Stream, index: u64, attempt: u32) -> Vec<f64> {
        self.mixture.draw(stream, index, attempt)
    }

    fn mixture(&self) -> Mixture {
        self.mixture.clone()
    }

    fn is_valid(&self, point: &[f64]) -> bool {
        (self.is_valid)(point)
    }

    fn validity_fraction(&self) -> f64 {
        self.validity
    }
}

/// Decides whether a point fails, under one question or several.
pub trait LimitState: Sync {
    /// Number of questions, ≥ 1.
    fn questions(&self) -> usize {
        1
    }

    /// Number of guides of each question, ≥ 1.
    fn guides(&self) -> usize {
        1
    }

    /// One value per point, question and guide, in this order, the guide innermost. Guide 0 decides: ≤ 0 fails. The
    /// others are ≤ 0 exactly where it is, and only tell a search what is near to failure. They are continuous at the
    /// limit if possible. +∞ may stand for "far from any failure".
    ///
    /// # Errors
    /// Any error that prevents the evaluation.
    fn evaluate(&self, points: &[Vec<f64>]) -> Result<Vec<f64>>;

    /// The draws of the density with these indices that fail any question, in order. An implementation may draw where it
    /// evaluates, but as a pure function of stream and index.
    ///
    /// # Errors
    /// Those of the evaluation.
    fn failures(&self, density: &dyn Density, stream: Stream, indices: Range<u64>) -> Result<Vec<Failure>> {
        let mut failures = Vec::new();
        for batch in batches(indices) {
            let draw = |index| Some((index, density.draw(&stream, index)?));
            let drawn: Vec<Option<(u64, Vec<f64>)>> = batch.into_par_iter().map(draw).collect();
            let (indices, points) = drawn.into_iter().flatten().unzip();
            failures.extend(failing(self, indices, points)?);
        }
        Ok(failures)
    }
}

/// A draw of the density that fails at least one question.
#[derive(Debug, Clone, PartialEq)]
pub struct Failure {
    /// Index of the draw.
    pub index: u64,
    /// Its point.
    pub point: Vec<f64>,
    /// Question by question, whether it fails.
    pub fails: Vec<bool>,
}

impl<F: Fn(&[Vec<f64>]) -> Result<Vec<f64>> + Sync> LimitState for F {
    fn evaluate(&self, points: &[Vec<f64>]) -> Result<Vec<f64>> {
        self(points)
    }
}

/// The values of a batch, checked: all are there, none of them NaN.
pub(crate) fn evaluate_checked<L: LimitState + ?Sized>(limit_state: &L, points: &[Vec<f64>]) -> Result<Vec<f64>> {
    if points.is_empty() {
        return Ok(Vec::new());
    }
    let values = limit_state.evaluate(points)?;
    let per_point = limit_state.questions() * limit_state.guides();
    if values.len() != points.len() * per_point {
        return Err(Error::Internal(format!("{} points were given {} values", points.len(), values.len())));
    }
    match values.iter().position(|v| v.is_nan()) {
        Some(at) => Err(Error::Internal(format!("the limit state of {:?} is not a number", points[at / per_point]))),
        None => Ok(values),
    }
}

/// The points that fail any question, with their indices.
pub(super) fn failing<L: LimitState + ?Sized>(
    limit_state: &L,
    indices: Vec<u64>,
    points: Vec<Vec<f64>>,
) -> Result<Vec<Failure>> {
    let values = evaluate_checked(limit_state, &points)?;
    let (questions, guides) = (limit_state.questions(), limit_state.guides());
    let fails = |values: &[f64]| values.iter().step_by(guides).map(|value| *value <= 0.0).collect::<Vec<bool>>();
    let all = indices.into_iter().zip(points).zip(values.chunks(questions * guides));
    let failures = all.map(|((index, point), values)| Failure { index, point, fails: fails(values) });
    Ok(failures.filter(|failure| failure.fails.contains(&true)).collect())
}

/// Points whose densities one task computes.
pub(super) const AT_ONCE: usize = 64;

/// Maximum number of points drawn and evaluated at a time: bounds the memory of any sample.
pub(crate) const BATCH: u64 = 1 << 16;

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
        let half = Truncated::with_validity(mixture, |x: &[f64]| x[0] > 0.0, 0.5).unwrap();
        let stream = Stream { seed: 2, purpose: 3 };
        let draws: Vec<Vec<f64>> = (0..10_000).filter_map(|i| half.draw(&stream, i)).collect();
        assert!(draws.iter().all(|point| point[0] > 0.0));
        assert_eq!(half.log_densities(&[&[-1.0, 0.0]]), [f64::NEG_INFINITY]);
    }

    #[test]
    fn an_index_without_a_valid_point_is_void() {
        let mixture = Mixture::of_kernels(vec![vec![0.0]], &[1.0]).unwrap();
        let never = Truncated::with_validity(mixture, |_: &[f64]| false, 0.5).unwrap();
        assert!(never.draw(&Stream { seed: 2, purpose: 3 }, 0).is_none());
    }
}
