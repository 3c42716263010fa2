//! A forest plot: estimates with their intervals, one line each, in groups, each group with its reference as a band.

use super::axis::{Axis, AxisScale, logarithmic_reach, number};
use super::drawing::{
    self, BORDER_PX, GREY, GRID, INK, Look, NAME, NAME_BOLD, NOTE, TEXT_WIDTH_PX, Type, WIDTH_PX, area, group, line,
    paragraph, path_data, plain, rect, text,
};
use super::svg::{Canvas, Color, Shape, TextAnchor};

/// One estimate.
#[derive(Debug, Clone, PartialEq)]
pub struct ForestRow {
    /// What was estimated or how; wrapped when long.
    pub name: String,
    /// The estimate, in the axis's unit. `None` is undefined (0/0): said in words and not drawn.
    pub estimate: Option<f64>,
    /// Lower end of the interval; not drawn if it or `upper` is not finite or they are swapped.
    pub lower: f64,
    /// Upper end of the interval.
    pub upper: f64,
}

/// Estimates that belong together.
#[derive(Debug, Clone, PartialEq)]
pub struct ForestGroup {
    /// Heading of the group, such as the driver model and criterion; wrapped when long.
    pub name: String,
    /// What the rows are compared with; its interval is a band through the group.
    pub reference: Option<ForestRow>,
    /// The rows, from top to bottom.
    pub rows: Vec<ForestRow>,
}

/// Estimates with intervals.
#[derive(Debug, Clone, PartialEq)]
pub struct ForestFigure {
    /// Heading; wrapped when long.
    pub title: String,
    /// Line below the heading (what was sampled, which interval); wrapped when long.
    pub subtitle: Option<String>,
    /// Words below the axis, with unit, such as `Failures per hour (1/h)`.
    pub axis: String,
    /// How the axis places values. On a logarithmic one an estimate of zero is drawn as the interval's upper end
    /// with an arrow to the left.
    pub scale: AxisScale,
    /// The groups, from top to bottom.
    pub groups: Vec<ForestGroup>,
}

/// Widths of the names, the plot and the numbers, with gaps between.
const NAME_WIDTH_PX: f64 = 280.0;
const PLOT_PX: (f64, f64) = (BORDER_PX + NAME_WIDTH_PX + 16.0, BORDER_PX + NAME_WIDTH_PX + 16.0 + 370.0);
const VALUE_LEFT_PX: f64 = PLOT_PX.1 + 18.0;
const VALUE_WIDTH_PX: f64 = WIDTH_PX - BORDER_PX - VALUE_LEFT_PX;
/// With more lines than this the axis stands at the top too.
const LONG_ROWS: usize = 20;
const MAX_NUMBERS: usize = 6;
const ROW: Type = Type { size_px: 14, bold: false, colour: INK };
/// Colour of a reference's band; its estimate is a diamond, that of a row a disc.
const REFERENCE_COLOUR: &str = "#E69F00";
/// How far names stand in from their group's heading.
const INDENT_PX: f64 = 14.0;

/// What of a row can be drawn on the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Drawn {
    estimate: Option<f64>,
    interval: Option<(f64, f64)>,
    /// The estimate is zero on a logarithmic axis: only the upper end is drawn.
    below: bool,
}

impl ForestRow {
    fn drawn(&self, scale: AxisScale) -> Drawn {
        let finite = |v: f64| AxisScale::Linear.shows(v);
        let estimate = self.estimate.filter(|e| finite(*e));
        let ordered = finite(self.lower) && finite(self.upper) && self.lower <= self.upper;
        let interval = (ordered && scale.shows(self.upper) && estimate.is_some()).then_some((self.lower, self.upper));
        let zero = scale == AxisScale::Logarithmic && estimate == Some(0.0);
        Drawn { estimate: estimate.filter(|e| scale.shows(*e)), interval, below: zero && interval.is_some() }
    }

