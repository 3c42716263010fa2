//! SVG documents: shapes, groups and wrapped text. The plots define the layout.
//!
//! Coordinates are in user units (px) with at most two decimals, so that equal figures have equal bytes on every
//! machine.

use std::fmt::{Display, Write};

use lanesweep_support::plain_text::escape_markup;

pub(crate) const INK: &str = "#1a1a1a";
pub(crate) const GREY: &str = "#5f5f5f";
pub(crate) const GRID: &str = "#bdbdbd";
pub(crate) const WHITE: &str = "#ffffff";
const FONTS: &str = "DejaVu Sans, Verdana, Arial, Helvetica, sans-serif";

/// A position on the page, px.
pub(crate) type Position = (f64, f64);

/// Paint of a shape. Colours are `#rrggbb`.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Paint<'a> {
    pub fill: Option<&'a str>,
    /// Opacity of the fill, 0 to 1; `None` is 1.
    pub opacity: Option<f64>,
    /// Colour and width (px).
    pub stroke: Option<(&'a str, f64)>,
    /// Lengths of dashes and gaps, px; empty: solid.
    pub dash: &'a str,
}

impl<'a> Paint<'a> {
    pub(super) fn fill(colour: &'a str) -> Self {
        Paint { fill: Some(colour), ..Paint::default() }
    }

    pub(super) fn line(colour: &'a str, width_px: f64) -> Self {
        Paint { stroke: Some((colour, width_px)), ..Paint::default() }
    }
}

/// Type of a text: size, weight, colour.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Type {
    pub size_px: u32,
    pub bold: bool,
    pub colour: &'static str,
}

pub(crate) const fn set(size_px: u32, bold: bool, colour: &'static str) -> Type {
    Type { size_px, bold, colour }
}

impl Type {
    pub(crate) fn line_px(self) -> f64 {
        f64::from(self.size_px) * 1.3
    }

    /// Upper estimate of a character's width, px. The reader's font is unknown, so it is that of the wide DejaVu Sans.
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

    pub(crate) fn text_px(self, text: &str) -> f64 {
        text.chars().map(|c| self.char_px(c)).sum()
    }

