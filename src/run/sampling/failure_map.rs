//! Failure maps: failure rates of lanes over two parameters.

use serde::{Deserialize, Serialize};

use super::kernel_counts::add_counts;
use crate::engine::CountedAxis;
use crate::stats::density::DensityModel;
use crate::{Error, Place, Result};

pub use crate::engine::MAP_CELLS;
/// Margin of a map beyond the outermost kernel, in standard deviations of the kernels.
const MARGIN: f64 = 2.0;

/// One axis: a parameter and its range.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MapAxis {
    /// Index of the parameter in a point.
    pub parameter: usize,
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Lower end.
    pub lower: f64,
    /// Upper end.
    pub upper: f64,
}

/// Two axes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MapAxes {
    /// Horizontal axis.
    pub x: MapAxis,
    /// Vertical axis.
    pub y: MapAxis,
}

impl MapAxis {
    /// The range that covers a parameter's kernels.
    fn of(density: &DensityModel, name: &str) -> Result<MapAxis> {
        let parameter = density.space.index_of(name)?;
        let described = &density.space.parameters()[parameter];
        let values = density.kde.points().iter().map(|p| p[parameter]);
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        let margin = MARGIN * density.kde.spread()[parameter];
        Ok(MapAxis {
            parameter,
            name: described.name.clone(),
            unit: described.unit.clone(),
            lower: (low - margin).max(described.lower.unwrap_or(f64::NEG_INFINITY)),
            upper: (high + margin).min(described.upper.unwrap_or(f64::INFINITY)),
        })
    }

    fn cell(&self, value: f64) -> Option<usize> {
        let share = (value - self.lower) / (self.upper - self.lower);
        // The condition also refuses NaN.
        if !(0.0..1.0).contains(&share) {
            return None;
        }
        Some(((share * MAP_CELLS as f64) as usize).min(MAP_CELLS - 1))
    }

    /// The axis for a backend that counts: it compares numbers of the lane arithmetic with edges.
    fn counted(&self) -> CountedAxis {
        let mut edges = [f32::INFINITY; MAP_CELLS + 1];
        for (cell, edge) in edges.iter_mut().enumerate() {
            *edge = smallest(|value| self.reaches(value, cell));
        }
        CountedAxis { parameter: self.parameter, edges }
    }

    /// Whether a value is in this cell or beyond it; cell `MAP_CELLS` is beyond the axis.
    fn reaches(&self, value: f64, cell: usize) -> bool {
        let share = (value - self.lower) / (self.upper - self.lower);
        match self.cell(value) {
            Some(own) => own >= cell,
            None => share >= 1.0,
        }
    }

    /// Edges of the cells, one more than cells.
    pub fn edges(&self) -> Vec<f64> {
        let width = (self.upper - self.lower) / MAP_CELLS as f64;
        (0..=MAP_CELLS).map(|k| self.lower + width * k as f64).collect()
    }
}

/// The smallest number of the lane arithmetic for which a condition holds that holds for all larger ones; infinite if
/// there is none.
fn smallest(holds: impl Fn(f64) -> bool) -> f32 {
    // The order of these words is that of the numbers.
    let number = |word: u32| f32::from_bits(if word >> 31 == 0 { !word } else { word & 0x7fff_ffff });
    let word = |number: f32| {
        let bits = number.to_bits();
        if bits >> 31 == 0 { bits | 1 << 31 } else { !bits }
    };
    let (mut below, mut above) = (word(f32::MIN) - 1, word(f32::INFINITY));
    while above - below > 1 {
        let middle = below + (above - below) / 2;
        if holds(f64::from(number(middle))) {
            above = middle;
        } else {
            below = middle;
        }
    }
    number(above)
}

impl MapAxes {
    /// The axes for a backend that counts.
    pub(super) fn counted(&self) -> [CountedAxis; 2] {
        [self.x.counted(), self.y.counted()]
    }

    /// Axes for two parameters of a density.
    ///
    /// # Errors
    /// [`Error::Usage`] for an unknown parameter, or the same one twice.
    pub fn of(density: &DensityModel, x: &str, y: &str) -> Result<MapAxes> {
        let axes = MapAxes { x: MapAxis::of(density, x)?, y: MapAxis::of(density, y)? };
        if axes.x.parameter == axes.y.parameter {
            let problem = format!("a map over `{x}` twice shows nothing");
            return Err(Error::usage(Place::option("map"), problem, "name two parameters"));
        }
        Ok(axes)
    }

    /// Cell of a point, row by row from below; `None` outside the axes.
    pub(crate) fn cell(&self, point: &[f32]) -> Option<usize> {
        let along = |axis: &MapAxis| axis.cell(f64::from(*point.get(axis.parameter)?));
        Some(along(&self.y)? * MAP_CELLS + along(&self.x)?)
    }
}

/// Samples and failures per cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MapCounts {
    /// The axes.
    pub axes: MapAxes,
    /// Samples, row by row from below: the lanes of each model from each headway.
    pub samples: Vec<u64>,
    /// Failed lanes of each cell: headway × model.
    pub failures: Vec<Vec<u64>>,
}

impl MapCounts {
    pub(super) fn new(axes: MapAxes, lanes_per_sample: usize) -> MapCounts {
        let cells = vec![0; MAP_CELLS * MAP_CELLS];
        MapCounts { axes, failures: vec![cells.clone(); lanes_per_sample], samples: cells }
    }

    pub(super) fn add(&mut self, other: &MapCounts) {
        add_counts(&mut self.samples, &other.samples);
        self.failures.iter_mut().zip(&other.failures).for_each(|(ours, theirs)| add_counts(ours, theirs));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A device compares with edges in place of the division; next to an edge both give the same cell.
    #[test]
    fn the_edges_of_the_lane_arithmetic_are_those_of_the_cells() {
        for (lower, upper) in [(0.0, 1.0), (-3.7, 12.9), (0.1, 0.1000001), (20.0, 20.0), (f64::NEG_INFINITY, 3.0)] {
            let axis = MapAxis { parameter: 0, name: "v".to_owned(), unit: "m/s".to_owned(), lower, upper };
            let counted = axis.counted();
            let by_edges = |value: f32| match counted.edges.iter().filter(|edge| value >= **edge).count() {
                0 => None,
                reached => (reached <= MAP_CELLS).then(|| reached - 1),
            };
            let near = counted.edges.iter().flat_map(|edge| [edge.next_down(), *edge, edge.next_up()]);
            let all = near.chain((0..1000).map(|k| k as f32 * 0.03 - 10.0)).chain([f32::MIN, -0.0, 0.0, f32::MAX]);
            for value in all.filter(|value| value.is_finite()) {
                assert_eq!(by_edges(value), axis.cell(f64::from(value)), "{value} on {lower} to {upper}");
            }
        }
    }
}
