//! Convergence of an estimate: failure probability with its interval over the number of samples, one panel per driver
//! model, all panels on the same axes.
//!
//! Both axes are logarithmic, because probabilities span decades. They cannot show an estimate of zero: its interval's
//! upper end is drawn instead, with an arrow downwards.

use super::plot::{AxisScale, logarithmic_reach, number};
use super::plot::{Ends, Figure, HOLLOW, Mark, Plot, PlotAxis, Series, Value, is_few};
use crate::run::sampling::Checkpoint;
use crate::stats::density::DensityModel;

/// The estimate after a number of samples.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ConvergencePoint {
    /// Samples so far, at least 1.
    pub samples: u64,
    /// Estimated probability, in 0..=1. Zero is drawn as the upper limit.
    pub probability: f64,
    /// Lower end of the interval, finite; a value below 0 is treated as 0.
    pub lower: f64,
    /// Upper end of the interval, finite, not below `lower`; a value above 1 is treated as 1.
    pub upper: f64,
    /// Ends of the interval that also covers the sampling of scenarios, if known.
    pub outer: Option<(f64, f64)>,
    /// Number of scenarios with failures, if known.
    pub failing_scenarios: Option<f64>,
}

/// One line: the estimates of one quantity in the order of their samples (sorted before drawing).
#[derive(Debug, Clone, PartialEq)]
pub struct ConvergenceSeries {
    /// Heading of its panel, such as the driver model; series with the same heading are in the same panel.
    pub panel: String,
    /// Name in the legend, such as the criterion; the same name has the same look in every panel.
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
    /// Confidence level of the intervals, 0 to 1.
    pub level: f64,
    /// The lines; panels and legend in the order of first appearance.
    pub series: Vec<ConvergenceSeries>,
}

impl ConvergencePoint {
    /// Why the point cannot be drawn; `None` if it can.
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

/// The sampled density, for the line below a heading.
pub(super) fn sampled(density: &DensityModel) -> String {
    let id = density.space.id();
    format!("{} {} · {}", id.category.label(), id.key, density.provenance.data)
}

impl ConvergenceFigure {
    /// Failure probability over the samples of a sampling run, one panel per driver model.
    pub fn of(density: &DensityModel, checkpoints: &[Checkpoint], level: f64) -> ConvergenceFigure {
        let mut series: Vec<ConvergenceSeries> = Vec::new();
        for checkpoint in checkpoints {
            for row in &checkpoint.rows {
                let (panel, name) = (row.model.name(), row.criterion.label());
                let point = ConvergencePoint {
                    samples: checkpoint.samples,
                    probability: row.probability,
                    lower: row.interval[0],
                    upper: row.interval[1],
                    outer: row.with_data.map(|([low, high], _)| (low, high)),
                    failing_scenarios: row.with_data.map(|(_, scenarios)| scenarios),
                };
                match series.iter_mut().find(|s| s.panel == panel && s.name == name) {
                    Some(known) => known.points.push(point),
                    None => series.push(ConvergenceSeries {
                        panel: panel.to_owned(),
                        name: name.to_owned(),
                        points: vec![point],
                    }),
                }
            }
        }
        let title = "Failure probability against samples".to_owned();
        ConvergenceFigure { title, subtitle: Some(sampled(density)), level, series }
    }

