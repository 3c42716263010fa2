//! The figure of one case: everything that its driver models see and do, over one time axis.
//!
//! The sheet has the width of a column of a paper (two for a cut-out, whose vehicles stand side by side) and type that
//! stays readable at that width. Series differ in colour, dashes and line width, marks in their shapes.

use super::axis::{Axis, number};
use super::drawing::{
    self, GREY, INK, Look, Type, area, group, line, on_circle, paragraph, path, path_data, rect, text,
};
use super::svg::{Canvas, Color, Shape, TextAnchor};
pub use super::trace_panels::TraceSeries;
use super::trace_panels::{Curve, Level, Owner, Panel, PanelMark, Reach, Shown};
use crate::engine::Mark;

/// Lanes of one case, or of variants of one, on one sheet.
#[derive(Debug, Clone)]
pub struct TraceFigure<'a> {
    /// Heading; wrapped when long.
    pub title: String,
    /// Line below the heading; wrapped when long.
    pub subtitle: Option<String>,
    /// The lanes.
    pub series: Vec<TraceSeries<'a>>,
    /// Where time ends, s; otherwise 2 s after the last change.
    pub until_s: Option<f64>,
}

/// Width of a column of the sheet, px: type of 13 px becomes 6 pt at the 252 pt of a paper's column.
const COLUMN_PX: f64 = 540.0;
const MARGIN_PX: f64 = 14.0;
/// From the column's edge to the plot: room for numbers.
const LEFT_PX: f64 = 58.0;
const TITLE: Type = Type { size_px: 17, bold: true, colour: INK };
const SUBTITLE: Type = Type { size_px: 13, bold: false, colour: INK };
const NAME: Type = Type { size_px: 14, bold: true, colour: INK };
const HINT: Type = Type { size_px: 13, bold: false, colour: GREY };
const CELL: Type = Type { size_px: 13, bold: false, colour: INK };
/// Width of a column of the table of marks, and of the line sample before a name.
const CELL_PX: f64 = 76.0;
const SAMPLE_PX: f64 = 38.0;
const MARK_PX: f64 = 5.0;

