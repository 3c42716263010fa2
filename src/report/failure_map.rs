//! Where failures are: the share of failed samples per cell of two scenario parameters, as a heat map.
//!
//! The colours run from pale yellow to dark blue, each darker than the one before: they can be told apart by
//! colour-blind readers and in grey print. Three things are never only a colour: a cell without samples is hatched,
//! a cell with few samples is a smaller square, and a cell without failures has its own grey, so that "none seen" and
//! "few" differ.

use super::svg::{Canvas, Color, PathData, Shape, TextAnchor};
use std::fmt::Write;

use super::axis::{Axis, number, plain_end};
use super::drawing::{
    self, BORDER_PX, GREY, GRID, INK, NOTE, TEXT_WIDTH_PX, TICK, Type, WIDTH_PX, group, paragraph, path_data, rect,
    text,
};

/// One parameter, cut into cells.
#[derive(Debug, Clone, PartialEq)]
pub struct MapAxis {
    /// Name, such as `initial gap`.
    pub name: String,
    /// Unit, such as `m`; empty for a number without one.
    pub unit: String,
    /// Edges of the cells in that unit: finite, increasing, one more than cells.
    pub edges: Vec<f64>,
}

/// Counts of samples and failures over two parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct FailureMap {
    /// Heading; wrapped when long.
    pub title: String,
    /// Line below the heading (which model and criterion, what was sampled); wrapped when long.
    pub subtitle: Option<String>,
    /// The parameter across.
    pub x: MapAxis,
    /// The parameter upwards.
    pub y: MapAxis,
    /// Samples per cell, row by row: the cell of `x` cell i and `y` cell j is at `j * (x cells) + i`.
    pub samples: Vec<u64>,
    /// Failures per cell, in the same order; not more than samples.
    pub failures: Vec<u64>,
}

/// With fewer samples than this a cell's share says little.
const FEW_SAMPLES: u64 = 10;
/// Left edge of the map, where its right edge and the colour bar are.
const LEFT_PX: f64 = BORDER_PX + 64.0;
const RIGHT_PX: f64 = WIDTH_PX - BORDER_PX - 120.0;
const BAR_PX: (f64, f64) = (RIGHT_PX + 44.0, RIGHT_PX + 66.0);
/// From a share of zero to the largest one. Relative luminance falls from step to step.
const COLOURS: [(u8, u8, u8); 6] =
    [(255, 236, 150), (226, 199, 112), (176, 163, 116), (120, 124, 126), (66, 82, 122), (10, 32, 80)];
/// A cell with samples and without failures.
const NONE_FAILED: &str = "#ececec";
const HATCH: &str = "#9a9a9a";
const LABEL: Type = Type { size_px: 15, bold: false, colour: INK };

impl MapAxis {
    fn cells(&self) -> usize {
        self.edges.len().saturating_sub(1)
    }

    fn label(&self) -> String {
        if self.unit.is_empty() { self.name.clone() } else { format!("{} ({})", self.name, self.unit) }
    }

    fn problem(&self) -> Option<String> {
        let name = &self.name;
        if self.cells() == 0 {
            return Some(format!("the axis {name} has no cell"));
        }
        // Beyond this the width of an axis would leave the range of f64.
        if self.edges.iter().any(|e| !e.is_finite() || e.abs() > 1e300) {
            return Some(format!("an edge of the axis {name} is not a finite number"));
        }
        let rising = self.edges.windows(2).all(|e| e[0] < e[1]);
        (!rising).then(|| format!("the edges of the axis {name} do not increase"))
    }
}

/// What is known of one cell.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Share {
    /// No samples.
    Empty,
    /// More failures than samples: a mistake in the counts.
    Wrong,
    /// Share of failures, and whether from few samples only.
    Known { share: f64, few: bool },
}

impl FailureMap {
    /// Why the map cannot be drawn, if so: an axis without cells, edges that do not increase, or counts that do not
    /// match the cells. Then [`FailureMap::svg`] says so in words and [`FailureMap::csv`] has no rows.
    pub fn problem(&self) -> Option<String> {
        let cells = self.x.cells() * self.y.cells();
        let counts = [("samples", self.samples.len()), ("failures", self.failures.len())];
        let wrong = counts.into_iter().find(|(_, n)| *n != cells);
        let count = || wrong.map(|(what, n)| format!("there are {n} counts of {what} for {cells} cells"));
        self.x.problem().or_else(|| self.y.problem()).or_else(count)
    }

