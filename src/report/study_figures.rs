//! The figures of a study except the radar charts: F1 with intervals, recall and precision, failures against the headway, F1 against the
//! number of parameters, the shapes of a decomposition, the distributions of parameters.

use super::plot::{Figure, GREY, HOLLOW, Height, Layer, Look, Mark, Name, Plot, PlotAxis, Rule, Series, Value, is_few};
use crate::engine::{Confusion, Headway, LanePlan, Partial};
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::run::score::{CategoryScores, f1, precision, recall};
use crate::run::study::ParameterHistogram;
use crate::scenario::Category;
use crate::scenario::parameterization::{ModeShape, Parameterization};
use crate::support::readable::counted;
use crate::{Error, Result};

/// Failed lanes of one category by headway.
#[derive(Debug, Clone, PartialEq)]
pub struct HeadwayFailures {
    variants: Vec<String>,
    headways: Vec<Headway>,
    models: Vec<ModelId>,
    /// Counts by variant × headway × model × criterion.
    failures: Vec<u64>,
}

impl HeadwayFailures {
    /// From a block of a plan.
    ///
    /// # Errors
    /// [`crate::Error`] if the counts do not match the plan.
    pub fn of(plan: &LanePlan, partial: &Partial, block: usize) -> Result<HeadwayFailures> {
        let failures = partial.headway_failures(plan, block)?.to_vec();
        HeadwayFailures::new(&plan.blocks[block].variants, &plan.headways, &plan.models, failures)
    }

    fn new(
        variants: &[String],
        headways: &[Headway],
        models: &[ModelId],
        failures: Vec<u64>,
    ) -> Result<HeadwayFailures> {
        let expected = variants.len() * headways.len() * models.len() * Criterion::ALL.len();
        if failures.len() != expected {
            let problem = format!("{} counts of failures by headway, expected {expected}", failures.len());
            return Err(Error::Internal(problem));
        }
        let (variants, headways, models) = (variants.to_vec(), headways.to_vec(), models.to_vec());
        Ok(HeadwayFailures { variants, headways, models, failures })
    }

    /// Failed lanes of a variant at a headway; models and criteria by their indices in the plan.
    fn count(&self, (variant, headway, model, criterion): (usize, usize, usize, Criterion)) -> u64 {
        let lane = (variant * self.headways.len() + headway) * self.models.len() + model;
        self.failures[lane * Criterion::ALL.len() + criterion.index()]
    }

    /// Rows ordered by variant, headway, model and criterion.
    pub(super) fn rows(&self) -> impl Iterator<Item = (&str, Headway, ModelId, Criterion, u64)> {
        let lanes = self.variants.iter().flat_map(move |variant| {
            let starts = self.headways.iter().map(move |&headway| (variant, headway));
            starts.flat_map(|(variant, headway)| self.models.iter().map(move |&model| (variant, headway, model)))
        });
        lanes.zip(self.failures.chunks(Criterion::ALL.len())).flat_map(|((variant, headway, model), failures)| {
            let counts = Criterion::ALL.into_iter().zip(failures);
            counts.map(move |(criterion, &failures)| (variant.as_str(), headway, model, criterion, failures))
        })
    }

