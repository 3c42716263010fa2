//! Failure maps: failure rates of lanes over two parameters.

use serde::{Deserialize, Serialize};

use crate::stats::density::DensityModel;
use crate::{Error, Place, Result};

/// Cells along each axis.
pub const MAP_CELLS: usize = 20;
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

    /// Edges of the cells, one more than cells.
    pub fn edges(&self) -> Vec<f64> {
        let width = (self.upper - self.lower) / MAP_CELLS as f64;
        (0..=MAP_CELLS).map(|k| self.lower + width * k as f64).collect()
    }
}

impl MapAxes {
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
    pub fn cell(&self, point: &[f32]) -> Option<usize> {
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
        let sum =
            |ours: &mut [u64], theirs: &[u64]| ours.iter_mut().zip(theirs).for_each(|(a, b)| *a = a.saturating_add(*b));
        sum(&mut self.samples, &other.samples);
        for (ours, theirs) in self.failures.iter_mut().zip(&other.failures) {
            sum(ours, theirs);
        }
    }
}
