//! Axes of the figures: linear, logarithmic or by the square root, with ticks at round numbers.

use super::svg::Position;
use lanesweep_support::readable::{OneTwoFive, next, one_two_five, plain_step};

/// Scale of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum AxisScale {
    /// Linear.
    #[default]
    Linear,
    /// Logarithmic; zero and negative values cannot be shown.
    Logarithmic,
    /// Square root, from zero: small shares stay legible beside large ones.
    SquareRoot,
}

impl AxisScale {
    /// Whether the axis can show `value`. Beyond 1e±300 widths and ratios would overflow `f64`.
    pub(crate) fn shows(self, value: f64) -> bool {
        match self {
            Self::Linear => value.abs() <= 1e300,
            Self::Logarithmic => (1e-300..=1e300).contains(&value),
            Self::SquareRoot => (0.0..=1e300).contains(&value),
        }
    }

    /// The value in the units in which the axis is linear.
    fn place(self, value: f64) -> f64 {
        match self {
            Self::Linear => value,
            Self::Logarithmic => libm::log10(value),
            Self::SquareRoot => value.max(0.0).sqrt(),
        }
    }
}

/// An axis between two round ends.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Axis {
    scale: AxisScale,
    /// Ends, as returned by [`AxisScale::place`].
    low: f64,
    high: f64,
    from_px: f64,
    to_px: f64,
}

/// A tick of the axis, with its number if there is room for it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Tick {
    pub at_px: f64,
    pub label: Option<String>,
}

impl Axis {
    /// The axis for all `values` that it can show, its ends rounded outwards. `None` without such a value. If all are
    /// equal, the axis extends a little to both sides.
    pub(super) fn around(scale: AxisScale, values: &[f64], (from_px, to_px): (f64, f64)) -> Option<Self> {
        let shown = || values.iter().copied().filter(|v| scale.shows(*v));
        let (min, max) = (shown().reduce(f64::min)?, shown().reduce(f64::max)?);
        let (low, high) = match scale {
            AxisScale::Linear => {
                // Values equal except for rounding count as equal, because a step between such ends would be below the
                // resolution of f64.
                let size = min.abs().max(max.abs());
                let margin = if max - min > 1e-9 * size { 0.0 } else { 0.1 * if size == 0.0 { 1.0 } else { size } };
                let (min, max) = (min - margin, max + margin);
                let step = plain_step((max - min) / 8.0);
                ((min / step).floor() * step, (max / step).ceil() * step)
            }
            AxisScale::Logarithmic => {
                let (mut below, mut above) = (one_two_five(min), one_two_five(max));
                if place(above) < libm::log10(max) - 1e-12 {
                    above = next(above, 1);
                }
                if below == above {
                    (below, above) = (next(below, -1), next(above, 1));
                }
                (place(below), place(above))
            }
            AxisScale::SquareRoot if max > 0.0 => {
                let above = one_two_five(max);
                let above = if value(above) < max * (1.0 - 1e-12) { next(above, 1) } else { above };
                (0.0, value(above).sqrt())
            }
            AxisScale::SquareRoot => (0.0, 1.0),
        };
        Some(Self { scale, low, high, from_px, to_px })
    }

    /// The linear axis that ends exactly at `low` and `high` (finite, `low < high`).
    pub(super) fn exactly((low, high): (f64, f64), (from_px, to_px): (f64, f64)) -> Self {
        Self { scale: AxisScale::Linear, low, high, from_px, to_px }
    }

    /// Whether `value` is between the ends.
    pub(super) fn holds(&self, value: f64) -> bool {
        self.scale.shows(value) && (self.low - 1e-9..=self.high + 1e-9).contains(&self.scale.place(value))
    }

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

    /// How many numbers fit above one another without crowding.
    pub(super) fn vertical_numbers(&self) -> usize {
        let max = if self.scale == AxisScale::Logarithmic { 8.0 } else { 6.0 };
        (self.length_px() / 18.0).clamp(2.0, max) as usize
    }

    /// Position of `value`, px; the nearer end if the axis cannot show it.
    pub(super) fn at(&self, value: f64) -> f64 {
        let place = match self.scale {
            AxisScale::Logarithmic if value <= 0.0 => self.low,
            scale => scale.place(value).clamp(self.low, self.high),
        };
        let share = (place - self.low) / (self.high - self.low);
        self.from_px + share * (self.to_px - self.from_px)
    }

    /// The ticks, with at most about `max_ticks` numbers.
    pub(super) fn ticks(&self, max_ticks: usize) -> Vec<Tick> {
        match self.scale {
            AxisScale::Linear => self.linear_ticks(max_ticks),
            AxisScale::Logarithmic => self.decade_ticks(max_ticks),
            AxisScale::SquareRoot => self.root_ticks(),
        }
    }

    fn tick(&self, place: f64, label: Option<String>) -> Tick {
        let share = (place - self.low) / (self.high - self.low);
        Tick { at_px: self.from_px + share * (self.to_px - self.from_px), label }
    }