    /// Fraction of the recorded scenarios that fail, over the headway: a panel per model, a line per criterion.
    pub fn figure(&self, scores: &CategoryScores, data: &str) -> Figure {
        let thw_s = |headway: &Headway| match headway {
            Headway::ThwS(seconds) => Some(*seconds),
            Headway::GapM(metres) => Some(*metres),
            // These headways differ between scenarios.
            Headway::MinFollowing | Headway::Observed => None,
        };
        let is_gap = self.headways.iter().any(|headway| matches!(headway, Headway::GapM(_)));
        let panel = |(model, id): (usize, &ModelId)| {
            let series = |criterion: Criterion| {
                let share = |(at, headway): (usize, &Headway)| {
                    // One lane per scenario and headway.
                    let failed = self.count((0, at, model, criterion));
                    let place = (thw_s(headway)?, 100.0 * failed as f64 / scores.scenarios.max(1) as f64);
                    let is_few = is_few(failed as f64);
                    let label = if is_few && failed > 0 { failed.to_string() } else { String::new() };
                    Some(Value { label, is_few, ..Value::from(place) })
                };
                let mut values: Vec<Value> = self.headways.iter().enumerate().filter_map(share).collect();
                values.sort_by(|a, b| a.x.total_cmp(&b.x));
                Series { values, ..Series::new(criterion.label(), &[Mark::Line, Mark::Points], []) }
            };
            Plot {
                heading: id.name().to_owned(),
                x: PlotAxis::new(if is_gap { "initial gap in m" } else { "initial time headway in s" }),
                y: PlotAxis::exactly("failed scenarios in %", 0.0, 100.0),
                layers: Criterion::ALL.map(|criterion| series(criterion).into()).to_vec(),
                ..Plot::default()
            }
        };
        Figure {
            title: format!("{}: failures of the recorded scenarios against the headway", scores.category.label()),
            subtitle: Some(format!("{} scenarios. {data}", scores.scenarios)),
            caption: format!(
                "Share of the recorded scenarios (S) in which the driver model fails the criterion, without an interval. \
                 {HOLLOW}"
            ),
            plots: self.models.iter().enumerate().map(panel).collect(),
            ..Figure::default()
        }
    }
}

/// Heights of a parameterization and of the space below a row, px.
const LINE_PX: f64 = 9.0;
const ROW_GAP_PX: f64 = 14.0;

/// F1 of every parameterization with its interval, a row per driver model and criterion.
pub fn f1_intervals(scores: &CategoryScores, confidence: f64, data: &str) -> Figure {
    let variants = scores.variants.len() - 1;
    let row_px = variants as f64 * LINE_PX + ROW_GAP_PX;
    let cells: Vec<(ModelId, Criterion)> =
        scores.models.iter().flat_map(|&model| Criterion::ALL.map(|criterion| (model, criterion))).collect();
    let top = |row: usize| -(row as f64 * row_px);
    let name = |(row, (model, criterion)): (usize, &(ModelId, Criterion))| Name {
        at: top(row),
        words: format!("{}, {}", model.name(), criterion.label()),
        note: format!("S fails in {}", counted(scores.failing_scenarios(*model, *criterion) as usize, "scenario")),
        ..Name::default()
    };
    let series = |variant: usize| {
        let value = |(row, (model, criterion)): (usize, &(ModelId, Criterion))| {
            let cell = &scores.cells[scores.index(variant, *model, *criterion)?];
            Some(Value {
                x: f1(&cell.counts)?,
                y: top(row) - ROW_GAP_PX / 2.0 - (variant as f64 - 0.5) * LINE_PX,
                interval: cell.f1_interval.map(|interval| (interval.low, interval.high)),
                is_few: is_few(cell.failing_scenarios as f64),
                ..Value::default()
            })
        };
        let values = cells.iter().enumerate().filter_map(value).collect();
        let look = Look { line_px: 1.6, marker_px: 4.0, ..Look::of(variant - 1, variants) };
        let marks = &[Mark::Points, Mark::Intervals];
        let series = Series::new(legend_name(scores, variant), marks, []);
        Layer::from(Series { values, look: Some(look), is_sideways: true, ..series })
    };
    let separators = Rule {
        runs: (1..cells.len()).map(|row| vec![(0.0, top(row)), (1.0, top(row))]).collect(),
        colour: GREY,
        width_px: 0.5,
        ..Rule::default()
    };
    let height_px = cells.len() as f64 * row_px;
    let plot = Plot {
        x: PlotAxis { is_doubled: true, ..PlotAxis::exactly("F1", 0.0, 1.0) },
        y: PlotAxis { names: cells.iter().enumerate().map(name).collect(), ..PlotAxis::exactly("", -height_px, 0.0) },
        layers: std::iter::once(separators.into()).chain((1..=variants).map(series)).collect(),
        height: Height::Px(height_px),
        ..Plot::default()
    };
    Figure {
        title: format!("{}: F1 of parameterized against recorded scenarios", scores.category.label()),
        subtitle: Some(format!("{} scenarios. {data}", scores.scenarios)),
        caption: format!(
            "Marker: F1; further right is better. Line: its {} % interval over scenarios; without one, S fails in too few \
             scenarios. A parameterization without a marker has no F1, because neither S nor S' fails. {HOLLOW}",
            100.0 * confidence
        ),
        plots: vec![plot],
        ..Figure::default()
    }
}

