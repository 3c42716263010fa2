//! What the directions of a decomposition mean: the mean scenario and the scenarios one standard deviation along each
//! of the first directions, in the units of the recording.

use serde::{Deserialize, Serialize};

use super::Reduction;
use crate::scenario::Category;

/// Directions that are shown.
const SHOWN: usize = 3;

/// One series of the mean scenario and of those along the first directions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModeShape {
    /// What it is: `lateral position of the cutter`.
    pub quantity: String,
    /// Unit.
    pub unit: String,
    /// The mean, over equidistant instants of [0, T].
    pub mean: Vec<f64>,
    /// The mean plus σ_j/√N times direction j, for the first directions: one standard deviation of coefficient j.
    pub along: Vec<Vec<f64>>,
}

impl Reduction {
    /// The series of the decomposition with their shapes.
    pub fn mode_shapes(&self) -> Vec<ModeShape> {
        let signed = if self.is_signed() { ", left positive" } else { "" };
        let quantities: &[(&str, &str)] = match self.category {
            Category::CutIn => &[("lateral position of the cutter", "m"), ("speed of the cutter", "m/s")],
            Category::CutOut => &[
                ("lateral position of the cutting-out vehicle", "m"),
                ("speed of the cutting-out vehicle", "m/s"),
                ("speed of the vehicle ahead", "m/s"),
            ],
            Category::Lvd => &[("speed of the leader", "m/s")],
        };
        let shown = SHOWN.min(self.basis.directions.len()).min(self.basis.singular_values.len());
        let vector = |along: Option<usize>| {
            let mut coefficients = vec![0.0; shown];
            if let Some(j) = along {
                coefficients[j] = self.basis.singular_values[j] / (self.basis.rows as f64).sqrt();
            }
            self.basis.reconstruct(&coefficients)
        };
        let (mean, along) = (vector(None), (0..shown).map(|j| vector(Some(j))).collect::<Vec<_>>());
        // Series lie first, one behind the other, all of the same length.
        let instants = self.instants();
        let part = |z: &[f64], at: usize| z[at * instants..(at + 1) * instants].to_vec();
        let shape = |(at, (quantity, unit)): (usize, &(&str, &str))| ModeShape {
            quantity: if *unit == "m" { format!("{quantity}{signed}") } else { (*quantity).to_owned() },
            unit: (*unit).to_owned(),
            mean: part(&mean, at),
            along: along.iter().map(|z| part(z, at)).collect(),
        };
        quantities.iter().enumerate().map(shape).collect()
    }
}