    fn linear_ticks(&self, max_ticks: usize) -> Vec<Tick> {
        let step = plain_step((self.high - self.low) / max_ticks.max(1) as f64);

        let (first, last) = ((self.low / step - 1e-9).ceil(), (self.high / step + 1e-9).floor());
        // Neighbouring numbers must differ, at any distance from zero.
        let largest = self.low.abs().max(self.high.abs()) / step;
        let digits = 2 + libm::log10(largest.max(1.0)).ceil() as usize;
        let count = (last - first).max(0.0) as u32;
        let tick = |k: u32| {
            let value = (first + f64::from(k)) * step;
            self.tick(value.clamp(self.low, self.high), Some(digits_text(value, digits.min(15))))
        };
        (0..=count.min(100)).map(tick).collect()
    }

    /// Zero, the upper end, and between them each of 1, 2 and 5 with room for its number.
    fn root_ticks(&self) -> Vec<Tick> {
        let mut ticks = vec![self.tick(self.high, Some(number(self.high * self.high)))];
        let mut at = one_two_five(self.high * self.high);
        for _ in 0..12 {
            at = next(at, -1);
            let tick = self.tick(value(at).sqrt(), Some(number(value(at))));
            let has_room = |other: f64| (other - tick.at_px).abs() >= 15.0;
            if has_room(self.from_px) && ticks.last().is_none_or(|last| has_room(last.at_px)) {
                ticks.push(tick);
            }
        }
        ticks.push(self.tick(0.0, Some("0".to_owned())));
        ticks
    }

    /// Up to two decades 1, 2 and 5 have numbers, otherwise the decades, and every other decade or fewer if there are
    /// many.
    fn decade_ticks(&self, max_ticks: usize) -> Vec<Tick> {
        let decades = self.high - self.low;
        let every = (decades / max_ticks.max(1) as f64).ceil().max(1.0) as i32;
        let mut ticks = Vec::new();
        for exponent in self.low.floor() as i32..=self.high.ceil() as i32 {
            for digit in 1..=9_u8 {
                let at = place((digit, exponent));
                if at < self.low - 1e-9 || at > self.high + 1e-9 || (digit > 1 && decades > 10.0) {
                    continue;
                }
                let named = match digit {
                    1 => exponent.rem_euclid(every) == 0,
                    2 | 5 => decades <= 2.0 && 3.0 * decades <= max_ticks as f64,
                    _ => false,
                } || (decades <= 1.0 && matches!(digit, 2 | 5));
                let label = named.then(|| power_text(f64::from(digit), exponent, 0));
                ticks.push(self.tick(at, label));
            }
        }
        ticks
    }
}

/// The values that a logarithmic axis must include, from estimates and their intervals (estimate, lower, upper).
///
/// The axis starts at most one decade below the smallest estimate or, where that is zero, below the upper end. Without
/// this limit a lower end close to zero would compress everything else. An upper end that represents a zero estimate
/// has room for an arrow below it.
pub(crate) fn logarithmic_reach(intervals: &[(f64, f64, f64)]) -> Vec<f64> {
    let shown = |v: &f64| AxisScale::Logarithmic.shows(*v);
    let middles: Vec<f64> = intervals.iter().map(|(e, _, u)| if *e > 0.0 { *e } else { *u / 3.0 }).collect();
    let Some(smallest) = middles.iter().copied().filter(shown).reduce(f64::min) else { return Vec::new() };
    let lows = intervals.iter().map(|(_, l, _)| *l).filter(shown).map(|l| l.max(smallest / 10.0));
    middles.iter().copied().chain(intervals.iter().map(|(_, _, u)| *u)).chain(lows).filter(shown).collect()
}

/// A number with three digits in short form: `0.012`, `250`, `1.5e-6`; NaN and infinity in words.
pub(crate) fn number(value: f64) -> String {
    digits_text(value, 3)
}

/// A number with this many significant digits, without trailing zeros; from 1e5 and below 0.001 as a power of ten.
fn digits_text(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return if value.is_nan() { "not a number" } else { "infinite" }.to_string();
    }
    if value == 0.0 {
        return "0".to_string();
    }
    let written = format!("{value:.*e}", digits.max(1) - 1);
    let (mantissa, exponent) = written.split_once('e').unwrap_or((&written, "0"));
    let (mantissa, exponent) = (mantissa.parse().unwrap_or(value), exponent.parse().unwrap_or(0));
    power_text(mantissa, exponent, digits as i32 - 1)
}

/// `mantissa` · 10^`exponent` with at most this many decimals of the mantissa.
fn power_text(mantissa: f64, exponent: i32, decimals: i32) -> String {
    let trimmed = |text: String| match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_string(),
        false => text,
    };
    if !(-3..5).contains(&exponent) {
        return format!("{}e{exponent}", trimmed(format!("{mantissa:.*}", decimals.max(0) as usize)));
    }
    // Division instead of multiplication by a negative power: 2/10 is exactly 0.2.
    let power = f64::from(10_u32.pow(exponent.unsigned_abs()));
    let value = if exponent < 0 { mantissa / power } else { mantissa * power };
    trimmed(format!("{value:.*}", (decimals - exponent).max(0) as usize))
}

/// The common logarithm of digit · 10^exponent.
fn place((digit, exponent): OneTwoFive) -> f64 {
    f64::from(exponent) + libm::log10(f64::from(digit))
}

/// digit · 10^exponent.
fn value((digit, exponent): OneTwoFive) -> f64 {
    f64::from(digit) * libm::pow(10.0, f64::from(exponent))
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

    pub(super) fn shows(&self, (x, y): (f64, f64)) -> bool {
        self.x.scale.shows(x) && self.y.scale.shows(y)
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
