//! The radar chart of the paper: one spoke per (driver model, criterion), one polygon per parameterization,
//! radius = F1.
//!
//! `kuva` supplies the scene and the SVG writer (number format, XML escapes). Its own radar plot is not used: it
//! needs a number on every spoke, and an undefined F1 (0/0) drawn as a number would be a false measurement. Here
//! the line of a series is *broken* at an undefined spoke and the spoke is named in a note below the chart.
//!
//! Several series often share a value (F1 = 1 above all). So the lines are drawn from thick to thin and the markers
//! from large to small: what lies below stays visible.

use kuva::backend::svg::SvgBackend;
use kuva::render::color::Color;
use kuva::render::render::{PathData, Primitive, Scene, TextAnchor};
use std::f64::consts::TAU;

/// One polygon: the scores of one parameterization.
#[derive(Debug, Clone, PartialEq)]
pub struct RadarSeries {
    /// Name in the legend, such as `1: constant speed, constant lateral speed`.
    pub name: String,
    /// One score per spoke, in the order of [`RadarChart::spokes`], each in 0..=1 (no unit). `None` is undefined
    /// (0/0). A missing entry, a NaN and a number outside 0..=1 are no score either and are shown as undefined;
    /// entries beyond the last spoke are ignored.
    pub values: Vec<Option<f64>>,
}

/// One radar chart: one scenario category.
#[derive(Debug, Clone, PartialEq)]
pub struct RadarChart {
    /// Heading; wrapped when long.
    pub title: String,
    /// Line below the heading (where the data come from); wrapped when long.
    pub subtitle: Option<String>,
    /// Names of the spokes, clockwise from the top, such as `Reg157 Collision`.
    pub spokes: Vec<String>,
    /// The polygons, in the order of the legend.
    pub series: Vec<RadarSeries>,
}

/// Width of the picture and of its empty border, in SVG user units (px).
const WIDTH_PX: f64 = 1000.0;
const BORDER_PX: f64 = 36.0;
const TEXT_WIDTH_PX: f64 = WIDTH_PX - 2.0 * BORDER_PX;
/// Radius of the ring F1 = 1.
const RADIUS_PX: f64 = 285.0;
/// Distance of a spoke's name from the outer ring.
const NAME_GAP_PX: f64 = 20.0;
/// Widest line of a spoke's name; a name at three o'clock still fits between ring and border.
const NAME_WIDTH_PX: f64 = WIDTH_PX / 2.0 - RADIUS_PX - NAME_GAP_PX - 8.0;
/// Length of the line sample in the legend, and where the text behind it starts.
const SAMPLE_PX: f64 = 56.0;
const SAMPLE_TEXT_PX: f64 = 68.0;

const FONTS: &str = "DejaVu Sans, Verdana, Arial, Helvetica, sans-serif";
const INK: &str = "#1a1a1a";
const GREY: &str = "#5f5f5f";
const GRID: &str = "#bdbdbd";

/// Okabe & Ito (2008), chosen for colour-blind readers; without the yellow, too pale as a line on white.
const COLOURS: [&str; 7] = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#000000", "#E69F00", "#56B4E9"];
/// Line styles (SVG dash arrays); the empty one is solid.
const DASHES: [&str; 7] = ["", "10,4", "3,3", "12,3,3,3", "18,5", "7,3,2,3,2,3", "5,6"];
/// Corners of the markers on the unit circle: number, and whether a corner is on top. 0 is a circle.
const MARKERS: [(u32, bool); 7] = [(0, true), (4, false), (3, true), (4, true), (3, false), (5, true), (6, true)];

/// How a text is set.
#[derive(Clone, Copy)]
struct Type {
    size_px: u32,
    bold: bool,
    colour: &'static str,
}

const TITLE: Type = Type { size_px: 24, bold: true, colour: INK };
const SUBTITLE: Type = Type { size_px: 16, bold: false, colour: INK };
const NAME: Type = Type { size_px: 16, bold: false, colour: INK };
const NAME_UNDEFINED: Type = Type { colour: GREY, ..NAME };
const RING: Type = Type { size_px: 13, bold: false, colour: GREY };
const LEGEND: Type = Type { size_px: 16, bold: false, colour: INK };
const NOTE: Type = Type { size_px: 14, bold: false, colour: INK };
const NOTE_HEAD: Type = Type { bold: true, ..NOTE };

