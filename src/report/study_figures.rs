//! The figures of a study: F1 with intervals and as the radar chart of the paper, recall and precision, failures against
//! the headway, F1 against the number of parameters, the shapes of a decomposition, the distributions of parameters.

use super::dots::{DotRow, Dots, dots};
use super::plot::{
    AxisScale, Figure, GREY, INK, Look, Mark, Name, Plot, PlotAxis, Rule, Series, Symbol, Value, is_few, number,
    quantity,
};
use lanesweep_engine::Headway;
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_model::scenario::Category;
use lanesweep_model::scenario::parameterization::{ModeShape, Parameterization};
use lanesweep_run::score::{
    CROSS_VALIDATED, CategoryScores, HeadwayFailures, MeanF1, ScoreInterval, equal_f1, f1, pareto_front, precision,
    recall,
};
use lanesweep_run::study::ParameterHistogram;
use lanesweep_stats::estimate::wilson;

/// Fraction of the scenarios that fail, over the headway: S with its interval, beside it every S'; a panel per model
/// and criterion. `None` with fewer than two headways that are the same for all scenarios.
pub(super) fn headways(of: &HeadwayFailures, scores: &CategoryScores, confidence: f64, data: &str) -> Option<Figure> {
    if of.headways.iter().filter_map(Headway::value).count() < 2 {
        return None;
    }
    let is_gap = of.headways.iter().any(|headway| matches!(headway, Headway::GapM(_)));
    let cells: Vec<(usize, Criterion)> =
        (0..of.models.len()).flat_map(|model| Criterion::ALL.map(|criterion| (model, criterion))).collect();
    let count = |variant: usize, (model, criterion): (usize, Criterion)| {
        move |at: usize| of.count((variant, at, model, criterion))
    };
    // One lane per scenario and headway.
    let share = |count: u64| 100.0 * count as f64 / scores.scenarios.max(1) as f64;
    let panel = |&cell: &(usize, Criterion)| {
        let series = |variant: usize| {
            let value = |(at, headway): (usize, &Headway)| {
                let failed = count(variant, cell)(at);
                let interval = wilson(failed as f64, scores.scenarios as f64, confidence);
                let is_few = variant == 0 && is_few(failed as f64);
                Some(Value {
                    label: if is_few { failed.to_string() } else { String::new() },
                    interval: (variant == 0).then_some((100.0 * interval.low, 100.0 * interval.high)),
                    is_few,
                    ..Value::from((headway.value()?, share(failed)))
                })
            };
            let mut values: Vec<Value> = of.headways.iter().enumerate().filter_map(value).collect();
            values.sort_by(|a, b| a.x.total_cmp(&b.x));
            // A number once is enough for neighbours that share it.
            let numbers: Vec<String> = values.iter().map(|value| value.label.clone()).collect();
            for (value, pair) in values.iter_mut().skip(1).zip(numbers.windows(2)) {
                if pair[0] == pair[1] {
                    value.label.clear();
                }
            }
            if variant == 0 {
                let look = Look { colour: INK, line_px: 1.8, marker_px: 3.0, ..Look::of(0, 1) };
                let marks = &[Mark::Band, Mark::Line, Mark::Points];
                return Series::new("S, as recorded", marks, values).with_look(look);
            }
            let look = Look { line_px: 1.2, ..Look::of(variant - 1, of.variants.len() - 1) };
            Series::new(legend_name(scores, variant), &[Mark::Line], values).with_look(look)
        };
        let shares = (0..of.variants.len()).flat_map(|variant| (0..of.headways.len()).map(count(variant, cell)));
        let (least, most) = shares.fold((u64::MAX, 0), |(low, high), count| (low.min(count), high.max(count)));
        let scale = if least > most / 3 { AxisScale::Linear } else { AxisScale::SquareRoot };
        Plot {
            heading: format!("{}, {}", of.models[cell.0].name(), cell.1.label()),
            x: PlotAxis::around(
                if is_gap { "initial gap in m" } else { "initial time headway in s" },
                AxisScale::Linear,
                of.headways.iter().filter_map(Headway::value).chain([0.0]).collect(),
            ),
            y: PlotAxis { scale, ..PlotAxis::new("failed scenarios in %") },
            series: (0..of.variants.len()).map(series).collect(),
            ..Plot::default()
        }
    };
    let all = 0..of.variants.len();
    let fails = |cell: &&(usize, Criterion)| {
        all.clone().any(|variant| (0..of.headways.len()).any(|at| count(variant, **cell)(at) > 0))
    };
    let empty = cells.iter().filter(|cell| !fails(cell));
    let empty = empty.map(|(model, criterion)| format!("{}, {}", of.models[*model].name(), criterion.label()));
    Some(Figure {
        caption: format!(
            "Black: share of the recorded scenarios in which the driver model fails the criterion; band: its {} % \
             interval over scenarios. Colours: the same scenarios, parameterized. Vertical axes by the square root from \
             0, or linear where all shares are large. Of equal numbers in a row the first is written.",
            100.0 * confidence
        ),
        plots: cells.iter().filter(fails).map(panel).collect(),
        columns: Criterion::ALL.len(),
        notes: ("Left out, because nothing fails:", empty.collect()),
        ..titled(scores, "failures against the headway", data)
    })
}