impl TraceFigure<'_> {
    /// The figure as a complete SVG document, 540 px wide (1080 px for a cut-out) and as high as its panels need.
    ///
    /// A note says so where the lanes go on after the last time that is shown. TTC is shown up to ten times
    /// its threshold, BTN up to 2.5 times. Texts are XML-escaped; control characters become U+FFFD. The same figure
    /// gives the same bytes. Nothing fails: without lanes only the texts remain.
    pub fn svg(&self) -> String {
        let shown = Shown::of(&self.series, self.until_s);
        let columns = shown.columns();
        let sheet = Sheet { width_px: COLUMN_PX * columns.len() as f64, looks: self.looks() };
        let mut canvas = drawing::sheet(sheet.width_px);
        let across_px = sheet.width_px - 2.0 * MARGIN_PX;
        let mut y = paragraph(&mut canvas, (MARGIN_PX, 14.0), &self.title, TITLE, across_px);
        if let Some(subtitle) = &self.subtitle {
            y = paragraph(&mut canvas, (MARGIN_PX, y + 3.0), subtitle, SUBTITLE, across_px);
        }
        if self.series.iter().all(|s| s.trace.steps.is_empty()) {
            y = paragraph(&mut canvas, (MARGIN_PX, y + 8.0), "There is no lane to draw.", CELL, across_px);
            return drawing::document(canvas, y);
        }
        y = self.table(&mut canvas, &sheet, y + 8.0) + 6.0;
        let lines = self.mark_lines();
        let mut bottom = y;
        for (k, panels) in columns.iter().enumerate() {
            let left = COLUMN_PX * k as f64;
            let time = time_axis(shown.until_s, (left + LEFT_PX, left + COLUMN_PX - MARGIN_PX));
            bottom = bottom.max(sheet.column(&mut canvas, panels, &time, left, y, &lines));
        }
        y = bottom + 6.0;
        for note in self.notes(&shown, &columns) {
            y = paragraph(&mut canvas, (MARGIN_PX, y), &note, CELL, across_px) + 3.0;
        }
        drawing::document(canvas, y)
    }

    fn looks(&self) -> Vec<Look> {
        let count = self.series.len();
        let depth = |k: usize| if count > 1 { k as f64 / (count - 1) as f64 } else { 0.5 };
        (0..count).map(|k| Look { line_px: 2.9 - 1.4 * depth(k), ..Look::of(k, count) }).collect()
    }

    /// Names, marks and worst values of the series; returns the y below.
    fn table(&self, canvas: &mut Canvas, sheet: &Sheet, top: f64) -> f64 {
        let columns = [Mark::Reaction.label(), Mark::Braking.label(), Mark::Contact.label(), "min TTC", "max BTN"];
        let name_left = MARGIN_PX + SAMPLE_PX + 8.0;
        let longest_px = self.series.iter().map(|s| CELL.text_px(&s.name)).fold(0.0, f64::max);
        let most = sheet.width_px - MARGIN_PX - CELL_PX * columns.len() as f64;
        let at = |column: usize| most.min(name_left + longest_px + 16.0) + CELL_PX * column as f64;
        let mut y = top + CELL.line_px();
        for (column, head) in columns.iter().enumerate() {
            text(canvas, (at(column), top + f64::from(CELL.size_px)), head, HINT, TextAnchor::Start);
        }
        for (k, series) in self.series.iter().enumerate() {
            let look = &sheet.looks[k];
            let (baseline, middle) = (y + f64::from(CELL.size_px), y + CELL.line_px() / 2.0);
            group(canvas, "class=\"legend\"", None);
            canvas.add(look.line(path_data(&[(MARGIN_PX, middle), (MARGIN_PX + SAMPLE_PX, middle)], false)));
            canvas.add(Shape::GroupEnd);
            let below = paragraph(canvas, (name_left, y), &series.name, CELL, at(0) - name_left - 8.0);
            for (column, mark) in Mark::ALL.into_iter().enumerate() {
                let Some(step) = series.trace.step_of(mark) else {
                    text(canvas, (at(column), baseline), "never", HINT, TextAnchor::Start);
                    continue;
                };
                symbol(canvas, mark, (at(column) + MARK_PX, middle), look);
                let time = format!("{} s", thousandths(series.trace.time_s(step)));
                text(canvas, (at(column) + 2.0 * MARK_PX + 5.0, baseline), &time, CELL, TextAnchor::Start);
            }
            let outcome = &series.trace.outcome;
            text(canvas, (at(3), baseline), &worst(outcome.min_ttc, " s"), CELL, TextAnchor::Start);
            text(canvas, (at(4), baseline), &worst(outcome.max_btn, ""), CELL, TextAnchor::Start);
            y = below.max(y + CELL.line_px()) + 3.0;
        }
        y
    }

    /// Where lines run through all panels: for a single lane only, more would be a thicket.
    fn mark_lines(&self) -> Vec<(Mark, f64)> {
        let [series] = &self.series[..] else { return Vec::new() };
        let time = |mark: Mark| Some((mark, series.trace.time_s(series.trace.step_of(mark)?)));
        Mark::ALL.into_iter().filter_map(time).collect()
    }

    fn notes(&self, shown: &Shown, columns: &[Vec<Panel>]) -> Vec<String> {
        let mut notes = Vec::new();
        if shown.has_unjudged() {
            notes.push("Thin in gap, TTC, BTN: not looked at by the criteria.".to_owned());
        }
        let is_cut = |panel: &Panel| {
            let Reach::Exactly(_, top) = panel.reach else { return false };
            panel.curves.iter().flat_map(|curve| &curve.points).any(|point| point.1 >= top)
        };
        if columns.iter().flatten().any(is_cut) {
            notes.push("A curve that ends at the top edge goes on above it.".to_owned());
        }
        notes.push("Long dashes: edges of a lane 3.5 m wide.".to_owned());
        let end_s = self.series.iter().filter_map(|s| Some(s.trace.steps.last()?.time_s)).fold(0.0, f64::max);
        if end_s > shown.until_s {
            let (until, end) = (thousandths(shown.until_s), thousandths(end_s));
            notes.push(format!("The lanes go on after {until} s, the longest to {end} s."));
        }
        notes
    }
}

struct Sheet {
    width_px: f64,
    looks: Vec<Look>,
}