    fn share(&self, cell: usize) -> Share {
        match (self.samples[cell], self.failures[cell]) {
            (0, 0) => Share::Empty,
            (samples, failures) if failures > samples => Share::Wrong,
            (samples, failures) => Share::Known { share: failures as f64 / samples as f64, few: samples < FEW_SAMPLES },
        }
    }

    /// The map as a complete SVG document, 1000 px wide and as high as its cells and texts need.
    ///
    /// A cell with more failures than samples is left white, crossed out and counted in a note. Texts are
    /// XML-escaped; control characters become U+FFFD. The same map gives the same bytes. Nothing fails: a map with a
    /// [`FailureMap::problem`] is a text that names it.
    pub fn svg(&self) -> String {
        let (mut canvas, y) = drawing::page(&self.title, self.subtitle.as_deref());
        if let Some(problem) = self.problem() {
            let words = format!("This map cannot be drawn: {problem}.");
            let y = paragraph(&mut canvas, (BORDER_PX, y + 14.0), &words, NOTE, TEXT_WIDTH_PX);
            return drawing::document(canvas, y);
        }
        let shares: Vec<Share> = (0..self.samples.len()).map(|cell| self.share(cell)).collect();
        let known = |s: &Share| if let Share::Known { share, .. } = s { Some(*share) } else { None };
        let largest = shares.iter().filter_map(known).fold(0.0, f64::max);
        let largest = if largest > 0.0 { plain_end(largest).min(1.0) } else { 0.0 };

        let y = paragraph(&mut canvas, (BORDER_PX, y + 14.0), &self.y.label(), LABEL, RIGHT_PX - BORDER_PX);
        let ratio = self.y.cells() as f64 / self.x.cells() as f64;
        let (top, width_px) = (y + 8.0, RIGHT_PX - LEFT_PX);
        let bottom = top + (width_px * ratio).clamp(360.0, width_px);
        let ends = |axis: &MapAxis| (axis.edges[0], axis.edges[axis.cells()]);
        let x = Axis::exactly(ends(&self.x), (LEFT_PX, RIGHT_PX));
        let y = Axis::exactly(ends(&self.y), (bottom, top));

        self.cells(&mut canvas, &shares, (&x, &y), largest);
        rect(&mut canvas, (LEFT_PX, top), (RIGHT_PX, bottom), Color::None, Some((GREY, 1.0)));
        y.draw_left(&mut canvas, (LEFT_PX, RIGHT_PX), 8, false);
        let mut below = x.draw_below(&mut canvas, (top, bottom), 8, false);
        colour_bar(&mut canvas, (top, bottom), largest);
        for line in LABEL.wrap(&self.x.label(), RIGHT_PX - LEFT_PX) {
            text(&mut canvas, ((LEFT_PX + RIGHT_PX) / 2.0, below + 19.0), &line, LABEL, TextAnchor::Middle);
            below += LABEL.line_px();
        }
        let below = key(&mut canvas, &shares, below + 20.0);
        let below = drawing::notes(&mut canvas, "Notes:", &self.notes(&shares), below + 10.0);
        drawing::document(canvas, below)
    }

    fn cells(&self, canvas: &mut Canvas, shares: &[Share], (x, y): (&Axis, &Axis), largest: f64) {
        let [across, up] = [(x, &self.x), (y, &self.y)].map(|(axis, edges)| {
            let edges: Vec<f64> = edges.edges.iter().map(|e| axis.at(*e)).collect();
            edges
        });
        let corners = |cell: usize| {
            let (i, j) = (cell % self.x.cells(), cell / self.x.cells());
            ((across[i], up[j]), (across[i + 1], up[j + 1]))
        };
        // Whole cells without smoothing, so that no white seams part neighbours; the rims of small squares need it.
        for few_now in [false, true] {
            let whole = "shape-rendering=\"crispEdges\"";
            group(canvas, if few_now { "class=\"rarely-sampled\"" } else { whole }, None);
            for (cell, share) in shares.iter().enumerate() {
                let Share::Known { share, few } = *share else { continue };
                if few != few_now {
                    continue;
                }
                let class = if few { "class=\"cell few\"" } else { "class=\"cell\"" };
                group(canvas, class, Some(self.tip(cell, share)));
                square(canvas, corners(cell), share_colour(share, largest), few);
                canvas.add(Shape::GroupEnd);
            }
            canvas.add(Shape::GroupEnd);
        }
        let mut strokes = Vec::new();
        for (cell, share) in shares.iter().enumerate() {
            let ((left, lower), (right, upper)) = corners(cell);
            match share {
                Share::Empty => strokes.extend(hatching(corners(cell))),
                Share::Wrong => {
                    strokes.push(path_data(&[(left, lower), (right, upper)], false));
                    strokes.push(path_data(&[(left, upper), (right, lower)], false));
                }
                Share::Known { .. } => {}
            }
        }
        hatch(canvas, &strokes);
    }

