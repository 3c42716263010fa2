//! What a plot draws: cells (rectangles whose flat colour shows their content), over them rules, over both series
//! (line, points, band, intervals).

use super::axis::{Axes, is_shown};
use super::look::Look;
use super::svg::{Anchor, Canvas, GREY, GRID, Paint, Position, Type, WHITE, set};

pub(crate) const TICK: Type = set(13, false, GREY);

/// A value with fewer failing scenarios than this is drawn hollow.
const MIN_SCENARIOS: f64 = 10.0;

/// Caption of hollow markers.
pub(super) const HOLLOW: &str = "Hollow: fewer than ten failing scenarios; n is their number.";

/// Whether a value is based on few failing scenarios; their number may be an effective one.
pub(crate) fn is_few(failing_scenarios: f64) -> bool {
    failing_scenarios < MIN_SCENARIOS
}

/// Marks of a series.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mark {
    /// A line through the values in order, broken at values that cannot be shown.
    Line,
    /// A marker per value.
    Points,
    /// The vertical intervals of neighbouring values as an area.
    Band,
    /// The horizontal interval of each value as a line with a bar at both ends.
    Intervals,
}

/// One value of a series.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Value {
    /// Horizontal value.
    pub x: f64,
    /// Vertical value.
    pub y: f64,
    /// Ends of its interval.
    pub interval: Option<(f64, f64)>,
    /// Based on few failing scenarios: its marker is hollow.
    pub is_few: bool,
}

impl From<(f64, f64)> for Value {
    fn from((x, y): (f64, f64)) -> Self {
        Value { x, y, ..Value::default() }
    }
}

impl Value {
    /// Whether axes can show it.
    pub(super) fn is_shown(&self) -> bool {
        is_shown(self.x) && is_shown(self.y)
    }
}

/// A series of values.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Series {
    /// Name in the legend; the same name has the same look in every plot. Empty: not in the legend.
    pub name: String,
    /// Marks of the values.
    pub marks: Vec<Mark>,
    /// The values. Those that an axis cannot show are not drawn.
    pub values: Vec<Value>,
    /// Own look; `None`: the look of its index in the legend.
    pub look: Option<Look>,
}

/// Reference lines behind the series.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Rule {
    /// The lines, inside the plot's ranges.
    pub runs: Vec<Vec<(f64, f64)>>,
    /// Name in the legend; empty: not in the legend.
    pub name: String,
    /// Name at the end of the first line.
    pub label: String,
    /// `#rrggbb`.
    pub colour: &'static str,
    /// Width.
    pub width_px: f64,
    /// Lengths of dashes and gaps, px; empty: solid.
    pub dash: &'static str,
    /// Attributes of the lines' group.
    pub attributes: &'static str,
}

impl Rule {
    pub(super) fn draw(&self, canvas: &mut Canvas, axes: &Axes) {
        let runs: Vec<Vec<Position>> =
            self.runs.iter().map(|run| run.iter().map(|value| axes.at(*value)).collect()).collect();
        let paint = Paint { dash: self.dash, ..Paint::line(self.colour, self.width_px) };
        canvas.group(self.attributes, "", |canvas| canvas.path(&runs, false, paint));
    }

    /// Draws the label on the end of the first line: before the end of a level one, beside the end of a steep one.
    pub(super) fn name_at_end(&self, canvas: &mut Canvas, axes: &Axes, taken: &mut Vec<(f64, f64, f64)>) {
        let ends = self.runs.first().and_then(|run| Some((run[run.len().checked_sub(2)?], run.last()?)));
        let Some((before, end)) = ends.filter(|_| !self.label.is_empty()) else { return };
        let (width, (x, y)) = (TICK.text_px(&self.label), axes.at(*end));
        let is_steep = before.0 == end.0;
        let left = if is_steep && axes.is_inside((x + width + 6.0, y)) { x + 4.0 } else { x - width - 4.0 };
        let mut base = if is_steep { y + 13.0 } else { (y + 4.5).min(axes.y.ends_px().1 - 3.0) };
        while taken.iter().any(|w| left < w.0 + w.1 && left + width > w.0 && (base - w.2).abs() < 12.0) {
            base += 13.0;
        }
        canvas.rect((left - 2.0, base - 11.0), (left + width + 2.0, base + 2.0), Paint::fill(WHITE));
        canvas.text((left, base), &self.label, TICK, Anchor::Start);
        taken.push((left, width, base));
    }

    /// Draws a sample for the legend.
    pub(super) fn sample(&self, canvas: &mut Canvas, (x, y): Position, width_px: f64) {
        let paint = Paint { dash: self.dash, ..Paint::line(self.colour, self.width_px) };
        canvas.path(&[vec![(x, y), (x + width_px, y)]], false, paint);
    }
}

impl Series {
    /// Values with marks; pairs are values without intervals.
    pub(crate) fn new<V: Into<Value>>(
        name: impl Into<String>,
        marks: &[Mark],
        values: impl IntoIterator<Item = V>,
    ) -> Self {
        let values = values.into_iter().map(Into::into).collect();
        Series { name: name.into(), marks: marks.to_vec(), values, ..Series::default() }
    }

    /// The same with a look of its own.
    pub(crate) fn with_look(self, look: Look) -> Self {
        Series { look: Some(look), ..self }
    }

    fn has(&self, mark: Mark) -> bool {
        self.marks.contains(&mark)
    }

