//! The one type of all figures: plots with axes, what they draw, and a legend built from it.
//!
//! The caller gives numbers and words; this module defines their look, as a picture and as CSV. A new kind of picture
//! is a new mark or axis scale. A figure has the width of a column of a paper (88 mm, where its type is 6 pt), a wide
//! one that of two, and is as high as its texts need, so no text is cut.

mod axis;
mod frame;
mod layer;
mod look;
mod svg;

use std::f64::consts::TAU;
use std::iter;

pub(super) use layer::{Cells, FilledCell, Mark, Rule, Series, Value};
pub(super) use look::{Look, Symbol};

pub(super) use axis::plain_end;
pub(super) use layer::is_few;
use layer::{HOLLOW, TICK, fill_sample};
pub(super) use svg::{GREY, INK};

use axis::{Axes, Axis, on_circle};
use frame::{numbers_left, spoke_name};
use lanesweep_support::readable::plain;
use lanesweep_support::table::Table;
use svg::{Anchor, Canvas, GRID, Paint, Position, Type, WHITE, set};

/// Width of a figure: type of 13 px becomes 6 pt at the 252 pt of a paper's column.
const COLUMN_PX: f64 = 540.0;
const MARGIN_PX: f64 = 14.0;
/// Space between plots.
const GAP_PX: f64 = 14.0;
/// Length of a sample in the legend, and offset of the text after it.
const SAMPLE_PX: f64 = 38.0;
const SAMPLE_TEXT_PX: f64 = 46.0;
/// Maximum width of the texts left and right of a plot whose vertical axis has named ticks.
const NAME_PX: f64 = 150.0;
/// Radius of the outer ring of a polar plot, distance of the names from it, and their width.
const RADIUS_PX: f64 = 150.0;
const NAME_GAP_PX: f64 = 14.0;
const SPOKE_PX: f64 = COLUMN_PX / 2.0 - RADIUS_PX - NAME_GAP_PX - 8.0;

const TITLE: Type = set(17, true, INK);
const TEXT: Type = set(13, false, INK);
const HEADING: Type = set(13, true, INK);

/// Plots with their texts.
#[derive(Debug, Clone, Default)]
pub struct Figure {
    /// Heading; wrapped when long.
    pub title: String,
    /// Line below the heading; wrapped when long.
    pub subtitle: Option<String>,
    /// The plots, row by row. Where all have the same axis, its numbers are at the edge only.
    pub plots: Vec<Plot>,
    /// Plots in a row; 0: as many as their number suggests.
    pub columns: usize,
    /// Twice as wide.
    pub is_wide: bool,
    /// Explains the marks; wrapped when long.
    pub caption: String,
    /// A bold heading and lines at the foot; omitted without lines.
    pub notes: (&'static str, Vec<String>),
}

/// One plot. With nothing to draw and without heading its place in the row stays empty.
#[derive(Debug, Clone, Default)]
pub struct Plot {
    /// Heading.
    pub heading: String,
    /// Heading of the row that it begins.
    pub row: String,
    /// How to read it, in a few words, at the right of the heading.
    pub hint: String,
    /// Horizontal axis; in a polar plot the angle, one full turn from end to end.
    pub x: PlotAxis,
    /// Vertical axis; in a polar plot the radius.
    pub y: PlotAxis,
    /// Rectangles, behind everything else.
    pub cells: Option<Cells>,
    /// Reference lines, behind the series.
    pub rules: Vec<Rule>,
    /// Values with marks.
    pub series: Vec<Series>,
    /// Height of the frame.
    pub height: Height,
    /// Polar plot: the axes are angle and radius.
    pub is_polar: bool,
}

/// Height of a plot's frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Height {
    /// Depends on the number of plots in a row.
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
    /// Ends, the lower first.
    pub ends: (f64, f64),
    /// Names instead of numbers.
    pub names: Vec<Name>,
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
    /// Whether the row has no values.
    pub is_empty: bool,
}

impl PlotAxis {
    /// An axis with these ends.
    pub(crate) fn new(label: impl Into<String>, low: f64, high: f64) -> Self {
        PlotAxis { label: label.into(), ends: (low, high), names: Vec::new() }
    }

    fn place(&self, (from_px, to_px): (f64, f64)) -> Axis {
        Axis { low: self.ends.0, high: self.ends.1, from_px, to_px }
    }
}

