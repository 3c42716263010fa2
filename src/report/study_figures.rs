//! The figures of a study: F1 with intervals and as the radar chart of the paper.

use super::plot::{
    Figure, GREY, Height, Look, Mark, Name, Plot, PlotAxis, Rule, Series, Value, is_few, name_height_px,
};
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_model::scenario::Category;
use lanesweep_model::scenario::parameterization::Parameterization;
use lanesweep_run::score::{CROSS_VALIDATED, CategoryScores, f1};

/// `FSM, TTC`.
fn cell_name((model, criterion): &(ModelId, Criterion)) -> String {
    format!("{}, {}", model.name(), criterion.label())
}

/// A figure of a category without plots.
fn titled(scores: &CategoryScores, title: &str, data: &str) -> Figure {
    Figure {
        title: format!("{}: {title}", scores.category.label()),
        subtitle: Some(format!("{} scenarios{}. {data}", scores.scenarios, validation(scores))),
        ..Figure::default()
    }
}

/// `, SVD cross-validated`, where it is.
pub(super) fn validation(scores: &CategoryScores) -> &'static str {
    if scores.is_cross_validated() { ", SVD cross-validated" } else { "" }
}

/// The driver models and criteria of a category.
fn cells(scores: &CategoryScores) -> Vec<(ModelId, Criterion)> {
    scores.models.iter().flat_map(|&model| Criterion::ALL.map(|criterion| (model, criterion))).collect()
}

