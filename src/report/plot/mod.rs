//! The one type of all figures: plots with axes, their layers, and a legend built from the layers.
//!
//! The caller gives numbers and words; this module defines their look, as a picture and as CSV. A new kind of picture
//! is a new layer or axis scale. A page is 1000 px wide and as high as its texts need, so no text is cut.

mod axis;
mod cells;
mod frame;
mod layer;
mod look;
mod svg;

use std::f64::consts::TAU;

pub use axis::AxisScale;
pub use cells::{Cells, ColourBar, Fill, FilledCell, Hatch};
pub use layer::{Layer, Mark, Rule, Series, Value};
pub use look::{Look, Symbol};

pub(super) use axis::{Axis, logarithmic_reach, number, plain_end};
pub(super) use frame::ROW;
pub(super) use layer::{HOLLOW, TICK, is_few};
#[cfg(test)]
pub(super) use svg::tests::words;
pub(super) use svg::{Anchor, Canvas, GREY, GRID, INK, Paint, Position, Type, WHITE, set};

use crate::support::table::Table;
use axis::{Axes, on_circle};
use frame::{colour_bar, numbers_left, spoke_name};

const WIDTH_PX: f64 = 1000.0;
const BORDER_PX: f64 = 36.0;
const TEXT_WIDTH_PX: f64 = WIDTH_PX - 2.0 * BORDER_PX;
/// Space between plots.
const GAP_PX: f64 = 22.0;
/// Length of a sample in the legend, and offset of the text after it.
const SAMPLE_PX: f64 = 56.0;
const SAMPLE_TEXT_PX: f64 = 68.0;
/// Widths of the texts left and right of a plot whose vertical axis has named ticks, and the indent of rows.
const NAME_PX: f64 = 280.0;
const NOTE_PX: f64 = 226.0;
const INDENT_PX: f64 = 14.0;
/// Radius of the outer ring of a polar plot, distance of the names from it, and their width.
const RADIUS_PX: f64 = 285.0;
const NAME_GAP_PX: f64 = 20.0;
const SPOKE_PX: f64 = WIDTH_PX / 2.0 - RADIUS_PX - NAME_GAP_PX - 8.0;

const TITLE: Type = set(24, true, INK);
const TEXT: Type = set(16, false, INK);
const HEADING: Type = set(16, true, INK);
const NOTE: Type = set(14, false, INK);

/// A page of plots with its texts.
#[derive(Debug, Clone, Default)]
pub struct Figure {
    /// Heading; wrapped when long.
    pub title: String,
    /// Line below the heading; wrapped when long.
    pub subtitle: Option<String>,
    /// The plots, row by row.
    pub plots: Vec<Plot>,
    /// Explains the marks; wrapped when long.
    pub caption: String,
    /// A bold heading and lines at the foot; omitted without lines.
    pub notes: (&'static str, Vec<String>),
}

/// One plot.
#[derive(Debug, Clone, Default)]
pub struct Plot {
    /// Heading.
    pub heading: String,
    /// Horizontal axis; in a polar plot the angle, one full turn from end to end.
    pub x: PlotAxis,
    /// Vertical axis; in a polar plot the radius.
    pub y: PlotAxis,
    /// The layers: cells behind rules behind series.
    pub layers: Vec<Layer>,
    /// Height of the frame.
    pub height: Height,
    /// Polar plot: the axes are angle and radius.
    pub is_polar: bool,
}

/// Height of a plot's frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Height {
    /// Depends on the number of plots on the page.
    #[default]
    Usual,
    /// Height, px.
    Px(f64),
    /// Multiple of the width.
    OfWidth(f64),
}

/// An axis without a position on a page.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PlotAxis {
    /// Quantity and unit; wrapped when long.
    pub label: String,
    /// Scale.
    pub scale: AxisScale,
    /// Ends.
    pub ends: Ends,
    /// Names instead of numbers.
    pub names: Vec<Name>,
    /// Whether the numbers are repeated at the top.
    pub is_doubled: bool,
}