impl Sheet {
    /// One column of panels; returns the y below.
    fn column(
        &self,
        canvas: &mut Canvas,
        panels: &[Panel],
        time: &Axis,
        left: f64,
        top: f64,
        lines: &[(Mark, f64)],
    ) -> f64 {
        let across = (left + LEFT_PX, left + COLUMN_PX - MARGIN_PX);
        let labels = place_labels(lines, time, across);
        let rows = labels.iter().map(|label| label.row + 1).max().unwrap_or(0);
        let (mut y, mut bottom) = (top, top);
        for (k, panel) in panels.iter().enumerate() {
            let title_bottom = y + NAME.line_px() + 3.0;
            text(canvas, (across.0, title_bottom - 6.0), panel.title, NAME, TextAnchor::Start);
            text(canvas, (across.1, title_bottom - 6.0), &panel.hint, HINT, TextAnchor::End);
            // The labels of the lines through all panels stand above the first plot.
            let above = if k == 0 { rows as f64 * CELL.line_px() } else { 0.0 };
            let down = (title_bottom + above, title_bottom + above + panel.height_px);
            // In pieces, so that no title is crossed.
            for label in &labels {
                let from = if k == 0 { title_bottom + label.row as f64 * CELL.line_px() + 2.0 } else { down.0 };
                group(canvas, &format!("class=\"mark-line {}\"", label.mark.label()), None);
                let d = path_data(&[(label.x, from), (label.x, down.1)], false);
                canvas.add(path(d, None, Color::from(INK), 1.0, dash_of(label.mark)));
                canvas.add(Shape::GroupEnd);
            }
            for label in labels.iter().filter(|_| k == 0) {
                let row_bottom = title_bottom + (label.row + 1) as f64 * CELL.line_px();
                // On white: lines of other labels pass behind.
                let (from, to) = label.text_px;
                let white = Color::from("#ffffff");
                rect(
                    canvas,
                    (from - 1.0, row_bottom - CELL.line_px() + 1.0),
                    (to + 1.0, row_bottom - 1.0),
                    white,
                    None,
                );
                let x = if label.is_right { from } else { to };
                let anchor = if label.is_right { TextAnchor::Start } else { TextAnchor::End };
                text(canvas, (x, row_bottom - 4.0), &label.words, CELL, anchor);
            }
            self.panel(canvas, panel, time, across, down, k + 1 == panels.len());
            bottom = down.1;
            y = down.1 + 5.0;
        }
        text(canvas, (across.1, bottom + 36.0), "Time (s)", NAME, TextAnchor::End);
        bottom + 40.0
    }

    fn panel(
        &self,
        canvas: &mut Canvas,
        panel: &Panel,
        time: &Axis,
        across: (f64, f64),
        down: (f64, f64),
        is_last: bool,
    ) {
        let value = Axis::exactly(panel.reach.ends(), (down.1, down.0));
        let rows = if panel.height_px < 70.0 { 2 } else { 5 };
        value.draw_left(canvas, across, rows, true);
        let time_ticks = time.ticks(8);
        for tick in &time_ticks {
            line(canvas, (tick.at_px, down.0), (tick.at_px, down.1), drawing::GRID, 0.8);
        }
        if is_last {
            time.draw_below(canvas, down, 8, false);
        }
        for level in &panel.levels {
            let y = value.at(level.1);
            let (dash, width_px, colour) = match level.0 {
                Level::Zero => (None, 1.1, GREY),
                Level::Threshold => (Some("2,3"), 1.4, INK),
                Level::LaneEdge => (Some("14,6"), 1.1, GREY),
                Level::EgoSide => (None, 2.4, GREY),
            };
            let d = path_data(&[(across.0, y), (across.1, y)], false);
            canvas.add(path(d, None, Color::from(colour), width_px, dash.map(str::to_owned)));
        }
        for band in &panel.bands {
            let upper = band.points.iter().map(|p| (time.at(p.0), value.at(p.2)));
            let lower = band.points.iter().rev().map(|p| (time.at(p.0), value.at(p.1)));
            area(canvas, &upper.chain(lower).collect::<Vec<_>>(), self.colour(band.owner), 0.18);
        }
        for curve in &panel.curves {
            group(canvas, "class=\"series\"", None);
            self.curve(canvas, curve, time, &value);
            canvas.add(Shape::GroupEnd);
        }
        group(canvas, &format!("class=\"frame\" data-panel=\"{}\"", panel.title), None);
        rect(canvas, (across.0, down.0), (across.1, down.1), Color::None, Some((GREY, 1.0)));
        canvas.add(Shape::GroupEnd);
        for mark in &panel.marks {
            self.mark(canvas, mark, (time.at(mark.at.0), value.at(mark.at.1)));
        }
    }

    fn colour(&self, owner: Owner) -> Color {
        match owner {
            Owner::Series(k) => self.looks[k].colour.clone(),
            Owner::All => Color::from(GREY),
        }
    }

    fn curve(&self, canvas: &mut Canvas, curve: &Curve, time: &Axis, value: &Axis) {
        let places: Vec<(f64, f64)> = curve.points.iter().map(|p| (time.at(p.0), value.at(p.1))).collect();
        let dash = match curve.owner {
            Owner::Series(k) => self.looks[k].dash.clone(),
            Owner::All => None,
        };
        let line_px = match curve.owner {
            Owner::All => 2.0,
            Owner::Series(_) if curve.is_thin => 1.0,
            Owner::Series(k) => self.looks[k].line_px,
        };
        if let [(cx, cy)] = places[..] {
            let (fill, r) = (self.colour(curve.owner), 1.0 + line_px / 2.0);
            let dot = Shape::Circle { cx, cy, r, fill, stroke: None, stroke_width: None };
            canvas.add(dot);
        } else if places.len() > 1 {
            let d = path_data(&without_inner_points(&places), false);
            canvas.add(path(d, None, self.colour(curve.owner), line_px, dash));
        }
    }