/// F1 of every parameterization with its interval: a row per driver model and criterion; of a single driver a row per
/// parameterization.
pub(super) fn f1_intervals(scores: &CategoryScores, confidence: f64, data: &str) -> Figure {
    let (cells, judged) = (cells(scores), scores.judged());
    let failing = |cell: &(ModelId, Criterion)| scores.failing_scenarios(cell.0, cell.1);
    let note = |cell: &(ModelId, Criterion)| format!("n = {}", failing(cell));
    let value = |row: usize, variant: usize, cell: &(ModelId, Criterion)| {
        let of = &scores.cells[scores.index(variant, cell.0, cell.1)?];
        let (interval, is_few) = (of.f1_interval.map(|of| (of.low, of.high)), is_few(failing(cell) as f64));
        Some(Value { interval, is_few, ..Value::from((f1(&of.counts)?, row as f64)) })
    };
    let is_single = scores.models.len() == 1;
    let (rows, series): (Vec<(String, String)>, Vec<Series>) = if is_single {
        let rows = judged.iter().map(|variant| (legend_name(scores, *variant), String::new()));
        let series = cells.iter().map(|cell| {
            let values = judged.iter().enumerate().filter_map(|(row, variant)| value(row, *variant, cell));
            Series::new(format!("{} ({})", cell_name(cell), note(cell)), &[], values)
        });
        (rows.collect(), series.collect())
    } else {
        let rows = cells.iter().map(|cell| (cell_name(cell), note(cell)));
        let series = judged.iter().map(|variant| {
            let values = cells.iter().enumerate().filter_map(|(row, cell)| value(row, *variant, cell));
            Series::new(legend_name(scores, *variant), &[], values)
        });
        (rows.collect(), series.collect())
    };
    Figure {
        caption: format!(
            "Marker: F1; further right is better; in each row in the order below. Line: its {} % interval over scenarios. \
             n: scenarios in which S fails; without a line they are too few for an interval. Without a marker: neither S \
             nor S' fails.",
            100.0 * confidence
        ),
        plots: vec![dots(&rows, PlotAxis::new("F1", -0.02, 1.02), series)],
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
    let variants = scores.judged();
    let is_empty = |cell: &(ModelId, Criterion)| variants.iter().all(|variant| score(*variant, cell).is_none());
    let name = |(at, cell): (usize, &(ModelId, Criterion))| {
        let (spoke, failing) = (cell_name(cell), scores.failing_scenarios(cell.0, cell.1));
        let words = match is_empty(cell) {
            true => format!("{spoke} (undefined)"),
            false if is_few(failing as f64) => format!("{spoke} (n\u{a0}=\u{a0}{failing})"),
            false => spoke,
        };
        Name { at: at as f64, words, is_empty: is_empty(cell), ..Name::default() }
    };
    let series = |(place, &variant): (usize, &usize)| {
        let value = |(at, cell): (usize, &(ModelId, Criterion))| Value {
            is_few: is_few(scores.failing_scenarios(cell.0, cell.1) as f64),
            ..Value::from((at as f64, score(variant, cell).unwrap_or(f64::NAN)))
        };
        // Many values are equal, most often 1: lines of equal weight, markers that shrink.
        let look = Look { line_px: 1.4, ..Look::of(place, variants.len()) };
        let values = cells.iter().enumerate().map(value);
        Series::new(legend_name(scores, variant), &[Mark::Line, Mark::Points], values).with_look(look)
    };
    let rings = [0.2, 0.4, 0.6, 0.8, 1.0].map(|at| Name { at, words: format!("{at:.1}"), ..Name::default() });
    let plot = Plot {
        x: PlotAxis {
            names: cells.iter().enumerate().map(name).collect(),
            ..PlotAxis::new("", 0.0, cells.len() as f64)
        },
        y: PlotAxis { names: rings.to_vec(), ..PlotAxis::new("F1", 0.0, 1.0) },
        series: variants.iter().enumerate().map(series).collect(),
        is_polar: true,
        ..Plot::default()
    };
    let gaps = variants.iter().copied().filter_map(|variant| {
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

/// `2: constant acceleration, constant lateral speed`.
pub(super) fn legend_name(scores: &CategoryScores, variant: usize) -> String {
    variant_name(scores.category, &scores.variants[variant])
}

/// The same for a key. A decomposition says whether it has seen the scenarios that it replays.
pub(super) fn variant_name(category: Category, key: &str) -> String {
    let base = short_name(key);
    let Some(id) = Parameterization::find(category, base) else { return key.to_owned() };
    let is_seen = id.coefficients().is_some() && base == key;
    format!("{base}: {}{}", id.description(), if is_seen { ", in sample" } else { "" })
}

/// The key of the parameterization of a variant.
pub(super) fn short_name(key: &str) -> &str {
    key.strip_suffix(CROSS_VALIDATED).unwrap_or(key)
}

/// Height of a line, and of the space below a row, px.
const LINE_PX: f64 = 8.0;
const ROW_GAP_PX: f64 = 12.0;

/// A plot of rows with a name at the left and a note at the right. Values have the index of their row as y; an estimate is
/// at x, its intervals along it.
fn dots(rows: &[(String, String)], x: PlotAxis, series: Vec<Series>) -> Plot {
    let lines = series.len();
    let names_px = rows.iter().map(|(words, _)| name_height_px(words) + 6.0).fold(24.0, f64::max);
    let row_px = (lines as f64 * LINE_PX + ROW_GAP_PX).max(names_px);
    let height_px = rows.len() as f64 * row_px;
    let name = |(index, (words, note)): (usize, &(String, String))| Name {
        at: -(index as f64 * row_px),
        words: words.clone(),
        note: note.clone(),
        ..Name::default()
    };
    let line = |(line, series): (usize, Series)| {
        let look = series.look.unwrap_or_else(|| Look::of(line, lines));
        let value = |value: Value| {
            let y = -(value.y * row_px) - ROW_GAP_PX / 2.0 - (line as f64 + 0.5) * LINE_PX;
            Value { y, ..value }
        };
        Series {
            values: series.values.into_iter().map(value).collect(),
            marks: vec![Mark::Points, Mark::Intervals],
            look: Some(Look { line_px: 1.4, marker_px: 3.8, ..look }),
            ..series
        }
    };
    let separators = Rule {
        runs: (1..rows.len()).map(|row| [0.0, f64::MAX].map(|x| (x, -(row as f64 * row_px))).to_vec()).collect(),
        colour: GREY,
        width_px: 0.5,
        ..Rule::default()
    };
    Plot {
        x,
        y: PlotAxis { names: rows.iter().enumerate().map(name).collect(), ..PlotAxis::new("", -height_px, 0.0) },
        rules: vec![separators],
        series: series.into_iter().enumerate().map(line).collect(),
        height: Height::Px(height_px),
        ..Plot::default()
    }
}
