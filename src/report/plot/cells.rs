//! Cells: rectangles whose flat colour shows their content.

use super::axis::Axes;
use super::svg::{Canvas, GRID, Paint, Position};

/// Overlap of neighbouring rows of cells, to avoid white seams.
const SEAM_PX: f64 = 0.6;

/// Look of a cell.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Fill {
    /// `#rrggbb`; empty: not painted.
    pub colour: String,
    /// 0 to 1; `None` is 1.
    pub opacity: Option<f64>,
}

/// A rectangle.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FilledCell {
    /// Two opposite corners.
    pub corners: [(f64, f64); 2],
    /// Its look.
    pub fill: Fill,
    /// Tooltip in a browser.
    pub tip: String,
}

/// A colour scale from zero to a maximum, at the right of the plots.
#[derive(Debug, Clone, Copy)]
pub struct ColourBar {
    /// Quantity of the colours.
    pub label: &'static str,
    /// The maximum.
    pub largest: f64,
    /// Colour of a position between 0 and 1.
    pub colour: fn(f64) -> String,
}

/// Rectangles behind everything else.
#[derive(Debug, Clone, Default)]
pub struct Cells {
    /// The rectangles.
    pub cells: Vec<FilledCell>,
    /// Legend: names and their looks.
    pub key: Vec<(String, Fill)>,
}

impl Fill {
    fn draw(&self, canvas: &mut Canvas, (x1, y1): Position, (x2, y2): Position) {
        if !self.colour.is_empty() {
            let paint = Paint { opacity: self.opacity, ..Paint::fill(&self.colour) };
            canvas.rect((x1, y1.min(y2)), (x2, y1.max(y2) + SEAM_PX), paint);
        }
    }

    /// Draws a sample for the legend.
    pub(super) fn sample(&self, canvas: &mut Canvas, from: Position, to: Position) {
        self.draw(canvas, from, to);
        canvas.rect(from, to, Paint::line(GRID, 0.8));
    }
}

impl Cells {
    /// Draws the cells without anti-aliasing, to avoid white seams.
    pub(super) fn draw(&self, canvas: &mut Canvas, axes: &Axes) {
        canvas.group("shape-rendering=\"crispEdges\"", "", |canvas| {
            for cell in &self.cells {
                let (from, to) = (axes.at(cell.corners[0]), axes.at(cell.corners[1]));
                match cell.tip.as_str() {
                    "" => cell.fill.draw(canvas, from, to),
                    tip => canvas.group("class=\"cell\"", tip, |canvas| cell.fill.draw(canvas, from, to)),
                }
            }
        });
    }
}
