//! SVG documents: the shapes of the figures and their text. Layout is the figures' own.
//!
//! Coordinates are in user units (px) with at most two decimals, so equal figures are equal bytes on every machine.

use std::fmt::Write;

/// A fill or stroke.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Color {
    /// Nothing is painted.
    None,
    /// Red, green, blue.
    Rgb(u8, u8, u8),
}

impl From<&str> for Color {
    /// From `#rrggbb`; any other text is no colour.
    fn from(text: &str) -> Color {
        let byte = |at: usize| text.get(at..at + 2).and_then(|digits| u8::from_str_radix(digits, 16).ok());
        match (byte(1), byte(3), byte(5)) {
            (Some(r), Some(g), Some(b)) => Color::Rgb(r, g, b),
            _ => Color::None,
        }
    }
}

impl std::fmt::Display for Color {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Color::None => f.write_str("none"),
            Color::Rgb(r, g, b) => write!(f, "#{r:02x}{g:02x}{b:02x}"),
        }
    }
}

/// Which end of a text its position is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum TextAnchor {
    Start,
    Middle,
    End,
}

/// A path.
#[derive(Debug, Clone)]
pub struct PathData {
    /// Commands, as SVG has them.
    pub d: String,
    /// Fill; none where absent.
    pub fill: Option<Color>,
    /// Stroke.
    pub stroke: Color,
    /// Width of the stroke, px.
    pub stroke_width: f64,
    /// Opacity of the fill, 0 to 1.
    pub opacity: Option<f64>,
    /// Lengths of dashes and gaps, px; solid where absent.
    pub stroke_dasharray: Option<String>,
}

/// A shape, or the start or end of a group of shapes. Lengths in px.
#[derive(Debug, Clone)]
#[allow(missing_docs)]
pub enum Shape {
    Line {
        x1: f64,
        y1: f64,
        x2: f64,
        y2: f64,
        stroke: Color,
        stroke_width: f64,
        stroke_dasharray: Option<String>,
    },
    Rect {
        x: f64,
        y: f64,
        width: f64,
        height: f64,
        fill: Color,
        stroke: Option<Color>,
        stroke_width: Option<f64>,
        opacity: Option<f64>,
    },
    Circle {
        cx: f64,
        cy: f64,
        r: f64,
        fill: Color,
        stroke: Option<Color>,
        stroke_width: Option<f64>,
    },
    Path(Box<PathData>),
    Text {
        x: f64,
        y: f64,
        content: String,
        size: u32,
        anchor: TextAnchor,
        bold: bool,
        color: Color,
    },
    /// `attributes` are written as they are; browsers show `title` over the group.
    GroupStart {
        title: Option<String>,
        attributes: String,
    },
    GroupEnd,
}

/// A document that is being drawn.
#[derive(Debug, Clone)]
pub struct Canvas {
    /// Width, px.
    pub width: f64,
    /// Height, px.
    pub height: f64,
    /// CSS font families of all texts.
    pub font_family: &'static str,
    /// Colour of texts that name none.
    pub text_color: &'static str,
    /// In drawing order.
    pub shapes: Vec<Shape>,
}

impl Canvas {
    /// Appends a shape.
    pub fn add(&mut self, shape: Shape) {
        self.shapes.push(shape);
    }

    /// The document.
    pub fn to_svg(&self) -> String {
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}\" height=\"{}\" font-family=\"{}\" fill=\"{}\">\n",
            Number(self.width),
            Number(self.height),
            self.font_family,
            self.text_color
        );
        svg += "  <rect width=\"100%\" height=\"100%\" fill=\"white\" />\n";
        let mut depth = 1;
        for shape in &self.shapes {
            depth -= usize::from(matches!(shape, Shape::GroupEnd));
            svg.extend(std::iter::repeat_n("  ", depth));
            // Writing to a String cannot fail.
            let _ = shape.write(&mut svg, depth);
            svg.push('\n');
            depth += usize::from(matches!(shape, Shape::GroupStart { .. }));
        }
        svg + "</svg>\n"
    }
}