    /// The figure. Invalid points (not finite, not a probability, no samples, swapped interval ends, zero without an
    /// upper limit) are not drawn but counted in a note.
    pub fn figure(&self) -> Figure {
        let drawn: Vec<Vec<ConvergencePoint>> = self.series.iter().map(drawable).collect();
        let is_empty = drawn.iter().all(Vec::is_empty);
        // The same axes for all panels, so that they can be compared.
        let points = || drawn.iter().flatten();
        let samples = points().map(|p| p.samples as f64).collect();
        let widest =
            |p: &ConvergencePoint| p.outer.map_or((p.lower, p.upper), |o| (o.0.min(p.lower), o.1.max(p.upper)));
        let intervals: Vec<_> = points().map(|p| (p.probability, widest(p).0, widest(p).1)).collect();
        let axis = |label: &str, values| PlotAxis {
            scale: AxisScale::Logarithmic,
            ends: Ends::Around(values),
            ..PlotAxis::new(label)
        };
        let (x, y) = (axis("Samples", samples), axis("Failure probability", logarithmic_reach(&intervals)));
        let plot = |panel: &str| {
            let here = self.series.iter().zip(&drawn).filter(|(series, _)| series.panel == panel);
            Plot {
                heading: panel.to_owned(),
                x: x.clone(),
                y: y.clone(),
                layers: here.map(|(series, points)| series.layer(points).into()).collect(),
                ..Plot::default()
            }
        };
        let panels = distinct(self.series.iter().map(|s| s.panel.as_str()));
        Figure {
            title: self.title.clone(),
            subtitle: self.subtitle.clone(),
            plots: if is_empty { Vec::new() } else { panels.into_iter().map(plot).collect() },
            caption: if is_empty { "There is no estimate to draw.".to_owned() } else { self.caption(&drawn) },
            notes: ("Not drawn:", self.refused()),
        }
    }

    /// Explains the marks that occur.
    fn caption(&self, drawn: &[Vec<ConvergencePoint>]) -> String {
        let level = 100.0 * self.level;
        let mut words = format!(
            "Marker: estimate. Area or whisker: its {level} % interval over the draws alone, which more samples make \
             narrower. "
        );
        let points = || drawn.iter().flatten();
        words.push_str(match points().any(|p| p.outer.is_some()) {
            true => {
                "Pale area: the interval over draws and scenarios, at fixed bandwidth and scale; more samples do not make \
                 it narrower than the scenarios allow. "
            }
            false => "It does not cover what other scenarios would change. ",
        });
        words.push_str("Both axes are logarithmic.");
        if points().any(|p| p.failing_scenarios.is_some_and(is_few)) {
            words = [&words, HOLLOW].join(" ");
        }
        if points().any(|p| p.probability > 0.0 && p.outer.map_or(p.lower, |o| o.0) < p.probability / 10.0) {
            words.push_str(" An interval that reaches the lower edge goes on below it.");
        }
        if points().any(|p| p.probability == 0.0) {
            words.push_str(" Arrow: the estimate is zero; the bar is the interval's upper end.");
        }
        words
    }

