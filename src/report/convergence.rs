//! How an estimate settles: failure probability with its interval over the number of samples, one panel per driver
//! model, all panels on the same axes.
//!
//! Both axes are logarithmic, because probabilities span decades. An estimate of zero has no place there: its
//! interval's upper end is drawn instead, with an arrow downwards.

use super::axis::{Axis, AxisScale, logarithmic_reach, number};
use super::drawing::{
    self, BORDER_PX, GREY, Look, NAME_BOLD, NOTE, TEXT_WIDTH_PX, TICK, area, group, paragraph, path_data, plain, rect,
    text,
};
use super::svg::{Canvas, Color, Shape, TextAnchor};

/// The estimate after so many samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConvergencePoint {
    /// Samples so far, at least 1.
    pub samples: u64,
    /// Estimated probability, in 0..=1. Zero is drawn as the upper limit.
    pub probability: f64,
    /// Lower end of the interval, finite; below zero it counts as zero.
    pub lower: f64,
    /// Upper end of the interval, finite, not below `lower`; above one it counts as one.
    pub upper: f64,
}

/// One line: the estimates of one quantity in the order of their samples (sorted for drawing).
#[derive(Debug, Clone, PartialEq)]
pub struct ConvergenceSeries {
    /// Heading of the panel the line is in, such as the driver model; series with the same words share the panel.
    pub panel: String,
    /// Name in the legend, such as the criterion; the same name looks the same in every panel.
    pub name: String,
    /// The estimates.
    pub points: Vec<ConvergencePoint>,
}

/// Probabilities over samples.
#[derive(Debug, Clone, PartialEq)]
pub struct ConvergenceFigure {
    /// Heading; wrapped when long.
    pub title: String,
    /// Line below the heading (what was sampled, which interval); wrapped when long.
    pub subtitle: Option<String>,
    /// The lines; panels and legend in the order of first appearance.
    pub series: Vec<ConvergenceSeries>,
}

/// Room at the left of a panel for the numbers, at its right for half a number.
const LEFT_PX: f64 = 62.0;
const RIGHT_PX: f64 = 14.0;
/// Empty space between the panels.
const GAP_PX: f64 = 22.0;
/// With more points than this a series has no markers: they would hide its line.
const MAX_MARKERS: usize = 40;

impl ConvergencePoint {
    /// Why the point cannot be drawn, if so.
    fn refusal(&self) -> Option<&'static str> {
        let numbers = [self.probability, self.lower, self.upper];
        if self.samples == 0 {
            Some("without samples")
        } else if numbers.iter().any(|v| !v.is_finite()) {
            Some("not a finite number")
        } else if !(0.0..=1.0).contains(&self.probability) {
            Some("no probability in 0 to 1")
        } else if self.lower > self.upper {
            Some("the interval's ends are swapped")
        } else if self.probability == 0.0 && !AxisScale::Logarithmic.shows(self.upper) {
            Some("zero without an upper limit")
        } else {
            None
        }
    }
}

impl ConvergenceFigure {
    /// The figure as a complete SVG document, 1000 px wide and as high as its panels and texts need.
    ///
    /// A point that is no estimate (not finite, no probability, no samples, interval upside down, zero without an
    /// upper limit) is not drawn but counted in a note. Texts are XML-escaped; control characters become U+FFFD. The
    /// same figure gives the same bytes. Nothing fails: without points only the texts remain, and say so.
    pub fn svg(&self) -> String {
        let (mut canvas, mut y) = drawing::page(&self.title, self.subtitle.as_deref());
        let drawn: Vec<Vec<ConvergencePoint>> = self.series.iter().map(drawable).collect();
        let names = distinct(self.series.iter().map(|s| s.name.as_str()));
        let look = |name: &str| look(names.iter().position(|n| *n == name).unwrap_or(0), names.len());
        y = self.panels(&mut canvas, &drawn, &look, y + 14.0);
        if drawn.iter().any(|points| !points.is_empty()) {
            let legend: Vec<(&str, Look)> = names.iter().map(|name| (*name, look(name))).collect();
            y = drawing::legend(&mut canvas, &legend, y + 8.0);
            y = paragraph(&mut canvas, (BORDER_PX, y + 6.0), &caption(&drawn), NOTE, TEXT_WIDTH_PX);
        } else {
            let words = "There is no estimate to draw.";
            y = paragraph(&mut canvas, (BORDER_PX, y), words, NOTE, TEXT_WIDTH_PX);
        }
        y = drawing::notes(&mut canvas, "Not drawn:", &self.refused(), y + 10.0);
        drawing::document(canvas, y)
    }