impl Type {
    fn line_px(self) -> f64 {
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

    fn text_px(self, text: &str) -> f64 {
        text.chars().map(|c| self.char_px(c)).sum()
    }

    /// `text` in lines no wider than `width_px`: broken at blanks, and inside a word only if it alone is too wide.
    fn wrap(self, text: &str, width_px: f64) -> Vec<String> {
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
struct Look {
    colour: Color,
    dash: Option<String>,
    line_px: f64,
    corners: (u32, bool),
    marker_px: f64,
}

impl Look {
    /// Colour, dash and marker cycle together; from the eighth series on the dash is shifted, so no pair repeats
    /// before 49 series.
    fn of(index: usize, count: usize) -> Self {
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

    fn line(&self, d: String) -> Primitive {
        path(d, None, self.colour.clone(), self.line_px, self.dash.clone())
    }

    /// The marker around a point, with a white rim that parts it from the markers below.
    fn marker(&self, (x, y): (f64, f64)) -> Primitive {
        let (corners, on_top) = self.corners;
        let (fill, rim) = (self.colour.clone(), Color::from("#ffffff"));
        if corners == 0 {
            let (r, stroke, stroke_width) = (self.marker_px * 0.9, Some(rim), Some(1.0));
            return Primitive::Circle { cx: x, cy: y, r, fill, fill_opacity: None, stroke, stroke_width };
        }
        let step = TAU / f64::from(corners);
        let first = if on_top { 0.0 } else { step / 2.0 };
        let outline: Vec<_> =
            (0..corners).map(|k| on_circle((x, y), self.marker_px * 1.1, first + step * f64::from(k))).collect();
        path(path_data(&outline, true), Some(fill), rim, 1.0, None)
    }
}

/// The chart as a complete SVG document, 1000 px wide and as high as its texts need.
///
/// The outer ring is 1, the centre 0, rings every 0.2. A score that is `None` gets no point and no line; all such
/// spokes are named, series by series, below the legend. Texts are XML-escaped; control characters become U+FFFD.
/// The same chart gives the same bytes. Nothing fails: without spokes or series only the texts remain.
pub fn radar_svg(chart: &RadarChart) -> String {
    let scores: Vec<Vec<Option<f64>>> = chart.series.iter().map(|s| scores(s, chart.spokes.len())).collect();
    let mut scene = Scene::new(WIDTH_PX, 0.0);
    scene.font_family = Some(FONTS.to_string());
    scene.text_color = Some(INK.to_string());

    let mut y = paragraph(&mut scene, (BORDER_PX, 24.0), &chart.title, TITLE, TEXT_WIDTH_PX);
    if let Some(subtitle) = &chart.subtitle {
        y = paragraph(&mut scene, (BORDER_PX, y + 4.0), subtitle, SUBTITLE, TEXT_WIDTH_PX);
    }
    if !chart.spokes.is_empty() {
        y = web(&mut scene, chart, &scores, y + 14.0);
        let caption = "Radius: F1 score, 0 at the centre, 1 at the outer ring.";
        y = paragraph(&mut scene, (BORDER_PX, y + 12.0), caption, NOTE, TEXT_WIDTH_PX);
    }
    y = legend(&mut scene, chart, y + 10.0);
    y = notes(&mut scene, chart, &scores, y + 10.0);
    scene.height = (y + 20.0).ceil();
    SvgBackend::new().with_pretty(true).render_scene(&scene)
}

/// One score per spoke; whatever is no number in 0..=1 is undefined.
fn scores(series: &RadarSeries, spokes: usize) -> Vec<Option<f64>> {
    let score = |i: usize| series.values.get(i).copied().flatten().filter(|v| (0.0..=1.0).contains(v));
    (0..spokes).map(score).collect()
}

fn undefined_everywhere(scores: &[Vec<Option<f64>>], spoke: usize) -> bool {
    !scores.is_empty() && scores.iter().all(|s| s[spoke].is_none())
}

/// Rings, spokes, names and polygons below `top`; returns the y below them.
fn web(scene: &mut Scene, chart: &RadarChart, scores: &[Vec<Option<f64>>], top: f64) -> f64 {
    let names: Vec<Vec<String>> = (0..chart.spokes.len())
        .map(|i| {
            let mut lines = NAME.wrap(&chart.spokes[i], NAME_WIDTH_PX);
            if undefined_everywhere(scores, i) {
                lines.push("(undefined)".to_string());
            }
            lines
        })
        .collect();
    let names_px = names.iter().map(Vec::len).max().unwrap_or(0) as f64 * NAME.line_px();
    let reach = names_px + NAME_GAP_PX + RADIUS_PX;
    let centre = (WIDTH_PX / 2.0, top + reach);
    let turn = |i: usize| TAU * i as f64 / names.len() as f64;

    for ring in 1..=5_u32 {
        let (r, stroke) = (RADIUS_PX * f64::from(ring) / 5.0, Some(Color::from(GRID)));
        let (fill, stroke_width) = (Color::None, Some(if ring == 5 { 1.6 } else { 1.0 }));
        scene.add(Primitive::Circle { cx: centre.0, cy: centre.1, r, fill, fill_opacity: None, stroke, stroke_width });
    }
    for (i, lines) in names.iter().enumerate() {
        let nowhere = undefined_everywhere(scores, i);
        let (x2, y2) = on_circle(centre, RADIUS_PX, turn(i));
        scene.add(Primitive::Line {
            x1: centre.0,
            y1: centre.1,
            x2,
            y2,
            stroke: Color::from(GRID),
            stroke_width: 1.0,
            stroke_dasharray: nowhere.then(|| "2,5".to_string()),
        });
        spoke_name(scene, lines, centre, turn(i), if nowhere { NAME_UNDEFINED } else { NAME });
    }
    // Round joins: a mitred corner of a thin spike would reach beyond its score.
    group(scene, "stroke-linejoin=\"round\"", None);
    for (s, values) in scores.iter().enumerate() {
        let look = Look::of(s, scores.len());
        let at = |(i, v): (usize, &Option<f64>)| v.map(|v| on_circle(centre, RADIUS_PX * v, turn(i)));
        let points: Vec<Option<(f64, f64)>> = values.iter().enumerate().map(at).collect();
        for (run, closed) in runs(&points) {
            if run.len() > 1 {
                scene.elements.push(look.line(path_data(&run, closed)));
            }
        }
    }
    // All markers above all lines: a marker says where a score is, also where lines cross.
    for (s, values) in scores.iter().enumerate() {
        let look = Look::of(s, scores.len());
        for (i, value) in values.iter().enumerate() {
            let Some(value) = value else { continue };
            let tip = format!("{}; {}: {value:.3}", plain(&chart.series[s].name), plain(&chart.spokes[i]));
            group(scene, "class=\"score\"", Some(tip));
            scene.elements.push(look.marker(on_circle(centre, RADIUS_PX * value, turn(i))));
            scene.elements.push(Primitive::GroupEnd);
        }
    }
    scene.elements.push(Primitive::GroupEnd);
    ring_labels(scene, centre, turn(1) / 2.0);
    centre.1 + reach
}

/// The values of the rings, midway between the first two spokes where no marker lies, above the lines.
fn ring_labels(scene: &mut Scene, centre: (f64, f64), turn: f64) {
    for ring in 1..=5_u32 {
        let (x, y) = on_circle(centre, RADIUS_PX * f64::from(ring) / 5.0, turn);
        scene.add(Primitive::Rect {
            x: x - 13.0,
            y: y - 9.0,
            width: 26.0,
            height: 18.0,
            fill: Color::from("#ffffff"),
            stroke: None,
            stroke_width: None,
            opacity: Some(0.8),
        });
        let label = format!("{:.1}", f64::from(ring) / 5.0);
        text(scene, (x, y + 5.0), &label, RING, TextAnchor::Middle);
    }
}

/// The lines of a spoke's name outside the outer ring: upward at the top, downward at the bottom, centred beside it.
fn spoke_name(scene: &mut Scene, lines: &[String], centre: (f64, f64), turn: f64, set: Type) {
    let (x, y) = on_circle(centre, RADIUS_PX + NAME_GAP_PX, turn);
    let (across, up) = (libm::sin(turn), libm::cos(turn));
    let anchor = match across {
        a if a > 0.2 => TextAnchor::Start,
        a if a < -0.2 => TextAnchor::End,
        _ => TextAnchor::Middle,
    };
    // `up` runs from 1 (the block ends at y) over 0 (centred on y) to -1 (it starts at y).
    let block_px = lines.len() as f64 * set.line_px();
    let first = y - block_px * (1.0 + up) / 2.0 + f64::from(set.size_px);
    for (k, line) in lines.iter().enumerate() {
        text(scene, (x, first + k as f64 * set.line_px()), line, set, anchor);
    }
}

/// Sample and name of each series, in two columns read downwards (one, if a name is too long for half the width);
/// returns the y below.
fn legend(scene: &mut Scene, chart: &RadarChart, top: f64) -> f64 {
    let half_px = TEXT_WIDTH_PX / 2.0;
    let fits = chart.series.iter().all(|s| LEGEND.text_px(&s.name) <= half_px - SAMPLE_TEXT_PX - 12.0);
    let columns = if fits { 2 } else { 1 };
    let rows = chart.series.len().div_ceil(columns);
    let width_px = TEXT_WIDTH_PX / columns as f64 - SAMPLE_TEXT_PX;
    let mut bottom = top;
    let mut y = top;
    for (s, series) in chart.series.iter().enumerate() {
        let column = s / rows.max(1);
        if s % rows.max(1) == 0 {
            y = top;
        }
        let x = BORDER_PX + half_px * column as f64;
        let look = Look::of(s, chart.series.len());
        let middle = y + LEGEND.line_px() / 2.0;
        scene.add(look.line(path_data(&[(x, middle), (x + SAMPLE_PX, middle)], false)));
        scene.add(look.marker((x + SAMPLE_PX / 2.0, middle)));
        y = paragraph(scene, (x + SAMPLE_TEXT_PX, y), &series.name, LEGEND, width_px).max(y + LEGEND.line_px()) + 5.0;
        bottom = bottom.max(y);
    }
    bottom
}

/// Which scores are undefined, if any; returns the y below.
fn notes(scene: &mut Scene, chart: &RadarChart, scores: &[Vec<Option<f64>>], top: f64) -> f64 {
    let everywhere = |i: &usize| undefined_everywhere(scores, *i);
    let name = |i: usize| chart.spokes[i].as_str();
    let mut lines = Vec::new();
    let all: Vec<&str> = (0..chart.spokes.len()).filter(everywhere).map(name).collect();
    if !all.is_empty() {
        lines.push(format!("In every series: {}", all.join(", ")));
    }
    for (series, values) in chart.series.iter().zip(scores) {
        let here = |i: &usize| values[*i].is_none() && !everywhere(i);
        let gaps: Vec<&str> = (0..chart.spokes.len()).filter(here).map(name).collect();
        if !gaps.is_empty() {
            lines.push(format!("{} — {}", series.name, gaps.join(", ")));
        }
    }
    if lines.is_empty() {
        return top;
    }
    let head = "Undefined F1 (0/0): no point is drawn and the line is broken there.";
    let mut y = paragraph(scene, (BORDER_PX, top), head, NOTE_HEAD, TEXT_WIDTH_PX);
    for line in lines {
        y = paragraph(scene, (BORDER_PX, y + 3.0), &line, NOTE, TEXT_WIDTH_PX);
    }
    y
}

/// The pieces of a series' line, and whether the piece closes: the whole polygon, or what lies between the gaps
/// (a piece may run over the top spoke).
fn runs(points: &[Option<(f64, f64)>]) -> Vec<(Vec<(f64, f64)>, bool)> {
    let Some(gap) = points.iter().position(Option::is_none) else {
        return vec![(points.iter().copied().flatten().collect(), true)];
    };
    let from_gap: Vec<_> = points[gap..].iter().chain(&points[..gap]).copied().collect();
    let pieces = from_gap.split(Option::is_none).filter(|run| !run.is_empty());
    pieces.map(|run| (run.iter().copied().flatten().collect(), false)).collect()
}

/// The point at `turn` (radians, clockwise from the top) on a circle.
fn on_circle((x, y): (f64, f64), radius: f64, turn: f64) -> (f64, f64) {
    (x + radius * libm::sin(turn), y - radius * libm::cos(turn))
}

fn path_data(points: &[(f64, f64)], closed: bool) -> String {
    let corners: Vec<String> = points.iter().map(|(x, y)| format!("{x:.2},{y:.2}")).collect();
    format!("M{}{}", corners.join(" L"), if closed { " Z" } else { "" })
}

fn path(
    d: String,
    fill: Option<Color>,
    stroke: Color,
    stroke_width: f64,
    stroke_dasharray: Option<String>,
) -> Primitive {
    Primitive::Path(Box::new(PathData { d, fill, stroke, stroke_width, opacity: None, stroke_dasharray }))
}

/// Opens a group; `tip` is what a browser shows over it. `Scene::add` would bring hover styles along, so past it.
fn group(scene: &mut Scene, attributes: &str, tip: Option<String>) {
    let extra_attrs = Some(attributes.to_string());
    scene.elements.push(Primitive::GroupStart { transform: None, title: tip, extra_attrs });
}

/// A wrapped text with its top at `y`; returns the y below it.
fn paragraph(scene: &mut Scene, (x, y): (f64, f64), words: &str, set: Type, width_px: f64) -> f64 {
    let lines = set.wrap(words, width_px);
    for (k, line) in lines.iter().enumerate() {
        text(scene, (x, y + k as f64 * set.line_px() + f64::from(set.size_px)), line, set, TextAnchor::Start);
    }
    y + lines.len() as f64 * set.line_px()
}

fn text(scene: &mut Scene, (x, y): (f64, f64), line: &str, set: Type, anchor: TextAnchor) {
    scene.add(Primitive::Text {
        x,
        y,
        // kuva would read `$…$` as a formula; `\$` is its plain dollar.
        content: plain(line).replace('$', "\\$"),
        size: set.size_px,
        anchor,
        rotate: None,
        bold: set.bold,
        color: Some(Color::from(set.colour)),
    });
}

/// Without the characters that XML 1.0 allows in no form, not even escaped.
fn plain(line: &str) -> String {
    let allowed = |c: char| !c.is_control() && !matches!(c, '\u{FFFE}' | '\u{FFFF}');
    line.chars().map(|c| if allowed(c) { c } else { '\u{FFFD}' }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(series: usize, gaps: &[(usize, usize)]) -> RadarChart {
        let criteria = ["Collision", "TTC", "BTN"];
        let spokes: Vec<String> = ["Reg157", "RSS", "CC", "FSM"]
            .iter()
            .flat_map(|model| criteria.iter().map(move |criterion| format!("{model} {criterion}")))
            .collect();
        let score = |s: usize, i: usize| (!gaps.contains(&(s, i))).then(|| 1.0 - 0.04 * ((s * 5 + i * 3) % 17) as f64);
        let name = |s: usize| match s {
            0 => "1: constant speed, constant lateral speed".to_string(),
            _ => format!("{}: SVD, {} coefficients", char::from(b'a' + s as u8), s + 1),
        };
        let series = (0..series)
            .map(|s| RadarSeries { name: name(s), values: (0..spokes.len()).map(|i| score(s, i)).collect() })
            .collect();
        RadarChart { title: "Cut-in".into(), subtitle: Some("SYNTHETIC DATA: test".into()), spokes, series }
    }

    /// The words of the document's texts, lines joined, and a check that its tags nest.
    fn words(svg: &str) -> String {
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
    fn every_title_spoke_and_series_is_named_and_no_note_stands_without_need() {
        let chart = chart(7, &[]);
        let words = words(&radar_svg(&chart));
        let texts = chart.spokes.iter().chain(chart.series.iter().map(|s| &s.name));
        for text in texts.chain([&chart.title]).chain(chart.subtitle.as_ref()) {
            assert!(words.contains(text.as_str()), "{text} is missing");
        }
        for ring in ["0.2", "0.4", "0.6", "0.8", "1.0"] {
            assert!(words.contains(ring));
        }
        assert!(!words.to_lowercase().contains("undefined"));
    }

    #[test]
    fn an_undefined_score_gets_no_point_and_is_named() {
        let whole = radar_svg(&chart(2, &[]));
        let broken = radar_svg(&chart(2, &[(1, 4), (0, 11), (1, 11)]));
        let points = |svg: &str| svg.matches("class=\"score\"").count();
        assert_eq!((points(&whole), points(&broken)), (24, 21));
        assert!(!broken.contains("NaN"));
        let words = words(&broken);
        assert!(words.contains("b: SVD, 2 coefficients — RSS TTC"), "{words}");
        assert!(words.contains("In every series: FSM BTN"));
        assert!(words.contains("FSM BTN (undefined)"));
    }

    #[test]
    fn what_is_no_f1_is_undefined_and_zero_is_a_score() {
        let mut chart = chart(1, &[]);
        let values = vec![Some(f64::NAN), Some(1.5), Some(-0.1), Some(f64::INFINITY), Some(0.0), Some(1.0)];
        assert_eq!(
            scores(&RadarSeries { name: String::new(), values: values.clone() }, 7)[4..],
            [Some(0.0), Some(1.0), None]
        );
        chart.series[0].values = values;
        assert_eq!(radar_svg(&chart).matches("class=\"score\"").count(), 2);
    }

    #[test]
    fn the_line_is_broken_at_every_gap_and_runs_over_the_top() {
        let p = |k: usize| (k as f64, 0.0);
        let full: Vec<_> = (0..4).map(|k| Some(p(k))).collect();
        assert_eq!(runs(&full), [((0..4).map(p).collect(), true)]);
        let gaps = [Some(p(0)), None, Some(p(2)), None, Some(p(4))];
        assert_eq!(runs(&gaps), [(vec![p(2)], false), (vec![p(4), p(0)], false)]);
        assert!(runs(&[None, None]).is_empty());
    }

    #[test]
    fn markup_dollars_and_control_characters_in_names_do_no_harm() {
        let mut chart = chart(1, &[(0, 0)]);
        chart.title = "a < b & \"c\" > 'd' $x$ \u{1}".into();
        chart.spokes[0] = "<script>".into();
        let words = words(&radar_svg(&chart));
        assert!(words.contains("a &lt; b &amp; &quot;c&quot; &gt; &apos;d&apos; $x$ \u{FFFD}"), "{words}");
        assert!(words.contains("&lt;script&gt;"));
    }

    #[test]
    fn the_same_chart_gives_the_same_bytes() {
        assert_eq!(radar_svg(&chart(7, &[(3, 3)])), radar_svg(&chart(7, &[(3, 3)])));
    }

    #[test]
    fn empty_charts_and_long_texts_still_make_a_picture() {
        let mut empty = chart(0, &[]);
        words(&radar_svg(&empty));
        empty.spokes.clear();
        words(&radar_svg(&empty));
        let mut long = chart(9, &[]);
        long.subtitle = Some("SYNTHETIC DATA: ".repeat(40));
        long.series[0].name = "x".repeat(300);
        words(&radar_svg(&long));
        for line in SUBTITLE.wrap(&"SYNTHETIC DATA: ".repeat(40), TEXT_WIDTH_PX) {
            assert!(SUBTITLE.text_px(&line) <= TEXT_WIDTH_PX);
        }
    }

    #[test]
    fn no_two_series_look_alike() {
        let looks: std::collections::BTreeSet<_> = (0..49).map(|i| (i % COLOURS.len(), Look::of(i, 49).dash)).collect();
        assert_eq!(looks.len(), 49);
    }
}
