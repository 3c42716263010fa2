//! The figures of a sampling run: from its counts to what the drawing files take.

use super::convergence::{ConvergenceFigure, ConvergencePoint, ConvergenceSeries};
use super::failure_map::{FailureMap, MapAxis};
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::run::sampling::{Checkpoint, MapCounts};
use crate::stats::density::DensityModel;

/// Line below the heading: what was sampled.
fn subtitle(density: &DensityModel) -> String {
    let id = density.space.id();
    format!("{} {} · {}", id.category.label(), id.key, density.provenance.data)
}

/// Probability over samples, one panel per driver model.
pub fn convergence(density: &DensityModel, checkpoints: &[Checkpoint]) -> ConvergenceFigure {
    let mut series: Vec<ConvergenceSeries> = Vec::new();
    for checkpoint in checkpoints {
        for row in &checkpoint.rows {
            let (panel, name) = (row.model.name(), row.criterion.label());
            let point = ConvergencePoint {
                samples: checkpoint.samples,
                probability: row.probability,
                lower: row.interval[0],
                upper: row.interval[1],
            };
            match series.iter_mut().find(|s| s.panel == panel && s.name == name) {
                Some(known) => known.points.push(point),
                None => series.push(ConvergenceSeries {
                    panel: panel.to_owned(),
                    name: name.to_owned(),
                    points: vec![point],
                }),
            }
        }
    }
    let title = "Failure probability against samples".to_owned();
    ConvergenceFigure { title, subtitle: Some(subtitle(density)), series }
}

/// The failure map of one model.
pub fn failure_map(
    density: &DensityModel,
    map: &MapCounts,
    at: usize,
    model: ModelId,
    criterion: Criterion,
) -> FailureMap {
    let axis = |axis: &crate::run::sampling::MapAxis| MapAxis {
        name: axis.name.clone(),
        unit: axis.unit.clone(),
        edges: axis.edges(),
    };
    FailureMap {
        title: format!("{}: share of lanes that fail {}", model.name(), criterion.label()),
        subtitle: Some(subtitle(density)),
        x: axis(&map.axes.x),
        y: axis(&map.axes.y),
        samples: map.lanes.clone(),
        failures: map.failures[at].clone(),
    }
}