/// `FSM, TTC`.
fn cell_name((model, criterion): &(ModelId, Criterion)) -> String {
    format!("{}, {}", model.name(), criterion.label())
}

/// A figure of a category without plots.
fn titled(scores: &CategoryScores, title: &str, data: &str) -> Figure {
    Figure {
        title: format!("{}: {title}", scores.category.label()),
        subtitle: Some(format!("{} scenarios. {data}", scores.scenarios)),
        ..Figure::default()
    }
}

/// The driver models and criteria of a category.
fn cells(scores: &CategoryScores) -> Vec<(ModelId, Criterion)> {
    scores.models.iter().flat_map(|&model| Criterion::ALL.map(|criterion| (model, criterion))).collect()
}

fn ends(interval: Option<ScoreInterval>) -> Option<(f64, f64)> {
    interval.map(|interval| (interval.low, interval.high))
}

/// F1 of every parameterization with its interval, a row per driver model and criterion.
pub(super) fn f1_intervals(scores: &CategoryScores, confidence: f64, data: &str) -> Figure {
    let cells = cells(scores);
    let row = |cell: &(ModelId, Criterion)| DotRow {
        name: cell_name(cell),
        failing_scenarios: scores.failing_scenarios(cell.0, cell.1),
    };
    let rows: Vec<DotRow> = cells.iter().map(row).collect();
    let series = |variant: usize| {
        let value = |(row, (model, criterion)): (usize, &(ModelId, Criterion))| {
            let cell = &scores.cells[scores.index(variant, *model, *criterion)?];
            let interval = ends(cell.f1_interval);
            Some(Value { interval, ..Value::from((f1(&cell.counts)?, row as f64)) })
        };
        Series::new(legend_name(scores, variant), &[], cells.iter().enumerate().filter_map(value))
    };
    let (x, series) = (PlotAxis::exactly("F1", -0.02, 1.02), (1..scores.variants.len()).map(series).collect());
    Figure {
        caption: format!(
            "Marker: F1; further right is better; in each row in the order below. Line: its {} % interval over scenarios. \
             n: scenarios in which S fails; without a line they are too few for an interval. Without a marker: neither S \
             nor S' fails.",
            100.0 * confidence
        ),
        plots: dots(&rows, vec![Dots { x, series, ..Dots::default() }]),
        ..titled(scores, "F1 of parameterized against recorded scenarios", data)
    }
}