    fn tip(&self, cell: usize, share: f64) -> String {
        let (i, j) = (cell % self.x.cells(), cell / self.x.cells());
        let range = |axis: &MapAxis, k: usize| format!("{} to {}", number(axis.edges[k]), number(axis.edges[k + 1]));
        let (x, y) = (range(&self.x, i), range(&self.y, j));
        let (failures, samples) = (self.failures[cell], self.samples[cell]);
        format!("{x}; {y}: {failures} of {samples} failed, share {}", number(share))
    }

    fn notes(&self, shares: &[Share]) -> Vec<String> {
        let mut lines = Vec::new();
        let known = || shares.iter().filter(|s| matches!(s, Share::Known { .. }));
        if known().next().is_none() {
            lines.push("No cell has samples.".to_string());
        } else if known().all(|s| matches!(s, Share::Known { share: 0.0, .. })) {
            lines.push("No sample failed.".to_string());
        }
        let wrong = shares.iter().filter(|s| **s == Share::Wrong).count();
        if wrong > 0 {
            lines.push(format!(
                "Crossed out, because failures are more than samples: {wrong} of {} cells.",
                shares.len()
            ));
        }
        lines
    }

    /// The cells as CSV, one row each in the order of [`FailureMap::samples`]: edges in the axes' units, counts, and
    /// the share, empty without samples or with more failures than samples. Numbers in full precision.
    pub fn csv(&self) -> String {
        let mut table = "x_lower,x_upper,y_lower,y_upper,samples,failures,share\n".to_string();
        if self.problem().is_some() {
            return table;
        }
        for cell in 0..self.samples.len() {
            let (i, j) = (cell % self.x.cells(), cell / self.x.cells());
            let share = match self.share(cell) {
                Share::Known { share, .. } => share.to_string(),
                Share::Empty | Share::Wrong => String::new(),
            };
            let (x, y) = (&self.x.edges[i..], &self.y.edges[j..]);
            let (samples, failures) = (self.samples[cell], self.failures[cell]);
            let _ = writeln!(table, "{},{},{},{},{samples},{failures},{share}", x[0], x[1], y[0], y[1]);
        }
        table
    }
}

type Corners = ((f64, f64), (f64, f64));

/// A cell, or the middle of one with few samples.
fn square(canvas: &mut Canvas, (a, b): Corners, fill: Color, few: bool) {
    if !few {
        return rect(canvas, a, b, fill, None);
    }
    let inner = |from: f64, to: f64| (from + 0.22 * (to - from), to - 0.22 * (to - from));
    let ((x1, x2), (y1, y2)) = (inner(a.0, b.0), inner(a.1, b.1));
    // In small cells the rim must not outweigh the colour.
    let rim_px = (0.08 * (x2 - x1).abs().min((y2 - y1).abs())).min(0.8);
    rect(canvas, (x1, y1), (x2, y2), fill, Some((HATCH, rim_px)));
}

/// Lines along the diagonal of a cell, about 12 px apart; in small cells the diagonal alone.
fn hatching(((left, lower), (right, upper)): Corners) -> Vec<String> {
    let size_px = (right - left).abs().min((upper - lower).abs());
    let lines = (size_px / 12.0).clamp(1.0, 100.0) as i32;
    let at = |x: f64, y: f64| (left + x * (right - left), lower + y * (upper - lower));
    let line = |k: i32| {
        let shift = f64::from(k) / f64::from(lines);
        let (from, to) = ((-shift).max(0.0), (1.0 - shift).min(1.0));
        path_data(&[at(from, from + shift), at(to, to + shift)], false)
    };
    (1 - lines..lines).map(line).collect()
}

fn hatch(canvas: &mut Canvas, strokes: &[String]) {
    if strokes.is_empty() {
        return;
    }
    let (d, stroke, stroke_width) = (strokes.join(" "), Color::from(HATCH), 0.8);
    let (fill, opacity, stroke_dasharray) = (None, None, None);
    group(canvas, "class=\"hatch\"", None);
    canvas.add(Shape::Path(Box::new(PathData { d, fill, stroke, stroke_width, opacity, stroke_dasharray })));
    canvas.add(Shape::GroupEnd);
}

fn share_colour(share: f64, largest: f64) -> Color {
    if share <= 0.0 { Color::from(NONE_FAILED) } else { scale_colour(share / largest) }
}