/// Ends of an axis.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Ends {
    /// Around the values of the layers.
    #[default]
    Layers,
    /// Around these values.
    Around(Vec<f64>),
    /// Exactly these two, on a linear axis.
    Exactly(f64, f64),
}

/// A named position on an axis.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Name {
    /// Position; on a vertical axis the top of its lines.
    pub at: f64,
    /// The name; wrapped when long.
    pub words: String,
    /// Text at the other side of the plot; wrapped when long.
    pub note: String,
    /// Whether it is the heading of the names below it.
    pub is_heading: bool,
    /// Whether the row has no values.
    pub is_empty: bool,
}

impl PlotAxis {
    /// A linear axis around the values of the layers.
    pub fn new(label: impl Into<String>) -> Self {
        PlotAxis { label: label.into(), ..PlotAxis::default() }
    }

    /// A linear axis with these ends.
    pub fn exactly(label: impl Into<String>, low: f64, high: f64) -> Self {
        PlotAxis { ends: Ends::Exactly(low, high), ..PlotAxis::new(label) }
    }

    fn place(&self, values: impl Iterator<Item = f64>, ends_px: (f64, f64)) -> Option<Axis> {
        match &self.ends {
            Ends::Exactly(low, high) => Some(Axis::exactly((*low, *high), ends_px)),
            Ends::Around(values) => Axis::around(self.scale, values, ends_px),
            Ends::Layers => Axis::around(self.scale, &values.collect::<Vec<_>>(), ends_px),
        }
    }
}

impl Figure {
    /// The figure as a complete SVG document. Texts are XML-escaped; control characters become U+FFFD. The same figure
    /// gives the same bytes. It never fails: a plot without a value says so, and without plots only the texts remain.
    pub fn svg(&self) -> String {
        let mut canvas = Canvas::new(WIDTH_PX);
        let mut y = canvas.paragraph((BORDER_PX, 24.0), &self.title, TITLE, TEXT_WIDTH_PX);
        if let Some(subtitle) = &self.subtitle {
            y = canvas.paragraph((BORDER_PX, y + 4.0), subtitle, TEXT, TEXT_WIDTH_PX);
        }
        y = self.rows(&mut canvas, y + 14.0);
        y = self.legend(&mut canvas, y + 8.0);
        y = canvas.paragraph((BORDER_PX, y + 6.0), &self.caption, NOTE, TEXT_WIDTH_PX);
        if !self.notes.1.is_empty() {
            y = canvas.paragraph((BORDER_PX, y + 10.0), self.notes.0, Type { bold: true, ..NOTE }, TEXT_WIDTH_PX);
        }
        for line in &self.notes.1 {
            y = canvas.paragraph((BORDER_PX, y + 3.0), line, NOTE, TEXT_WIDTH_PX);
        }
        canvas.document(y)
    }

    /// The numbers of the series: one row per value.
    pub fn csv(&self) -> String {
        let series = self.plots.iter().flat_map(|plot| plot.series().map(move |series| (plot, series)));
        let rows = series.flat_map(|(plot, series)| series.values.iter().map(move |value| (plot, series, value)));
        Table::of(rows)
            .column("panel", |(plot, ..)| plot.heading.as_str())
            .column("series", |(_, series, _)| series.name.as_str())
            .column("label", |(.., value)| value.label.as_str())
            .column("x_quantity", |(plot, ..)| plot.x.label.as_str())
            .column("x", |(.., value)| value.x)
            .column("y_quantity", |(plot, ..)| plot.y.label.as_str())
            .column("y", |(.., value)| value.y)
            .build()
            .csv()
    }

    /// The names of the series, in the order of the legend.
    fn names(&self) -> Vec<&str> {
        let mut names: Vec<&str> = Vec::new();
        for series in self.plots.iter().flat_map(Plot::series) {
            if !series.name.is_empty() && !names.contains(&series.name.as_str()) {
                names.push(&series.name);
            }
        }
        names
    }

