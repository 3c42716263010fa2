//! The radar chart of the paper: one spoke per (driver model, criterion), one polygon per parameterization,
//! radius = F1.
//!
//! A number for an undefined F1 (0/0) would be a false measurement. The line of a series is *broken* at an undefined
//! spoke, and a note below the chart names the spoke.
//!
//! Several series often have the same value (usually F1 = 1), so lines and markers are thicker than in other figures.

use super::plot::{Figure, HOLLOW, Look, Mark, Name, Plot, PlotAxis, Series, Value, is_few};

/// One polygon: the scores of one parameterization.
#[derive(Debug, Clone, PartialEq)]
pub struct RadarSeries {
    /// Name in the legend, such as `1: constant speed, constant lateral speed`.
    pub name: String,
    /// One score per spoke, in the order of [`RadarChart::spokes`], each in 0..=1 (no unit). `None` is undefined (0/0).
    /// A missing entry, NaN and a number outside 0..=1 are also shown as undefined; entries beyond the last spoke are
    /// ignored.
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
    /// Scenarios in which S fails, per spoke; missing: unknown.
    pub failing: Vec<u64>,
    /// The polygons, in the order of the legend.
    pub series: Vec<RadarSeries>,
}

impl RadarChart {
    /// The chart as a figure: the outer ring is 1, the centre 0, rings every 0.2. An undefined score has no point and
    /// no line; all such spokes are listed below the legend, series by series.
    pub fn figure(&self) -> Figure {
        let scores: Vec<Vec<Option<f64>>> = self.series.iter().map(|s| scores(s, self.spokes.len())).collect();
        let is_undefined = |spoke: usize| !scores.is_empty() && scores.iter().all(|s| s[spoke].is_none());
        let name = |(at, words): (usize, &String)| {
            let is_empty = is_undefined(at);
            let words = match self.few(at) {
                _ if is_empty => format!("{words} (undefined)"),
                Some(1) => format!("{words} (1 scenario)"),
                Some(failing) => format!("{words} ({failing} scenarios)"),
                None => words.clone(),
            };
            Name { at: at as f64, words, is_empty, ..Name::default() }
        };
        let series = scores.iter().zip(&self.series).enumerate().map(|(at, (scores, series))| {
            let value = |(spoke, score): (usize, &Option<f64>)| Value {
                x: spoke as f64,
                y: score.unwrap_or(f64::NAN),
                is_few: self.few(spoke).is_some(),
                tip: format!("{}; {}: {:.3}", series.name, self.spokes[spoke], score.unwrap_or(f64::NAN)),
                ..Value::default()
            };
            let look = Look::of(at, self.series.len());
            Series {
                values: scores.iter().enumerate().map(value).collect(),
                look: Some(Look { line_px: 1.6 * look.line_px, marker_px: 1.6 * look.marker_px, ..look }),
                attributes: "class=\"score\"".to_owned(),
                ..Series::new(&series.name, &[Mark::Line, Mark::Points], [])
            }
        });
        let rings = [0.2, 0.4, 0.6, 0.8, 1.0].map(|at| Name { at, words: format!("{at:.1}"), ..Name::default() });
        let names: Vec<Name> = self.spokes.iter().enumerate().map(name).collect();
        let plot = Plot {
            x: PlotAxis { names, ..PlotAxis::exactly("", 0.0, self.spokes.len() as f64) },
            y: PlotAxis { names: rings.to_vec(), ..PlotAxis::exactly("", 0.0, 1.0) },
            layers: series.map(Into::into).collect(),
            is_polar: true,
            ..Plot::default()
        };
        let mut caption =
            "Radius: F1 score, 0 at the centre, 1 at the outer ring, without its interval, which the table \
                           has."
                .to_owned();
        if (0..self.spokes.len()).any(|spoke| self.few(spoke).is_some()) {
            caption = [&caption, HOLLOW].join(" ");
        }
        let notes = self.undefined(&scores, &is_undefined);
        Figure {
            title: self.title.clone(),
            subtitle: self.subtitle.clone(),
            caption: if self.spokes.is_empty() { String::new() } else { caption },
            plots: if self.spokes.is_empty() { Vec::new() } else { vec![plot] },
            notes: ("Undefined F1 (0/0): no point is drawn and the line is broken there.", notes),
        }
    }