    /// Estimate and interval as numbers, and in words why one is not drawn.
    fn words(&self, scale: AxisScale) -> String {
        let Some(estimate) = self.estimate else { return "undefined".to_string() };
        if !AxisScale::Linear.shows(estimate) {
            return format!("not drawn: {}", number(estimate));
        }
        let (lower, upper) = (number(self.lower), number(self.upper));
        let interval = if !self.lower.is_finite() || !self.upper.is_finite() {
            "no interval".to_string()
        } else if self.lower > self.upper {
            format!("no interval: {lower} is above {upper}")
        } else {
            format!("[{lower}, {upper}]")
        };
        let drawn = self.drawn(scale);
        let nowhere = drawn.estimate.is_none() && !drawn.below;
        format!("{} {interval}{}", number(estimate), if nowhere { " (not on a logarithmic axis)" } else { "" })
    }
}

impl ForestFigure {
    /// The figure as a complete SVG document, 1000 px wide and as high as its lines need.
    ///
    /// Every row is named and its numbers stand beside it; what cannot be drawn is said there. Texts are
    /// XML-escaped; control characters become U+FFFD. The same figure gives the same bytes. Nothing fails: without
    /// any estimate only the texts remain.
    pub fn svg(&self) -> String {
        let (mut canvas, y) = drawing::page(&self.title, self.subtitle.as_deref());
        let axis = self.axis();
        let lines = self.groups.iter().map(|g| g.rows.len() + 2).sum::<usize>();
        let mut top = y + 14.0;
        if lines == 0 {
            let y = paragraph(&mut canvas, (BORDER_PX, top), "There is no estimate to draw.", NOTE, TEXT_WIDTH_PX);
            return drawing::document(canvas, y);
        }
        if lines > LONG_ROWS && axis.is_some() {
            top += 22.0;
        }
        let bottom = self.groups.iter().fold(top, |y, g| y + g.height_px(self.scale)) + 4.0;
        if let Some(axis) = &axis {
            self.grid(&mut canvas, axis, (top, bottom), lines > LONG_ROWS);
        }
        let mut y = top;
        for group in &self.groups {
            y = self.group(&mut canvas, axis.as_ref(), group, y);
        }
        let mut below = bottom;
        if let Some(axis) = &axis {
            rect(&mut canvas, (PLOT_PX.0, top), (PLOT_PX.1, bottom), Color::None, Some((GREY, 1.0)));
            below = axis.draw_below(&mut canvas, (top, bottom), MAX_NUMBERS, false);
            for words in NAME.wrap(&self.axis, TEXT_WIDTH_PX - NAME_WIDTH_PX) {
                text(&mut canvas, ((PLOT_PX.0 + PLOT_PX.1) / 2.0, below + 20.0), &words, NAME, TextAnchor::Middle);
                below += NAME.line_px();
            }
        }
        let y = paragraph(&mut canvas, (BORDER_PX, below + 18.0), &self.caption(), NOTE, TEXT_WIDTH_PX);
        drawing::document(canvas, y)
    }

    fn all_rows(&self) -> impl Iterator<Item = &ForestRow> {
        self.groups.iter().flat_map(|g| g.reference.iter().chain(&g.rows))
    }

    /// The axis around all that is drawn; `None` if nothing is.
    fn axis(&self) -> Option<Axis> {
        let mut reach = Vec::new();
        let mut intervals = Vec::new();
        for drawn in self.all_rows().map(|row| row.drawn(self.scale)) {
            let estimate = drawn.estimate.or(drawn.below.then_some(0.0));
            let ends = drawn.interval.or(estimate.map(|e| (e, e)));
            if let Some((lower, upper)) = ends {
                reach.extend([lower, upper].into_iter().chain(estimate));
                intervals.push((estimate.unwrap_or(upper), lower, upper));
            }
        }
        match self.scale {
            AxisScale::Linear => Axis::around(self.scale, &reach, PLOT_PX),
            AxisScale::Logarithmic => Axis::around(self.scale, &logarithmic_reach(&intervals), PLOT_PX),
        }
    }