/// The radar chart of the paper: F1 per model and criterion (spokes), one polygon per parameterization. The line of a
/// parameterization is broken where its F1 is undefined (0/0): a number would be a false measurement.
pub(super) fn radar(scores: &CategoryScores, data: &str) -> Figure {
    let cells = cells(scores);
    let score = |variant: usize, &(model, criterion): &(ModelId, Criterion)| {
        scores.index(variant, model, criterion).and_then(|at| f1(&scores.cells[at].counts))
    };
    let variants = 1..scores.variants.len();
    let is_empty = |cell: &(ModelId, Criterion)| variants.clone().all(|variant| score(variant, cell).is_none());
    let name = |(at, cell): (usize, &(ModelId, Criterion))| {
        let (spoke, failing) = (cell_name(cell), scores.failing_scenarios(cell.0, cell.1));
        let words = match is_empty(cell) {
            true => format!("{spoke} (undefined)"),
            false => format!("{spoke}{}", few(failing)),
        };
        Name { at: at as f64, words, is_empty: is_empty(cell), ..Name::default() }
    };
    let series = |variant: usize| {
        let value = |(at, cell): (usize, &(ModelId, Criterion))| Value {
            is_few: is_few(scores.failing_scenarios(cell.0, cell.1) as f64),
            ..Value::from((at as f64, score(variant, cell).unwrap_or(f64::NAN)))
        };
        // Many values are equal, most often 1: lines of equal weight, markers that shrink.
        let look = Look { line_px: 1.4, ..Look::of(variant - 1, scores.variants.len() - 1) };
        let values = cells.iter().enumerate().map(value);
        Series::new(legend_name(scores, variant), &[Mark::Line, Mark::Points], values).with_look(look)
    };
    let rings = [0.2, 0.4, 0.6, 0.8, 1.0].map(|at| Name { at, words: format!("{at:.1}"), ..Name::default() });
    let plot = Plot {
        x: PlotAxis {
            names: cells.iter().enumerate().map(name).collect(),
            ..PlotAxis::exactly("", 0.0, cells.len() as f64)
        },
        y: PlotAxis { names: rings.to_vec(), ..PlotAxis::exactly("", 0.0, 1.0) },
        series: variants.clone().map(series).collect(),
        is_polar: true,
        ..Plot::default()
    };
    let gaps = variants.clone().filter_map(|variant| {
        let undefined = cells.iter().filter(|cell| score(variant, cell).is_none() && !is_empty(cell));
        let names: Vec<String> = undefined.map(cell_name).collect();
        (!names.is_empty()).then(|| format!("{}: {}", legend_name(scores, variant), names.join("; ")))
    });
    Figure {
        caption: "Radius: F1, 0 at the centre, 1 at the outer ring, without its interval.".to_owned(),
        plots: if cells.is_empty() { Vec::new() } else { vec![plot] },
        notes: ("Undefined F1 (0/0), where the line is broken:", gaps.collect()),
        ..titled(scores, "F1 as a radar, as de Gelder and Op den Camp draw it", data)
    }
}

