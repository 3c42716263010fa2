//! Cells: rectangles whose colour or hatching shows their content.

use super::axis::Axes;
use super::svg::{Canvas, GRID, Paint, Position, WHITE};

const HATCH_GREY: &str = "#9a9a9a";
/// Overlap of neighbouring rows of cells, to avoid white seams.
const SEAM_PX: f64 = 0.6;

/// Hatching of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Hatch {
    /// None.
    #[default]
    None,
    /// White, rising.
    Rising,
    /// White, falling.
    Falling,
    /// Grey, on white.
    Grey,
    /// Grey, both ways.
    Crossed,
}

/// Look of a cell.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Fill {
    /// `#rrggbb`; empty: not painted.
    pub colour: String,
    /// 0 to 1; `None` is 1.
    pub opacity: Option<f64>,
    /// Lines over it.
    pub hatch: Hatch,
    /// Only the middle of the cell is filled.
    pub is_inset: bool,
}

/// A rectangle.
#[derive(Debug, Clone, PartialEq)]
pub struct FilledCell {
    /// Two opposite corners.
    pub corners: [(f64, f64); 2],
    /// Its look.
    pub fill: Fill,
    /// Tooltip in a browser.
    pub tip: String,
}

/// A colour scale from zero to a maximum, at the right of the plot.
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
    /// Legend for colours that represent numbers.
    pub bar: Option<ColourBar>,
}

impl Fill {
    /// Draws the whole rectangle or its middle, and the hatching.
    pub(super) fn draw(&self, canvas: &mut Canvas, (x1, y1): Position, (x2, y2): Position) {
        if !self.colour.is_empty() {
            let paint = Paint { opacity: self.opacity, ..Paint::fill(&self.colour) };
            if self.is_inset {
                let inner = |from: f64, to: f64| (from + 0.22 * (to - from), to - 0.22 * (to - from));
                let ((x1, x2), (y1, y2)) = (inner(x1, x2), inner(y1, y2));
                // In small cells the rim must not dominate the colour.
                let rim_px = (0.08 * (x2 - x1).abs().min((y2 - y1).abs())).min(0.8);
                canvas.rect((x1, y1), (x2, y2), Paint { stroke: Some((HATCH_GREY, rim_px)), ..paint });
            } else {
                canvas.rect((x1, y1.min(y2)), (x2, y1.max(y2) + SEAM_PX), paint);
            }
        }
    }

    /// The hatching lines, aligned to one pattern for the whole page.
    fn strokes(&self, (x1, y1): Position, (x2, y2): Position) -> Vec<Vec<Position>> {
        let ((x1, x2), (y1, y2)) = ((x1.min(x2), x1.max(x2)), (y1.min(y2), y1.max(y2)));
        let pitch_px = if self.hatch == Hatch::Grey { 12.0 } else { 7.0 };
        // Rising lines have x + y = c, falling ones x − y = c.
        let places = |low: f64, high: f64| {
            let (first, last) = ((low / pitch_px).ceil() as i64, (high / pitch_px).floor() as i64);
            (first..=last).map(|k| k as f64 * pitch_px)
        };
        let rising = places(x1 + y1, x2 + y2).map(|c| {
            let (from, to) = ((c - y2).max(x1), (c - y1).min(x2));
            vec![(from, c - from), (to, c - to)]
        });
        let falling = places(x1 - y2, x2 - y1).map(|c| {
            let (from, to) = ((c + y1).max(x1), (c + y2).min(x2));
            vec![(from, from - c), (to, to - c)]
        });
        match self.hatch {
            Hatch::None => Vec::new(),
            Hatch::Rising | Hatch::Grey => rising.collect(),
            Hatch::Falling => falling.collect(),
            Hatch::Crossed => rising.chain(falling).collect(),
        }
    }

    /// Draws a sample for the legend.
    pub(super) fn sample(&self, canvas: &mut Canvas, from: Position, to: Position) {
        self.draw(canvas, from, to);
        hatch(canvas, std::iter::once((self, from, to)));
        canvas.rect(from, to, Paint::line(GRID, 0.8));
    }
}

/// Draws the hatching of cells, one path per colour.
fn hatch<'a>(canvas: &mut Canvas, cells: impl Iterator<Item = (&'a Fill, Position, Position)> + Clone) {
    for (is_grey, paint) in [(false, Paint::line(WHITE, 1.4)), (true, Paint::line(HATCH_GREY, 0.8))] {
        let own = cells.clone().filter(|cell| matches!(cell.0.hatch, Hatch::Grey | Hatch::Crossed) == is_grey);
        let strokes: Vec<Vec<Position>> = own.flat_map(|(fill, from, to)| fill.strokes(from, to)).collect();
        if !strokes.is_empty() {
            canvas.group("class=\"hatch\"", "", |canvas| canvas.path(&strokes, false, paint));
        }
    }
}

impl Cells {
    pub(super) fn draw(&self, canvas: &mut Canvas, axes: &Axes) {
        let places = |cell: &FilledCell| (axes.at(cell.corners[0]), axes.at(cell.corners[1]));
        // Whole cells are drawn without anti-aliasing, to avoid white seams; the rims of small squares need it.
        for is_inset in [false, true] {
            let attributes = if is_inset { "class=\"inset\"" } else { "shape-rendering=\"crispEdges\"" };
            let mut own = self.cells.iter().filter(|cell| cell.fill.is_inset == is_inset).peekable();
            if own.peek().is_none() {
                continue;
            }
            canvas.group(attributes, "", |canvas| {
                for cell in own {
                    let (from, to) = places(cell);
                    let class = if is_inset { "class=\"cell few\"" } else { "class=\"cell\"" };
                    match cell.tip.as_str() {
                        "" => cell.fill.draw(canvas, from, to),
                        tip => canvas.group(class, tip, |canvas| cell.fill.draw(canvas, from, to)),
                    }
                }
            });
        }
        let places = self.cells.iter().map(|cell| {
            let (from, to) = places(cell);
            (&cell.fill, from, to)
        });
        hatch(canvas, places);
    }
}
