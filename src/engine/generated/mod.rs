//! Cases generated where their lanes run: sample index → point → case, a pure function of seed and index. The CPU
//! generates them here, a device in `shaders/generate.wgsl`, with the same bits.
//!
//! Points are binary32 everywhere, in every lane arithmetic. Only exact division, no root, no transcendental function:
//! the sinusoid is a polynomial, the normal deviates come from a table.

mod decode;
mod points;
mod recipe;

pub use points::{ATTEMPTS, DrawnPoint, MAX_PARAMETERS, PointSource, Points};
pub use recipe::{CasePath, ColumnBound, LateralPath, MAX_BOUNDS, NO_SLOT, Recipe, ReducedColumns};

use crate::model::scalar::Real;
use crate::scenario::Tables;

use super::lane_case::LaneCase;

/// A case generator: where points come from and what they mean.
#[derive(Debug, Clone, PartialEq)]
pub struct Generator {
    /// Sample index → point.
    pub points: Points,
    /// Point → case.
    pub recipe: Recipe,
    /// The basis of a reduction: mean, then every direction, each column divided by its weight; else empty.
    pub basis: Vec<f32>,
}

impl Generator {
    /// The point of a sample index.
    #[inline]
    pub fn draw(&self, index: u64) -> DrawnPoint {
        self.points.draw(index, |point| decode::is_valid(&self.recipe, &self.basis, point))
    }

    /// The case of a sample index; its series are appended to `tables`.
    pub fn case<R: Real>(&self, index: u64, tables: &mut Tables<R>) -> LaneCase<R> {
        let drawn = self.draw(index);
        if drawn.is_void() { self.recipe.void() } else { self.decode(&drawn.values, tables) }
    }

    /// The case of a valid point; its series are appended to `tables`.
    fn decode<R: Real>(&self, point: &[f32], tables: &mut Tables<R>) -> LaneCase<R> {
        decode::case(&self.recipe, &self.basis, point, tables)
    }

    /// Maximum number of table entries of one case: speeds, lateral states.
    pub fn table_entries(&self) -> [u32; 2] {
        let entries = self.recipe.longest_series();
        match self.recipe.path() {
            CasePath::Kinematic => [0, 0],
            CasePath::Sinusoid => [entries, 0],
            CasePath::Reduced => [entries * self.recipe.speed_series(), entries * self.recipe.lateral_series()],
        }
    }
}