    /// All panels below `top`, side by side as their number allows; returns the y below.
    fn panels(
        &self,
        canvas: &mut Canvas,
        drawn: &[Vec<ConvergencePoint>],
        look: &dyn Fn(&str) -> Look,
        top: f64,
    ) -> f64 {
        let panels = distinct(self.series.iter().map(|s| s.panel.as_str()));
        let (columns, height_px) = match panels.len() {
            0 | 1 => (1, 430.0),
            2..=4 => (2, 270.0),
            _ => (3, 210.0),
        };
        let width_px = (TEXT_WIDTH_PX - GAP_PX * (columns - 1) as f64) / columns as f64;
        let most_x = if columns == 1 { 10 } else { 6 };
        let mut y = top;
        for (row, in_row) in panels.chunks(columns).enumerate() {
            let heads: Vec<Vec<String>> = in_row.iter().map(|p| NAME_BOLD.wrap(p, width_px)).collect();
            let heads_px = heads.iter().map(Vec::len).max().unwrap_or(0) as f64 * NAME_BOLD.line_px();
            let (plot_top, mut bottom) = (y + heads_px + 30.0, y);
            for (column, (panel, head)) in in_row.iter().zip(&heads).enumerate() {
                let left = BORDER_PX + column as f64 * (width_px + GAP_PX);
                let across = (left + LEFT_PX, left + width_px - RIGHT_PX);
                let down = (plot_top, plot_top + height_px);
                let Some(axes) = Axes::around(drawn, across, down) else { return top };
                paragraph(canvas, (left, y), &head.join(" "), NAME_BOLD, width_px);
                text(canvas, (left, plot_top - 13.0), "Failure probability", TICK, TextAnchor::Start);
                bottom = axes.frame(canvas, across, down, most_x);
                if panels.len() <= row * columns + column + columns {
                    text(canvas, (across.1, bottom + 14.0), "Samples", TICK, TextAnchor::End);
                }
                let here = || self.series.iter().zip(drawn).filter(|(s, _)| s.panel == *panel);
                // All bands below all lines below all markers: a band never hides an estimate.
                here().for_each(|(series, points)| axes.band(canvas, points, &look(&series.name)));
                here().for_each(|(series, points)| axes.line(canvas, points, &look(&series.name)));
                here().for_each(|(series, points)| axes.markers(canvas, points, &look(&series.name), series));
            }
            y = bottom + 22.0;
        }
        y
    }

    /// Per series and reason, how many points are not drawn.
    fn refused(&self) -> Vec<String> {
        let mut lines = Vec::new();
        for series in &self.series {
            let name = [series.panel.as_str(), series.name.as_str()].join(" ");
            if series.points.is_empty() {
                lines.push(format!("{} — no points", name.trim()));
            }
            let reasons = || series.points.iter().filter_map(ConvergencePoint::refusal);
            for reason in distinct(reasons()) {
                let count = reasons().filter(|r| *r == reason).count();
                lines.push(format!("{} — {count} of {} points: {reason}", name.trim(), series.points.len()));
            }
        }
        lines
    }
}

/// The two axes of one panel.
struct Axes {
    x: Axis,
    y: Axis,
}

impl Axes {
    /// Axes around the points of all panels, so that panels can be compared.
    fn around(drawn: &[Vec<ConvergencePoint>], across: (f64, f64), (top, bottom): (f64, f64)) -> Option<Self> {
        let points: Vec<&ConvergencePoint> = drawn.iter().flatten().collect();
        let samples: Vec<f64> = points.iter().map(|p| p.samples as f64).collect();
        let intervals: Vec<_> = points.iter().map(|p| (p.probability, p.lower, p.upper)).collect();
        let x = Axis::around(AxisScale::Logarithmic, &samples, across)?;
        let y = Axis::around(AxisScale::Logarithmic, &logarithmic_reach(&intervals), (bottom, top))?;
        Some(Self { x, y })
    }

    /// Grid, numbers and frame; returns the y below the numbers.
    fn frame(&self, canvas: &mut Canvas, across: (f64, f64), down: (f64, f64), most_x: usize) -> f64 {
        self.y.draw_left(canvas, across, 8, true);
        let bottom = self.x.draw_below(canvas, down, most_x, true);
        rect(canvas, (across.0, down.0), (across.1, down.1), Color::None, Some((GREY, 1.0)));
        bottom
    }

    fn at(&self, samples: u64, probability: f64) -> (f64, f64) {
        (self.x.at(samples as f64), self.y.at(probability))
    }