/// Height of a name beside a plot, px.
pub(super) fn name_height_px(words: &str) -> f64 {
    TEXT.height_px(words, NAME_PX)
}

impl Figure {
    /// The figure as a complete SVG document. Texts are XML-escaped; control characters become U+FFFD. The same figure
    /// gives the same bytes. It never fails: a plot without a value says so, and without plots only the texts remain.
    pub fn svg(&self) -> String {
        self.drawn(&self.texts(), None)
    }

    /// The figure for a paper, as wide as a column (88 mm) or two (180 mm), and its texts, which are not in it.
    pub(super) fn plain(&self) -> (String, String) {
        let width_mm = if self.is_wide { 180.0 } else { 88.0 };
        let texts = self.texts().concat().into_iter().map(|(.., words)| words + "\n").collect();
        (self.drawn(&[Vec::new(), Vec::new()], Some(width_mm)), texts)
    }

    /// The texts above and below the plots, with their type and the space above them.
    fn texts(&self) -> [Vec<(Type, f64, String)>; 2] {
        let has_few = self.series().flat_map(|series| &series.values).any(|value| value.is_few);
        let caption = [&*self.caption, if has_few { HOLLOW } else { "" }].join(" ").trim_end().to_owned();
        let (heading, lines) = &self.notes;
        let heading = lines.first().map(|_| (HEADING, 5.0, (*heading).to_owned()));
        let notes = heading.into_iter().chain(lines.iter().map(|line| (TEXT, 2.0, line.clone())));
        let subtitle = self.subtitle.iter().map(|subtitle| (TEXT, 3.0, subtitle.clone()));
        let title = (TITLE, 0.0, self.title.clone());
        [iter::once(title).chain(subtitle).collect(), iter::once((TEXT, 3.0, caption)).chain(notes).collect()]
    }

    fn drawn(&self, [above, below]: &[Vec<(Type, f64, String)>; 2], width_mm: Option<f64>) -> String {
        let width_px = self.width_px();
        let mut canvas = Canvas::new(width_px + 2.0 * MARGIN_PX);
        let mut y = 14.0;
        for (set, gap_px, words) in above {
            y = canvas.paragraph((MARGIN_PX, y + gap_px), words, *set, width_px);
        }
        y = self.rows(&mut canvas, y + 8.0);
        y = self.legend(&mut canvas, y + 2.0);
        for (set, gap_px, words) in below {
            y = canvas.paragraph((MARGIN_PX, y + gap_px), words, *set, width_px);
        }
        // What a screen reader says: the data, and what the marks are.
        let description = [self.subtitle.as_deref().unwrap_or_default(), &self.caption].join(" ");
        canvas.document(y, width_mm, &self.title, description.trim())
    }

    /// The numbers of the series: one row per value.
    pub(crate) fn numbers(&self) -> Table {
        let series = self.plots.iter().flat_map(|plot| plot.series.iter().map(move |series| (plot, series)));
        let rows = series.flat_map(|(plot, series)| series.values.iter().map(move |value| (plot, series, value)));
        Table::of(rows)
            .column("panel", |(plot, ..)| plot.heading.as_str())
            .column("row", |(plot, _, value)| plot.name_of(value).map_or("", |name| name.words.as_str()))
            .column("series", |(_, series, _)| series.name.as_str())
            .column("x_quantity", |(plot, ..)| plot.x.label.as_str())
            .column("x", |(.., value)| value.x)
            .column("x_low", |(_, series, value)| series.ends_of(value).map(|ends| ends.0))
            .column("x_high", |(_, series, value)| series.ends_of(value).map(|ends| ends.1))
            .column("y_quantity", |(plot, ..)| plot.y.label.as_str())
            .column("y", |(plot, _, value)| (plot.is_polar || plot.y.names.is_empty()).then_some(value.y))
            .build()
    }

    fn width_px(&self) -> f64 {
        if self.is_wide { 2.0 * COLUMN_PX - 2.0 * MARGIN_PX } else { COLUMN_PX - 2.0 * MARGIN_PX }
    }

    fn series(&self) -> impl Iterator<Item = &Series> {
        self.plots.iter().flat_map(|plot| &plot.series)
    }