/// Recall and precision of every parameterization, a panel per driver model and criterion.
pub fn recall_and_precision(scores: &CategoryScores, data: &str) -> Figure {
    let panel = |model: ModelId, criterion: Criterion| {
        let failing = scores.failing_scenarios(model, criterion);
        let series = |variant: usize| {
            let counts = scores.index(variant, model, criterion).map(|at| scores.cells[at].counts);
            let of = |share: fn(&Confusion) -> Option<f64>| counts.as_ref().and_then(share).unwrap_or(f64::NAN);
            let value = Value { is_few: is_few(failing as f64), ..Value::from((of(recall), of(precision))) };
            Series { values: vec![value], ..Series::new(legend_name(scores, variant), &[Mark::Points], []) }
        };
        let equal = Rule {
            runs: [0.2, 0.4, 0.6, 0.8].map(equal_f1).to_vec(),
            colour: GREY,
            width_px: 0.9,
            dash: "4,4",
            attributes: "class=\"equal-f1\"".to_owned(),
            ..Rule::default()
        };
        Plot {
            heading: format!("{}, {}{}", model.name(), criterion.label(), few(failing)),
            x: PlotAxis::exactly("recall", 0.0, 1.0),
            y: PlotAxis::exactly("precision", 0.0, 1.0),
            layers: std::iter::once(equal.into())
                .chain((1..scores.variants.len()).map(|variant| series(variant).into()))
                .collect(),
            ..Plot::default()
        }
    };
    let plots = scores.models.iter().flat_map(|&model| Criterion::ALL.map(|criterion| panel(model, criterion)));
    Figure {
        title: format!("{}: recall and precision of S' against S", scores.category.label()),
        subtitle: Some(format!("{} scenarios. {data}", scores.scenarios)),
        caption: format!(
            "Recall: share of the recorded failures that the parameterized scenarios show; precision: share of their \
             failures that were recorded; both without an interval. Dashed: equal F1, from 0.2 to 0.8. Without a failure \
             on one side a share is undefined and has no marker. {HOLLOW}"
        ),
        plots: plots.collect(),
        ..Figure::default()
    }
}

/// Text for a heading if there are few scenarios.
fn few(failing_scenarios: u64) -> String {
    let is_few = is_few(failing_scenarios as f64);
    if is_few { format!(" ({})", counted(failing_scenarios as usize, "scenario")) } else { String::new() }
}

/// All pairs of recall and precision with this F1: P = F·R/(2R − F).
fn equal_f1(f: f64) -> Vec<(f64, f64)> {
    let min_recall = f / (2.0 - f);
    let value = |k: u32| {
        let r = 1.0 + (min_recall - 1.0) * f64::from(k) / 40.0;
        (r, (f * r / (2.0 * r - f)).min(1.0))
    };
    (0..=40).rev().map(value).collect()
}