    /// The intervals of neighbouring estimates as an area, of a single one as a whisker. Those of zeros are left to
    /// the arrows: as areas down to the edge they would cover half of the panel and say no more.
    fn band(&self, canvas: &mut Canvas, points: &[ConvergencePoint], look: &Look) {
        for run in points.split(|p| p.probability == 0.0) {
            let upper = run.iter().map(|p| self.at(p.samples, p.upper));
            let outline: Vec<_> = upper.chain(run.iter().rev().map(|p| self.at(p.samples, p.lower))).collect();
            match run.len() {
                0 => {}
                1 => canvas.add(Look { dash: None, line_px: 1.2, ..look.clone() }.line(path_data(&outline, false))),
                _ => area(canvas, &outline, look.colour.clone(), 0.15),
            }
        }
    }

    /// The line through the estimates, broken where one is zero.
    fn line(&self, canvas: &mut Canvas, points: &[ConvergencePoint], look: &Look) {
        for run in points.split(|p| p.probability == 0.0).filter(|run| run.len() > 1) {
            let run: Vec<_> = run.iter().map(|p| self.at(p.samples, p.probability)).collect();
            canvas.add(look.line(path_data(&run, false)));
        }
    }

    fn markers(&self, canvas: &mut Canvas, points: &[ConvergencePoint], look: &Look, series: &ConvergenceSeries) {
        let alone = |k: usize| {
            let beside = [k.checked_sub(1), Some(k + 1)].into_iter().flatten().filter_map(|i| points.get(i));
            beside.into_iter().all(|p| p.probability == 0.0)
        };
        for (k, p) in points.iter().enumerate() {
            if p.probability > 0.0 && points.len() > MAX_MARKERS && !alone(k) {
                continue;
            }
            let [estimate, lower, upper] = [p.probability, p.lower, p.upper].map(number);
            let name = plain(&[series.panel.as_str(), series.name.as_str()].join(" "));
            let tip = format!("{name}: {estimate} [{lower}, {upper}] after {} samples", p.samples);
            if p.probability > 0.0 {
                group(canvas, "class=\"estimate\"", Some(tip));
                canvas.add(look.marker(self.at(p.samples, p.probability)));
            } else {
                group(canvas, "class=\"limit\"", Some(tip));
                limit(canvas, self.at(p.samples, p.upper), look);
            }
            canvas.add(Shape::GroupEnd);
        }
    }
}

/// A short bar with an arrow downwards: the value is somewhere below.
fn limit(canvas: &mut Canvas, (x, y): (f64, f64), look: &Look) {
    let solid = Look { dash: None, line_px: 1.6, ..look.clone() };
    // The lines drawn first are the wider ones: where limits coincide, as they do early on, each can be seen.
    let half = 1.6 * look.marker_px;
    canvas.add(solid.line(path_data(&[(x - half, y), (x + half, y)], false)));
    canvas.add(solid.line(path_data(&[(x, y), (x, y + 9.0)], false)));
    area(canvas, &[(x - 3.5, y + 8.0), (x + 3.5, y + 8.0), (x, y + 15.0)], look.colour.clone(), 1.0);
}

/// As in the legend's other figures, but thin: dozens of points lie close together.
fn look(index: usize, count: usize) -> Look {
    let depth = if count > 1 { index as f64 / (count - 1) as f64 } else { 0.5 };
    Look { line_px: 2.6 - 1.0 * depth, marker_px: 5.5 - 2.0 * depth, ..Look::of(index, count) }
}

fn drawable(series: &ConvergenceSeries) -> Vec<ConvergencePoint> {
    let mut points: Vec<_> = series.points.iter().copied().filter(|p| p.refusal().is_none()).collect();
    points.iter_mut().for_each(|p| p.upper = p.upper.min(1.0));
    points.sort_by_key(|p| p.samples);
    points
}

fn distinct<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut seen = Vec::new();
    for name in names {
        if !seen.contains(&name) {
            seen.push(name);
        }
    }
    seen
}

/// What the marks mean, as far as they occur.
fn caption(drawn: &[Vec<ConvergencePoint>]) -> String {
    let mut words = "Marker: estimate. Area or whisker: its interval. Both axes are logarithmic.".to_string();
    if drawn.iter().flatten().any(|p| p.probability > 0.0 && p.lower < p.probability / 10.0) {
        words.push_str(" An interval that reaches the lower edge goes on below it.");
    }
    if drawn.iter().flatten().any(|p| p.probability == 0.0) {
        words.push_str(" Arrow: the estimate is zero; the bar is the interval's upper end.");
    }
    words
}

#[cfg(test)]
mod tests {
    use super::super::drawing::tests::words;
    use super::*;