/// Recall and precision of every parameterization, a panel per driver model and criterion, each around its values.
pub(super) fn recall_and_precision(scores: &CategoryScores, confidence: f64, data: &str) -> Figure {
    let panel = |&(model, criterion): &(ModelId, Criterion)| {
        let failing = scores.failing_scenarios(model, criterion);
        let value = |variant: usize| {
            let cell = &scores.cells[scores.index(variant, model, criterion)?];
            Some(Value {
                interval: ends(cell.precision_interval),
                across: ends(cell.recall_interval),
                is_few: is_few(failing as f64),
                ..Value::from((recall(&cell.counts)?, precision(&cell.counts)?))
            })
        };
        let values: Vec<Option<Value>> = (1..scores.variants.len()).map(value).collect();
        let lowest = values.iter().flatten().map(|value| value.x.min(value.y)).reduce(f64::min)?;
        let low = (10.0 * lowest - 0.5).floor().clamp(0.0, 9.0) / 10.0;
        let series = |(at, value): (usize, Option<Value>)| {
            let name = legend_name(scores, at + 1);
            let look = Look { line_px: 1.4, ..Look::of(at, scores.variants.len() - 1) };
            Series::new(name, &[Mark::Points, Mark::Intervals], value).with_look(look)
        };
        let step = if low < 0.55 { 2 } else { 1 };
        let equal = (1..10).filter(|tenth| tenth % step == 0).map(|tenth| f64::from(tenth) / 10.0);
        let equal = equal.filter_map(|f| {
            let run: Vec<(f64, f64)> = equal_f1(f).into_iter().filter(|(r, p)| r.min(*p) >= low).collect();
            let (label, attributes) = (f.to_string(), "class=\"equal-f1\"".to_owned());
            let runs = vec![run];
            let rule = Rule { runs, label, colour: GREY, width_px: 0.9, dash: "4,4", attributes, ..Rule::default() };
            (rule.runs[0].len() > 1).then_some(rule)
        });
        Some(Plot {
            heading: format!("{}, {}{}", model.name(), criterion.label(), few(failing)),
            x: PlotAxis::exactly("recall", low, 1.0),
            y: PlotAxis::exactly("precision", low, 1.0),
            rules: equal.collect(),
            series: values.into_iter().enumerate().map(series).collect(),
            ..Plot::default()
        })
    };
    let cells = cells(scores);
    let drawn: Vec<Option<Plot>> = cells.iter().map(panel).collect();
    let undefined = |(cell, plot): (&(ModelId, Criterion), &Option<Plot>)| {
        let counts = |variant: usize| scores.index(variant, cell.0, cell.1).map(|at| scores.cells[at].counts);
        let has_none = |variant: &usize| counts(*variant).is_none_or(|c| recall(&c).and(precision(&c)).is_none());
        let keys: Vec<&str> =
            (1..scores.variants.len()).filter(has_none).map(|variant| scores.variants[variant].as_str()).collect();
        let which = if plot.is_none() { "all".to_owned() } else { keys.join(", ") };
        (!keys.is_empty()).then(|| format!("{}: {which}", cell_name(cell)))
    };
    let undefined: Vec<String> = cells.iter().zip(&drawn).filter_map(undefined).collect();
    let undefined = Some(undefined.join("; ")).filter(|text| !text.is_empty());
    Figure {
        caption: format!(
            "Recall: share of the recorded failures that the parameterized scenarios show; precision: share of their \
             failures that were recorded, and undefined where S' never fails. Lines: {} % intervals over scenarios, cut \
             at the edge, none where too few scenarios fail. Dashed: equal F1. Each panel begins below its lowest value.",
            100.0 * confidence
        ),
        plots: drawn.into_iter().flatten().collect(),
        notes: ("Without a marker, because S or S' never fails:", undefined.into_iter().collect()),
        ..titled(scores, "recall and precision of S' against S", data)
    }
}

/// Text for a heading if there are few scenarios.
fn few(failing_scenarios: u64) -> String {
    let is_few = is_few(failing_scenarios as f64);
    if is_few { format!(" (n\u{a0}=\u{a0}{failing_scenarios})") } else { String::new() }
}

