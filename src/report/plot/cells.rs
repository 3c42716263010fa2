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
    /// Where its first corner is in frames of equal length; `None`: not there. Empty: it stays.
    pub places: Vec<Option<(f64, f64)>>,
    /// Length of all frames together, s; then they begin again.
    pub seconds: f64,
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

impl FilledCell {
    /// Moves the group that is being drawn.
    fn moves(&self, canvas: &mut Canvas, axes: &Axes) {
        let (x0, y0) = axes.at(self.corners[0]);
        let place = |at: &Option<(f64, f64)>| {
            let (x, y) = at.map_or((x0, y0), |at| axes.at(at));
            format!("{:.1},{:.1}", x - x0, y - y0)
        };
        let mut element = |name: &str, rest: &str, values: Vec<String>| {
            let (seconds, values) = (self.seconds, values.join(";"));
            let repeat = format!("dur=\"{seconds:.2}s\" repeatCount=\"indefinite\" values=\"{values}\"");
            canvas.element(&format!("<{name} {rest} {repeat} />"));
        };
        if !self.places.is_empty() {
            let move_by = "attributeName=\"transform\" type=\"translate\"";
            element("animateTransform", move_by, self.places.iter().map(place).collect());
            let shown = self.places.iter().map(|at| u8::from(at.is_some()).to_string()).collect();
            element("animate", "attributeName=\"opacity\" calcMode=\"discrete\"", shown);
        }
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
                    tip => canvas.group("class=\"cell\"", tip, |canvas| {
                        cell.moves(canvas, axes);
                        cell.fill.draw(canvas, from, to);
                    }),
                }
            }
        });
    }
}