    fn grid(&self, canvas: &mut Canvas, axis: &Axis, (top, bottom): (f64, f64), numbers_on_top: bool) {
        for tick in axis.ticks(MAX_NUMBERS) {
            let Some(label) = &tick.label else { continue };
            line(canvas, (tick.at_px, top), (tick.at_px, bottom), GRID, 0.8);
            if numbers_on_top {
                line(canvas, (tick.at_px, top - 6.0), (tick.at_px, top), GREY, 1.0);
                text(canvas, (tick.at_px, top - 10.0), label, drawing::TICK, TextAnchor::Middle);
            }
        }
    }

    /// Heading, reference and rows of one group from `top` on; returns the y below.
    fn group(&self, canvas: &mut Canvas, axis: Option<&Axis>, group: &ForestGroup, top: f64) -> f64 {
        let mut y = paragraph(canvas, (BORDER_PX, top + 8.0), &group.name, NAME_BOLD, NAME_WIDTH_PX) + 2.0;
        let bottom = top + group.height_px(self.scale);
        if let Some(reference) = &group.reference {
            let drawn = reference.drawn(self.scale);
            if let (Some(axis), Some((lower, upper))) = (axis, drawn.interval) {
                // At least a line, where the interval is narrower than one.
                let (left, right) = (axis.at(lower), axis.at(upper).max(axis.at(lower) + 1.0));
                let corners = [(left, y), (right, y), (right, bottom), (left, bottom)];
                area(canvas, &corners, Color::from(REFERENCE_COLOUR), 0.28);
            }
            if let (Some(axis), Some(estimate)) = (axis, drawn.estimate) {
                line(canvas, (axis.at(estimate), y), (axis.at(estimate), bottom), REFERENCE_COLOUR, 1.4);
            }
            y = self.row(canvas, axis, reference, &reference_look(), y, &group.name);
        }
        for row in &group.rows {
            y = self.row(canvas, axis, row, &row_look(), y, &group.name);
        }
        bottom
    }

    /// One line: name, mark, numbers; returns the y below.
    fn row(
        &self,
        canvas: &mut Canvas,
        axis: Option<&Axis>,
        row: &ForestRow,
        look: &Look,
        y: f64,
        group_name: &str,
    ) -> f64 {
        let (words, height_px) = (row.words(self.scale), row.height_px(self.scale));
        paragraph(canvas, (BORDER_PX + INDENT_PX, y + 3.0), &row.name, ROW, NAME_WIDTH_PX - INDENT_PX);
        paragraph(canvas, (VALUE_LEFT_PX, y + 3.0), &words, ROW, VALUE_WIDTH_PX);
        let Some(axis) = axis else { return y + height_px };
        let middle = y + 3.0 + ROW.line_px() / 2.0;
        let drawn = row.drawn(self.scale);
        let tip = format!("{}; {}: {words}", plain(group_name), plain(&row.name));
        let class = if drawn.below { "class=\"limit\"" } else { "class=\"estimate\"" };
        if drawn.estimate.is_some() || drawn.below {
            group(canvas, class, Some(tip));
            if let (Some((_, upper)), true) = (drawn.interval, drawn.below) {
                limit(canvas, (axis.at(upper), middle), look);
            } else if let Some((lower, upper)) = drawn.interval {
                whisker(canvas, axis, (lower, upper), middle, look);
            }
            if let Some(estimate) = drawn.estimate {
                canvas.add(look.marker((axis.at(estimate), middle)));
            }
            canvas.add(Shape::GroupEnd);
        }
        y + height_px
    }

