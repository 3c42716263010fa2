//! The surroundings of a plot: ticks with their numbers, names, the colour scale.

use super::axis::Axis;
use super::axis::on_circle;
use super::svg::{Anchor, Canvas, GREY, GRID, INK, Paint, Position, Type, set};
use super::{
    ColourBar, HEADING, INDENT_PX, NAME_GAP_PX, NAME_PX, NOTE_PX, Name, Plot, RADIUS_PX, SPOKE_PX, TEXT, TICK,
};

/// Type of a name beside a plot.
pub(in crate::report) const ROW: Type = set(14, false, INK);

impl Name {
    /// Height of its lines beside a plot.
    pub(in crate::report) fn height_px(&self) -> f64 {
        if self.is_heading {
            return HEADING.height_px(&self.words, NAME_PX) + 10.0;
        }
        let words = ROW.height_px(&self.words, NAME_PX - INDENT_PX);
        words.max(ROW.height_px(&self.note, NOTE_PX)).max(ROW.line_px()) + 6.0
    }
}

impl Plot {
    /// Draws the horizontal axis: grid, ticks, numbers.
    pub(super) fn numbers_below(
        &self,
        canvas: &mut Canvas,
        axis: &Axis,
        (top, bottom): (f64, f64),
        has_numbers: bool,
        has_grid: bool,
    ) {
        for tick in axis.ticks((axis.length_px() / 58.0) as usize) {
            let x = tick.at_px;
            let Some(label) = &tick.label else {
                canvas.line((x, bottom), (x, bottom + 3.0), GREY, 0.8);
                continue;
            };
            if has_grid {
                canvas.line((x, top), (x, bottom), GRID, 0.8);
            }
            if has_numbers {
                canvas.line((x, bottom), (x, bottom + 6.0), GREY, 1.0);
                canvas.text((x, bottom + 20.0), label, TICK, Anchor::Middle);
            }
            if self.x.is_doubled {
                canvas.line((x, top - 6.0), (x, top), GREY, 1.0);
                canvas.text((x, top - 10.0), label, TICK, Anchor::Middle);
            }
        }
    }

    /// Draws the names of a vertical axis at the left and their notes at the right.
    pub(super) fn names_beside(&self, canvas: &mut Canvas, (left, right): (f64, f64), (top, _): (f64, f64)) {
        for name in &self.y.names {
            let (x, y) = (left - NAME_PX - 16.0, top - name.at);
            if name.is_heading {
                canvas.paragraph((x, y + 8.0), &name.words, HEADING, NAME_PX);
            } else {
                canvas.paragraph((x + INDENT_PX, y + 3.0), &name.words, ROW, NAME_PX - INDENT_PX);
                canvas.paragraph((right + 18.0, y + 3.0), &name.note, ROW, NOTE_PX);
            }
        }
    }
}

/// Draws the vertical axis: grid, ticks, numbers.
pub(super) fn numbers_left(canvas: &mut Canvas, axis: &Axis, (left, right): (f64, f64), has_grid: bool) {
    for tick in axis.ticks(axis.vertical_numbers()) {
        let y = tick.at_px;
        let Some(label) = &tick.label else {
            canvas.line((left - 3.0, y), (left, y), GREY, 0.8);
            continue;
        };
        if has_grid {
            canvas.line((left, y), (right, y), GRID, 0.8);
        }
        canvas.line((left - 6.0, y), (left, y), GREY, 1.0);
        canvas.text((left - 9.0, y + 4.5), label, TICK, Anchor::End);
    }
}

/// Draws a spoke's name outside the outer ring: upward at the top, downward at the bottom, centred at the sides.
pub(super) fn spoke_name(canvas: &mut Canvas, name: &Name, centre: Position, turn: f64) {
    let (x, y) = on_circle(centre, RADIUS_PX + NAME_GAP_PX, turn);
    let anchor = match libm::sin(turn) {
        across if across > 0.2 => Anchor::Start,
        across if across < -0.2 => Anchor::End,
        _ => Anchor::Middle,
    };
    let set = if name.is_empty { Type { colour: GREY, ..TEXT } } else { TEXT };
    // The cosine goes from 1 (the block ends at y) through 0 (centred on y) to -1 (it starts at y).
    let top = y - set.height_px(&name.words, SPOKE_PX) * (1.0 + libm::cos(turn)) / 2.0;
    canvas.block((x, top), &name.words, set, SPOKE_PX, anchor);
}

