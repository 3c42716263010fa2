//! The figures of a comparison: rates of the densities beside those of the recorded scenarios.

use super::axis::AxisScale;
use super::compare::CompareFile;
use super::forest::{ForestFigure, ForestGroup, ForestRow};
use crate::model::criterion::Criterion;
use crate::run::sampling::{CategoryComparison, RateRecord};

fn row(name: String, rate: &RateRecord) -> ForestRow {
    // On a logarithmic axis a rate of 0 has no place, but the bound above it has.
    ForestRow { name, estimate: rate.rate.is_finite().then_some(rate.rate), lower: rate.low, upper: rate.high }
}

/// One criterion of one category: a group per driver model, a row per density, the recorded scenarios as reference.
pub fn rates(file: &CompareFile, comparison: &CategoryComparison, criterion: Criterion) -> ForestFigure {
    let recorded = comparison.recorded.iter().filter(|cell| cell.criterion == criterion);
    let groups = recorded.map(|cell| {
        let density = |p: &crate::run::sampling::ComparedParameterization| {
            let found = p.cells.iter().find(|c| c.model == cell.model && c.criterion == criterion)?;
            Some(row(format!("{} ({} parameters)", p.key, p.parameters), &found.sampled.rate))
        };
        ForestGroup {
            name: cell.model.name().to_owned(),
            reference: Some(row("S, as recorded".to_owned(), &cell.rate)),
            rows: comparison.parameterizations.iter().filter_map(density).collect(),
        }
    });
    ForestFigure {
        title: format!("{}: share of lanes that fail {}", comparison.category.label(), criterion.label()),
        subtitle: Some(format!("{} · densities of {} samples each", file.data, file.samples)),
        axis: "Failure probability".to_owned(),
        scale: AxisScale::Logarithmic,
        groups: groups.collect(),
    }
}
