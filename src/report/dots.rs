//! Dot plots: estimates with their intervals, a row of close lines per name, a line per series.

use super::plot::{GREY, Height, Look, Mark, Name, Plot, PlotAxis, Rule, Series, Value, name_height_px};

/// Height of a line, and of the space below a row, px.
const LINE_PX: f64 = 8.0;
const ROW_GAP_PX: f64 = 12.0;

/// A plot of rows with a name at the left and a note at the right. Values have the index of their row as y; an estimate is
/// at x, its intervals along it.
pub(super) fn dots(rows: &[(String, String)], x: PlotAxis, series: Vec<Series>) -> Plot {
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