/// Draws the scale from zero to a round number at or above the maximum.
pub(super) fn colour_bar(canvas: &mut Canvas, bar: &ColourBar, (left, right): (f64, f64), (top, bottom): (f64, f64)) {
    const BANDS: u32 = 100;
    canvas.text((left, top + 12.0), bar.label, TICK, Anchor::Start);
    let (top, bottom) = (top + 28.0, bottom.min(top + 420.0));
    let edge = |k: u32| bottom + (top - bottom) * f64::from(k) / f64::from(BANDS);
    canvas.group("shape-rendering=\"crispEdges\" class=\"scale\"", "", |canvas| {
        for k in 0..BANDS {
            let colour = (bar.colour)((f64::from(k) + 0.5) / f64::from(BANDS));
            canvas.rect((left, edge(k)), (right, edge(k + 1)), Paint::fill(&colour));
        }
    });
    canvas.rect((left, top), (right, bottom), Paint::line(GREY, 1.0));
    for tick in Axis::exactly((0.0, bar.largest), (bottom, top)).ticks(6) {
        canvas.line((right, tick.at_px), (right + 5.0, tick.at_px), GREY, 1.0);
        canvas.text((right + 8.0, tick.at_px + 4.5), tick.label.as_deref().unwrap_or(""), TICK, Anchor::Start);
    }
}

#[cfg(test)]
mod tests {
    use super::super::*;

    fn series(name: &str, marks: &[Mark], values: &[(f64, f64)]) -> Series {
        Series::new(name, marks, values.iter().copied())
    }

    fn figure(plots: Vec<Plot>) -> Figure {
        Figure { title: "Title".into(), caption: "Caption.".into(), plots, ..Figure::default() }
    }

    fn plot(series: Vec<Series>) -> Plot {
        let layers = series.into_iter().map(Layer::from).collect();
        Plot {
            heading: "Head".into(),
            x: PlotAxis::new("x in m"),
            y: PlotAxis::new("y in s"),
            layers,
            ..Plot::default()
        }
    }

    #[test]
    fn every_value_has_a_mark_and_every_name_is_in_the_legend_once() {
        let points = series("a & b", &[Mark::Points], &[(0.0, 1.0), (2.0, 3.0), (f64::NAN, 1.0)]);
        let values = [(0.0, 0.0), (1.0, f64::INFINITY), (2.0, 2.0), (3.0, 1.0)];
        let line = series("line", &[Mark::Line, Mark::Points], &values);
        let svg = figure(vec![plot(vec![points.clone(), line]), plot(vec![points])]).svg();
        assert_eq!(svg.matches("class=\"value\"").count(), 2 + 3 + 2);
        assert_eq!(svg.matches("class=\"legend\"").count(), 2);
        let words = words(&svg);
        assert_eq!(words.matches("line").count(), 1);
        assert!(words.contains("a &amp; b") && words.contains("x in m") && words.contains("y in s"));
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }

    #[test]
    fn bars_stand_on_zero_and_their_width_is_within_the_axis() {
        let bars = plot(vec![series("", &[Mark::Bars(2.0)], &[(1.0, 4.0), (3.0, 0.0), (5.0, 8.0)])]);
        let axes = bars.axes((0.0, 60.0), (0.0, 100.0), None).unwrap();
        assert!(axes.x.at(0.0) >= 0.0 && axes.x.at(6.0) <= 60.0 && axes.x.at(0.0) < axes.x.at(6.0));
        assert_eq!(axes.y.at(0.0), 100.0);
        assert!(figure(vec![bars]).svg().matches("#ffffff").count() >= 2);
    }

    #[test]
    fn nothing_to_draw_is_said_and_makes_a_picture() {
        for values in [vec![], vec![(f64::NAN, f64::NAN)]] {
            let svg = figure(vec![plot(vec![series("s", &[Mark::Points], &values)])]).svg();
            assert!(words(&svg).contains("no value to draw"));
        }
        assert!(words(&figure(Vec::new()).svg()).contains("Caption."));
    }

    #[test]
    fn the_numbers_hold_every_value_of_the_picture() {
        let mut points = series("one, two", &[Mark::Points], &[(0.5, 1.0), (2.0, f64::NAN)]);
        points.values[0].label = "\"q\"".into();
        points.values[1].label = "b".into();
        let text = figure(vec![plot(vec![points])]).csv();
        let mut reader = ::csv::Reader::from_reader(text.as_bytes());
        let rows: Vec<::csv::StringRecord> = reader.records().map(std::result::Result::unwrap).collect();
        assert_eq!(rows.len(), 2);
        assert_eq!((&rows[0][1], &rows[0][2], &rows[0][4], &rows[1][6]), ("one, two", "\"q\"", "0.5", "NaN"));
    }
}