    fn mark(&self, canvas: &mut Canvas, mark: &PanelMark, at: (f64, f64)) {
        group(canvas, &format!("class=\"mark {}\" data-t=\"{}\"", mark.mark.label(), mark.at.0), None);
        symbol(canvas, mark.mark, at, &self.looks[mark.series]);
        canvas.add(Shape::GroupEnd);
    }
}

/// From 0 to the end; a lane of one step has an axis too.
fn time_axis(until_s: f64, across: (f64, f64)) -> Axis {
    Axis::exactly((0.0, if until_s > 0.0 { until_s } else { 1.0 }), across)
}

/// Told apart by shape: circle, triangle, cross.
fn symbol(canvas: &mut Canvas, mark: Mark, (x, y): (f64, f64), look: &Look) {
    let (colour, white) = (look.colour.clone(), Color::from("#ffffff"));
    match mark {
        Mark::Reaction => {
            let (fill, stroke, stroke_width) = (white, Some(colour), Some(2.0));
            let r = MARK_PX - 1.0;
            canvas.add(Shape::Circle { cx: x, cy: y, r, fill, stroke, stroke_width });
        }
        Mark::Braking => {
            let corners: Vec<_> = [1.0, 3.0, 5.0]
                .map(|sixth| on_circle((x, y - 0.5), MARK_PX + 1.5, sixth * std::f64::consts::FRAC_PI_3))
                .to_vec();
            canvas.add(path(path_data(&corners, true), Some(colour), white, 1.0, None));
        }
        Mark::Contact => {
            for (stroke, width_px) in [(white, 5.0), (colour, 2.6)] {
                for (dx, dy) in [(MARK_PX, MARK_PX), (MARK_PX, -MARK_PX)] {
                    let d = path_data(&[(x - dx, y - dy), (x + dx, y + dy)], false);
                    canvas.add(path(d, None, stroke.clone(), width_px, None));
                }
            }
        }
    }
}

fn dash_of(mark: Mark) -> Option<String> {
    match mark {
        Mark::Reaction => Some("2,3".to_owned()),
        Mark::Braking => Some("7,3".to_owned()),
        Mark::Contact => None,
    }
}

/// The label of a line through all panels.
struct Label {
    mark: Mark,
    words: String,
    x: f64,
    /// The text, right or left of its line, from and to.
    text_px: (f64, f64),
    is_right: bool,
    row: usize,
}

/// Labels above a column, in as many rows as they need not to touch; towards the middle of the plot.
fn place_labels(lines: &[(Mark, f64)], time: &Axis, across: (f64, f64)) -> Vec<Label> {
    let mut taken: Vec<Vec<(f64, f64)>> = Vec::new();
    let mut labels = Vec::new();
    for &(mark, at_s) in lines {
        let words = format!("{} {} s", mark.label(), thousandths(at_s));
        let (x, width) = (time.at(at_s), CELL.text_px(&words));
        let is_right = x + 4.0 + width <= across.1;
        let (from, to) = if is_right { (x + 4.0, x + 4.0 + width) } else { (x - 4.0 - width, x - 4.0) };
        let free = |row: &Vec<(f64, f64)>| row.iter().all(|&(a, b)| to + 6.0 < a || from - 6.0 > b);
        let row = taken.iter().position(free).unwrap_or(taken.len());
        if row == taken.len() {
            taken.push(Vec::new());
        }
        taken[row].push((from, to));
        labels.push(Label { mark, words, x, text_px: (from, to), is_right, row });
    }
    labels
}

/// Without points between neighbours on whose line they lie: a lane has thousands of steps.
fn without_inner_points(places: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut kept: Vec<(f64, f64)> = Vec::new();
    for (k, &(x, y)) in places.iter().enumerate() {
        let is_inner = match (kept.last(), places.get(k + 1)) {
            (Some(&(x0, y0)), Some(&(x1, y1))) if x1 > x0 => (y0 + (y1 - y0) * (x - x0) / (x1 - x0) - y).abs() < 0.004,
            _ => false,
        };
        if !is_inner {
            kept.push((x, y));
        }
    }
    kept
}

fn thousandths(value: f64) -> String {
    ((value * 1e3).round() / 1e3).to_string()
}

fn worst(value: f64, unit: &str) -> String {
    if value.is_finite() { format!("{}{unit}", number(value)) } else { "∞".to_owned() }
}