/// The colour at `place` in 0..=1 of the scale, straight between its anchors.
fn scale_colour(place: f64) -> Color {
    let along = place.clamp(0.0, 1.0) * (COLOURS.len() - 1) as f64;
    let first = (along as usize).min(COLOURS.len() - 2);
    let (from, to, part) = (COLOURS[first], COLOURS[first + 1], along - first as f64);
    let mix = |a: u8, b: u8| (f64::from(a) + part * (f64::from(b) - f64::from(a))).round() as u8;
    Color::Rgb(mix(from.0, to.0), mix(from.1, to.1), mix(from.2, to.2))
}

/// The scale from zero to `largest`, a plain number at or above every share, at the right of the map; without any failure there is none.
fn colour_bar(canvas: &mut Canvas, (top, bottom): (f64, f64), largest: f64) {
    if largest <= 0.0 {
        return;
    }
    let (left, right) = BAR_PX;
    let bottom = bottom.min(top + 420.0);
    text(canvas, (left, top + 12.0), "Share failed", TICK, TextAnchor::Start);
    let top = top + 28.0;
    let bands = 100_u32;
    let edge = |k: u32| bottom + (top - bottom) * f64::from(k) / f64::from(bands);
    group(canvas, "shape-rendering=\"crispEdges\" class=\"scale\"", None);
    for k in 0..bands {
        rect(
            canvas,
            (left, edge(k)),
            (right, edge(k + 1)),
            scale_colour((f64::from(k) + 0.5) / f64::from(bands)),
            None,
        );
    }
    canvas.add(Shape::GroupEnd);
    rect(canvas, (left, top), (right, bottom), Color::None, Some((GREY, 1.0)));
    for tick in Axis::exactly((0.0, largest), (bottom, top)).ticks(6) {
        drawing::line(canvas, (right, tick.at_px), (right + 5.0, tick.at_px), GREY, 1.0);
        if let Some(label) = &tick.label {
            text(canvas, (right + 8.0, tick.at_px + 4.5), label, TICK, TextAnchor::Start);
        }
    }
}

/// What the cells that are no plain colour mean, as far as they occur; returns the y below.
fn key(canvas: &mut Canvas, shares: &[Share], top: f64) -> f64 {
    let is = |test: fn(&Share) -> bool| shares.iter().any(test);
    let mut x = LEFT_PX;
    let mut entry = |canvas: &mut Canvas, words: &str| {
        let corners = ((x, top + 18.0), (x + 18.0, top));
        text(canvas, (x + 26.0, top + 14.0), words, NOTE, TextAnchor::Start);
        x += 26.0 + NOTE.text_px(words) + 24.0;
        corners
    };
    let mut any = false;
    if is(|s| matches!(s, Share::Known { share: 0.0, .. })) {
        let (a, b) = entry(canvas, "no failure");
        rect(canvas, a, b, Color::from(NONE_FAILED), Some((GRID, 0.8)));
        any = true;
    }
    if is(|s| matches!(s, Share::Known { few: true, .. })) {
        let (a, b) = entry(canvas, &format!("fewer than {FEW_SAMPLES} samples: smaller square"));
        rect(canvas, a, b, Color::None, Some((GRID, 0.8)));
        square(canvas, (a, b), scale_colour(0.6), true);
        any = true;
    }
    if is(|s| matches!(s, Share::Empty)) {
        let (a, b) = entry(canvas, "no samples");
        rect(canvas, a, b, Color::None, Some((GRID, 0.8)));
        hatch(canvas, &hatching((a, b)));
        any = true;
    }
    if any { top + 22.0 } else { top }
}

#[cfg(test)]
mod tests {
    use super::super::drawing::tests::words;
    use super::*;

    fn axis(name: &str, unit: &str, cells: usize) -> MapAxis {
        let edges = (0..=cells).map(|k| 10.0 + 5.0 * k as f64).collect();
        MapAxis { name: name.into(), unit: unit.into(), edges }
    }

    fn map(nx: usize, ny: usize, count: impl Fn(usize, usize) -> (u64, u64)) -> FailureMap {
        let counts: Vec<_> = (0..nx * ny).map(|c| count(c % nx, c / nx)).collect();
        FailureMap {
            title: "Cut-in".into(),
            subtitle: None,
            x: axis("initial gap", "m", nx),
            y: axis("speed difference", "m/s", ny),
            samples: counts.iter().map(|c| c.0).collect(),
            failures: counts.iter().map(|c| c.1).collect(),
        }
    }