    /// Draws all plots below `top`, in rows that depend on their number; returns the y below.
    fn rows(&self, canvas: &mut Canvas, top: f64) -> f64 {
        let (columns, height_px) = match self.plots.len() {
            0 | 1 => (1, 420.0),
            2 | 4 => (2, 290.0),
            _ => (3, 220.0),
        };
        let names = self.names();
        let look = |series: &Series| {
            let place = names.iter().position(|name| *name == series.name);
            series.look.unwrap_or_else(|| Look::of(place.unwrap_or(0), names.len()))
        };
        let width_px = (TEXT_WIDTH_PX - GAP_PX * (columns - 1) as f64) / columns as f64;
        let words = if columns == 1 { Type { size_px: 15, ..NOTE } } else { TICK };
        let mut y = top;
        for in_row in self.plots.chunks(columns) {
            let above = |plot: &Plot| {
                let words = words.height_px(&plot.y.label, width_px);
                let labels = if words > 0.0 { words + 10.0 } else { 0.0 } + if plot.x.is_doubled { 22.0 } else { 0.0 };
                HEADING.height_px(&plot.heading, width_px) + labels
            };
            let frame_top = y + in_row.iter().map(above).fold(0.0, f64::max);
            let mut bottom = frame_top;
            for (column, plot) in in_row.iter().enumerate() {
                let left = BORDER_PX + column as f64 * (width_px + GAP_PX);
                canvas.paragraph((left, y), &plot.heading, HEADING, width_px);
                let label_px = words.height_px(&plot.y.label, width_px);
                canvas.paragraph((left, frame_top - label_px - 8.0), &plot.y.label, words, width_px);
                if plot.is_polar {
                    bottom = bottom.max(plot.draw_polar(canvas, &look, frame_top));
                    continue;
                }
                let (room_left, room_right) = plot.room_px();
                let across = (left + room_left, left + width_px - room_right);
                let frame_px = match plot.height {
                    Height::Usual => height_px,
                    Height::Px(px) => px,
                    Height::OfWidth(times) => times * (across.1 - across.0),
                };
                let down = (frame_top, frame_top + frame_px);
                plot.draw(canvas, &look, across, down, true);
                let (middle, label_px) = ((across.0 + across.1) / 2.0, across.1 - across.0);
                let below = canvas.block((middle, down.1 + 26.0), &plot.x.label, words, label_px, Anchor::Middle);
                bottom = bottom.max(below);
            }
            y = bottom + 14.0;
        }
        y
    }

