//! Cases that are made where their lanes run: sample index → point → case, a pure function of the seed and the
//! index. The CPU makes them here, a device in `shaders/generate.wgsl`, with the same bits.
//!
//! Points are binary32 everywhere, whatever a lane computes with. No division but the exact one, no root, no
//! transcendental: the sinusoid is a polynomial, the normal deviates come from a table.

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
    /// The basis of a reduction, column by column divided by the weights: mean, then every direction; else empty.
    pub basis: Vec<f32>,
}

impl Generator {
    /// The point of a sample index.
    #[inline]
    pub fn draw(&self, index: u64) -> DrawnPoint {
        self.points.draw(index, |point| decode::is_valid(&self.recipe, &self.basis, point))
    }

    /// The case of a sample index; series go to the end of `tables`.
    pub fn case<R: Real>(&self, index: u64, tables: &mut Tables<R>) -> LaneCase<R> {
        let drawn = self.draw(index);
        if drawn.is_void() { self.recipe.void() } else { self.decode(&drawn.values, tables) }
    }

    /// The case of a valid point; series go to the end of `tables`.
    pub fn decode<R: Real>(&self, point: &[f32], tables: &mut Tables<R>) -> LaneCase<R> {
        decode::case(&self.recipe, &self.basis, point, tables)
    }

    /// Entries of the tables that one case fills at most: speeds, lateral states.
    pub fn table_entries(&self) -> [u32; 2] {
        let entries = self.recipe.longest_series();
        match self.recipe.path() {
            CasePath::Kinematic => [0, 0],
            CasePath::Sinusoid => [entries, 0],
            CasePath::Reduced => [entries * self.recipe.speed_series(), entries * self.recipe.lateral_series()],
        }
    }
}