    /// Per series and reason, the number of points not drawn.
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

impl ConvergenceSeries {
    fn layer(&self, points: &[ConvergencePoint]) -> Series {
        let value = |p: &ConvergencePoint| {
            let [estimate, lower, upper] = [p.probability, p.lower, p.upper].map(number);
            let name = [self.panel.as_str(), self.name.as_str()].join(" ");
            let tip = format!("{name}: {estimate} [{lower}, {upper}] after {} samples", p.samples);
            let (x, y) = (p.samples as f64, p.probability);
            let is_few = p.failing_scenarios.is_some_and(is_few);
            Value { x, y, interval: Some((p.lower, p.upper)), outer: p.outer, is_few, tip, ..Value::default() }
        };
        let mut values: Vec<Value> = points.iter().map(value).collect();
        // A number at every point would cover the line.
        if let Some((value, p)) = values.last_mut().zip(points.last()).filter(|(value, _)| value.is_few) {
            value.label = p.failing_scenarios.map_or(String::new(), |n| format!("{n:.0}"));
        }
        Series {
            values,
            attributes: "class=\"estimate\"".to_owned(),
            ..Series::new(&self.name, &[Mark::Band, Mark::Line, Mark::Points], [])
        }
    }
}

fn drawable(series: &ConvergenceSeries) -> Vec<ConvergencePoint> {
    let mut points: Vec<_> = series.points.iter().copied().filter(|p| p.refusal().is_none()).collect();
    for p in &mut points {
        p.upper = p.upper.min(1.0);
        p.outer = p.outer.map(|(low, high)| (low, high.min(1.0))).filter(|(low, high)| low <= high && low.is_finite());
    }
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

#[cfg(test)]
mod tests {
    use super::super::plot::Axis;
    use super::super::plot::words;
    use super::*;

    fn point(samples: u64, probability: f64) -> ConvergencePoint {
        let half = 2.0 * (probability.max(1e-6) / samples as f64).sqrt();
        ConvergencePoint {
            samples,
            probability,
            lower: (probability - half).max(0.0),
            upper: probability + half,
            ..ConvergencePoint::default()
        }
    }

    fn figure(panels: usize, names: usize, probability: impl Fn(usize) -> f64) -> ConvergenceFigure {
        let series = |i: usize| ConvergenceSeries {
            panel: format!("Model{}", i / names),
            name: format!("Criterion{}", i % names),
            points: (3..7).map(|k| point(10_u64.pow(k), probability(i))).collect(),
        };
        ConvergenceFigure {
            title: "Cut-in".into(),
            subtitle: None,
            level: 0.95,
            series: (0..panels * names).map(series).collect(),
        }
    }

    fn marks(svg: &str) -> (usize, usize) {
        (svg.matches("class=\"estimate\"").count(), svg.matches("class=\"limit\"").count())
    }

    #[test]
    fn every_panel_and_criterion_is_named_once_and_every_estimate_has_a_mark() {
        let svg = figure(4, 3, |i| 1e-2 / (i + 1) as f64).figure().svg();
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
        let svg = figure(1, 2, |i| [0.0, 1e-3][i]).figure().svg();
        assert_eq!(marks(&svg), (4, 4));
        assert!(words(&svg).contains("Arrow: the estimate is zero"));
        let svg = figure(2, 2, |_| 0.0).figure().svg();
        assert_eq!(marks(&svg), (0, 16), "all zero still makes a picture");
    }

    #[test]
    fn the_arrow_has_room_above_the_lower_edge() {
        let drawn: Vec<_> = figure(1, 1, |_| 0.0).series.iter().map(drawable).collect();
        let upper: Vec<f64> = drawn[0].iter().map(|p| p.upper).collect();
        let intervals: Vec<_> = upper.iter().map(|upper| (0.0, 0.0, *upper)).collect();
        let axis = Axis::around(AxisScale::Logarithmic, &logarithmic_reach(&intervals), (430.0, 0.0)).unwrap();
        let lowest = upper.iter().map(|upper| axis.at(*upper)).fold(0.0, f64::max);
        assert!(lowest + 15.0 < 430.0, "{lowest}");
    }

    #[test]
    fn the_interval_with_the_data_is_drawn_behind_that_of_the_draws_and_both_are_named() {
        let narrow = figure(1, 1, |_| 1e-2);
        let mut wide = narrow.clone();
        for point in &mut wide.series[0].points {
            (point.outer, point.failing_scenarios) = (Some((5e-3, 2e-2)), Some(7.2));
        }
        let [narrow, wide] = [narrow, wide].map(|figure| figure.figure().svg());
        let areas = |svg: &str| svg.matches("opacity=\"0.09\"").count();
        assert_eq!((areas(&narrow), areas(&wide)), (0, 1));
        let [narrow, wide] = [narrow, wide].map(|svg| words(&svg));
        assert!(narrow.contains("95 % interval over the draws alone") && narrow.contains("does not cover what other"));
        assert!(wide.contains("over draws and scenarios") && wide.contains("Hollow") && wide.contains('7'), "{wide}");
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
        let svg = figure.figure().svg();
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
        assert_eq!(marks(&one.figure().svg()), (1, 0));
        one.series[0].points.clear();
        assert!(words(&one.figure().svg()).contains("There is no estimate to draw."));
        one.series.clear();
        assert!(words(&one.figure().svg()).contains("There is no estimate to draw."));
        let mut long = figure(5, 3, |_| 1e-5);
        long.series[0].panel = "<model> & ".repeat(60);
        long.series[1].name = "q".repeat(400);
        assert_eq!(words(&long.figure().svg()).matches('q').count(), 400);
        assert_eq!(long.figure().svg(), long.figure().svg());
    }

    #[test]
    fn many_points_have_no_markers_but_zeros_keep_their_arrows() {
        let mut many = figure(1, 1, |_| 1e-3);
        many.series[0].points = (1..=1000).map(|n| point(n * 100, if n < 3 { 0.0 } else { 1e-3 })).collect();
        assert_eq!(marks(&many.figure().svg()), (0, 2));
    }
}