    /// Draws samples and names of the layers, in two columns read downwards (one if a name is too long for half the
    /// width); returns the y below.
    fn legend(&self, canvas: &mut Canvas, top: f64) -> f64 {
        let names = self.names();
        let series = || self.plots.iter().flat_map(Plot::series);
        let looks = names.iter().enumerate().filter_map(|(at, name)| {
            let series = series().find(|series| series.name == *name)?;
            Some((*name, Entry::Series(series, series.look.unwrap_or_else(|| Look::of(at, names.len())))))
        });
        let mut entries: Vec<(&str, Entry)> = looks.collect();
        for (name, fill) in self.plots.iter().flat_map(Plot::cells).flat_map(|cells| &cells.key) {
            if entries.iter().all(|entry| entry.0 != name.as_str()) {
                entries.push((name, Entry::Fill(fill)));
            }
        }
        for rule in self.plots.iter().flat_map(Plot::rules).filter(|rule| !rule.name.is_empty()) {
            if entries.iter().all(|entry| entry.0 != rule.name.as_str()) {
                entries.push((&rule.name, Entry::Rule(rule)));
            }
        }
        let half_px = TEXT_WIDTH_PX / 2.0;
        let fits = entries.iter().all(|(name, _)| TEXT.text_px(name) <= half_px - SAMPLE_TEXT_PX - 12.0);
        let columns = if fits { 2 } else { 1 };
        let width_px = TEXT_WIDTH_PX / columns as f64 - SAMPLE_TEXT_PX;
        let mut bottom = top;
        for (column, entries) in entries.chunks(entries.len().div_ceil(columns).max(1)).enumerate() {
            let (x, mut y) = (BORDER_PX + half_px * column as f64, top);
            for (name, entry) in entries {
                let middle = y + TEXT.line_px() / 2.0;
                canvas.group("class=\"legend\"", "", |canvas| match entry {
                    Entry::Series(series, look) => series.sample(canvas, (x, middle), SAMPLE_PX, look),
                    Entry::Rule(rule) => rule.sample(canvas, (x, middle), SAMPLE_PX),
                    Entry::Fill(fill) => fill.sample(canvas, (x + 17.0, middle - 9.0), (x + 39.0, middle + 9.0)),
                });
                let below = canvas.paragraph((x + SAMPLE_TEXT_PX, y), name, TEXT, width_px);
                y = below.max(y + TEXT.line_px()) + 5.0;
            }
            bottom = bottom.max(y);
        }
        bottom
    }
}

