//! A forest plot: estimates with their intervals, one line each, in groups, with each group's reference as a band.

use super::plot::{AxisScale, logarithmic_reach, number};
use super::plot::{
    Cells, Ends, Figure, Fill, FilledCell, HOLLOW, Height, INK, Layer, Look, Mark, Name, Plot, PlotAxis, ROW, Rule,
    Series, Symbol, Value, is_few,
};
use crate::support::readable::counted;

/// One estimate.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ForestRow {
    /// The estimated quantity or the method; wrapped when long.
    pub name: String,
    /// The estimate, in the axis's unit. `None` is undefined (0/0): stated in words and not drawn.
    pub estimate: Option<f64>,
    /// Lower end of the interval; not drawn if it or `upper` is not finite or they are swapped.
    pub lower: f64,
    /// Upper end of the interval.
    pub upper: f64,
    /// Ends of a wider interval, drawn thinner.
    pub outer: Option<(f64, f64)>,
    /// Scenarios with a failure, if known.
    pub failing_scenarios: Option<u64>,
}

/// A group of estimates.
#[derive(Debug, Clone, PartialEq)]
pub struct ForestGroup {
    /// Heading of the group, such as the driver model and criterion; wrapped when long.
    pub name: String,
    /// Reference of the rows; its interval is a band through the group.
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
    /// Label of the axis, with unit, such as `Failures per hour (1/h)`.
    pub axis: String,
    /// Scale of the axis. On a logarithmic axis an estimate of zero is drawn as the interval's upper end with an arrow
    /// to the left.
    pub scale: AxisScale,
    /// What the intervals cover, in one sentence.
    pub intervals: String,
    /// The groups, from top to bottom.
    pub groups: Vec<ForestGroup>,
}

/// With more lines than this the axis is also drawn at the top.
const LONG_ROWS: usize = 20;
/// Colour of a reference's band. The reference estimate is a diamond, that of a row a disc.
const REFERENCE_COLOUR: &str = "#e69f00";
/// Space below a group.
const GROUP_GAP_PX: f64 = 4.0;

/// The parts of a row that can be drawn on the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Drawn {
    estimate: Option<f64>,
    interval: Option<(f64, f64)>,
    /// The estimate is zero on a logarithmic axis: only the upper end is drawn.
    below: bool,
}

impl ForestRow {
    /// The number of scenarios with a failure, if it is small.
    fn few(&self) -> Option<u64> {
        self.failing_scenarios.filter(|n| is_few(*n as f64))
    }

    fn drawn(&self, scale: AxisScale) -> Drawn {
        let finite = |v: f64| AxisScale::Linear.shows(v);
        let estimate = self.estimate.filter(|e| finite(*e));
        let ordered = finite(self.lower) && finite(self.upper) && self.lower <= self.upper;
        let interval = (ordered && scale.shows(self.upper) && estimate.is_some()).then_some((self.lower, self.upper));
        let zero = scale == AxisScale::Logarithmic && estimate == Some(0.0);
        Drawn { estimate: estimate.filter(|e| scale.shows(*e)), interval, below: zero && interval.is_some() }
    }

    /// Estimate and interval as numbers, and the reason if one is not drawn.
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
            format!("[{lower},\u{a0}{upper}]")
        };
        let drawn = self.drawn(scale);
        let nowhere = drawn.estimate.is_none() && !drawn.below;
        let off = if nowhere { " (not on a logarithmic axis)" } else { "" };
        let outer =
            self.outer.map_or(String::new(), |(low, high)| format!(", [{},\u{a0}{}]", number(low), number(high)));
        let few = self.few().map_or(String::new(), |n| format!(", {}", counted(n as usize, "scenario")));
        format!("{} {interval}{outer}{off}{few}", number(estimate))
    }
}

impl ForestFigure {
    /// The figure: every row has its name and numbers; anything that cannot be drawn is stated there.
    pub fn figure(&self) -> Figure {
        let lines = self.groups.iter().map(|g| g.rows.len() + 2).sum::<usize>();
        let (title, subtitle) = (self.title.clone(), self.subtitle.clone());
        let plots = if lines == 0 { Vec::new() } else { vec![self.plot(lines > LONG_ROWS)] };
        Figure { title, subtitle, plots, caption: self.caption(), ..Figure::default() }
    }