    /// The names of the series, in the order of the legend.
    fn names(&self) -> Vec<&str> {
        let mut names: Vec<&str> = Vec::new();
        for series in self.series() {
            if !series.name.is_empty() && !names.contains(&series.name.as_str()) {
                names.push(&series.name);
            }
        }
        names
    }

    /// The look of a series: its own, or that of its place in the legend.
    fn look(&self, series: &Series) -> Look {
        series.look.unwrap_or_else(|| {
            let names = self.names();
            Look::of(names.iter().position(|name| *name == series.name).unwrap_or(0), names.len())
        })
    }

    /// Whether all plots have the same axis.
    fn shares(&self, axis: fn(&Plot) -> &PlotAxis) -> bool {
        let mut shown = self.plots.iter().filter(|plot| !plot.is_blank());
        let first = shown.next();
        self.plots.len() > 1
            && first.is_some_and(|first| {
                let like = |plot: &Plot| (&axis(plot).label, axis(plot).ends) == (&axis(first).label, axis(first).ends);
                shown.all(like)
            })
    }

    /// Draws all plots below `top`, in rows; returns the y below.
    fn rows(&self, canvas: &mut Canvas, top: f64) -> f64 {
        let columns = match (self.columns, self.plots.len()) {
            (0, 0 | 1) => 1,
            (0, 2 | 4) => 2,
            (0, _) => 3,
            (columns, _) => columns,
        };
        let (shares_x, shares_y) = (self.shares(|plot| &plot.x), self.shares(|plot| &plot.y));
        // Shared numbers need room at the edges only.
        let room = |at: usize| {
            let here = self.plots.iter().skip(at).step_by(columns).map(Plot::room_px);
            here.fold((0.0, 0.0), |(l, r): (f64, f64), (left, right)| (l.max(left), r.max(right)))
        };
        let rooms: Vec<(f64, f64)> = (0..columns).map(room).collect();
        let left_px = |column: usize| if shares_y && column > 0 { 0.0 } else { rooms[column].0 };
        let gaps_px = GAP_PX * (columns - 1) as f64;
        let taken_px: f64 = (0..columns).map(|column| left_px(column) + rooms[column].1).sum();
        let frame_px = (self.width_px() - gaps_px - taken_px) / columns as f64;
        let mut y = top;
        for (row, in_row) in self.plots.chunks(columns).enumerate() {
            if let Some(heading) = in_row.first().map(|plot| &plot.row).filter(|heading| !heading.is_empty()) {
                y = canvas.paragraph((MARGIN_PX, y), heading, HEADING, self.width_px()) + 2.0;
            }
            // Of a shared axis the first plot has the label; the headings of a row are level.
            let label_px = |column: usize, plot: &Plot| match shares_y && row > 0 {
                true => 0.0,
                false => TICK.height_px(&plot.y.label, left_px(if shares_y { 0 } else { column }) + frame_px),
            };
            let above = |(column, plot): (usize, &Plot)| {
                let heading_px = if shares_y { frame_px } else { frame_px + left_px(column) };
                HEADING.height_px(&plot.heading, heading_px) + label_px(column, plot) + 4.0
            };
            let frame_top = y + in_row.iter().enumerate().map(above).fold(0.0, f64::max);
            let (mut bottom, mut left) = (frame_top, MARGIN_PX);
            for (column, plot) in in_row.iter().enumerate() {
                let across = (left + left_px(column), left + left_px(column) + frame_px);
                let from = if shares_y { across.0 } else { left };
                left = across.1 + rooms[column].1 + GAP_PX;
                if plot.is_blank() {
                    continue;
                }
                let label_px = label_px(column, plot);
                let heading_px = HEADING.height_px(&plot.heading, across.1 - from);
                let above = frame_top - 4.0 - label_px;
                canvas.paragraph((from, above - heading_px), &plot.heading, HEADING, across.1 - from);
                canvas.text((across.1, above - 4.0), &plot.hint, TICK, Anchor::End);
                if label_px > 0.0 && (!shares_y || column == 0) {
                    let from = across.0 - left_px(column);
                    canvas.paragraph((from, above), &plot.y.label, TICK, across.1 - from);
                }
                if plot.is_polar {
                    bottom = bottom.max(plot.draw_polar(canvas, &|series| self.look(series), frame_top));
                    continue;
                }
                let frame_px = match plot.height {
                    Height::Usual => (0.75 * frame_px).clamp(100.0, 260.0),
                    Height::Px(px) => px,
                    Height::OfWidth(times) => times * frame_px,
                };
                let down = (frame_top, frame_top + frame_px);
                let below = self.plots.iter().skip((row + 1) * columns + column).step_by(columns);
                let is_lowest = !shares_x || below.clone().all(Plot::is_blank);
                plot.draw(canvas, &|series| self.look(series), (across, down), (is_lowest, !shares_y || column == 0));
                let mut end = down.1 + if is_lowest { 24.0 } else { 6.0 };
                if !shares_x {
                    let middle = (across.0 + across.1) / 2.0;
                    end = canvas.block((middle, end), &plot.x.label, TICK, across.1 - from, Anchor::Middle);
                }
                bottom = bottom.max(end);
            }
            y = bottom + 8.0;
        }
        if let Some(plot) = self.plots.first().filter(|_| shares_x) {
            let right = self.width_px() - rooms[columns - 1].1;
            let (from, to) = (MARGIN_PX + left_px(0), MARGIN_PX + right);
            y = canvas.block(((from + to) / 2.0, y - 6.0), &plot.x.label, TICK, to - from, Anchor::Middle) + 6.0;
        }
        y
    }

