//! Dot plots: estimates with their intervals, a row of close lines per quantity, a line per series, in one panel or in
//! several over the same rows.

use super::plot::{Ends, GREY, Height, Look, Mark, Name, Plot, PlotAxis, Rule, Series, Value, is_few};

/// Height of a line, and of the space below a row, px.
const LINE_PX: f64 = 8.0;
const ROW_GAP_PX: f64 = 12.0;

/// A row: its name, and the number of scenarios in which S fails.
pub(super) struct DotRow {
    pub name: String,
    pub failing_scenarios: u64,
}

/// One panel.
#[derive(Default)]
pub(super) struct Dots {
    pub heading: String,
    /// The axis of the estimates.
    pub x: PlotAxis,
    /// Values at which a line runs through all rows, and its dashes.
    pub marked: Vec<(f64, &'static str)>,
    /// Names and values, the index of the row as y. An estimate is at x, its intervals along it.
    pub series: Vec<Series>,
}

/// The panels as plots. A row with few failing scenarios has hollow markers and its number at the right.
pub(super) fn dots(rows: &[DotRow], panels: Vec<Dots>) -> Vec<Plot> {
    let lines = panels.iter().map(|panel| panel.series.len()).max().unwrap_or(0);
    let row_px = (lines as f64 * LINE_PX + ROW_GAP_PX).max(24.0);
    let height_px = rows.len() as f64 * row_px;
    let count = panels.len();
    let plot = |(at, panel): (usize, Dots)| {
        let name = |(index, row): (usize, &DotRow)| Name {
            at: -(index as f64 * row_px),
            words: if at == 0 { row.name.clone() } else { String::new() },
            note: if at + 1 == count { format!("n = {}", row.failing_scenarios) } else { String::new() },
            ..Name::default()
        };
        let line = |(line, series): (usize, Series)| {
            let look = series.look.unwrap_or_else(|| Look::of(line, lines));
            let value = |value: Value| {
                let row = rows.get(value.y as usize);
                let is_few = row.is_some_and(|row| is_few(row.failing_scenarios as f64));
                let y = -(value.y * row_px) - ROW_GAP_PX / 2.0 - (line as f64 + 0.5) * LINE_PX;
                Value { y, is_few, ..value }
            };
            Series {
                values: series.values.into_iter().map(value).collect(),
                marks: vec![Mark::Points, Mark::Intervals],
                look: Some(Look { line_px: 1.4, marker_px: 3.8, ..look }),
                is_sideways: true,
                ..series
            }
        };
        let separators = Rule {
            runs: (1..rows.len()).map(|row| [0.0, f64::MAX].map(|x| (x, -(row as f64 * row_px))).to_vec()).collect(),
            colour: GREY,
            width_px: 0.5,
            ..Rule::default()
        };
        let marked = panel.marked.iter().map(|&(x, dash)| {
            let runs = vec![vec![(x, -height_px), (x, 0.0)]];
            Rule { runs, colour: GREY, width_px: 1.2, dash, ..Rule::default() }
        });
        let ends = Ends::Exactly(-height_px, 0.0);
        Plot {
            heading: panel.heading,
            x: panel.x,
            y: PlotAxis { names: rows.iter().enumerate().map(name).collect(), ends, ..PlotAxis::default() },
            rules: std::iter::once(separators).chain(marked).collect(),
            series: panel.series.into_iter().enumerate().map(line).collect(),
            height: Height::Px(height_px),
            ..Plot::default()
        }
    };
    panels.into_iter().enumerate().map(plot).collect()
}
