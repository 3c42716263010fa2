//! A sheet of maps: small multiples of one grid, a panel per combination of speeds, every cell in the look of its
//! kind, the boundary between kinds drawn.
//!
//! Kinds differ in lightness and, where two are equally light, in hatching: they can be told apart by colour-blind
//! readers and in grey print. What a page of three panels in a row shows stays readable at the width of a column.

use super::axis::Axis;
use super::drawing::{
    self, BORDER_PX, GREY, GRID, INK, NAME_BOLD, NOTE, TEXT_WIDTH_PX, Type, group, paragraph, path, path_data, rect,
    text,
};
use super::svg::{Canvas, Color, TextAnchor};
use crate::run::grid::{Grid, boundary, runs};

/// What the cells of one kind look like.
#[derive(Debug, Clone, PartialEq)]
pub struct Kind {
    /// Name in the key.
    pub name: String,
    fill: &'static str,
    hatch: Hatch,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Hatch {
    None,
    Rising,
    Falling,
}

/// A sheet.
pub struct MapSheet<'a> {
    /// Heading; wrapped when long.
    pub title: String,
    /// Line below the heading; wrapped when long.
    pub subtitle: String,
    /// The grid.
    pub grid: &'a Grid,
    /// Kinds of cells.
    pub kinds: Vec<Kind>,
    /// Kind of every cell, in the grid's order.
    pub cells: Vec<u8>,
    /// Lines at the foot.
    pub notes: Vec<String>,
}

const LABEL: Type = Type { size_px: 17, bold: false, colour: INK };
/// Space between panels: for the numbers of an axis, and for a panel's name.
const GUTTER_PX: (f64, f64) = (46.0, 62.0);
const HATCH_PX: f64 = 7.0;
/// Overlap of neighbouring rows; the boundary's line is wider.
const SEAM_PX: f64 = 0.6;

impl Kind {
    /// A cell in which nothing fails, and one in which it does.
    pub fn outcomes() -> Vec<Kind> {
        let kind = |name: &str, fill| Kind { name: name.to_owned(), fill, hatch: Hatch::None };
        vec![kind("pass", "#f7f1dc"), kind("fail", "#6f86ad")]
    }

    /// The four of a difference, in the order of [`crate::run::grid::Agreement::ALL`].
    pub fn agreements(first: &str, second: &str) -> Vec<Kind> {
        let kind = |name: String, fill, hatch| Kind { name, fill, hatch };
        vec![
            kind("both pass".to_owned(), "#f7f1dc", Hatch::None),
            kind("both fail".to_owned(), "#b9b9b9", Hatch::None),
            kind(format!("only {first} fails"), "#0072B2", Hatch::Rising),
            kind(format!("only {second} fails"), "#E08A00", Hatch::Falling),
        ]
    }
}

/// Where a panel is.
#[derive(Clone, Copy)]
struct Frame<'a> {
    x: &'a Axis,
    y: &'a Axis,
    across: &'a [f64],
    up: &'a [f64],
}

