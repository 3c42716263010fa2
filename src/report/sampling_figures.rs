//! The figures of a sampling run.
//!
//! Convergence of an estimate: failure probability with its interval over the number of samples, one panel per driver
//! model, all panels on the same axes. Both axes are logarithmic, because probabilities span decades. They cannot show
//! an estimate of zero: its interval's upper end is drawn instead, with an arrow downwards.
//!
//! Where failures occur: the fraction of failed samples per cell of two scenario parameters, as heat maps. The colours
//! go from pale yellow over green to dark blue and darken with each step, so that colour-blind readers and grey prints
//! can distinguish them, but for pale cells; the scale is the same for all models and headways of a run.

use super::plot::{
    AxisScale, Cells, ColourBar, Figure, Fill, FilledCell, Height, Mark, Plot, PlotAxis, Series, Value, is_few,
    logarithmic_reach, number, plain_end, quantity,
};
use crate::engine::{Headway, LanePlan};
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::run::sampling::{Checkpoint, CheckpointRow, MAP_CELLS, MapAxis, MapCounts};
use crate::stats::density::DensityModel;
use crate::support::readable::count;
use crate::support::table::Table;

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

/// The failure maps of a sampling run.
pub(super) struct FailureMaps<'a> {
    /// What was sampled.
    pub density: &'a DensityModel,
    /// Its headways and models.
    pub plan: &'a LanePlan,
    /// The counts.
    pub map: &'a MapCounts,
    /// Number of valid samples, inside the map and outside.
    pub samples: u64,
    /// Criterion of the failures.
    pub criterion: Criterion,
}

/// With fewer samples than this a cell's fraction is uncertain.
const FEW_SAMPLES: u64 = 10;
/// Opacity of such cells.
const PALE: f64 = 0.35;
/// From a fraction of zero to the maximum. Relative luminance decreases from step to step.
const COLOURS: [(u8, u8, u8); 6] =
    [(250, 218, 96), (170, 206, 110), (96, 174, 124), (44, 126, 136), (38, 74, 122), (10, 32, 80)];
/// Colour of a cell with samples and without failures.
const NONE_FAILED: &str = "#ececec";

