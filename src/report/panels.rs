//! Small plots side by side: lines, points or bars over a number, on linear axes, with one legend for all.
//!
//! What differs between figures (which numbers, which words) is with who makes them; here is how they look, as a
//! picture and as numbers.

use super::axis::{Axis, AxisScale, number};
use super::csv;
use super::drawing::{
    self, BORDER_PX, GREY, Look, NAME_BOLD, NOTE, TEXT_WIDTH_PX, TICK, group, paragraph, path_data, plain, rect, text,
};
use super::svg::{Canvas, Color, Shape, TextAnchor};
use crate::Result;

/// How the values of a series are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Mark {
    /// A line through the values in their order, without markers.
    Line,
    /// A marker per value.
    Points,
    /// Both.
    LineAndPoints,
    /// A bar from zero per value, so wide in the unit of x.
    Bars(f64),
}

/// One series of values.
#[derive(Debug, Clone, PartialEq)]
pub struct PanelSeries {
    /// Name in the legend; the same name looks the same in every panel. An empty one is not in the legend.
    pub name: String,
    /// How it is drawn.
    pub mark: Mark,
    /// `(x, y)`; values that are not finite are left out of the picture and named in the numbers.
    pub values: Vec<(f64, f64)>,
    /// A word beside each value, or none at all.
    pub labels: Vec<String>,
}

/// A grey line behind the series, with a word at its end.
#[derive(Debug, Clone, PartialEq)]
pub struct Guide {
    /// The line, inside the panel's ranges.
    pub values: Vec<(f64, f64)>,
    /// The word.
    pub label: String,
}

/// One plot.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Panel {
    /// Heading.
    pub heading: String,
    /// Quantity and unit of the horizontal axis.
    pub x: String,
    /// Quantity and unit of the vertical axis.
    pub y: String,
    /// Ends of the axes, where they are not to follow the values.
    pub x_range: Option<(f64, f64)>,
    /// The same, vertically.
    pub y_range: Option<(f64, f64)>,
    /// What is drawn.
    pub series: Vec<PanelSeries>,
    /// Lines to compare with.
    pub guides: Vec<Guide>,
}

/// The plots with their words.
#[derive(Debug, Clone, PartialEq)]
pub struct PanelFigure {
    /// Heading; wrapped when long.
    pub title: String,
    /// Line below the heading; wrapped when long.
    pub subtitle: Option<String>,
    /// What the marks mean; wrapped when long.
    pub caption: String,
    /// The plots, row by row.
    pub panels: Vec<Panel>,
}

const LEFT_PX: f64 = 56.0;
const RIGHT_PX: f64 = 16.0;
const GAP_PX: f64 = 22.0;
/// With more values than this a line has no markers: they would hide it.
const MAX_MARKERS: usize = 40;
/// With more labelled values than this none is written out.
const MAX_WORDS: usize = 8;

impl PanelFigure {
    /// The figure as a complete SVG document, 1000 px wide and as high as its panels and texts need. The same figure
    /// gives the same bytes; a panel without a value says so.
    pub fn svg(&self) -> String {
        let (mut canvas, y) = drawing::page(&self.title, self.subtitle.as_deref());
        let names = self.names();
        let named: Vec<&str> = names.iter().filter(|name| !name.is_empty()).copied().collect();
        let look = |name: &str| look(named.iter().position(|n| *n == name).unwrap_or(0), named.len());
        let mut y = self.rows(&mut canvas, &look, y + 14.0);
        let legend: Vec<(&str, Look)> = named.iter().map(|name| (*name, look(name))).collect();
        if legend.len() > 1 {
            y = drawing::legend(&mut canvas, &legend, y + 8.0);
        }
        y = paragraph(&mut canvas, (BORDER_PX, y + 6.0), &self.caption, NOTE, TEXT_WIDTH_PX);
        drawing::document(canvas, y)
    }