    fn point(samples: u64, probability: f64) -> ConvergencePoint {
        let half = 2.0 * (probability.max(1e-6) / samples as f64).sqrt();
        ConvergencePoint { samples, probability, lower: (probability - half).max(0.0), upper: probability + half }
    }

    fn figure(panels: usize, names: usize, probability: impl Fn(usize) -> f64) -> ConvergenceFigure {
        let series = |i: usize| ConvergenceSeries {
            panel: format!("Model{}", i / names),
            name: format!("Criterion{}", i % names),
            points: (3..7).map(|k| point(10_u64.pow(k), probability(i))).collect(),
        };
        ConvergenceFigure { title: "Cut-in".into(), subtitle: None, series: (0..panels * names).map(series).collect() }
    }

    fn marks(svg: &str) -> (usize, usize) {
        (svg.matches("class=\"estimate\"").count(), svg.matches("class=\"limit\"").count())
    }

    #[test]
    fn every_panel_and_criterion_is_named_once_and_every_estimate_has_a_mark() {
        let svg = figure(4, 3, |i| 1e-2 / (i + 1) as f64).svg();
        let words = words(&svg);
        for name in ["Model0", "Model3", "Criterion0", "Criterion2", "Samples", "Failure probability"] {
            assert!(words.contains(name), "{name}");
        }
        assert_eq!(words.matches("Criterion1").count(), 1, "one legend for all panels");
        assert_eq!(marks(&svg), (48, 0));
        assert!(!words.contains("Arrow") && !words.contains("Not drawn"));
    }

    #[test]
    fn a_zero_estimate_is_an_upper_limit_and_said_to_be() {
        let svg = figure(1, 2, |i| [0.0, 1e-3][i]).svg();
        assert_eq!(marks(&svg), (4, 4));
        assert!(words(&svg).contains("Arrow: the estimate is zero"));
        let svg = figure(2, 2, |_| 0.0).svg();
        assert_eq!(marks(&svg), (0, 16), "all zero still makes a picture");
    }

    #[test]
    fn the_arrow_has_room_above_the_lower_edge() {
        let drawn: Vec<_> = figure(1, 1, |_| 0.0).series.iter().map(drawable).collect();
        let axes = Axes::around(&drawn, (0.0, 800.0), (0.0, 430.0)).unwrap();
        let lowest = drawn[0].iter().map(|p| axes.at(p.samples, p.upper).1).fold(0.0, f64::max);
        assert!(lowest + 15.0 < 430.0, "{lowest}");
    }

    #[test]
    fn what_is_no_estimate_is_not_drawn_but_counted() {
        let mut figure = figure(1, 1, |_| 1e-3);
        let good = point(1000, 1e-3);
        figure.series[0].points.extend([
            ConvergencePoint { samples: 0, ..good },
            ConvergencePoint { probability: f64::NAN, ..good },
            ConvergencePoint { upper: f64::INFINITY, ..good },
            ConvergencePoint { probability: 1.5, ..good },
            ConvergencePoint { lower: 0.5, upper: 0.1, ..good },
            ConvergencePoint { probability: 0.0, lower: 0.0, upper: 0.0, ..good },
        ]);
        let svg = figure.svg();
        assert_eq!(marks(&svg), (4, 0));
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
        let words = words(&svg);
        for note in ["1 of 10 points: without samples", "2 of 10 points: not a finite number", "ends are swapped"] {
            assert!(words.contains(note), "{words}");
        }
    }

    #[test]
    fn one_point_no_points_and_endless_names_still_make_a_picture() {
        let mut one = figure(1, 1, |_| 1.0);
        one.series[0].points.truncate(1);
        assert_eq!(marks(&one.svg()), (1, 0));
        one.series[0].points.clear();
        assert!(words(&one.svg()).contains("There is no estimate to draw."));
        one.series.clear();
        assert!(words(&one.svg()).contains("There is no estimate to draw."));
        let mut long = figure(5, 3, |_| 1e-5);
        long.series[0].panel = "<model> & ".repeat(60);
        long.series[1].name = "q".repeat(400);
        assert_eq!(words(&long.svg()).matches('q').count(), 400);
        assert_eq!(long.svg(), long.svg());
    }

    #[test]
    fn many_points_have_no_markers_but_zeros_keep_their_arrows() {
        let mut many = figure(1, 1, |_| 1e-3);
        many.series[0].points = (1..=1000).map(|n| point(n * 100, if n < 3 { 0.0 } else { 1e-3 })).collect();
        assert_eq!(marks(&many.svg()), (0, 2));
    }
}