    /// Rows are on a vertical axis in px, downwards from the top.
    fn plot(&self, is_doubled: bool) -> Plot {
        let (mut names, mut bands, mut y) = (Vec::new(), Vec::new(), 0.0);
        let look = Look { line_px: 1.8, marker_px: 5.0, ..Look::of(0, 1) };
        let diamond = Look { colour: INK, symbol: Symbol::Polygon(4, 0.0), marker_px: 6.0, ..look };
        let series = |look| Series {
            look: Some(look),
            is_sideways: true,
            attributes: "class=\"estimate\"".to_owned(),
            ..Series::new("", &[Mark::Points, Mark::Intervals], [])
        };
        let mut layers = [series(look), series(diamond)];
        let mut rule = Rule { colour: REFERENCE_COLOUR, width_px: 1.4, ..Rule::default() };
        for group in &self.groups {
            let mut add = |name: Name| {
                let from = y;
                y += name.height_px();
                names.push(Name { at: -from, ..name });
                -from
            };
            let heading = Name { words: group.name.clone(), is_heading: true, ..Name::default() };
            let top = -heading.height_px() + add(heading);
            let rows = group.reference.iter().map(|row| (row, 1)).chain(group.rows.iter().map(|row| (row, 0)));
            for (row, layer) in rows {
                let note = row.words(self.scale);
                let tip = format!("{}; {}: {note}", group.name, row.name);
                let from = add(Name { words: row.name.clone(), note, ..Name::default() });
                let Drawn { estimate, interval, below } = row.drawn(self.scale);
                if let Some(x) = estimate.or(below.then_some(0.0)) {
                    let y = from - 3.0 - ROW.line_px() / 2.0;
                    let (outer, is_few) = (row.outer, row.few().is_some());
                    layers[layer].values.push(Value { x, y, interval, outer, is_few, tip, ..Value::default() });
                }
            }
            y += GROUP_GAP_PX;
            let Some(reference) = group.reference.as_ref().map(|row| row.drawn(self.scale)) else { continue };
            if let Some((lower, upper)) = reference.interval {
                let fill = Fill { colour: REFERENCE_COLOUR.to_owned(), opacity: Some(0.28), ..Fill::default() };
                bands.push(FilledCell { corners: [(lower, top), (upper, -y)], fill, tip: String::new() });
            }
            rule.runs.extend(reference.estimate.map(|estimate| vec![(estimate, top), (estimate, -y)]));
        }
        let cells = Cells { cells: bands, ..Cells::default() };
        let layers = [Layer::from(cells), rule.into()].into_iter().chain(layers.map(Layer::from));
        let x = PlotAxis { scale: self.scale, ends: Ends::Around(self.reach()), ..PlotAxis::new(&self.axis) };
        Plot {
            x: PlotAxis { is_doubled, ..x },
            y: PlotAxis { names, ..PlotAxis::exactly("", -y, 0.0) },
            layers: layers.collect(),
            height: Height::Px(y),
            ..Plot::default()
        }
    }

    fn all_rows(&self) -> impl Iterator<Item = &ForestRow> {
        self.groups.iter().flat_map(|g| g.reference.iter().chain(&g.rows))
    }

    /// The values that the axis must include.
    fn reach(&self) -> Vec<f64> {
        let mut reach = Vec::new();
        let mut intervals = Vec::new();
        for (row, drawn) in self.all_rows().map(|row| (row, row.drawn(self.scale))) {
            let estimate = drawn.estimate.or(drawn.below.then_some(0.0));
            let ends = drawn.interval.or(estimate.map(|e| (e, e)));
            let ends = ends.map(|ends| row.outer.map_or(ends, |o| (o.0.min(ends.0), o.1.max(ends.1))));
            if let Some((lower, upper)) = ends {
                reach.extend([lower, upper].into_iter().chain(estimate));
                intervals.push((estimate.unwrap_or(upper), lower, upper));
            }
        }
        if self.scale == AxisScale::Linear { reach } else { logarithmic_reach(&intervals) }
    }