    /// The numbers of the picture: one row per value.
    ///
    /// # Errors
    /// None for what this program makes.
    pub fn csv(&self) -> Result<Vec<u8>> {
        let header = ["panel", "series", "label", "x_quantity", "x", "y_quantity", "y"];
        let mut rows = vec![header.map(str::to_owned).to_vec()];
        for panel in &self.panels {
            for series in &panel.series {
                for (at, (x, y)) in series.values.iter().enumerate() {
                    let label = series.labels.get(at).cloned().unwrap_or_default();
                    let (x, y) = (x.to_string(), y.to_string());
                    let words = (panel.heading.clone(), series.name.clone(), panel.x.clone(), panel.y.clone());
                    rows.push(vec![words.0, words.1, label, words.2, x, words.3, y]);
                }
            }
        }
        csv::text(rows)
    }

    fn names(&self) -> Vec<&str> {
        let mut names: Vec<&str> = Vec::new();
        for series in self.panels.iter().flat_map(|panel| &panel.series) {
            if !names.contains(&series.name.as_str()) {
                names.push(&series.name);
            }
        }
        names
    }

    fn rows(&self, canvas: &mut Canvas, look: &dyn Fn(&str) -> Look, top: f64) -> f64 {
        let (columns, height_px) = match self.panels.len() {
            0 | 1 => (1, 420.0),
            2 | 4 => (2, 290.0),
            _ => (3, 220.0),
        };
        let width_px = (TEXT_WIDTH_PX - GAP_PX * (columns - 1) as f64) / columns as f64;
        let mut y = top;
        for in_row in self.panels.chunks(columns) {
            let heads = in_row.iter().map(|panel| NAME_BOLD.wrap(&panel.heading, width_px).len());
            let plot_top = y + heads.max().unwrap_or(0) as f64 * NAME_BOLD.line_px() + 26.0;
            let mut bottom = plot_top;
            for (column, panel) in in_row.iter().enumerate() {
                let left = BORDER_PX + column as f64 * (width_px + GAP_PX);
                paragraph(canvas, (left, y), &panel.heading, NAME_BOLD, width_px);
                let across = (left + LEFT_PX, left + width_px - RIGHT_PX);
                bottom = bottom.max(panel.draw(canvas, across, (plot_top, plot_top + height_px), look));
            }
            y = bottom + 20.0;
        }
        y
    }
}

impl Panel {
    /// The plot within these ends; returns the y below its words.
    fn draw(&self, canvas: &mut Canvas, across: (f64, f64), down: (f64, f64), look: &dyn Fn(&str) -> Look) -> f64 {
        let bottom = down.1 + 44.0;
        let (Some(x), Some(y)) = (self.x_axis(across), self.y_axis((down.1, down.0))) else {
            let middle = (across.0 + across.1) / 2.0;
            rect(canvas, (across.0, down.0), (across.1, down.1), Color::None, Some((GREY, 1.0)));
            text(canvas, (middle, (down.0 + down.1) / 2.0), "no value to draw", TICK, TextAnchor::Middle);
            return bottom;
        };
        text(canvas, (across.0 - LEFT_PX + 4.0, down.0 - 11.0), &self.y, TICK, TextAnchor::Start);
        y.draw_left(canvas, across, 6, true);
        let numbers = x.draw_below(canvas, down, ((across.1 - across.0) / 70.0) as usize, true);
        text(canvas, (across.1, numbers + 12.0), &self.x, TICK, TextAnchor::End);
        rect(canvas, (across.0, down.0), (across.1, down.1), Color::None, Some((GREY, 1.0)));
        let at = |(a, b): (f64, f64)| (x.at(a), y.at(b));
        for guide in &self.guides {
            let line: Vec<_> = guide.values.iter().copied().map(at).collect();
            let thin = Look { colour: Color::from(GREY), line_px: 0.9, dash: Some("4,4".to_owned()), ..look("") };
            canvas.add(thin.line(path_data(&line, false)));
            if let Some(&(end_x, end_y)) = line.last() {
                text(canvas, (end_x - 4.0, end_y - 4.0), &guide.label, TICK, TextAnchor::End);
            }
        }
        for series in &self.series {
            series.bars_and_line(canvas, &at, &look(&series.name));
        }
        // Every marker above every line.
        let mut taken: Vec<(f64, f64, f64)> = Vec::new();
        for series in &self.series {
            series.markers(canvas, &at, &look(&series.name), self, &mut taken);
        }
        bottom
    }