/// An entry of the legend.
enum Entry<'a> {
    Series(&'a Series, Look),
    Fill(&'a Fill),
    Rule(&'a Rule),
}

impl Plot {
    pub(super) fn series(&self) -> impl Iterator<Item = &Series> {
        self.layers.iter().filter_map(|layer| if let Layer::Series(series) = layer { Some(series) } else { None })
    }

    fn rules(&self) -> impl Iterator<Item = &Rule> {
        self.layers.iter().filter_map(|layer| if let Layer::Rule(rule) = layer { Some(rule) } else { None })
    }

    fn cells(&self) -> impl Iterator<Item = &Cells> {
        self.layers.iter().filter_map(|layer| if let Layer::Cells(cells) = layer { Some(cells) } else { None })
    }

    /// Space left and right of the frame, px.
    fn room_px(&self) -> (f64, f64) {
        if !self.y.names.is_empty() {
            return (NAME_PX + 16.0, NOTE_PX + 18.0);
        }
        (60.0, if self.cells().any(|cells| cells.bar.is_some()) { 120.0 } else { 16.0 })
    }

    /// The axes within these ends; `None` if there is nothing to show.
    fn axes(&self, across: (f64, f64), down: (f64, f64), centre: Option<Position>) -> Option<Axes> {
        let width =
            |series: &Series| series.marks.iter().find_map(|m| if let Mark::Bars(w) = m { Some(*w) } else { None });
        let half = self.series().filter_map(width).fold(0.0, f64::max) / 2.0;
        let shown = || {
            let is_shown = |v: &&Value| self.x.scale.shows(v.x) && self.y.scale.shows(v.y);
            self.series().flat_map(|series| &series.values).filter(is_shown)
        };
        let is_given = self.is_polar || [&self.x, &self.y].iter().any(|axis| matches!(axis.ends, Ends::Around(_)));
        if !is_given && self.series().next().is_some() && shown().next().is_none() {
            return None;
        }
        let x = self.x.place(shown().flat_map(|v| [v.x - half, v.x + half]), across)?;
        let zero = (half > 0.0).then_some(0.0);
        let y = self.y.place(shown().map(|v| v.y).chain(zero), (down.1, down.0))?;
        Some(Axes { x, y, centre })
    }

    /// Draws the plot in a frame: axes with their numbers, layers.
    pub(super) fn draw(
        &self,
        canvas: &mut Canvas,
        look: &dyn Fn(&Series) -> Look,
        across: (f64, f64),
        down: (f64, f64),
        has_x_numbers: bool,
    ) {
        let axes = self.axes(across, down, None);
        if let Some(axes) = &axes {
            let has_grid = self.cells().all(|cells| cells.bar.is_none() && cells.key.is_empty());
            if self.y.names.is_empty() {
                numbers_left(canvas, &axes.y, across, has_grid);
            }
            self.numbers_below(canvas, &axes.x, down, has_x_numbers, has_grid);
            self.behind(canvas, axes, look);
        }
        canvas.group("class=\"frame\"", "", |canvas| {
            canvas.rect((across.0, down.0), (across.1, down.1), Paint::line(GREY, 1.0));
        });
        self.names_beside(canvas, across, down);
        let Some(axes) = axes else {
            let middle = ((across.0 + across.1) / 2.0, (down.0 + down.1) / 2.0);
            return canvas.text(middle, "no value to draw", TICK, Anchor::Middle);
        };
        self.markers(canvas, &axes, look);
        for bar in self.cells().filter_map(|cells| cells.bar.as_ref()).filter(|bar| bar.largest > 0.0) {
            colour_bar(canvas, bar, (across.1 + 44.0, across.1 + 66.0), down);
        }
    }

    /// Draws all layers except markers, which are above the frame.
    fn behind(&self, canvas: &mut Canvas, axes: &Axes, look: &dyn Fn(&Series) -> Look) {
        self.cells().for_each(|cells| cells.draw(canvas, axes));
        self.rules().for_each(|rule| rule.draw(canvas, axes));
        // All bands, then all lines, then all markers: a band never hides a value.
        self.series().for_each(|series| series.bands(canvas, axes, &look(series)));
        self.series().for_each(|series| series.bars_and_line(canvas, axes, &look(series)));
    }

    fn markers(&self, canvas: &mut Canvas, axes: &Axes, look: &dyn Fn(&Series) -> Look) {
        let mut taken = Vec::new();
        for series in self.series() {
            series.markers(canvas, axes, &look(series), (&self.x.label, &self.y.label), &mut taken);
        }
    }

    /// Draws rings, spokes with their names, and layers around the middle of the page; returns the y below.
    fn draw_polar(&self, canvas: &mut Canvas, look: &dyn Fn(&Series) -> Look, top: f64) -> f64 {
        let name_px = |name: &Name| TEXT.height_px(&name.words, SPOKE_PX);
        let reach = self.x.names.iter().map(name_px).fold(0.0, f64::max) + NAME_GAP_PX + RADIUS_PX;
        let centre = (WIDTH_PX / 2.0, top + reach);
        let Some(axes) = self.axes((0.0, TAU), (RADIUS_PX, 0.0), Some(centre)) else { return top };
        for ring in &self.y.names {
            let radius_px = axes.y.at(ring.at);
            canvas.circle(centre, radius_px, Paint::line(GRID, if radius_px < RADIUS_PX { 1.0 } else { 1.6 }));
        }
        for name in &self.x.names {
            let dash = if name.is_empty { "2,5" } else { "" };
            let spoke = vec![centre, on_circle(centre, RADIUS_PX, axes.x.at(name.at))];
            canvas.path(&[spoke], false, Paint { dash, ..Paint::line(GRID, 1.0) });
            spoke_name(canvas, name, centre, axes.x.at(name.at));
        }
        self.behind(canvas, &axes, look);
        self.markers(canvas, &axes, look);
        // Above the lines, midway between the first two spokes, where no marker is.
        let turn = self.x.names.get(1).map_or(0.0, |name| axes.x.at(name.at) / 2.0);
        for ring in &self.y.names {
            let (x, y) = on_circle(centre, axes.y.at(ring.at), turn);
            let paint = Paint { opacity: Some(0.8), ..Paint::fill(WHITE) };
            canvas.rect((x - 13.0, y - 9.0), (x + 13.0, y + 9.0), paint);
            canvas.text((x, y + 5.0), &ring.words, TICK, Anchor::Middle);
        }
        centre.1 + reach
    }
}