impl FailureMaps<'_> {
    fn failures(&self, headway: usize, model: usize) -> &[u64] {
        self.map.failures.get(headway * self.plan.models.len() + model).map_or(&[], Vec::as_slice)
    }

    /// Whether the headway is a parameter of the density.
    fn is_drawn(&self) -> bool {
        self.density.space.thw_s(&vec![0.0; self.density.space.dimensions()]).is_some()
    }

    /// Cells with samples: index, samples, failures.
    fn cells(&self, headway: usize, model: usize) -> impl Iterator<Item = (usize, u64, u64)> {
        let counts = self.map.samples.iter().zip(self.failures(headway, model)).enumerate();
        counts.filter(|(_, (samples, _))| **samples > 0).map(|(at, (samples, failures))| (at, *samples, *failures))
    }

    /// The maximum of the colours: the largest share of a cell with enough samples, at any headway of any model.
    fn largest(&self) -> f64 {
        let all =
            (0..self.plan.headways.len()).flat_map(|headway| (0..self.plan.models.len()).map(move |m| (headway, m)));
        let shares = all.flat_map(|(headway, model)| self.cells(headway, model));
        let shares = shares.filter(|(_, samples, _)| *samples >= FEW_SAMPLES);
        let largest = shares.map(|(_, samples, failures)| failures as f64 / samples as f64).fold(0.0, f64::max);
        if largest > 0.0 { plain_end(largest).min(1.0) } else { 1.0 }
    }

    /// The maps of one model, one per headway from short to long.
    pub(super) fn figure(&self, model: usize) -> Figure {
        let (largest, axes) = (self.largest(), &self.map.axes);
        let (x, y) = (axes.x.edges(), axes.y.edges());
        let axis = |axis: &MapAxis| {
            let name = quantity(&axis.name);
            let label = if axis.unit.is_empty() { name } else { format!("{name} in {}", axis.unit) };
            PlotAxis::exactly(label, axis.lower, axis.upper)
        };
        let fill = |samples: u64, failures: u64| Fill {
            colour: match failures {
                0 => NONE_FAILED.to_owned(),
                _ => scale_colour(failures as f64 / samples as f64 / largest),
            },
            opacity: (samples < FEW_SAMPLES).then_some(PALE),
        };
        let plot = |headway: usize| {
            let cell = |(at, samples, failures): (usize, u64, u64)| {
                let (i, j) = (at % MAP_CELLS, at / MAP_CELLS);
                let range = |edges: &[f64], k: usize| format!("{} to {}", number(edges[k]), number(edges[k + 1]));
                let share = number(failures as f64 / samples as f64);
                FilledCell {
                    corners: [(x[i], y[j]), (x[i + 1], y[j + 1])],
                    fill: fill(samples, failures),
                    tip: format!("{}; {}: {failures} of {samples} failed, share {share}", range(&x, i), range(&y, j)),
                }
            };
            let has_none = self.cells(headway, model).any(|(_, _, failures)| failures == 0);
            let has_few = self.cells(headway, model).any(|(_, samples, _)| samples < FEW_SAMPLES);
            let key = [
                has_none.then(|| ("no failure".to_owned(), fill(FEW_SAMPLES, 0))),
                has_few.then(|| (format!("any colour paler: fewer than {FEW_SAMPLES} samples"), fill(3, 1))),
            ];
            let cells = self.cells(headway, model).map(cell).collect();
            Plot {
                heading: match self.plan.headways[headway] {
                    _ if self.is_drawn() => "headway sampled".to_owned(),
                    Headway::ThwS(thw_s) => format!("THW {thw_s} s"),
                    other => other.to_string(),
                },
                x: axis(&axes.x),
                y: axis(&axes.y),
                cells: Some(Cells { cells, key: key.into_iter().flatten().collect() }),
                height: Height::OfWidth(1.0),
                ..Plot::default()
            }
        };
        let mut headways: Vec<usize> = (0..self.plan.headways.len()).collect();
        let value = |at: usize| self.plan.headways[at].value().unwrap_or(0.0);
        headways.sort_by(|a, b| value(*a).total_cmp(&value(*b)));
        let outside = self.samples.saturating_sub(self.map.samples.iter().sum());
        let model_name = self.plan.models[model].name();
        Figure {
            title: format!("{model_name}: share of samples that fail {}", self.criterion.label()),
            subtitle: Some(sampled(self.density)),
            plots: headways.into_iter().map(plot).collect(),
            bar: Some(ColourBar { label: "Share failed", largest, colour: scale_colour }),
            caption: format!(
                "The colours mean the same for every model and headway of this run. White: no samples. The scale ends at the largest share of a cell that is not pale. {} of {} samples \
                 lie outside the map.",
                count(outside),
                count(self.samples)
            ),
            ..Figure::default()
        }
    }

    /// The cells of one model as CSV: edges in the axes' units, counts, and the fraction of failures, empty without
    /// samples.
    pub(super) fn csv(&self, model: usize) -> String {
        let (x, y) = (self.map.axes.x.edges(), self.map.axes.y.edges());
        let cells = self.map.samples.len();
        let rows = (0..self.plan.headways.len() * cells).map(|at| (at / cells, at % cells));
        let failures = |(headway, cell): (usize, usize)| self.failures(headway, model).get(cell).copied().unwrap_or(0);
        Table::of(rows)
            .column("headway", |(headway, _)| match self.is_drawn() {
                true => "sampled".to_owned(),
                false => self.plan.headways[headway].to_string(),
            })
            .column("x_lower", |(_, cell)| x[cell % MAP_CELLS])
            .column("x_upper", |(_, cell)| x[cell % MAP_CELLS + 1])
            .column("y_lower", |(_, cell)| y[cell / MAP_CELLS])
            .column("y_upper", |(_, cell)| y[cell / MAP_CELLS + 1])
            .column("samples", |(_, cell)| self.map.samples[cell])
            .column("failures", failures)
            .column("share", |(headway, cell)| {
                let samples = self.map.samples[cell];
                (samples > 0).then(|| failures((headway, cell)) as f64 / samples as f64)
            })
            .build()
            .csv()
    }
}

/// The colour at `place` (0 to 1) of the scale, linear between its anchors.
fn scale_colour(place: f64) -> String {
    let along = place.clamp(0.0, 1.0) * (COLOURS.len() - 1) as f64;
    let first = (along as usize).min(COLOURS.len() - 2);
    let (from, to, part) = (COLOURS[first], COLOURS[first + 1], along - first as f64);
    let mix = |a: u8, b: u8| (f64::from(a) + part * (f64::from(b) - f64::from(a))).round() as u8;
    format!("#{:02x}{:02x}{:02x}", mix(from.0, to.0), mix(from.1, to.1), mix(from.2, to.2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_colour_of_the_scale_is_darker_than_the_one_before_and_none_is_the_grey_of_no_failure() {
        let luminance = |colour: String| {
            let linear =
                |at: usize| (f64::from(u8::from_str_radix(&colour[at..at + 2], 16).unwrap()) / 255.0).powf(2.2);
            0.2126 * linear(1) + 0.7152 * linear(3) + 0.0722 * linear(5)
        };
        let scale: Vec<f64> = (0..=50).map(|k| luminance(scale_colour(f64::from(k) / 50.0))).collect();
        assert!(scale.windows(2).all(|l| l[0] > l[1]), "{scale:?}");
        assert!(scale[0] > 0.7 && scale[50] < 0.02);
        assert!((0..=1000).all(|k| scale_colour(f64::from(k) / 1000.0) != NONE_FAILED));
    }
}