    fn cells(svg: &str) -> (usize, usize) {
        (svg.matches("class=\"cell\"").count(), svg.matches("class=\"cell few\"").count())
    }

    #[test]
    fn axes_carry_name_and_unit_and_every_sampled_cell_is_drawn_once() {
        let svg = map(4, 3, |i, j| (100, (i * j) as u64)).svg();
        let words = words(&svg);
        for name in ["initial gap (m)", "speed difference (m/s)", "Share failed", "no failure"] {
            assert!(words.contains(name), "{name} in {words}");
        }
        assert_eq!(cells(&svg), (12, 0));
        assert!(!svg.contains("class=\"hatch\"") && !words.contains("no samples") && !words.contains("fewer"));
    }

    #[test]
    fn unsampled_and_rarely_sampled_cells_are_marked_by_shape_and_explained() {
        let svg = map(3, 1, |i, _| [(0, 0), (9, 3), (10, 3)][i]).svg();
        assert_eq!(cells(&svg), (1, 1));
        assert!(svg.contains("class=\"hatch\""));
        let words = words(&svg);
        assert!(words.contains("fewer than 10 samples") && words.contains("no samples"), "{words}");
    }

    #[test]
    fn each_colour_of_the_scale_is_darker_than_the_one_before_and_none_is_the_grey_of_no_failure() {
        let luminance = |colour: Color| {
            let Color::Rgb(r, g, b) = colour else { panic!("a colour of the scale") };
            let linear = |v: u8| (f64::from(v) / 255.0).powf(2.2);
            0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b)
        };
        let scale: Vec<f64> = (0..=50).map(|k| luminance(scale_colour(f64::from(k) / 50.0))).collect();
        assert!(scale.windows(2).all(|l| l[0] > l[1]), "{scale:?}");
        assert!(scale[0] > 0.8 && scale[50] < 0.02);
        assert_ne!(share_colour(0.0, 1.0), share_colour(1e-9, 1.0));
    }

    #[test]
    fn a_row_of_the_table_is_a_row_of_y_and_an_unknown_share_is_empty() {
        let map = map(2, 2, |i, j| [(8, 2), (0, 0), (4, 5), (3, 1)][2 * j + i]);
        let expected = "x_lower,x_upper,y_lower,y_upper,samples,failures,share\n\
                        10,15,10,15,8,2,0.25\n15,20,10,15,0,0,\n10,15,15,20,4,5,\n15,20,15,20,3,1,0.3333333333333333\n";
        assert_eq!(map.csv(), expected);
        assert!(words(&map.svg()).contains("failures are more than samples: 1 of 4 cells"));
    }

    #[test]
    fn rows_of_y_run_upwards() {
        let map = map(1, 2, |_, j| (100, [1, 99][j]));
        let svg = map.svg();
        let y = |tip: &str| -> f64 {
            let after = svg.split(tip).nth(1).unwrap().split(" y=\"").nth(1).unwrap();
            after.split('"').next().unwrap().parse().unwrap()
        };
        assert!(y("share 0.01<") > y("share 0.99<"), "the second row is above the first");
    }

    #[test]
    fn a_map_that_cannot_be_drawn_says_why() {
        let good = map(2, 2, |_, _| (1, 0));
        let mut problems = [good.clone(), good.clone(), good.clone(), good];
        problems[0].x.edges.clear();
        problems[1].y.edges[1] = f64::NAN;
        problems[2].y.edges[2] = problems[2].y.edges[0];
        problems[3].failures.pop();
        for (map, why) in problems.iter().zip(["no cell", "not a finite", "do not increase", "3 counts of failures"]) {
            assert!(words(&map.svg()).contains(why), "{why}");
            assert_eq!(map.csv().lines().count(), 1);
        }
    }

    #[test]
    fn all_zero_all_failed_all_empty_one_cell_and_endless_names_make_a_picture() {
        assert!(words(&map(5, 5, |_, _| (50, 0)).svg()).contains("No sample failed."));
        assert!(words(&map(5, 5, |_, _| (0, 0)).svg()).contains("No cell has samples."));
        assert_eq!(cells(&map(1, 1, |_, _| (50, 50)).svg()), (1, 0));
        let mut long = map(100, 100, |i, j| ((i + j) as u64, (j / 3) as u64));
        long.x.name = "gap & <speed> ".repeat(40);
        long.y.name = "x".repeat(400);
        let svg = long.svg();
        words(&svg);
        assert!(!svg.contains("NaN"));
        assert_eq!(svg, long.svg());
    }
}