impl Shape {
    fn write(&self, svg: &mut String, depth: usize) -> std::fmt::Result {
        match self {
            Shape::Line { x1, y1, x2, y2, stroke, stroke_width, stroke_dasharray } => {
                write!(svg, "<line x1=\"{}\" y1=\"{}\"", Number(*x1), Number(*y1))?;
                write!(svg, " x2=\"{}\" y2=\"{}\"", Number(*x2), Number(*y2))?;
                write!(svg, " stroke=\"{stroke}\" stroke-width=\"{}\"", Number(*stroke_width))?;
                optional(svg, "stroke-dasharray", stroke_dasharray.as_ref())?;
                svg.write_str(" />")
            }
            Shape::Rect { x, y, width, height, fill, stroke, stroke_width, opacity } => {
                write!(svg, "<rect x=\"{}\" y=\"{}\"", Number(*x), Number(*y))?;
                write!(svg, " width=\"{}\" height=\"{}\" fill=\"{fill}\"", Number(*width), Number(*height))?;
                optional(svg, "stroke", stroke.as_ref())?;
                optional(svg, "stroke-width", stroke_width.map(Number))?;
                optional(svg, "fill-opacity", opacity.map(Number))?;
                svg.write_str(" />")
            }
            Shape::Circle { cx, cy, r, fill, stroke, stroke_width } => {
                write!(svg, "<circle cx=\"{}\" cy=\"{}\" r=\"{}\"", Number(*cx), Number(*cy), Number(*r))?;
                write!(svg, " fill=\"{fill}\"")?;
                optional(svg, "stroke", stroke.as_ref())?;
                optional(svg, "stroke-width", stroke_width.map(Number))?;
                svg.write_str(" />")
            }
            Shape::Path(path) => {
                let width = Number(path.stroke_width);
                write!(svg, "<path d=\"{}\" stroke=\"{}\" stroke-width=\"{width}\"", path.d, path.stroke)?;
                write!(svg, " fill=\"{}\"", path.fill.as_ref().unwrap_or(&Color::None))?;
                optional(svg, "fill-opacity", path.opacity.map(Number))?;
                optional(svg, "stroke-dasharray", path.stroke_dasharray.as_ref())?;
                svg.write_str(" />")
            }
            Shape::Text { x, y, content, size, anchor, bold, color } => {
                let anchor = match anchor {
                    TextAnchor::Start => "start",
                    TextAnchor::Middle => "middle",
                    TextAnchor::End => "end",
                };
                write!(svg, "<text x=\"{}\" y=\"{}\" font-size=\"{size}\"", Number(*x), Number(*y))?;
                write!(svg, " text-anchor=\"{anchor}\"{}", if *bold { " font-weight=\"bold\"" } else { "" })?;
                write!(svg, " fill=\"{color}\">{}</text>", escaped(content))
            }
            Shape::GroupStart { title, attributes } => {
                write!(svg, "<g {attributes}>")?;
                let Some(title) = title else { return Ok(()) };
                write!(svg, "\n{}<title>{}</title>", "  ".repeat(depth + 1), escaped(title))
            }
            Shape::GroupEnd => svg.write_str("</g>"),
        }
    }
}

fn optional(svg: &mut String, name: &str, value: Option<impl std::fmt::Display>) -> std::fmt::Result {
    value.map_or(Ok(()), |value| write!(svg, " {name}=\"{value}\""))
}

/// A number with at most two decimals.
struct Number(f64);

impl std::fmt::Display for Number {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let text = format!("{:.2}", self.0);
        let text = text.trim_end_matches('0').trim_end_matches('.');
        f.write_str(if text == "-0" { "0" } else { text })
    }
}

/// Text as XML content or an attribute's value holds it.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out += "&amp;",
            '<' => out += "&lt;",
            '>' => out += "&gt;",
            '"' => out += "&quot;",
            '\'' => out += "&apos;",
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_at_most_two_decimals_and_no_negative_zero() {
        let text = [0.0, -0.001, 12.0, 461.400_000_000_000_03, 0.125, 1e4, -3.5].map(|v| Number(v).to_string());
        assert_eq!(text, ["0", "0", "12", "461.4", "0.12", "10000", "-3.5"]);
    }

    #[test]
    fn a_document_nests_its_groups_and_escapes_its_texts() {
        let mut canvas =
            Canvas { width: 10.0, height: 20.0, font_family: "serif", text_color: "#000000", shapes: Vec::new() };
        canvas.add(Shape::GroupStart { title: Some("a < b".to_owned()), attributes: "class=\"x\"".to_owned() });
        let (content, anchor, color) = ("S' & \"S\"".to_owned(), TextAnchor::Middle, Color::from("#0072B2"));
        canvas.add(Shape::Text { x: 1.0, y: 2.0, content, size: 12, anchor, bold: true, color });
        canvas.add(Shape::GroupEnd);
        assert_eq!(
            canvas.to_svg(),
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"10\" height=\"20\" font-family=\"serif\" fill=\"#000000\">\n  \
             <rect width=\"100%\" height=\"100%\" fill=\"white\" />\n  <g class=\"x\">\n    <title>a &lt; b</title>\n    \
             <text x=\"1\" y=\"2\" font-size=\"12\" text-anchor=\"middle\" font-weight=\"bold\" fill=\"#0072b2\">S&apos; \
             &amp; &quot;S&quot;</text>\n  </g>\n</svg>\n"
        );
    }
}
