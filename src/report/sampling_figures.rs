//! The convergence of an estimate: failure probability with its interval over the number of samples, one panel per driver
//! model, all panels on the same axes. Both axes are logarithmic, because probabilities span decades. They cannot show
//! an estimate of zero: its interval's upper end is drawn instead, with an arrow downwards.

use super::plot::{AxisScale, Figure, Mark, Plot, PlotAxis, Series, Value, is_few, logarithmic_reach, number};
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_run::sampling::{Checkpoint, CheckpointRow};
use lanesweep_stats::density::DensityModel;

/// The sampled density, for the line below a heading.
fn sampled(density: &DensityModel) -> String {
    let id = density.space.id();
    format!("{} {} · {}", id.category.label(), id.key, density.provenance.data)
}

/// Failure probability over the samples of a sampling run, at this confidence level.
pub(super) fn convergence(density: &DensityModel, checkpoints: &[Checkpoint], level: f64) -> Figure {
    let rows = || checkpoints.iter().flat_map(|checkpoint| checkpoint.rows.iter().map(move |row| (checkpoint, row)));
    let widest = |[low, high]: [f64; 2], outer: Option<[f64; 2]>| {
        outer.map_or((low, high), |outer| (outer[0].min(low), outer[1].max(high)))
    };
    let reach: Vec<(f64, f64, f64)> = rows()
        .map(|(_, row)| {
            let (low, high) = widest(row.interval, row.with_data.map(|(ends, _)| ends));
            (row.probability, low, high.min(1.0))
        })
        .collect();
    let samples: Vec<f64> = checkpoints.iter().map(|checkpoint| checkpoint.samples as f64).collect();
    let series = |model: ModelId, criterion: Criterion| {
        let own = rows().filter(|(_, row)| row.model == model && row.criterion == criterion);
        let value = |(checkpoint, row): (&Checkpoint, &CheckpointRow)| {
            let [low, high] = row.interval;
            let [estimate, lower, upper] = [row.probability, low, high].map(number);
            let name = format!("{} {}", model.name(), criterion.label());
            Value {
                interval: Some((low, high.min(1.0))),
                outer: row.with_data.map(|([low, high], _)| (low, high.min(1.0))),
                is_few: row.with_data.is_some_and(|(_, scenarios)| is_few(scenarios)),
                tip: format!("{name}: {estimate} [{lower}, {upper}] after {} samples", checkpoint.samples),
                ..Value::from((checkpoint.samples as f64, row.probability))
            }
        };
        let mut values: Vec<Value> = own.clone().map(value).collect();
        // A number at every point would cover the line.
        let last = own.fold(None, |_, (_, row)| row.with_data);
        if let Some((value, scenarios)) =
            values.last_mut().filter(|value| value.is_few).zip(last.map(|of| of.1.floor()))
        {
            value.label = format!("{scenarios:.0}");
        }
        let series = Series::new(criterion.label(), &[Mark::Band, Mark::Line, Mark::Points], values);
        Series { attributes: "class=\"estimate\"".to_owned(), ..series }
    };
    let mut models: Vec<ModelId> = Vec::new();
    rows().for_each(|(_, row)| models.extend((!models.contains(&row.model)).then_some(row.model)));
    let plot = |&model: &ModelId| {
        let has = |criterion: &Criterion| rows().any(|(_, row)| (row.model, row.criterion) == (model, *criterion));
        Plot {
            heading: model.name().to_owned(),
            x: PlotAxis::around("samples", AxisScale::Logarithmic, samples.clone()),
            y: PlotAxis::around("failure probability", AxisScale::Logarithmic, logarithmic_reach(&reach)),
            series: Criterion::ALL.into_iter().filter(has).map(|criterion| series(model, criterion)).collect(),
            ..Plot::default()
        }
    };
    Figure {
        title: "Failure probability against samples".to_owned(),
        subtitle: Some(sampled(density)),
        plots: models.iter().map(plot).collect(),
        caption: caption(rows().map(|(_, row)| row), level),
        ..Figure::default()
    }
}

/// Explains the marks that occur.
fn caption<'a>(rows: impl Iterator<Item = &'a CheckpointRow> + Clone, level: f64) -> String {
    let mut words = format!(
        "Marker: estimate. Area: its {} % interval over the draws alone, which more samples make narrower. ",
        100.0 * level
    );
    words.push_str(match rows.clone().any(|row| row.with_data.is_some()) {
        true => {
            "Pale area: the interval over draws and scenarios, at fixed bandwidth and scale; more samples do not make \
             it narrower than the scenarios allow. "
        }
        false => "It does not cover what other scenarios would change. ",
    });
    words.push_str("All headways together; both axes are logarithmic.");
    if rows.clone().any(|row| row.probability > 0.0 && row.interval[0] < row.probability / 10.0) {
        words.push_str(" An interval that reaches the lower edge goes on below it.");
    }
    if rows.clone().any(|row| row.probability == 0.0) {
        words.push_str(" Arrow: the estimate is zero; the bar is the interval's upper end.");
    }
    words
}