/// F1 against the number of parameters: the mean over the cells that every parameterization defines, over all criteria
/// and for each. Also the front of parameterizations that no other beats with at most as many parameters.
pub fn f1_by_parameters(scores: &CategoryScores, data: &str) -> Figure {
    let panel = |heading: &str, criteria: &[Criterion]| {
        let shared = shared_cells(scores, criteria);
        let fewest = shared.iter().map(|&(model, criterion)| scores.failing_scenarios(model, criterion)).min();
        let fewest = fewest.unwrap_or(0);
        let means = mean_f1(scores, &shared);
        let of = |name: &str| {
            let own = means.iter().filter(|(id, _)| id.family.name() == name);
            let values = own.map(|(id, mean)| {
                let point = Value::from((id.parameter_count() as f64, *mean));
                Value { label: id.key.to_string(), is_few: is_few(fewest as f64), ..point }
            });
            Series { values: values.collect(), ..Series::new(name, &[Mark::Points], []) }
        };
        let points: Vec<(f64, f64)> = means.iter().map(|(id, mean)| (id.parameter_count() as f64, *mean)).collect();
        let front = "no other is better with as few parameters";
        Plot {
            heading: if shared.is_empty() { heading.to_owned() } else { format!("{heading}{}", few(fewest)) },
            x: PlotAxis::exactly("parameters beside the headway", 1.0, 8.0),
            y: PlotAxis::exactly("mean F1", 0.0, 1.05),
            layers: vec![
                of("kinematic").into(),
                of("SVD").into(),
                Series::new(front, &[Mark::Line], pareto_front(&points)).into(),
            ],
            ..Plot::default()
        }
    };
    let mut plots = vec![panel("all criteria", &Criterion::ALL)];
    plots.extend(Criterion::ALL.map(|criterion| panel(criterion.label(), &[criterion])));
    Figure {
        title: format!("{}: F1 against the number of parameters", scores.category.label()),
        subtitle: Some(format!("{} scenarios. {data}", scores.scenarios)),
        caption: "Mean over the driver models (and criteria) whose F1 every parameterization defines, without an interval. \
                  The fewer parameters, the fewer samples a density needs: of two that are equally good the simpler one \
                  is preferable. Hollow: in one of these S fails in fewer than ten scenarios; the smallest number stands \
                  above."
            .to_owned(),
        plots,
        ..Figure::default()
    }
}

fn f1_of(scores: &CategoryScores, variant: usize, (model, criterion): (ModelId, Criterion)) -> Option<f64> {
    scores.index(variant, model, criterion).and_then(|at| f1(&scores.cells[at].counts))
}

/// The cells whose F1 is defined for every parameterization.
fn shared_cells(scores: &CategoryScores, criteria: &[Criterion]) -> Vec<(ModelId, Criterion)> {
    let cells = scores.models.iter().flat_map(|&model| criteria.iter().map(move |&criterion| (model, criterion)));
    cells.filter(|&cell| (1..scores.variants.len()).all(|variant| f1_of(scores, variant, cell).is_some())).collect()
}

/// The mean F1 of every parameterization over these cells; empty without cells.
fn mean_f1(scores: &CategoryScores, cells: &[(ModelId, Criterion)]) -> Vec<(Parameterization, f64)> {
    let mean = |variant: usize| {
        let sum: f64 = cells.iter().filter_map(|&cell| f1_of(scores, variant, cell)).sum();
        let id = Parameterization::find(scores.category, &scores.variants[variant])?;
        (!cells.is_empty()).then(|| (id, sum / cells.len() as f64))
    };
    (1..scores.variants.len()).filter_map(mean).collect()
}

/// The points that no other point with at most the same x exceeds, from left to right.
fn pareto_front(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.total_cmp(&a.1)));
    let mut front: Vec<(f64, f64)> = Vec::new();
    for point in sorted {
        if front.last().is_none_or(|last| point.1 > last.1) {
            front.push(point);
        }
    }
    front
}

