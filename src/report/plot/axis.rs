//! Axes of the figures, with ticks at round numbers.

use super::svg::Position;
use lanesweep_support::readable::{plain, plain_step};

/// Whether an axis can show a number. Beyond 1e±300 widths and ratios would overflow `f64`.
pub(super) fn is_shown(value: f64) -> bool {
    value.abs() <= 1e300
}

/// An axis between two ends (`low < high`), and where these are on the page.
#[derive(Debug, Clone, Copy)]
pub(super) struct Axis {
    pub low: f64,
    pub high: f64,
    pub from_px: f64,
    pub to_px: f64,
}

/// A tick of the axis, with its number.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Tick {
    pub at_px: f64,
    pub label: String,
}

impl Axis {
    /// Its ends on the page, the smaller first.
    pub(super) fn ends_px(&self) -> (f64, f64) {
        (self.from_px.min(self.to_px), self.from_px.max(self.to_px))
    }

    fn reaches(&self, px: f64) -> bool {
        (self.ends_px().0..=self.ends_px().1).contains(&px)
    }

    pub(super) fn length_px(&self) -> f64 {
        (self.to_px - self.from_px).abs()
    }

    /// Position of `value`, px; the nearer end if it lies outside.
    pub(super) fn at(&self, value: f64) -> f64 {
        let share = (value.clamp(self.low, self.high) - self.low) / (self.high - self.low);
        self.from_px + share * (self.to_px - self.from_px)
    }

    /// The ticks, at most about this many.
    pub(super) fn ticks(&self, max_ticks: usize) -> Vec<Tick> {
        let step = plain_step((self.high - self.low) / max_ticks.max(1) as f64);
        let (first, last) = ((self.low / step - 1e-9).ceil(), (self.high / step + 1e-9).floor());
        // Neighbouring numbers must differ, at any distance from zero.
        let largest = self.low.abs().max(self.high.abs()) / step;
        let digits = 2 + libm::log10(largest.max(1.0)).ceil() as usize;
        let count = (last - first).max(0.0) as u32;
        let tick = |k: u32| {
            let value = (first + f64::from(k)) * step;
            Tick { at_px: self.at(value), label: plain(value, digits.min(15)) }
        };
        (0..=count.min(100)).map(tick).collect()
    }
}

/// A round number slightly above `value` (positive), at which an axis from zero can end.
pub(crate) fn plain_end(value: f64) -> f64 {
    let step = plain_step(value / 8.0);
    (value / step - 1e-9).ceil() * step
}

/// Positions of values: on two axes, or at an angle (x) and radius (y) around a centre.
pub(super) struct Axes {
    pub x: Axis,
    pub y: Axis,
    pub centre: Option<Position>,
}

impl Axes {
    pub(super) fn at(&self, (x, y): (f64, f64)) -> Position {
        let place = (self.x.at(x), self.y.at(y));
        self.centre.map_or(place, |centre| on_circle(centre, place.1, place.0))
    }

    /// Whether a position on the page lies in the plot.
    pub(super) fn is_inside(&self, (x, y): Position) -> bool {
        self.centre.is_some() || (self.x.reaches(x) && self.y.reaches(y))
    }
}

/// The point at angle `turn` (radians, clockwise from the top) on a circle.
pub(super) fn on_circle((x, y): Position, radius: f64, turn: f64) -> Position {
    (x + radius * libm::sin(turn), y - radius * libm::cos(turn))
}