    fn finite(&self) -> impl Iterator<Item = (f64, f64)> {
        let all = self.series.iter().flat_map(|series| &series.values).copied();
        all.filter(|(x, y)| AxisScale::Linear.shows(*x) && AxisScale::Linear.shows(*y))
    }

    fn x_axis(&self, ends: (f64, f64)) -> Option<Axis> {
        if let Some(range) = self.x_range {
            return Some(Axis::exactly(range, ends));
        }
        let reach = |series: &PanelSeries| if let Mark::Bars(width) = series.mark { width / 2.0 } else { 0.0 };
        let half = self.series.iter().map(reach).fold(0.0, f64::max);
        let values: Vec<f64> = self.finite().flat_map(|(x, _)| [x - half, x + half]).collect();
        Axis::around(AxisScale::Linear, &values, ends)
    }

    fn y_axis(&self, ends: (f64, f64)) -> Option<Axis> {
        let has_values = self.finite().next().is_some();
        if let Some(range) = self.y_range.filter(|_| has_values) {
            return Some(Axis::exactly(range, ends));
        }
        let has_bars = self.series.iter().any(|series| matches!(series.mark, Mark::Bars(_)));
        let zero = has_bars.then_some(0.0);
        let values: Vec<f64> = self.finite().map(|(_, y)| y).chain(zero.filter(|_| has_values)).collect();
        Axis::around(AxisScale::Linear, &values, ends)
    }
}

impl PanelSeries {
    fn bars_and_line(&self, canvas: &mut Canvas, at: &dyn Fn((f64, f64)) -> (f64, f64), look: &Look) {
        if let Mark::Bars(width) = self.mark {
            for &(x, y) in self.values.iter().filter(|(x, y)| x.is_finite() && y.is_finite() && *y != 0.0) {
                let (from, to) = (at((x - width / 2.0, 0.0)), at((x + width / 2.0, y)));
                rect(canvas, from, to, look.colour.clone(), Some(("#ffffff", 0.8)));
            }
        }
        if matches!(self.mark, Mark::Line | Mark::LineAndPoints) {
            // A gap where there is no value.
            for run in self.values.split(|(x, y)| !x.is_finite() || !y.is_finite()).filter(|run| run.len() > 1) {
                canvas.add(look.line(path_data(&run.iter().copied().map(at).collect::<Vec<_>>(), false)));
            }
        }
    }

    /// `taken`: where labels stand already, as left end, width and base line.
    fn markers(
        &self,
        canvas: &mut Canvas,
        at: &dyn Fn((f64, f64)) -> (f64, f64),
        look: &Look,
        panel: &Panel,
        taken: &mut Vec<(f64, f64, f64)>,
    ) {
        let is_marked = match self.mark {
            Mark::Points => true,
            Mark::LineAndPoints => self.values.len() <= MAX_MARKERS,
            Mark::Line | Mark::Bars(_) => false,
        };
        if !is_marked {
            return;
        }
        for (k, &(x, y)) in self.values.iter().enumerate().filter(|(_, (x, y))| x.is_finite() && y.is_finite()) {
            let label = self.labels.get(k).map_or("", String::as_str);
            let words = [
                self.name.as_str(),
                label,
                &format!("{} {}", panel.x, number(x)),
                &format!("{} {}", panel.y, number(y)),
            ];
            let tip = words.iter().filter(|word| !word.is_empty()).copied().collect::<Vec<_>>().join("; ");
            group(canvas, "class=\"value\"", Some(plain(&tip)));
            let place = at((x, y));
            canvas.add(look.marker(place));
            canvas.add(Shape::GroupEnd);
            // A word per value of a few; with many they would cover one another.
            if !label.is_empty() && self.values.len() <= MAX_WORDS {
                let width = TICK.text_px(label);
                let places = [(9.0, -7.0), (-9.0 - width, -7.0), (9.0, 14.0), (-9.0 - width, 14.0), (9.0, -21.0)];
                let is_free = |(x, y): &(f64, f64)| {
                    let (x, y) = (place.0 + x, place.1 + y);
                    taken.iter().all(|w| x > w.0 + w.1 || x + width < w.0 || (y - w.2).abs() > 12.0)
                };
                let (dx, dy) = places.into_iter().find(is_free).unwrap_or(places[0]);
                taken.push((place.0 + dx, width, place.1 + dy));
                text(canvas, (place.0 + dx, place.1 + dy), label, TICK, TextAnchor::Start);
            }
        }
    }
}