    /// What the marks mean, as far as they occur.
    fn caption(&self) -> String {
        let drawn: Vec<Drawn> = self.all_rows().map(|row| row.drawn(self.scale)).collect();
        if drawn.iter().all(|d| d.estimate.is_none() && !d.below) {
            return "There is no estimate to draw.".to_string();
        }
        let mut words = "Marker: estimate. Line: its interval.".to_string();
        if self.groups.iter().any(|g| g.reference.is_some()) {
            words.push_str(" Band: interval of the group's reference, the diamond.");
        }
        if drawn.iter().any(|d| d.below) {
            words.push_str(" Arrow: the estimate is zero; the bar is the interval's upper end.");
        }
        let cut = |d: &Drawn| {
            !d.below
                && d.estimate.is_some()
                && d.interval.is_some_and(|(lower, _)| lower < d.estimate.unwrap_or(0.0) / 10.0)
        };
        if self.scale == AxisScale::Logarithmic && drawn.iter().any(cut) {
            words.push_str(" A line that reaches the left edge goes on beyond it.");
        }
        words
    }
}

impl ForestRow {
    fn height_px(&self, scale: AxisScale) -> f64 {
        let names = ROW.wrap(&self.name, NAME_WIDTH_PX - INDENT_PX).len();
        names.max(ROW.wrap(&self.words(scale), VALUE_WIDTH_PX).len()).max(1) as f64 * ROW.line_px() + 6.0
    }
}

impl ForestGroup {
    fn height_px(&self, scale: AxisScale) -> f64 {
        let head = NAME_BOLD.wrap(&self.name, NAME_WIDTH_PX).len() as f64 * NAME_BOLD.line_px() + 10.0;
        self.reference.iter().chain(&self.rows).map(|row| row.height_px(scale)).sum::<f64>() + head + 4.0
    }
}

fn row_look() -> Look {
    Look { line_px: 1.8, marker_px: 5.0, ..Look::of(0, 1) }
}

fn reference_look() -> Look {
    Look { colour: Color::from(INK), corners: (4, true), marker_px: 6.0, ..row_look() }
}

/// The interval with a short bar at each end that is on the axis.
fn whisker(canvas: &mut Canvas, axis: &Axis, (lower, upper): (f64, f64), y: f64, look: &Look) {
    let (left, right) = (axis.at(lower), axis.at(upper));
    canvas.add(look.line(path_data(&[(left, y), (right, y)], false)));
    for end in [left, right].into_iter().filter(|x| *x > PLOT_PX.0) {
        canvas.add(look.line(path_data(&[(end, y - 4.0), (end, y + 4.0)], false)));
    }
}

/// A short bar with an arrow to the left: the value is somewhere below.
fn limit(canvas: &mut Canvas, (x, y): (f64, f64), look: &Look) {
    canvas.add(look.line(path_data(&[(x, y - 5.0), (x, y + 5.0)], false)));
    canvas.add(look.line(path_data(&[(x - 11.0, y), (x, y)], false)));
    area(canvas, &[(x - 10.0, y - 4.0), (x - 10.0, y + 4.0), (x - 18.0, y)], look.colour.clone(), 1.0);
}

#[cfg(test)]
mod tests {
    use super::super::drawing::tests::words;
    use super::*;
    use AxisScale::{Linear, Logarithmic};

    fn row(name: &str, estimate: Option<f64>) -> ForestRow {
        let middle = estimate.unwrap_or(f64::NAN);
        ForestRow { name: name.into(), estimate, lower: middle * 0.7, upper: middle * 1.4 }
    }

    fn figure(scale: AxisScale, groups: usize, rows: Vec<ForestRow>) -> ForestFigure {
        let group = |g: usize| ForestGroup {
            name: format!("Group{g}"),
            reference: Some(row("plain Monte Carlo", Some(1.2e-4))),
            rows: rows.clone(),
        };
        let groups = (0..groups).map(group).collect();
        ForestFigure { title: "Cut-in".into(), subtitle: None, axis: "Failures (1/h)".into(), scale, groups }
    }

    fn marks(svg: &str) -> (usize, usize) {
        (svg.matches("class=\"estimate\"").count(), svg.matches("class=\"limit\"").count())
    }