    /// Draws samples and names of what is drawn, in two columns read downwards (one if a name is too long for half the
    /// width); returns the y below.
    fn legend(&self, canvas: &mut Canvas, top: f64) -> f64 {
        let shown = || self.plots.iter().flat_map(|plot| plot.series.iter().filter(|series| Plot::shows(series)));
        let series = self.names().into_iter().filter_map(|name| {
            let series = shown().find(|series| series.name == name)?;
            Some((name, Entry::Series(series, self.look(series))))
        });
        let fills = self.plots.iter().flat_map(|plot| &plot.cells).flat_map(|cells| &cells.key);
        let fills = fills.map(|(name, colour)| (name.as_str(), Entry::Fill(colour)));
        let rules = self.plots.iter().flat_map(|plot| &plot.rules).filter(|rule| !rule.name.is_empty());
        let rules = rules.map(|rule| (rule.name.as_str(), Entry::Rule(rule)));
        let mut entries: Vec<(&str, Entry)> = series.collect();
        for entry in fills.chain(rules) {
            if entries.iter().all(|(name, _)| *name != entry.0) {
                entries.push(entry);
            }
        }
        let half_px = self.width_px() / 2.0;
        let fits = entries.iter().all(|(name, _)| TEXT.text_px(name) <= half_px - SAMPLE_TEXT_PX - 12.0);
        let columns = if fits { 2 } else { 1 };
        let width_px = self.width_px() / columns as f64 - SAMPLE_TEXT_PX;
        let mut bottom = top;
        for (column, entries) in entries.chunks(entries.len().div_ceil(columns).max(1)).enumerate() {
            let (x, mut y) = (MARGIN_PX + half_px * column as f64, top);
            for (name, entry) in entries {
                let middle = y + TEXT.line_px() / 2.0;
                canvas.group("class=\"legend\"", "", |canvas| match entry {
                    Entry::Series(series, look) => series.sample(canvas, (x, middle), SAMPLE_PX, look),
                    Entry::Rule(rule) => rule.sample(canvas, (x, middle), SAMPLE_PX),
                    Entry::Fill(colour) => {
                        fill_sample(canvas, colour, (x + 10.0, middle - 7.0), (x + 28.0, middle + 7.0));
                    }
                });
                let below = canvas.paragraph((x + SAMPLE_TEXT_PX, y), name, TEXT, width_px);
                y = below.max(y + TEXT.line_px()) + 2.0;
            }
            bottom = bottom.max(y);
        }
        bottom
    }
}