    /// Wraps `text` to `width_px`: at blanks, and inside a word only if the word alone is too wide.
    fn wrap(self, text: &str, width_px: f64) -> Vec<String> {
        let mut lines = Vec::new();
        let mut line = String::new();
        // A no-break space keeps an interval together.
        for word in text.split(|c: char| c.is_whitespace() && c != '\u{a0}').filter(|word| !word.is_empty()) {
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

    /// Height of `text` wrapped to `width_px`.
    pub(super) fn height_px(self, text: &str, width_px: f64) -> f64 {
        self.wrap(text, width_px).len() as f64 * self.line_px()
    }
}

/// Alignment of a text at its position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}

/// A document under construction.
#[derive(Debug)]
pub(crate) struct Canvas {
    width_px: f64,
    body: String,
    depth: usize,
}

impl Canvas {
    pub(super) fn new(width_px: f64) -> Self {
        Canvas { width_px, body: String::new(), depth: 1 }
    }

    /// The document, ended a little below `bottom`, with what a screen reader says of it. With a width on paper it has a size
    /// there; else 1 px is 1 px.
    pub(super) fn document(self, bottom: f64, width_mm: Option<f64>, title: &str, description: &str) -> String {
        let height_px = (bottom + 20.0).ceil();
        let (width, height) = (Number(self.width_px), Number(height_px));
        let size = match width_mm {
            None => format!("width=\"{width}\" height=\"{height}\""),
            Some(mm) => {
                let height_mm = Number(mm * height_px / self.width_px);
                format!("width=\"{}mm\" height=\"{height_mm}mm\" viewBox=\"0 0 {width} {height}\"", Number(mm))
            }
        };
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" {size} font-family=\"{FONTS}\" fill=\"{INK}\">\n  \
             <title>{}</title>\n  <desc>{}</desc>\n  <rect width=\"100%\" height=\"100%\" fill=\"{WHITE}\" />\n{}</svg>\n",
            escape_markup(title),
            escape_markup(description),
            self.body
        )
    }

    /// Adds an element, written verbatim.
    fn element(&mut self, text: &str) {
        self.body.extend(std::iter::repeat_n("  ", self.depth));
        self.body += text;
        self.body.push('\n');
    }

    fn shape(&mut self, mut text: String, paint: Paint) {
        attribute(&mut text, "fill", Some(paint.fill.unwrap_or("none")));
        attribute(&mut text, "fill-opacity", paint.opacity.map(Number));
        attribute(&mut text, "stroke", paint.stroke.map(|stroke| stroke.0));
        attribute(&mut text, "stroke-width", paint.stroke.map(|stroke| Number(stroke.1)));
        attribute(&mut text, "stroke-dasharray", (!paint.dash.is_empty()).then_some(paint.dash));
        self.element(&(text + " />"));
    }

    /// Draws a rectangle between two corners, in either order.
    pub(super) fn rect(&mut self, (x1, y1): Position, (x2, y2): Position, paint: Paint) {
        let (x, y, width, height) =
            (Number(x1.min(x2)), Number(y1.min(y2)), Number((x2 - x1).abs()), Number((y2 - y1).abs()));
        self.shape(format!("<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\""), paint);
    }

    pub(super) fn circle(&mut self, (x, y): Position, radius_px: f64, paint: Paint) {
        self.shape(format!("<circle cx=\"{}\" cy=\"{}\" r=\"{}\"", Number(x), Number(y), Number(radius_px)), paint);
    }

    /// Draws polylines as one path.
    pub(crate) fn path(&mut self, runs: &[Vec<Position>], is_closed: bool, paint: Paint) {
        let run = |points: &Vec<Position>| {
            let corners: Vec<String> = points.iter().map(|(x, y)| format!("{},{}", Number(*x), Number(*y))).collect();
            format!("M{}{}", corners.join(" L"), if is_closed { " Z" } else { "" })
        };
        let d: Vec<String> = runs.iter().filter(|points| !points.is_empty()).map(run).collect();
        if !d.is_empty() {
            self.shape(format!("<path d=\"{}\"", d.join(" ")), paint);
        }
    }

    /// Draws one line of text on its base line.
    pub(crate) fn text(&mut self, (x, y): Position, line: &str, set: Type, anchor: Anchor) {
        let mut text = format!("<text x=\"{}\" y=\"{}\" font-size=\"{}\"", Number(x), Number(y), set.size_px);
        let anchor = match anchor {
            Anchor::Start => None,
            Anchor::Middle => Some("middle"),
            Anchor::End => Some("end"),
        };
        attribute(&mut text, "text-anchor", anchor);
        attribute(&mut text, "font-weight", set.bold.then_some("bold"));
        attribute(&mut text, "fill", (set.colour != INK).then_some(set.colour));
        self.element(&format!("{text}>{}</text>", escape_markup(line)));
    }

    /// Draws a wrapped text with its top at `y`; returns the y below it.
    pub(super) fn block(&mut self, (x, y): Position, words: &str, set: Type, width_px: f64, anchor: Anchor) -> f64 {
        let lines = set.wrap(words, width_px);
        for (k, line) in lines.iter().enumerate() {
            self.text((x, y + k as f64 * set.line_px() + f64::from(set.size_px)), line, set, anchor);
        }
        y + lines.len() as f64 * set.line_px()
    }

    pub(crate) fn paragraph(&mut self, at: Position, words: &str, set: Type, width_px: f64) -> f64 {
        self.block(at, words, set, width_px, Anchor::Start)
    }

    /// Groups what `draw` draws. `attributes` are written verbatim; `tip` is the group's tooltip in browsers.
    pub(crate) fn group(&mut self, attributes: &str, tip: &str, draw: impl FnOnce(&mut Self)) {
        self.element(&format!("<g {attributes}>"));
        self.depth += 1;
        if !tip.is_empty() {
            self.element(&format!("<title>{}</title>", escape_markup(tip)));
        }
        draw(self);
        self.depth -= 1;
        self.element("</g>");
    }
}

fn attribute(text: &mut String, name: &str, value: Option<impl Display>) {
    if let Some(value) = value {
        // Writing to a String cannot fail.
        let _ = write!(text, " {name}=\"{value}\"");
    }
}

/// A number with at most two decimals.
struct Number(f64);

impl Display for Number {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let text = format!("{:.2}", self.0);
        let text = text.trim_end_matches('0').trim_end_matches('.');
        f.write_str(if text == "-0" { "0" } else { text })
    }
}