/// The mean scenario and the scenarios along the first directions of a decomposition, and what the directions explain.
pub fn modes(category: Category, shapes: &[ModeShape], explained: &[f64], data: &str) -> Figure {
    let over_time = |values: &[f64]| {
        let last = values.len().saturating_sub(1).max(1) as f64;
        values.iter().enumerate().map(|(k, v)| (k as f64 / last, *v)).collect::<Vec<_>>()
    };
    let line = |name: String, values: &[f64]| Series::new(name, &[Mark::Line], over_time(values)).into();
    let panel = |shape: &ModeShape| {
        let along = shape.along.iter().enumerate();
        let moved = along.map(|(j, values)| line(format!("one standard deviation along direction {}", j + 1), values));
        Plot {
            heading: shape.quantity.clone(),
            x: PlotAxis::exactly("share of the duration T", 0.0, 1.0),
            y: PlotAxis::new(&shape.unit),
            layers: std::iter::once(line("mean scenario".to_owned(), &shape.mean)).chain(moved).collect(),
            ..Plot::default()
        }
    };
    let shares = explained.iter().enumerate().map(|(k, share)| ((k + 1) as f64, 100.0 * share));
    let share = Plot {
        heading: "explained variance".to_owned(),
        x: PlotAxis::new("coefficients"),
        y: PlotAxis::exactly("share in %", 0.0, 100.0),
        layers: vec![Series::new("", &[Mark::Bars(0.8)], shares).into()],
        ..Plot::default()
    };
    Figure {
        title: format!("{}: what the decomposition keeps", category.label()),
        subtitle: Some(data.to_owned()),
        caption:
            "Lines: the mean of the mined scenarios, and the scenario one standard deviation of a coefficient away \
                  from it; lateral positions are positive on the target's side, and a left-positive decomposition \
                  shows the side with more scenarios. Bars: share of the scaled variance that the first coefficients explain together."
                .to_owned(),
        plots: shapes.iter().map(panel).chain((!explained.is_empty()).then_some(share)).collect(),
        ..Figure::default()
    }
}

/// The histograms of the parameters of mined scenarios.
pub fn distributions(category: Category, histograms: &[ParameterHistogram], data: &str) -> Figure {
    let plot = |histogram: &ParameterHistogram| {
        let middle = |k: usize| histogram.low + (k as f64 + 0.5) * histogram.width;
        let values = histogram.counts.iter().enumerate().map(|(k, count)| (middle(k), *count as f64));
        Plot {
            heading: histogram.name.clone(),
            x: PlotAxis::new(&histogram.unit),
            y: PlotAxis::new("scenarios"),
            layers: vec![Series::new("", &[Mark::Bars(histogram.width)], values).into()],
            ..Plot::default()
        }
    };
    Figure {
        title: format!("{}: parameters of the mined scenarios", category.label()),
        subtitle: Some(data.to_owned()),
        caption: "Scenarios that passed the filters; bins about as wide as the rule of Freedman and Diaconis has \
                  them, at plain numbers."
            .to_owned(),
        plots: histograms.iter().map(plot).collect(),
        ..Figure::default()
    }
}

/// `2: constant acceleration, constant lateral speed`.
pub(super) fn legend_name(scores: &CategoryScores, variant: usize) -> String {
    let key = &scores.variants[variant];
    Parameterization::find(scores.category, key).map_or(key.clone(), |id| format!("{key}: {}", id.description()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failures_by_headway_are_as_many_as_the_lanes_they_count_or_an_error() {
        let (variants, headways) = (["S".to_owned()], [Headway::ThwS(1.0), Headway::ThwS(0.5)]);
        let of = |counts: u64| HeadwayFailures::new(&variants, &headways, &[ModelId::Fsm], (0..counts).collect());
        assert_eq!(of(6).unwrap().count((0, 1, 0, Criterion::Btn)), 5);
        for wrong in [0, 5, 7] {
            assert!(matches!(of(wrong), Err(Error::Internal(_))), "{wrong} counts");
        }
    }

    #[test]
    fn points_of_equal_f1_have_that_f1_and_lie_in_the_square() {
        for f in [0.2, 0.5, 0.8] {
            for (r, p) in equal_f1(f) {
                assert!((0.0..=1.0 + 1e-12).contains(&r) && (0.0..=1.0).contains(&p));
                assert!((2.0 * r * p / (r + p) - f).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn nothing_on_the_front_is_beaten_by_as_few_parameters() {
        let points = [(3.0, 0.5), (4.0, 0.4), (2.0, 0.3), (3.0, 0.6), (5.0, 0.6), (7.0, 0.9)];
        assert_eq!(pareto_front(&points), [(2.0, 0.3), (3.0, 0.6), (7.0, 0.9)]);
        assert!(pareto_front(&[]).is_empty());
    }
}