/// An entry of the legend.
enum Entry<'a> {
    Series(&'a Series, Look),
    Fill(&'static str),
    Rule(&'a Rule),
}

impl Plot {
    /// The name beside a value, or of its spoke; `None` on an axis with numbers.
    fn name_of(&self, value: &Value) -> Option<&Name> {
        match self.is_polar {
            true => self.x.names.iter().rfind(|name| name.at <= value.x),
            false => self.y.names.iter().rfind(|name| name.at >= value.y),
        }
    }

    fn is_blank(&self) -> bool {
        self.heading.is_empty() && self.cells.is_none() && self.rules.is_empty() && self.series.is_empty()
    }

    /// Whether the axes can show a value of the series.
    fn shows(series: &Series) -> bool {
        series.values.iter().any(Value::is_shown)
    }

    /// Space left and right of the frame, px.
    fn room_px(&self) -> (f64, f64) {
        if self.is_polar {
            return (0.0, 0.0);
        }
        let widest = |text: fn(&Name) -> &str| {
            let widths = self.y.names.iter().map(|name| TEXT.text_px(text(name)).min(NAME_PX));
            widths.reduce(f64::max).filter(|px| *px > 0.0).map_or(0.0, |px| px + 8.0)
        };
        let left = widest(|name| &name.words);
        (if self.y.names.is_empty() { 46.0 } else { left }, widest(|name| &name.note))
    }

    /// The axes within these ends; `None` if there is nothing to show.
    fn axes(&self, across: (f64, f64), down: (f64, f64), centre: Option<Position>) -> Option<Axes> {
        let is_empty = !self.series.is_empty() && !self.series.iter().any(Plot::shows);
        (self.is_polar || !is_empty).then(|| Axes {
            x: self.x.place(across),
            y: self.y.place((down.1, down.0)),
            centre,
        })
    }

    /// Draws the plot in a frame (across, down): axes with their numbers (below, at the left), content.
    fn draw(
        &self,
        canvas: &mut Canvas,
        look: &dyn Fn(&Series) -> Look,
        (across, down): ((f64, f64), (f64, f64)),
        (has_x_numbers, has_y_numbers): (bool, bool),
    ) {
        let axes = self.axes(across, down, None);
        if let Some(axes) = &axes {
            let has_grid = self.cells.is_none();
            if self.y.names.is_empty() {
                numbers_left(canvas, &axes.y, across, (has_y_numbers, has_grid));
            }
            self.numbers_below(canvas, &axes.x, down, (has_x_numbers, has_grid));
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
    }

    /// Draws all except markers, which are above the frame.
    fn behind(&self, canvas: &mut Canvas, axes: &Axes, look: &dyn Fn(&Series) -> Look) {
        self.cells.iter().for_each(|cells| cells.draw(canvas, axes));
        self.rules.iter().for_each(|rule| rule.draw(canvas, axes));
        // All bands, then all lines, then all markers: a band never hides a value.
        self.series.iter().for_each(|series| series.bands(canvas, axes, &look(series)));
        self.series.iter().for_each(|series| series.line(canvas, axes, &look(series)));
    }

    fn markers(&self, canvas: &mut Canvas, axes: &Axes, look: &dyn Fn(&Series) -> Look) {
        let mut taken = Vec::new();
        self.rules.iter().for_each(|rule| rule.name_at_end(canvas, axes, &mut taken));
        for series in &self.series {
            series.markers(canvas, axes, &look(series), &|value| self.tip(series, value));
        }
    }

    /// `FSM, collision; 2: constant acceleration; F1 0.86 [0.84 0.88]; n = 285`.
    fn tip(&self, series: &Series, value: &Value) -> String {
        let interval = series.ends_of(value);
        let interval = interval.map(|(low, high)| format!(" [{} {}]", plain(low, 3), plain(high, 3)));
        // The axis with numbers: the radius of a polar plot, whose rings have names too.
        let (axis, at) = if self.is_polar { (&self.y, value.y) } else { (&self.x, value.x) };
        let number = format!("{} {}{}", axis.label, plain(at, 3), interval.unwrap_or_default());
        let (row, note) = self.name_of(value).map_or(("", ""), |name| (&name.words, &name.note));
        let words = [self.heading.as_str(), row, &series.name, &number, note];
        words.into_iter().filter(|word| !word.is_empty()).collect::<Vec<_>>().join("; ")
    }

    /// Draws rings, spokes with their names, and series around the middle of the page; returns the y below.
    fn draw_polar(&self, canvas: &mut Canvas, look: &dyn Fn(&Series) -> Look, top: f64) -> f64 {
        let name_px = |name: &Name| TEXT.height_px(&name.words, SPOKE_PX);
        let reach = self.x.names.iter().map(name_px).fold(0.0, f64::max) + NAME_GAP_PX + RADIUS_PX;
        let centre = (COLUMN_PX / 2.0, top + reach);
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