/// As in the other figures, but thin.
fn look(index: usize, count: usize) -> Look {
    let depth = if count > 1 { index as f64 / (count - 1) as f64 } else { 0.5 };
    Look { line_px: 2.6 - depth, marker_px: 6.5 - 2.0 * depth, ..Look::of(index, count) }
}

#[cfg(test)]
mod tests {
    use super::super::drawing::tests::words;
    use super::*;

    fn series(name: &str, mark: Mark, values: &[(f64, f64)]) -> PanelSeries {
        PanelSeries { name: name.to_owned(), mark, values: values.to_vec(), labels: Vec::new() }
    }

    fn figure(panels: Vec<Panel>) -> PanelFigure {
        PanelFigure { title: "Title".into(), subtitle: None, caption: "Caption.".into(), panels }
    }

    fn panel(series: Vec<PanelSeries>) -> Panel {
        Panel { heading: "Head".into(), x: "x in m".into(), y: "y in s".into(), series, ..Panel::default() }
    }

    #[test]
    fn every_value_has_a_mark_and_every_name_is_in_the_legend_once() {
        let points = series("a & b", Mark::Points, &[(0.0, 1.0), (2.0, 3.0), (f64::NAN, 1.0)]);
        let line = series("line", Mark::LineAndPoints, &[(0.0, 0.0), (1.0, f64::INFINITY), (2.0, 2.0), (3.0, 1.0)]);
        let svg = figure(vec![panel(vec![points.clone(), line]), panel(vec![points])]).svg();
        assert_eq!(svg.matches("class=\"value\"").count(), 2 + 3 + 2);
        let words = words(&svg);
        assert_eq!(words.matches("line").count(), 1);
        assert!(words.contains("a &amp; b") && words.contains("x in m") && words.contains("y in s"));
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }

    #[test]
    fn bars_stand_on_zero_and_their_width_is_within_the_axis() {
        let bars = panel(vec![series("", Mark::Bars(2.0), &[(1.0, 4.0), (3.0, 0.0), (5.0, 8.0)])]);
        let axis = bars.x_axis((0.0, 60.0)).unwrap();
        assert!(axis.at(0.0) >= 0.0 && axis.at(6.0) <= 60.0 && axis.at(0.0) < axis.at(6.0));
        assert_eq!(bars.y_axis((100.0, 0.0)).unwrap().at(0.0), 100.0);
        let svg = figure(vec![bars]).svg();
        assert!(svg.matches("#ffffff").count() >= 2);
    }

    #[test]
    fn nothing_to_draw_is_said_and_makes_a_picture() {
        for values in [vec![], vec![(f64::NAN, f64::NAN)]] {
            let svg = figure(vec![panel(vec![series("s", Mark::Points, &values)])]).svg();
            assert!(words(&svg).contains("no value to draw"));
        }
        assert!(words(&figure(Vec::new()).svg()).contains("Caption."));
    }

    #[test]
    fn the_numbers_hold_every_value_of_the_picture() {
        let mut points = series("one, two", Mark::Points, &[(0.5, 1.0), (2.0, f64::NAN)]);
        points.labels = vec!["\"q\"".into(), "b".into()];
        let text = figure(vec![panel(vec![points])]).csv().unwrap();
        let mut reader = ::csv::Reader::from_reader(text.as_slice());
        let rows: Vec<::csv::StringRecord> = reader.records().map(std::result::Result::unwrap).collect();
        assert_eq!(rows.len(), 2);
        assert_eq!((&rows[0][1], &rows[0][2], &rows[0][4], &rows[1][6]), ("one, two", "\"q\"", "0.5", "NaN"));
    }
}