    #[test]
    fn every_row_is_named_with_its_numbers_and_has_a_mark() {
        for scale in [Linear, Logarithmic] {
            let svg = figure(scale, 2, vec![row("splitting", Some(1.5e-4)), row("importance", Some(9e-5))]).svg();
            let words = words(&svg);
            for name in ["Group0", "Group1", "splitting", "importance", "Failures (1/h)", "1.5e-4 [1.05e-4, 2.1e-4]"] {
                assert!(words.contains(name), "{name} in {words}");
            }
            assert_eq!(marks(&svg), (6, 0));
            assert!(words.contains("Band:") && !words.contains("Arrow"));
        }
    }

    #[test]
    fn an_undefined_estimate_is_said_and_not_drawn() {
        let nan = ForestRow { estimate: Some(f64::NAN), ..row("nan", Some(1e-4)) };
        let open = ForestRow { upper: f64::INFINITY, ..row("open", Some(1e-4)) };
        let swapped = ForestRow { lower: 0.2, upper: 0.1, ..row("swapped", Some(1e-4)) };
        let svg = figure(Linear, 1, vec![row("none", None), nan, open, swapped]).svg();
        assert_eq!(marks(&svg), (3, 0), "the reference and two without interval");
        assert!(!svg.contains("NaN"));
        let words = words(&svg);
        for part in ["undefined", "not drawn: not a number", "1e-4 no interval", "0.2 is above 0.1"] {
            assert!(words.contains(part), "{part} in {words}");
        }
    }

    #[test]
    fn zero_is_a_limit_on_a_logarithmic_axis_and_a_point_on_a_linear_one() {
        let zero = ForestRow { name: "zero".into(), estimate: Some(0.0), lower: 0.0, upper: 3e-5 };
        let nothing = ForestRow { upper: 0.0, ..zero.clone() };
        let negative = ForestRow { lower: -2.0, upper: -0.5, estimate: Some(-1.0), name: "negative".into() };
        let rows = vec![zero, nothing, negative];
        assert_eq!(marks(&figure(Linear, 1, rows.clone()).svg()), (4, 0));
        let svg = figure(Logarithmic, 1, rows).svg();
        assert_eq!(marks(&svg), (1, 1));
        let words = words(&svg);
        assert!(words.contains("Arrow: the estimate is zero"));
        assert_eq!(words.matches("(not on a logarithmic axis)").count(), 2, "{words}");
    }

    #[test]
    fn the_heights_of_the_rows_fill_the_group() {
        let long = row(&"a very long name ".repeat(20), Some(1e-4));
        let figure = figure(Logarithmic, 1, vec![long, row("", None)]);
        let mut canvas = super::super::drawing::sheet(WIDTH_PX);
        let group = &figure.groups[0];
        let rows: f64 = group.reference.iter().chain(&group.rows).map(|r| r.height_px(Logarithmic)).sum();
        let bottom = figure.group(&mut canvas, figure.axis().as_ref(), group, 0.0);
        assert!(bottom >= rows + NAME_BOLD.line_px());
    }

    #[test]
    fn empty_equal_many_and_endless_rows_make_a_picture() {
        for scale in [Linear, Logarithmic] {
            assert!(words(&figure(scale, 0, vec![]).svg()).contains("There is no estimate to draw."));
            let mut undefined = figure(scale, 1, vec![row("none", None)]);
            undefined.groups[0].reference = None;
            assert!(words(&undefined.svg()).contains("There is no estimate to draw."));
            let equal = ForestRow { name: "equal".into(), estimate: Some(1.0), lower: 1.0, upper: 1.0 };
            let mut same = figure(scale, 1, vec![equal.clone(), equal]);
            same.groups[0].reference = None;
            assert_eq!(marks(&same.svg()), (2, 0));
            let rows = (1..=100).map(|k| row(&format!("row {k}"), Some(1e-6 * f64::from(k)))).collect();
            let many = figure(scale, 1, rows);
            assert_eq!(marks(&many.svg()), (101, 0));
            assert_eq!(many.svg(), many.svg());
            let long = figure(scale, 2, vec![row(&"x".repeat(300), Some(1e-4)), row("a < b & $c$", Some(1e-4))]);
            assert_eq!(words(&long.svg()).matches('x').count(), 600);
        }
    }
}
