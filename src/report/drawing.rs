//! What the figures share: ink, type, the looks of series, and the few shapes and texts they are made of.
//!
//! Every figure is 1000 px wide and as high as its texts need, so no text is cut; [`svg`](super::svg) writes it.

use super::svg::{Canvas, Color, PathData, Shape, TextAnchor};
use crate::support::plain_text::acts;
use std::f64::consts::TAU;

/// Width of the picture and of its empty border, in SVG user units (px).
pub(super) const WIDTH_PX: f64 = 1000.0;
pub(super) const BORDER_PX: f64 = 36.0;
pub(super) const TEXT_WIDTH_PX: f64 = WIDTH_PX - 2.0 * BORDER_PX;
/// Length of the line sample in the legend, and where the text behind it starts.
const SAMPLE_PX: f64 = 56.0;
const SAMPLE_TEXT_PX: f64 = 68.0;

pub(super) const FONTS: &str = "DejaVu Sans, Verdana, Arial, Helvetica, sans-serif";
pub(super) const INK: &str = "#1a1a1a";
pub(super) const GREY: &str = "#5f5f5f";
pub(super) const GRID: &str = "#bdbdbd";

/// Okabe & Ito (2008), chosen for colour-blind readers; without the yellow, too pale as a line on white.
const COLOURS: [&str; 7] = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#000000", "#E69F00", "#56B4E9"];
/// Line styles (SVG dash arrays); the empty one is solid.
const DASHES: [&str; 7] = ["", "10,4", "3,3", "12,3,3,3", "18,5", "7,3,2,3,2,3", "5,6"];
/// Corners of the markers on the unit circle: number, and whether a corner is on top. 0 is a circle.
const MARKERS: [(u32, bool); 7] = [(0, true), (4, false), (3, true), (4, true), (3, false), (5, true), (6, true)];

/// How a text is set.
#[derive(Clone, Copy)]
pub(super) struct Type {
    pub size_px: u32,
    pub bold: bool,
    pub colour: &'static str,
}

pub(super) const TITLE: Type = Type { size_px: 24, bold: true, colour: INK };
pub(super) const SUBTITLE: Type = Type { size_px: 16, bold: false, colour: INK };
pub(super) const NAME: Type = Type { size_px: 16, bold: false, colour: INK };
pub(super) const NAME_BOLD: Type = Type { bold: true, ..NAME };
pub(super) const TICK: Type = Type { size_px: 13, bold: false, colour: GREY };
pub(super) const LEGEND: Type = Type { size_px: 16, bold: false, colour: INK };
pub(super) const NOTE: Type = Type { size_px: 14, bold: false, colour: INK };
pub(super) const NOTE_HEAD: Type = Type { bold: true, ..NOTE };

impl Type {
    pub fn line_px(self) -> f64 {
        f64::from(self.size_px) * 1.3
    }

    /// Upper estimate of a character's width. The reader's font is unknown, so this is the wide DejaVu Sans.
    fn char_px(self, c: char) -> f64 {
        let em = match c {
            ' ' | '.' | ',' | ':' | ';' | '\'' | '|' | 'i' | 'l' | 'j' | 'I' | '!' => 0.35,
            'm' | 'w' | 'M' | 'W' | '%' | '@' => 1.0,
            'A'..='Z' => 0.74,
            _ if c.is_ascii() => 0.63,
            _ => 1.0,
        };
        em * f64::from(self.size_px) * if self.bold { 1.13 } else { 1.0 }
    }

    pub fn text_px(self, text: &str) -> f64 {
        text.chars().map(|c| self.char_px(c)).sum()
    }

    /// `text` in lines no wider than `width_px`: broken at blanks, and inside a word only if it alone is too wide.
    pub fn wrap(self, text: &str, width_px: f64) -> Vec<String> {
        let mut lines = Vec::new();
        let mut line = String::new();
        for word in text.split_whitespace() {
            if !line.is_empty() && self.text_px(&line) + self.char_px(' ') + self.text_px(word) > width_px {
                lines.push(std::mem::take(&mut line));
            }
            if !line.is_empty() {
                line.push(' ');
            }
            for c in word.chars() {
                if !line.is_empty() && self.text_px(&line) + self.char_px(c) > width_px {
                    lines.push(std::mem::take(&mut line));
                }
                line.push(c);
            }
        }
        if !line.is_empty() {
            lines.push(line);
        }
        lines
    }
}

/// How one series looks.
#[derive(Debug, Clone)]
pub(super) struct Look {
    pub colour: Color,
    pub dash: Option<String>,
    pub line_px: f64,
    pub corners: (u32, bool),
    pub marker_px: f64,
}