/// F1 against the number of parameters: the mean over the cells that every parameterization defines, over all criteria
/// and for each. Also the front of parameterizations that no other beats with at most as many parameters.
pub(super) fn f1_by_parameters(scores: &CategoryScores, means: &[MeanF1], confidence: f64, data: &str) -> Figure {
    // With the place of each among the means: a given or cross-validated variant has no number of parameters.
    let found = scores.variants.iter().skip(1).map(|key| Parameterization::find(scores.category, key)).enumerate();
    let ids: Vec<(usize, Parameterization)> = found.filter_map(|(at, id)| Some((at, id?))).collect();
    let most = ids.iter().map(|(_, id)| id.parameter_count()).max().unwrap_or(1) as f64;
    let panel = |mean: &MeanF1| {
        let is_few = is_few(mean.fewest_failing as f64);
        let of = |name: &str, look: Look| {
            let own = ids.iter().filter(|(_, id)| id.family.name() == name);
            let value = |(at, id): &(usize, Parameterization)| {
                let (value, interval) = mean.values[*at];
                let place = Value::from((id.parameter_count() as f64, value));
                Value { label: id.key.to_string(), is_few, interval: ends(interval), ..place }
            };
            Series::new(name, &[Mark::Points, Mark::Intervals], own.map(value)).with_look(look)
        };
        let points = ids.iter().map(|(at, id)| (id.parameter_count() as f64, mean.values[*at].0));
        let front = if is_few { Vec::new() } else { pareto_front(&points.collect::<Vec<_>>()) };
        // A step at each point: there is nothing between two whole numbers.
        let steps = front.windows(2).flat_map(|pair| [pair[0], (pair[1].0, pair[0].1)]).chain(front.last().copied());
        let look = Look { colour: GREY, dash: "4,4", line_px: 1.2, ..Look::of(0, 1) };
        let own = [
            ("kinematic", Look { colour: INK, symbol: Symbol::Disc, marker_px: 5.0, ..look }),
            ("SVD", Look { colour: "#d55e00", symbol: Symbol::Polygon(4, 0.5), marker_px: 3.2, ..look }),
        ];
        let front = Series::new("best with as many parameters or fewer", &[Mark::Line], steps).with_look(look);
        let name = match mean.criteria[..] {
            [criterion] => criterion.label(),
            _ => "all criteria",
        };
        Plot {
            heading: format!("{name}{}", if mean.values.is_empty() { String::new() } else { few(mean.fewest_failing) }),
            x: PlotAxis { is_count: true, ..PlotAxis::exactly("parameters beside the headway", 0.0, most + 1.0) },
            y: PlotAxis::exactly("mean F1", 0.0, 1.05),
            series: own.into_iter().map(|(name, look)| of(name, look)).chain([front]).collect(),
            ..Plot::default()
        }
    };
    let (drawn, empty): (Vec<&MeanF1>, Vec<&MeanF1>) = means.iter().partition(|mean| !mean.values.is_empty());
    let empty = empty.into_iter().map(|mean| mean.criteria.iter().map(|c| c.label()).collect::<Vec<_>>().join(", "));
    Figure {
        caption: format!(
            "Mean over the driver models (and criteria) whose F1 every parameterization defines; line: its {} % interval \
             over scenarios. Beside the markers stand the keys of the parameterizations, as in the figure of F1. The fewer \
             parameters, the fewer samples a density needs: of two that are equally good the simpler one is preferable. \
             n, if given: the smallest number of scenarios in which S fails, over the cells of the mean; no front is \
             drawn.",
            100.0 * confidence
        ),
        plots: drawn.into_iter().map(panel).collect(),
        notes: ("Left out, because no F1 is defined for all:", empty.collect()),
        ..titled(scores, "F1 against the number of parameters", data)
    }
}

