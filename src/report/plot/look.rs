//! The look of a series: colour, dash, marker.

use std::f64::consts::TAU;

use super::axis::on_circle;
use super::svg::{Canvas, Paint, Position, WHITE};

/// Okabe & Ito (2008), chosen for colour-blind readers; without the yellow, which is too pale as a line on white.
const COLOURS: [&str; 7] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#000000", "#e69f00", "#56b4e9"];
/// Line styles (SVG dash arrays); the empty one is solid.
const DASHES: [&str; 7] = ["", "10,4", "3,3", "12,3,3,3", "18,5", "7,3,2,3,2,3", "5,6"];
const SYMBOLS: [Symbol; 7] = [
    Symbol::Disc,
    Symbol::Polygon(4, 0.5),
    Symbol::Polygon(3, 0.0),
    Symbol::Polygon(4, 0.0),
    Symbol::Polygon(3, 0.5),
    Symbol::Polygon(5, 0.0),
    Symbol::Polygon(6, 0.0),
];
/// Shape of a marker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Symbol {
    /// A filled circle.
    Disc,
    /// An empty circle.
    Ring,
    /// Two strokes.
    Cross,
    /// A polygon: its number of corners, and the position of the first in steps clockwise from the top.
    Polygon(u32, f64),
}

/// How a series looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    /// `#rrggbb`.
    pub colour: &'static str,
    /// Lengths of dashes and gaps, px; empty: solid.
    pub dash: &'static str,
    /// Width of the line.
    pub line_px: f64,
    /// Marker.
    pub symbol: Symbol,
    /// Radius of the marker.
    pub marker_px: f64,
    /// The marker is an outline.
    pub is_hollow: bool,
}

impl Look {
    /// Colour, dash and marker cycle together; from the eighth series on dash and marker are shifted, so that no pair repeats
    /// before 49 series. Lines go from thick to thin and markers from large to small, so that earlier ones stay
    /// visible.
    pub(crate) fn of(index: usize, count: usize) -> Self {
        let depth = if count > 1 { index as f64 / (count - 1) as f64 } else { 0.5 };
        Self {
            colour: COLOURS[index % COLOURS.len()],
            dash: DASHES[(index + index / COLOURS.len()) % DASHES.len()],
            line_px: 2.0 - 0.6 * depth,
            symbol: SYMBOLS[(index + index / COLOURS.len()) % SYMBOLS.len()],
            marker_px: 4.4 - 1.2 * depth,
            is_hollow: false,
        }
    }

    pub(crate) fn paint(&self) -> Paint<'static> {
        Paint { dash: self.dash, ..Paint::line(self.colour, self.line_px) }
    }

    /// Draws the marker at a point, with a white rim that separates it from markers below.
    pub(crate) fn marker(&self, canvas: &mut Canvas, (x, y): Position) {
        let (r, colour) = (self.marker_px, self.colour);
        let rimmed = match self.is_hollow {
            true => Paint { fill: Some(WHITE), ..Paint::line(colour, 1.6) },
            false => Paint { stroke: Some((WHITE, 1.0)), ..Paint::fill(colour) },
        };
        match self.symbol {
            Symbol::Disc => canvas.circle((x, y), r * 0.9, rimmed),
            Symbol::Ring => canvas.circle((x, y), r * 0.8, Paint { fill: Some(WHITE), ..Paint::line(colour, 2.0) }),
            Symbol::Cross => {
                let strokes = [vec![(x - r, y - r), (x + r, y + r)], vec![(x - r, y + r), (x + r, y - r)]];
                canvas.path(&strokes, false, Paint::line(WHITE, 5.0));
                canvas.path(&strokes, false, Paint::line(colour, 2.6));
            }
            Symbol::Polygon(corners, first) => {
                let turn = |k: u32| TAU * (f64::from(k) + first) / f64::from(corners);
                let outline = (0..corners).map(|k| on_circle((x, y), r * 1.1, turn(k))).collect();
                canvas.path(&[outline], true, rimmed);
            }
        }
    }
}