impl Look {
    /// Colour, dash and marker cycle together; from the eighth series on the dash is shifted, so no pair repeats
    /// before 49 series.
    pub fn of(index: usize, count: usize) -> Self {
        let depth = if count > 1 { index as f64 / (count - 1) as f64 } else { 1.0 };
        let dash = DASHES[(index + index / COLOURS.len()) % DASHES.len()];
        Self {
            colour: Color::from(COLOURS[index % COLOURS.len()]),
            dash: (!dash.is_empty()).then(|| dash.to_string()),
            line_px: 4.2 - 2.4 * depth,
            corners: MARKERS[index % MARKERS.len()],
            marker_px: 9.5 - 5.0 * depth,
        }
    }

    pub fn line(&self, d: String) -> Shape {
        path(d, None, self.colour.clone(), self.line_px, self.dash.clone())
    }

    /// The marker around a point, with a white rim that parts it from the markers below.
    pub fn marker(&self, (x, y): (f64, f64)) -> Shape {
        let (corners, on_top) = self.corners;
        let (fill, rim) = (self.colour.clone(), Color::from("#ffffff"));
        if corners == 0 {
            let (r, stroke, stroke_width) = (self.marker_px * 0.9, Some(rim), Some(1.0));
            return Shape::Circle { cx: x, cy: y, r, fill, stroke, stroke_width };
        }
        let step = TAU / f64::from(corners);
        let first = if on_top { 0.0 } else { step / 2.0 };
        let outline: Vec<_> =
            (0..corners).map(|k| on_circle((x, y), self.marker_px * 1.1, first + step * f64::from(k))).collect();
        path(path_data(&outline, true), Some(fill), rim, 1.0, None)
    }
}

/// An empty sheet; its height is set when everything is on it.
pub(super) fn sheet(width: f64) -> Canvas {
    Canvas { width, height: 0.0, font_family: FONTS, text_color: INK, shapes: Vec::new() }
}

/// A page with its heading and the line below it; returns the y below them.
pub(super) fn page(title: &str, subtitle: Option<&str>) -> (Canvas, f64) {
    let mut canvas = sheet(WIDTH_PX);
    let mut y = paragraph(&mut canvas, (BORDER_PX, 24.0), title, TITLE, TEXT_WIDTH_PX);
    if let Some(subtitle) = subtitle {
        y = paragraph(&mut canvas, (BORDER_PX, y + 4.0), subtitle, SUBTITLE, TEXT_WIDTH_PX);
    }
    (canvas, y)
}

/// The page, ending a little below `bottom`, as a complete SVG document.
pub(super) fn document(mut canvas: Canvas, bottom: f64) -> String {
    canvas.height = (bottom + 20.0).ceil();
    canvas.to_svg()
}

/// Sample and name of each series, in two columns read downwards (one, if a name is too long for half the width);
/// returns the y below.
pub(super) fn legend(canvas: &mut Canvas, entries: &[(&str, Look)], top: f64) -> f64 {
    let half_px = TEXT_WIDTH_PX / 2.0;
    let fits = entries.iter().all(|(name, _)| LEGEND.text_px(name) <= half_px - SAMPLE_TEXT_PX - 12.0);
    let columns = if fits { 2 } else { 1 };
    let rows = entries.len().div_ceil(columns);
    let width_px = TEXT_WIDTH_PX / columns as f64 - SAMPLE_TEXT_PX;
    let mut bottom = top;
    let mut y = top;
    for (s, (name, look)) in entries.iter().enumerate() {
        let column = s / rows.max(1);
        if s % rows.max(1) == 0 {
            y = top;
        }
        let x = BORDER_PX + half_px * column as f64;
        let middle = y + LEGEND.line_px() / 2.0;
        canvas.add(look.line(path_data(&[(x, middle), (x + SAMPLE_PX, middle)], false)));
        canvas.add(look.marker((x + SAMPLE_PX / 2.0, middle)));
        y = paragraph(canvas, (x + SAMPLE_TEXT_PX, y), name, LEGEND, width_px).max(y + LEGEND.line_px()) + 5.0;
        bottom = bottom.max(y);
    }
    bottom
}

/// A bold head and the lines below it; without lines nothing. Returns the y below.
pub(super) fn notes(canvas: &mut Canvas, head: &str, lines: &[String], top: f64) -> f64 {
    if lines.is_empty() {
        return top;
    }
    let mut y = paragraph(canvas, (BORDER_PX, top), head, NOTE_HEAD, TEXT_WIDTH_PX);
    for line in lines {
        y = paragraph(canvas, (BORDER_PX, y + 3.0), line, NOTE, TEXT_WIDTH_PX);
    }
    y
}

/// The point at `turn` (radians, clockwise from the top) on a circle.
pub(super) fn on_circle((x, y): (f64, f64), radius: f64, turn: f64) -> (f64, f64) {
    (x + radius * libm::sin(turn), y - radius * libm::cos(turn))
}

pub(super) fn path_data(points: &[(f64, f64)], closed: bool) -> String {
    let corners: Vec<String> = points.iter().map(|(x, y)| format!("{x:.2},{y:.2}")).collect();
    format!("M{}{}", corners.join(" L"), if closed { " Z" } else { "" })
}