impl MapSheet<'_> {
    /// The sheet as a complete SVG document, 1000 px wide. The same sheet gives the same bytes.
    pub fn svg(&self) -> String {
        let (mut canvas, y) = drawing::page(&self.title, Some(&self.subtitle));
        let y = self.key(&mut canvas, y + 12.0);
        let label =
            format!("Upwards: {}. Across: {}.", self.grid.y().parameter.title(), self.grid.x().parameter.title());
        let mut top = paragraph(&mut canvas, (BORDER_PX, y + 8.0), &label, LABEL, TEXT_WIDTH_PX);
        let panels = self.grid.panels().len();
        let columns = match panels {
            0 | 1 => 1,
            2..=4 => 2,
            _ => 3,
        };
        let width_px = (TEXT_WIDTH_PX - GUTTER_PX.0 * columns as f64) / columns as f64;
        let height_px = if columns == 1 { 0.6 * width_px } else { 0.8 * width_px };
        let (across, up) = (self.grid.x().edges(), self.grid.y().edges());
        for panel in 0..panels {
            let column = panel % columns;
            let left = BORDER_PX + GUTTER_PX.0 + (width_px + GUTTER_PX.0) * column as f64;
            let upper = top + 34.0;
            let ends = |edges: &[f64]| (edges[0], edges[edges.len() - 1]);
            let x = Axis::exactly(ends(&across), (left, left + width_px));
            let y = Axis::exactly(ends(&up), (upper + height_px, upper));
            let name = self.panel_name(panel);
            for (k, line) in NAME_BOLD.wrap(&name, width_px).iter().take(1).enumerate() {
                let at = (left, upper - 9.0 + k as f64);
                text(&mut canvas, at, line, Type { size_px: 15, ..NAME_BOLD }, TextAnchor::Start);
            }
            self.panel(&mut canvas, panel, Frame { x: &x, y: &y, across: &across, up: &up });
            let most = if columns == 1 { 10 } else { 6 };
            y.draw_left(&mut canvas, (left, left + width_px), most, false);
            x.draw_below(&mut canvas, (upper, upper + height_px), most, false);
            rect(&mut canvas, (left, upper), (left + width_px, upper + height_px), Color::None, Some((GREY, 1.0)));
            if column + 1 == columns || panel + 1 == panels {
                top += height_px + GUTTER_PX.1;
            }
        }
        let bottom = drawing::notes(&mut canvas, "Notes:", &self.notes, top + 10.0);
        drawing::document(canvas, bottom)
    }

    fn panel_name(&self, panel: usize) -> String {
        let axes = self.grid.panel_axes().iter().zip(&self.grid.panels()[panel]);
        let word = |key: &str| match key.split_once("_speed") {
            Some((vehicle, _)) => vehicle.to_owned(),
            None => key.rsplit_once('_').map_or(key, |(name, _)| name).replace('_', " "),
        };
        let units: Vec<&str> = self.grid.panel_axes().iter().map(|a| a.parameter.unit).collect();
        let parts: Vec<String> = axes
            .enumerate()
            .map(|(at, (axis, value))| {
                // A unit stands once where all are the same.
                let unit = if units[at + 1..].contains(&units[at]) { "" } else { units[at] };
                format!("{} {value} {unit}", word(axis.parameter.key)).trim_end().to_owned()
            })
            .collect();
        parts.join(", ")
    }

    fn panel(&self, canvas: &mut Canvas, panel: usize, frame: Frame) {
        let Frame { x, y, across, up } = frame;
        let kind = |i: usize, j: usize| usize::from(self.cells[self.grid.cell(panel, i, j)]);
        group(canvas, "shape-rendering=\"crispEdges\"", None);
        let mut hatching = Vec::new();
        for (number, look) in self.kinds.iter().enumerate() {
            for j in 0..self.grid.y().len() {
                for (from, to) in runs(self.grid.x().len(), &|i| kind(i, j) == number) {
                    let (a, b) = ((x.at(across[from]), y.at(up[j])), (x.at(across[to]), y.at(up[j + 1])));
                    // A little lower than its row, so that no white seam parts it from the one below.
                    let lower = if j > 0 { a.1 + SEAM_PX } else { a.1 };
                    rect(canvas, (a.0, lower), b, Color::from(look.fill), None);
                    hatching.extend(strokes(look.hatch, a, b));
                }
            }
        }
        canvas.add(super::svg::Shape::GroupEnd);
        if !hatching.is_empty() {
            canvas.add(path(hatching.join(" "), None, Color::from("#ffffff"), 1.4, None));
        }
        let at = |(i, j): (usize, usize)| (x.at(across[i]), y.at(up[j]));
        let lines = boundary(self.grid, &kind);
        let lines: Vec<String> = lines.into_iter().map(|(a, b)| path_data(&[at(a), at(b)], false)).collect();
        if !lines.is_empty() {
            group(canvas, "class=\"boundary\" stroke-linecap=\"square\"", None);
            canvas.add(path(lines.join(" "), None, Color::from(INK), 1.8, None));
            canvas.add(super::svg::Shape::GroupEnd);
        }
    }

    /// The looks with their names and counts; returns the y below.
    fn key(&self, canvas: &mut Canvas, top: f64) -> f64 {
        let (mut x, mut y) = (BORDER_PX, top);
        for (number, kind) in self.kinds.iter().enumerate() {
            let count = self.cells.iter().filter(|c| usize::from(**c) == number).count();
            let words = format!("{}: {count} of {}", kind.name, self.cells.len());
            let width_px = 30.0 + LABEL.text_px(&words) + 26.0;
            if x > BORDER_PX && x + width_px > BORDER_PX + TEXT_WIDTH_PX {
                (x, y) = (BORDER_PX, y + 30.0);
            }
            let (a, b) = ((x, y + 20.0), (x + 22.0, y));
            rect(canvas, a, b, Color::from(kind.fill), Some((GRID, 0.8)));
            let hatching = strokes(kind.hatch, a, b);
            if !hatching.is_empty() {
                canvas.add(path(hatching.join(" "), None, Color::from("#ffffff"), 1.4, None));
            }
            text(canvas, (x + 30.0, y + 16.0), &words, LABEL, TextAnchor::Start);
            x += width_px;
        }
        let y = y + 28.0;
        paragraph(
            canvas,
            (BORDER_PX, y),
            "Black lines: the boundary, between cells of different kinds.",
            NOTE,
            TEXT_WIDTH_PX,
        )
    }
}

/// Slanted lines inside a rectangle, on one pattern for the whole page.
fn strokes(hatch: Hatch, (x1, y1): (f64, f64), (x2, y2): (f64, f64)) -> Vec<String> {
    let ((x1, x2), (y1, y2)) = ((x1.min(x2), x1.max(x2)), (y1.min(y2), y1.max(y2)));
    // Rising lines have x + y = c, falling ones x − y = c.
    let (low, high) = match hatch {
        Hatch::None => return Vec::new(),
        Hatch::Rising => (x1 + y1, x2 + y2),
        Hatch::Falling => (x1 - y2, x2 - y1),
    };
    let (first, last) = ((low / HATCH_PX).ceil() as i64, (high / HATCH_PX).floor() as i64);
    let line = |k: i64| {
        let c = k as f64 * HATCH_PX;
        match hatch {
            Hatch::Rising => {
                let (from, to) = ((c - y2).max(x1), (c - y1).min(x2));
                path_data(&[(from, c - from), (to, c - to)], false)
            }
            _ => {
                let (from, to) = ((c + y1).max(x1), (c + y2).min(x2));
                path_data(&[(from, from - c), (to, to - c)], false)
            }
        }
    };
    (first..=last).map(line).collect()
}