    /// Runs of consecutive values that can be shown, and whether each run closes. Around a centre the last value is a
    /// neighbour of the first.
    fn runs<'a>(&'a self, axes: &Axes) -> Vec<(Vec<&'a Value>, bool)> {
        let shown: Vec<Option<&Value>> =
            self.values.iter().map(|value| Some(value).filter(|of| of.is_shown())).collect();
        let first_gap = shown.iter().position(Option::is_none);
        let from = if axes.centre.is_some() { first_gap.unwrap_or(0) } else { 0 };
        let closes = axes.centre.is_some() && first_gap.is_none();
        let turned: Vec<Option<&Value>> = shown[from..].iter().chain(&shown[..from]).copied().collect();
        let runs = turned.split(Option::is_none).filter(|run| !run.is_empty());
        runs.map(|run| (run.iter().copied().flatten().collect(), closes)).collect()
    }

    /// The ends of a value's interval along x.
    pub(super) fn ends_of(&self, value: &Value) -> Option<(f64, f64)> {
        value.interval.filter(|_| self.has(Mark::Intervals))
    }

    pub(super) fn bands(&self, canvas: &mut Canvas, axes: &Axes, look: &Look) {
        let paint = Paint { opacity: Some(0.16), ..Paint::fill(look.colour) };
        for (run, _) in self.runs(axes).iter().filter(|_| self.has(Mark::Band)) {
            let ends: Vec<(f64, (f64, f64))> =
                run.iter().filter_map(|value| Some((value.x, value.interval?))).collect();
            let (upper, lower) =
                (ends.iter().map(|(x, ends)| (*x, ends.1)), ends.iter().rev().map(|(x, ends)| (*x, ends.0)));
            canvas.path(&[upper.chain(lower).map(|place| axes.at(place)).collect()], true, paint);
        }
    }

    pub(super) fn line(&self, canvas: &mut Canvas, axes: &Axes, look: &Look) {
        let runs = self.runs(axes);
        if !self.has(Mark::Line) || runs.is_empty() {
            return;
        }
        // Round joins: a mitred corner of a thin spike would extend beyond its value.
        canvas.group("class=\"series\" stroke-linejoin=\"round\"", "", |canvas| {
            for (run, is_closed) in runs {
                let places: Vec<Position> = run.iter().map(|value| axes.at((value.x, value.y))).collect();
                match places[..] {
                    [_] if self.has(Mark::Points) => {}
                    [place] => canvas.circle(place, 1.0 + look.line_px / 2.0, Paint::fill(look.colour)),
                    _ => canvas.path(&[without_inner_points(&places)], is_closed, look.paint()),
                }
            }
        });
    }

    /// Draws intervals and markers.
    pub(super) fn markers(&self, canvas: &mut Canvas, axes: &Axes, look: &Look, tip: &dyn Fn(&Value) -> String) {
        for value in self.values.iter().filter(|value| self.has(Mark::Points) && value.is_shown()) {
            let place = axes.at((value.x, value.y));
            canvas.group("class=\"value\"", &tip(value), |canvas| {
                if let Some((low, high)) = self.ends_of(value) {
                    let bar = |(x, y): Position| vec![(x, y - 4.0), (x, y + 4.0)];
                    let (lower, upper) = (axes.at((low, value.y)), axes.at((high, value.y)));
                    let runs = [vec![lower, upper], bar(upper), bar(lower)];
                    canvas.path(&runs, false, Paint::line(look.colour, look.line_px));
                }
                Look { is_hollow: value.is_few, ..*look }.marker(canvas, place);
            });
        }
    }

    /// Draws a sample of the series for the legend.
    pub(super) fn sample(&self, canvas: &mut Canvas, (x, y): Position, width_px: f64, look: &Look) {
        if self.has(Mark::Line) || self.has(Mark::Intervals) {
            let dash = if self.has(Mark::Line) { look.dash } else { "" };
            canvas.path(&[vec![(x, y), (x + width_px, y)]], false, Look { dash, ..*look }.paint());
        }
        if self.has(Mark::Points) {
            look.marker(canvas, (x + width_px / 2.0, y));
        }
    }
}

/// Overlap of neighbouring rows of cells, to avoid white seams.
const SEAM_PX: f64 = 0.6;

/// A rectangle.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FilledCell {
    /// Two opposite corners.
    pub corners: [(f64, f64); 2],
    /// `#rrggbb`.
    pub colour: &'static str,
    /// Tooltip in a browser; empty: none.
    pub tip: &'static str,
}

/// Rectangles behind everything else.
#[derive(Debug, Clone, Default)]
pub struct Cells {
    /// The rectangles.
    pub cells: Vec<FilledCell>,
    /// Legend: names and their colours.
    pub key: Vec<(String, &'static str)>,
}

fn fill(canvas: &mut Canvas, colour: &str, (x1, y1): Position, (x2, y2): Position) {
    canvas.rect((x1, y1.min(y2)), (x2, y1.max(y2) + SEAM_PX), Paint::fill(colour));
}

/// Draws a sample of a colour for the legend.
pub(super) fn fill_sample(canvas: &mut Canvas, colour: &str, from: Position, to: Position) {
    fill(canvas, colour, from, to);
    canvas.rect(from, to, Paint::line(GRID, 0.8));
}

impl Cells {
    /// Draws the cells without anti-aliasing, to avoid white seams.
    pub(super) fn draw(&self, canvas: &mut Canvas, axes: &Axes) {
        canvas.group("shape-rendering=\"crispEdges\"", "", |canvas| {
            for cell in &self.cells {
                let (from, to) = (axes.at(cell.corners[0]), axes.at(cell.corners[1]));
                match cell.tip {
                    "" => fill(canvas, cell.colour, from, to),
                    tip => canvas.group("class=\"cell\"", tip, |canvas| fill(canvas, cell.colour, from, to)),
                }
            }
        });
    }
}

/// Removes points that lie on the line between their neighbours: a lane has thousands of steps.
fn without_inner_points(places: &[Position]) -> Vec<Position> {
    let mut kept: Vec<Position> = Vec::new();
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
