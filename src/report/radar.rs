//! The radar chart of the paper: one spoke per (driver model, criterion), one polygon per parameterization,
//! radius = F1.
//!
//! An undefined F1 (0/0) drawn as a number would be a false measurement. The line of a series is *broken* at an
//! undefined spoke, and a note below the chart names the spoke.
//!
//! Several series often share a value (F1 = 1 above all). So the lines are drawn from thick to thin and the markers
//! from large to small: what lies below stays visible.

use super::drawing::{
    self, BORDER_PX, GREY, GRID, Look, NAME, NOTE, TEXT_WIDTH_PX, TICK, Type, WIDTH_PX, group, on_circle, paragraph,
    path_data, plain, text,
};
use super::svg::{Canvas, Color, Shape, TextAnchor};
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

/// Radius of the ring F1 = 1.
const RADIUS_PX: f64 = 285.0;
/// Distance of a spoke's name from the outer ring.
const NAME_GAP_PX: f64 = 20.0;
/// Widest line of a spoke's name; a name at three o'clock still fits between ring and border.
const NAME_WIDTH_PX: f64 = WIDTH_PX / 2.0 - RADIUS_PX - NAME_GAP_PX - 8.0;
const NAME_UNDEFINED: Type = Type { colour: GREY, ..NAME };

/// The chart as a complete SVG document, 1000 px wide and as high as its texts need.
///
/// The outer ring is 1, the centre 0, rings every 0.2. A score that is `None` gets no point and no line; all such
/// spokes are named, series by series, below the legend. Texts are XML-escaped; control characters become U+FFFD.
/// The same chart gives the same bytes. Nothing fails: without spokes or series only the texts remain.
pub fn radar_svg(chart: &RadarChart) -> String {
    let scores: Vec<Vec<Option<f64>>> = chart.series.iter().map(|s| scores(s, chart.spokes.len())).collect();
    let (mut canvas, mut y) = drawing::page(&chart.title, chart.subtitle.as_deref());
    if !chart.spokes.is_empty() {
        y = web(&mut canvas, chart, &scores, y + 14.0);
        let caption = "Radius: F1 score, 0 at the centre, 1 at the outer ring.";
        y = paragraph(&mut canvas, (BORDER_PX, y + 12.0), caption, NOTE, TEXT_WIDTH_PX);
    }
    let count = chart.series.len();
    let names = chart.series.iter().map(|s| s.name.as_str()).enumerate();
    let legend: Vec<(&str, Look)> = names.map(|(s, name)| (name, Look::of(s, count))).collect();
    y = drawing::legend(&mut canvas, &legend, y + 10.0);
    y = notes(&mut canvas, chart, &scores, y + 10.0);
    drawing::document(canvas, y)
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
fn web(canvas: &mut Canvas, chart: &RadarChart, scores: &[Vec<Option<f64>>], top: f64) -> f64 {
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
        canvas.add(Shape::Circle { cx: centre.0, cy: centre.1, r, fill, stroke, stroke_width });
    }
    for (i, lines) in names.iter().enumerate() {
        let nowhere = undefined_everywhere(scores, i);
        let (x2, y2) = on_circle(centre, RADIUS_PX, turn(i));
        canvas.add(Shape::Line {
            x1: centre.0,
            y1: centre.1,
            x2,
            y2,
            stroke: Color::from(GRID),
            stroke_width: 1.0,
            stroke_dasharray: nowhere.then(|| "2,5".to_string()),
        });
        spoke_name(canvas, lines, centre, turn(i), if nowhere { NAME_UNDEFINED } else { NAME });
    }
    // Round joins: a mitred corner of a thin spike would reach beyond its score.
    group(canvas, "stroke-linejoin=\"round\"", None);
    for (s, values) in scores.iter().enumerate() {
        let look = Look::of(s, scores.len());
        let at = |(i, v): (usize, &Option<f64>)| v.map(|v| on_circle(centre, RADIUS_PX * v, turn(i)));
        let points: Vec<Option<(f64, f64)>> = values.iter().enumerate().map(at).collect();
        for (run, closed) in runs(&points) {
            if run.len() > 1 {
                canvas.add(look.line(path_data(&run, closed)));
            }
        }
    }
    // All markers above all lines: a marker says where a score is, also where lines cross.
    for (s, values) in scores.iter().enumerate() {
        let look = Look::of(s, scores.len());
        for (i, value) in values.iter().enumerate() {
            let Some(value) = value else { continue };
            let tip = format!("{}; {}: {value:.3}", plain(&chart.series[s].name), plain(&chart.spokes[i]));
            group(canvas, "class=\"score\"", Some(tip));
            canvas.add(look.marker(on_circle(centre, RADIUS_PX * value, turn(i))));
            canvas.add(Shape::GroupEnd);
        }
    }
    canvas.add(Shape::GroupEnd);
    ring_labels(canvas, centre, turn(1) / 2.0);
    centre.1 + reach
}

/// The values of the rings, midway between the first two spokes where no marker lies, above the lines.
fn ring_labels(canvas: &mut Canvas, centre: (f64, f64), turn: f64) {
    for ring in 1..=5_u32 {
        let (x, y) = on_circle(centre, RADIUS_PX * f64::from(ring) / 5.0, turn);
        canvas.add(Shape::Rect {
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
        text(canvas, (x, y + 5.0), &label, TICK, TextAnchor::Middle);
    }
}

/// The lines of a spoke's name outside the outer ring: upward at the top, downward at the bottom, centred beside it.
fn spoke_name(canvas: &mut Canvas, lines: &[String], centre: (f64, f64), turn: f64, set: Type) {
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
        text(canvas, (x, first + k as f64 * set.line_px()), line, set, anchor);
    }
}

/// Which scores are undefined, if any; returns the y below.
fn notes(canvas: &mut Canvas, chart: &RadarChart, scores: &[Vec<Option<f64>>], top: f64) -> f64 {
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
    drawing::notes(canvas, "Undefined F1 (0/0): no point is drawn and the line is broken there.", &lines, top)
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

#[cfg(test)]
mod tests {
    use super::super::drawing::tests::words;
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
    }
}
