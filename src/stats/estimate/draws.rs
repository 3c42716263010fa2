//! Points in bulk: drawn in parallel, judged in one batch.

use std::ops::Range;

use rayon::prelude::*;

use super::problem::{Density, Draw, LimitState, evaluate_checked};
use crate::Result;
use crate::stats::random::Stream;

/// Maximum number of points drawn and judged at a time: bounds the memory of any sample.
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

/// Draws and judges a range of indices, however long, keeping the points.
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

/// A range in batches.
pub(crate) fn batches(indices: Range<u64>) -> impl Iterator<Item = Range<u64>> {
    let mut at = indices.start;
    std::iter::from_fn(move || {
        let from = at;
        // Batches end at multiples of their size, so that sums over blocks join at once.
        at = (at / BATCH + 1).saturating_mul(BATCH).min(indices.end);
        (from < indices.end).then_some(from..at)
    })
}