pub(super) fn path(
    d: String,
    fill: Option<Color>,
    stroke: Color,
    stroke_width: f64,
    stroke_dasharray: Option<String>,
) -> Shape {
    Shape::Path(Box::new(PathData { d, fill, stroke, stroke_width, opacity: None, stroke_dasharray }))
}

/// Opens a group; `tip` is what a browser shows over it.
pub(super) fn group(canvas: &mut Canvas, attributes: &str, tip: Option<String>) {
    canvas.add(Shape::GroupStart { title: tip, attributes: attributes.to_owned() });
}

/// A straight line.
pub(super) fn line(canvas: &mut Canvas, (x1, y1): (f64, f64), (x2, y2): (f64, f64), colour: &str, stroke_width: f64) {
    let (stroke, stroke_dasharray) = (Color::from(colour), None);
    canvas.add(Shape::Line { x1, y1, x2, y2, stroke, stroke_width, stroke_dasharray });
}

/// A rectangle from corner to corner, in either order.
pub(super) fn rect(
    canvas: &mut Canvas,
    (x1, y1): (f64, f64),
    (x2, y2): (f64, f64),
    fill: Color,
    rim: Option<(&str, f64)>,
) {
    canvas.add(Shape::Rect {
        x: x1.min(x2),
        y: y1.min(y2),
        width: (x2 - x1).abs(),
        height: (y2 - y1).abs(),
        fill,
        stroke: rim.map(|(colour, _)| Color::from(colour)),
        stroke_width: rim.map(|(_, width_px)| width_px),
        opacity: None,
    });
}

/// A filled area without a rim.
pub(super) fn area(canvas: &mut Canvas, outline: &[(f64, f64)], fill: Color, opacity: f64) {
    let (d, stroke, stroke_dasharray) = (path_data(outline, true), Color::None, None);
    let fill = Some(fill);
    let opacity = Some(opacity);
    canvas.add(Shape::Path(Box::new(PathData { d, fill, stroke, stroke_width: 0.0, opacity, stroke_dasharray })));
}

/// A wrapped text with its top at `y`; returns the y below it.
pub(super) fn paragraph(canvas: &mut Canvas, (x, y): (f64, f64), words: &str, set: Type, width_px: f64) -> f64 {
    let lines = set.wrap(words, width_px);
    for (k, line) in lines.iter().enumerate() {
        text(canvas, (x, y + k as f64 * set.line_px() + f64::from(set.size_px)), line, set, TextAnchor::Start);
    }
    y + lines.len() as f64 * set.line_px()
}

pub(super) fn text(canvas: &mut Canvas, (x, y): (f64, f64), line: &str, set: Type, anchor: TextAnchor) {
    canvas.add(Shape::Text {
        x,
        y,
        content: plain(line),
        size: set.size_px,
        anchor,
        bold: set.bold,
        color: Color::from(set.colour),
    });
}

/// Without the characters that XML 1.0 allows in no form, not even escaped, and those that turn or hide others.
pub(super) fn plain(line: &str) -> String {
    let allowed = |c: char| !acts(c) && !matches!(c, '\u{FFFE}' | '\u{FFFF}');
    line.chars().map(|c| if allowed(c) { c } else { '\u{FFFD}' }).collect()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// The words of the document's texts, lines joined, and a check that its tags nest.
    pub fn words(svg: &str) -> String {
        let (mut open, mut words) = (Vec::new(), Vec::new());
        for part in svg.split('<').skip(1).filter(|part| !part.starts_with("!--")) {
            let (tag, after) = part.split_once('>').expect("every tag ends");
            assert!(!after.contains('>'), "bare > in {after}");
            for entity in after.split('&').skip(1) {
                assert!(["amp;", "lt;", "gt;", "quot;", "apos;"].iter().any(|e| entity.starts_with(e)), "bare &");
            }
            match tag.strip_prefix('/') {
                Some(name) => assert_eq!(open.pop().as_deref(), Some(name)),
                None if tag.ends_with('/') => {}
                None => open.push(tag.split_whitespace().next().unwrap_or("").to_string()),
            }
            if tag.starts_with("text ") {
                words.extend(after.split_whitespace().map(str::to_string));
            }
        }
        assert!(open.is_empty(), "open tags {open:?}");
        words.join(" ")
    }

    #[test]
    fn no_two_series_look_alike() {
        let looks: std::collections::BTreeSet<_> = (0..49).map(|i| (i % COLOURS.len(), Look::of(i, 49).dash)).collect();
        assert_eq!(looks.len(), 49);
    }

    #[test]
    fn wrapped_lines_stay_within_their_width() {
        for words in ["SYNTHETIC DATA: ".repeat(40), "x".repeat(300), String::new()] {
            for line in SUBTITLE.wrap(&words, TEXT_WIDTH_PX) {
                assert!(SUBTITLE.text_px(&line) <= TEXT_WIDTH_PX);
            }
        }
    }
}