    /// Explains the marks that occur.
    fn caption(&self) -> String {
        let drawn: Vec<Drawn> = self.all_rows().map(|row| row.drawn(self.scale)).collect();
        if drawn.iter().all(|d| d.estimate.is_none() && !d.below) {
            return "There is no estimate to draw.".to_string();
        }
        let mut words = format!("Marker: estimate. {}", self.intervals);
        if self.groups.iter().any(|g| g.reference.is_some()) {
            words.push_str(" Band: interval of the group's reference, the diamond.");
        }
        if drawn.iter().any(|d| d.below) {
            words.push_str(" Arrow: the estimate is zero; the bar is the interval's upper end.");
        }
        if self.all_rows().any(|row| row.few().is_some()) {
            words = [&words, HOLLOW].join(" ");
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

#[cfg(test)]
mod tests {
    use super::super::plot::words;
    use super::*;
    use AxisScale::{Linear, Logarithmic};

    fn row(name: &str, estimate: Option<f64>) -> ForestRow {
        let middle = estimate.unwrap_or(f64::NAN);
        ForestRow { name: name.into(), estimate, lower: middle * 0.7, upper: middle * 1.4, ..ForestRow::default() }
    }

    fn figure(scale: AxisScale, groups: usize, rows: Vec<ForestRow>) -> ForestFigure {
        let group = |g: usize| ForestGroup {
            name: format!("Group{g}"),
            reference: Some(row("plain Monte Carlo", Some(1.2e-4))),
            rows: rows.clone(),
        };
        let groups = (0..groups).map(group).collect();
        ForestFigure {
            title: "Cut-in".into(),
            subtitle: None,
            axis: "Failures (1/h)".into(),
            scale,
            intervals: "Line: 95 %.".into(),
            groups,
        }
    }

    fn marks(svg: &str) -> (usize, usize) {
        (svg.matches("class=\"estimate\"").count(), svg.matches("class=\"limit\"").count())
    }

    #[test]
    fn every_row_is_named_with_its_numbers_and_has_a_mark() {
        for scale in [Linear, Logarithmic] {
            let svg =
                figure(scale, 2, vec![row("splitting", Some(1.5e-4)), row("importance", Some(9e-5))]).figure().svg();
            let words = words(&svg);
            for name in ["Group0", "Group1", "splitting", "importance", "Failures (1/h)", "1.5e-4 [1.05e-4, 2.1e-4]"] {
                assert!(words.contains(name), "{name} in {words}");
            }
            assert_eq!(marks(&svg), (6, 0));
            assert!(words.contains("Band:") && !words.contains("Arrow"));
        }
    }

    #[test]
    fn an_estimate_from_few_scenarios_is_hollow_and_says_how_many_and_a_second_interval_is_drawn() {
        let rows = vec![
            row("plain", Some(1e-4)),
            ForestRow { outer: Some((1e-5, 1e-3)), failing_scenarios: Some(7), ..row("few", Some(1e-4)) },
        ];
        let svg = figure(Logarithmic, 1, rows).figure().svg();
        assert_eq!(svg.matches("fill=\"#ffffff\" stroke=\"#0072b2\"").count(), 1);
        let words = words(&svg);
        for said in ["1e-4 [7e-5, 1.4e-4], [1e-5, 0.001], 7 scenarios", "Line: 95 %.", "Hollow"] {
            assert!(words.contains(said), "{said} in {words}");
        }
    }

    #[test]
    fn an_undefined_estimate_is_said_and_not_drawn() {
        let nan = ForestRow { estimate: Some(f64::NAN), ..row("nan", Some(1e-4)) };
        let open = ForestRow { upper: f64::INFINITY, ..row("open", Some(1e-4)) };
        let swapped = ForestRow { lower: 0.2, upper: 0.1, ..row("swapped", Some(1e-4)) };
        let svg = figure(Linear, 1, vec![row("none", None), nan, open, swapped]).figure().svg();
        assert_eq!(marks(&svg), (3, 0), "the reference and two without interval");
        assert!(!svg.contains("NaN"));
        let words = words(&svg);
        for part in ["undefined", "not drawn: not a number", "1e-4 no interval", "0.2 is above 0.1"] {
            assert!(words.contains(part), "{part} in {words}");
        }
    }

    #[test]
    fn zero_is_a_limit_on_a_logarithmic_axis_and_a_point_on_a_linear_one() {
        let zero = ForestRow { upper: 3e-5, ..row("zero", Some(0.0)) };
        let nothing = ForestRow { upper: 0.0, ..zero.clone() };
        let negative = ForestRow { lower: -2.0, upper: -0.5, ..row("negative", Some(-1.0)) };
        let rows = vec![zero, nothing, negative];
        assert_eq!(marks(&figure(Linear, 1, rows.clone()).figure().svg()), (4, 0));
        let svg = figure(Logarithmic, 1, rows).figure().svg();
        assert_eq!(marks(&svg), (1, 1));
        let words = words(&svg);
        assert!(words.contains("Arrow: the estimate is zero"));
        assert_eq!(words.matches("(not on a logarithmic axis)").count(), 2, "{words}");
    }

    #[test]
    fn the_names_stand_below_one_another_and_within_the_plot() {
        let long = row(&"a very long name ".repeat(20), Some(1e-4));
        let plot = figure(Logarithmic, 1, vec![long, row("", None)]).plot(false);
        let ends: Vec<(f64, f64)> = plot.y.names.iter().map(|name| (-name.at, name.height_px() - name.at)).collect();
        assert!(ends.windows(2).all(|pair| pair[0].1 <= pair[1].0 + 1e-9), "{ends:?}");
        assert!(matches!(plot.height, Height::Px(px) if ends.iter().all(|end| end.1 <= px)));
    }

    #[test]
    fn empty_equal_many_and_endless_rows_make_a_picture() {
        for scale in [Linear, Logarithmic] {
            assert!(words(&figure(scale, 0, vec![]).figure().svg()).contains("There is no estimate to draw."));
            let mut undefined = figure(scale, 1, vec![row("none", None)]);
            undefined.groups[0].reference = None;
            assert!(words(&undefined.figure().svg()).contains("There is no estimate to draw."));
            let equal = ForestRow { lower: 1.0, upper: 1.0, ..row("equal", Some(1.0)) };
            let mut same = figure(scale, 1, vec![equal.clone(), equal]);
            same.groups[0].reference = None;
            assert_eq!(marks(&same.figure().svg()), (2, 0));
            let rows = (1..=100).map(|k| row(&format!("row {k}"), Some(1e-6 * f64::from(k)))).collect();
            let many = figure(scale, 1, rows);
            assert_eq!(marks(&many.figure().svg()), (101, 0));
            assert_eq!(many.figure().svg(), many.figure().svg());
            let long = figure(scale, 2, vec![row(&"x".repeat(300), Some(1e-4)), row("a < b & $c$", Some(1e-4))]);
            assert_eq!(words(&long.figure().svg()).matches('x').count(), 600);
        }
    }
}