/// The mean scenario between nine tenths of all, the scenarios along the first directions of a decomposition, and what
/// the directions leave unexplained.
pub(super) fn modes(category: Category, shapes: &[ModeShape], explained: &[f64], data: &str) -> Figure {
    let panel = |shape: &ModeShape| {
        let last = shape.mean.len().saturating_sub(1).max(1) as f64;
        let at = move |(k, v): (usize, &f64)| Value::from((k as f64 / last, *v));
        let line = |name: String, values: &[f64]| Series::new(name, &[Mark::Line], values.iter().enumerate().map(at));
        let mut mean = line("mean; area: the middle 90 % of the scenarios at each instant".to_owned(), &shape.mean);
        mean.marks.push(Mark::Band);
        for (value, [low, high]) in mean.values.iter_mut().zip(&shape.envelope) {
            value.interval = Some((*low, *high));
        }
        let along = shape.along.iter().enumerate();
        let moved =
            along.map(|(j, values)| line(format!("mean plus a standard deviation of coefficient {}", j + 1), values));
        let ends = shape.envelope.iter().flatten().chain(&shape.mean).chain(shape.along.iter().flatten());
        Plot {
            heading: shape.quantity.clone(),
            x: PlotAxis::exactly("share of the duration T", 0.0, 1.0),
            y: PlotAxis::around(&shape.unit, AxisScale::Linear, ends.copied().collect()),
            series: std::iter::once(mean).chain(moved).collect(),
            ..Plot::default()
        }
    };
    // Below a hundred-millionth the share is that of rounding.
    let rest = explained.iter().enumerate().map(|(k, share)| ((k + 1) as f64, 100.0 * (1.0 - share)));
    let rest: Vec<(f64, f64)> = rest.filter(|(_, rest)| *rest > 1e-6).collect();
    let residual = Plot {
        heading: "variance not explained".to_owned(),
        x: PlotAxis { is_count: true, ..PlotAxis::exactly("coefficients", 0.0, explained.len() as f64 + 1.0) },
        y: PlotAxis::around(
            "share in %",
            AxisScale::Logarithmic,
            rest.iter().map(|(_, rest)| *rest).chain([100.0]).collect(),
        ),
        series: vec![Series::new("", &[Mark::Line, Mark::Points], rest.iter().copied())],
        ..Plot::default()
    };
    Figure {
        title: format!("{}: what the decomposition keeps", category.label()),
        subtitle: Some(data.to_owned()),
        caption: "Lateral positions: 0 is the middle of the ego, positive is the target's side; where both sides are kept \
                  apart, the more frequent one is drawn. Variance: share of the scaled data's that the first coefficients \
                  together leave. A small share of the motions may decide the outcomes: see F1. The coefficients are \
                  correlated, so that one alone may lead out of the area."
            .to_owned(),
        plots: shapes.iter().map(panel).chain((!rest.is_empty()).then_some(residual)).collect(),
        columns: 2,
        ..Figure::default()
    }
}

/// The histograms of the parameters of mined scenarios.
pub(super) fn distributions(category: Category, histograms: &[ParameterHistogram], data: &str) -> Figure {
    let scenarios: u64 = histograms.first().map_or(0, |histogram| histogram.counts.iter().sum());
    let plot = |histogram: &ParameterHistogram| {
        let middle = |k: usize| histogram.low + (k as f64 + 0.5) * histogram.width;
        let values = histogram.counts.iter().enumerate().map(|(k, count)| (middle(k), *count as f64));
        Plot {
            heading: quantity(&histogram.name),
            x: PlotAxis::new(format!("{}, bins of {}", histogram.unit, number(histogram.width))),
            y: PlotAxis::new("scenarios"),
            series: vec![Series::new("", &[Mark::Bars(histogram.width)], values)],
            ..Plot::default()
        }
    };
    Figure {
        title: format!("{}: parameters of the mined scenarios", category.label()),
        subtitle: Some(format!("{scenarios} scenarios. {data}")),
        caption: "Scenarios that passed the filters; bins by the rule of Freedman and Diaconis, rounded.".to_owned(),
        plots: histograms.iter().map(plot).collect(),
        ..Figure::default()
    }
}

/// `2: constant acceleration, constant lateral speed`.
pub(super) fn legend_name(scores: &CategoryScores, variant: usize) -> String {
    variant_name(scores.category, &scores.variants[variant])
}

/// The same for a key.
pub(super) fn variant_name(category: Category, key: &str) -> String {
    let (base, suffix) = key.strip_suffix(CROSS_VALIDATED).map_or((key, ""), |base| (base, ", cross-validated"));
    let found = Parameterization::find(category, base);
    found.map_or(key.to_owned(), |id| format!("{key}: {}{suffix}", id.description()))
}