    /// The number of failing scenarios of a spoke, if it is small.
    fn few(&self, spoke: usize) -> Option<u64> {
        self.failing.get(spoke).copied().filter(|failing| is_few(*failing as f64))
    }

    /// Lists the undefined scores.
    fn undefined(&self, scores: &[Vec<Option<f64>>], is_undefined: &dyn Fn(usize) -> bool) -> Vec<String> {
        let names = |is_named: &dyn Fn(usize) -> bool| {
            let named = (0..self.spokes.len()).filter(|spoke| is_named(*spoke));
            named.map(|spoke| self.spokes[spoke].as_str()).collect::<Vec<_>>().join(", ")
        };
        let all = names(is_undefined);
        let everywhere = (!all.is_empty()).then(|| format!("In every series: {all}"));
        let own = self.series.iter().zip(scores).filter_map(|(series, scores)| {
            let gaps = names(&|spoke| scores[spoke].is_none() && !is_undefined(spoke));
            (!gaps.is_empty()).then(|| format!("{} — {gaps}", series.name))
        });
        everywhere.into_iter().chain(own).collect()
    }
}

/// One score per spoke, undefined unless it lies in 0..=1.
fn scores(series: &RadarSeries, spokes: usize) -> Vec<Option<f64>> {
    let score = |i: usize| series.values.get(i).copied().flatten().filter(|v| (0.0..=1.0).contains(v));
    (0..spokes).map(score).collect()
}

#[cfg(test)]
mod tests {
    use super::super::plot::words;
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
        RadarChart {
            title: "Cut-in".into(),
            subtitle: Some("SYNTHETIC DATA: test".into()),
            spokes,
            failing: vec![],
            series,
        }
    }

    #[test]
    fn every_title_spoke_and_series_is_named_and_no_note_stands_without_need() {
        let chart = chart(7, &[]);
        let words = words(&chart.figure().svg());
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
        let whole = chart(2, &[]).figure().svg();
        let broken = chart(2, &[(1, 4), (0, 11), (1, 11)]).figure().svg();
        let points = |svg: &str| svg.matches("class=\"score\"").count();
        assert_eq!((points(&whole), points(&broken)), (24, 21));
        assert!(!broken.contains("NaN"));
        let words = words(&broken);
        assert!(words.contains("b: SVD, 2 coefficients — RSS TTC"), "{words}");
        assert!(words.contains("In every series: FSM BTN"));
        assert!(words.contains("FSM BTN (undefined)"));
    }

    #[test]
    fn points_from_few_failing_scenarios_are_hollow_and_have_their_number() {
        let mut few = chart(2, &[]);
        few.failing = vec![10; few.spokes.len()];
        let whole = few.figure().svg();
        few.failing[4] = 3;
        let svg = few.figure().svg();
        let hollow = |svg: &str| svg.matches("fill=\"#ffffff\" stroke").count();
        assert_eq!(hollow(&svg) - hollow(&whole), 2, "one point of each series");
        let words = words(&svg);
        assert!(words.contains("RSS TTC (3 scenarios)") && words.contains("Hollow: fewer than ten failing scenarios"));
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
        assert_eq!(chart.figure().svg().matches("class=\"score\"").count(), 2);
    }

    #[test]
    fn markup_dollars_and_control_characters_in_names_do_no_harm() {
        let mut chart = chart(1, &[(0, 0)]);
        chart.title = "a < b & \"c\" > 'd' $x$ \u{1}".into();
        chart.spokes[0] = "<script>".into();
        let words = words(&chart.figure().svg());
        assert!(words.contains("a &lt; b &amp; &quot;c&quot; &gt; &apos;d&apos; $x$ \u{FFFD}"), "{words}");
        assert!(words.contains("&lt;script&gt;"));
    }

    #[test]
    fn the_same_chart_gives_the_same_bytes() {
        assert_eq!(chart(7, &[(3, 3)]).figure().svg(), chart(7, &[(3, 3)]).figure().svg());
    }

    #[test]
    fn empty_charts_and_long_texts_still_make_a_picture() {
        let mut empty = chart(0, &[]);
        words(&empty.figure().svg());
        empty.spokes.clear();
        words(&empty.figure().svg());
        let mut long = chart(9, &[]);
        long.subtitle = Some("SYNTHETIC DATA: ".repeat(40));
        long.series[0].name = "x".repeat(300);
        words(&long.figure().svg());
    }
}
