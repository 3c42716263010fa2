//! Where failures occur: the fraction of failed samples per cell of two scenario parameters, as a heat map.
//!
//! The colours go from pale yellow to dark blue and darken with each step, so that colour-blind readers and grey prints
//! can distinguish them. Three states are not shown by colour alone: a cell without samples is hatched, a cell with few
//! samples is a smaller square, and a cell without failures has its own grey.

use super::convergence::sampled;
use super::plot::{Cells, ColourBar, Figure, Fill, FilledCell, Hatch, Height, Plot, PlotAxis};
use super::plot::{number, plain_end};
use crate::model::criterion::Criterion;
use crate::model::driver::ModelId;
use crate::run::sampling::{self, MapCounts};
use crate::stats::density::DensityModel;
use crate::support::table::Table;

/// One parameter, divided into cells.
#[derive(Debug, Clone, PartialEq)]
pub struct MapAxis {
    /// Name, such as `initial gap`.
    pub name: String,
    /// Unit, such as `m`; empty for a dimensionless number.
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
    /// Horizontal parameter.
    pub x: MapAxis,
    /// Vertical parameter.
    pub y: MapAxis,
    /// Samples per cell, row by row: the cell of `x` cell i and `y` cell j is at `j * (x cells) + i`.
    pub samples: Vec<u64>,
    /// Failures per cell, in the same order; not more than samples.
    pub failures: Vec<u64>,
}

/// With fewer samples than this a cell's fraction is uncertain.
const FEW_SAMPLES: u64 = 10;
/// From a fraction of zero to the maximum. Relative luminance decreases from step to step.
const COLOURS: [(u8, u8, u8); 6] =
    [(255, 236, 150), (226, 199, 112), (176, 163, 116), (120, 124, 126), (66, 82, 122), (10, 32, 80)];
/// Colour of a cell with samples and without failures.
const NONE_FAILED: &str = "#ececec";

impl MapAxis {
    fn cells(&self) -> usize {
        self.edges.len().saturating_sub(1)
    }

    fn axis(&self) -> PlotAxis {
        let label = if self.unit.is_empty() { self.name.clone() } else { format!("{} ({})", self.name, self.unit) };
        PlotAxis::exactly(label, self.edges[0], self.edges[self.cells()])
    }

    fn problem(&self) -> Option<String> {
        let name = &self.name;
        if self.cells() == 0 {
            return Some(format!("the axis {name} has no cell"));
        }
        // Beyond this the width of an axis would overflow f64.
        if self.edges.iter().any(|e| !e.is_finite() || e.abs() > 1e300) {
            return Some(format!("an edge of the axis {name} is not a finite number"));
        }
        let rising = self.edges.windows(2).all(|e| e[0] < e[1]);
        (!rising).then(|| format!("the edges of the axis {name} do not increase"))
    }
}

/// Content of one cell.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Share {
    /// No samples.
    Empty,
    /// More failures than samples: an error in the counts.
    Wrong,
    /// Fraction of failures, and whether it is based on few samples.
    Known { share: f64, few: bool },
}

impl FailureMap {
    /// The failure map of one model of a sampling run.
    pub fn of(density: &DensityModel, map: &MapCounts, at: usize, model: ModelId, criterion: Criterion) -> FailureMap {
        let axis = |axis: &sampling::MapAxis| MapAxis {
            name: axis.name.clone(),
            unit: axis.unit.clone(),
            edges: axis.edges(),
        };
        FailureMap {
            title: format!("{}: share of lanes that fail {}", model.name(), criterion.label()),
            subtitle: Some(sampled(density)),
            x: axis(&map.axes.x),
            y: axis(&map.axes.y),
            samples: map.lanes.clone(),
            failures: map.failures[at].clone(),
        }
    }

    /// Why the map cannot be drawn: an axis without cells, edges that do not increase, or counts that do not match the
    /// cells. [`FailureMap::figure`] then shows the reason as text, and [`FailureMap::csv`] has no rows.
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

    /// The map as a figure.
    ///
    /// A cell with more failures than samples is left white, crossed out and counted in a note. A map with a
    /// [`FailureMap::problem`] becomes a text that states it.
    pub fn figure(&self) -> Figure {
        let (title, subtitle) = (self.title.clone(), self.subtitle.clone());
        if let Some(problem) = self.problem() {
            let caption = format!("This map cannot be drawn: {problem}.");
            return Figure { title, subtitle, caption, ..Figure::default() };
        }
        let shares: Vec<Share> = (0..self.samples.len()).map(|cell| self.share(cell)).collect();
        let known = |s: &Share| if let Share::Known { share, .. } = s { Some(*share) } else { None };
        let largest = shares.iter().filter_map(known).fold(0.0, f64::max);
        let largest = if largest > 0.0 { plain_end(largest).min(1.0) } else { 0.0 };
        let cell = |(at, share): (usize, &Share)| {
            let (i, j) = (at % self.x.cells(), at / self.x.cells());
            FilledCell {
                corners: [(self.x.edges[i], self.y.edges[j]), (self.x.edges[i + 1], self.y.edges[j + 1])],
                fill: share.fill(largest),
                tip: if let Share::Known { share, .. } = share { self.tip(at, *share) } else { String::new() },
            }
        };
        let looks = [
            ("no failure".to_owned(), Share::Known { share: 0.0, few: false }),
            (format!("fewer than {FEW_SAMPLES} samples: smaller square"), Share::Known { share: 0.6, few: true }),
            ("no samples".to_owned(), Share::Empty),
        ];
        let occurs = [
            shares.iter().any(|s| matches!(s, Share::Known { share: 0.0, .. })),
            shares.iter().any(|s| matches!(s, Share::Known { few: true, .. })),
            shares.contains(&Share::Empty),
        ];
        let key = looks.into_iter().zip(occurs).filter(|(_, occurs)| *occurs);
        let cells = Cells {
            cells: shares.iter().enumerate().map(cell).collect(),
            key: key.map(|((name, share), _)| (name, share.fill(1.0))).collect(),
            bar: Some(ColourBar { label: "Share failed", largest, colour: scale_colour }),
        };
        let plot = Plot {
            x: self.x.axis(),
            y: self.y.axis(),
            layers: vec![cells.into()],
            height: Height::OfWidth((self.y.cells() as f64 / self.x.cells() as f64).clamp(0.5, 1.0)),
            ..Plot::default()
        };
        Figure { title, subtitle, plots: vec![plot], notes: ("Notes:", self.notes(&shares)), ..Figure::default() }
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
    /// the fraction of failures. The fraction is empty without samples or with more failures than samples. Numbers have
    /// full precision.
    pub fn csv(&self) -> String {
        let cells = if self.problem().is_some() { 0 } else { self.samples.len() };
        let (x, y) = (&self.x.edges, &self.y.edges);
        Table::of((0..cells).map(|cell| (cell, cell % self.x.cells(), cell / self.x.cells())))
            .column("x_lower", |(_, i, _)| x[i])
            .column("x_upper", |(_, i, _)| x[i + 1])
            .column("y_lower", |(.., j)| y[j])
            .column("y_upper", |(.., j)| y[j + 1])
            .column("samples", |(cell, ..)| self.samples[cell])
            .column("failures", |(cell, ..)| self.failures[cell])
            .column("share", |(cell, ..)| match self.share(cell) {
                Share::Known { share, .. } => Some(share),
                Share::Empty | Share::Wrong => None,
            })
            .build()
            .csv()
    }
}

impl Share {
    /// The look of a cell, relative to the maximum fraction.
    fn fill(self, largest: f64) -> Fill {
        let hatched = |hatch| Fill { hatch, ..Fill::default() };
        match self {
            Share::Empty => hatched(Hatch::Grey),
            Share::Wrong => hatched(Hatch::Crossed),
            Share::Known { share, few } => Fill {
                colour: if share > 0.0 { scale_colour(share / largest) } else { NONE_FAILED.to_owned() },
                is_inset: few,
                ..Fill::default()
            },
        }
    }
}

/// The colour at `place` (0 to 1) of the scale, linear between its anchors.
fn scale_colour(place: f64) -> String {
    let along = place.clamp(0.0, 1.0) * (COLOURS.len() - 1) as f64;
    let first = (along as usize).min(COLOURS.len() - 2);
    let (from, to, part) = (COLOURS[first], COLOURS[first + 1], along - first as f64);
    let mix = |a: u8, b: u8| (f64::from(a) + part * (f64::from(b) - f64::from(a))).round() as u8;
    format!("#{:02x}{:02x}{:02x}", mix(from.0, to.0), mix(from.1, to.1), mix(from.2, to.2))
}

#[cfg(test)]
mod tests {
    use super::super::plot::words;
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
        let svg = map(4, 3, |i, j| (100, (i * j) as u64)).figure().svg();
        let words = words(&svg);
        for name in ["initial gap (m)", "speed difference (m/s)", "Share failed", "no failure"] {
            assert!(words.contains(name), "{name} in {words}");
        }
        assert_eq!(cells(&svg), (12, 0));
        assert!(!svg.contains("class=\"hatch\"") && !words.contains("no samples") && !words.contains("fewer"));
    }

    #[test]
    fn unsampled_and_rarely_sampled_cells_are_marked_by_shape_and_explained() {
        let svg = map(3, 1, |i, _| [(0, 0), (9, 3), (10, 3)][i]).figure().svg();
        assert_eq!(cells(&svg), (1, 1));
        assert!(svg.contains("class=\"hatch\""));
        let words = words(&svg);
        assert!(words.contains("fewer than 10 samples") && words.contains("no samples"), "{words}");
    }

    #[test]
    fn each_colour_of_the_scale_is_darker_than_the_one_before_and_none_is_the_grey_of_no_failure() {
        let luminance = |colour: String| {
            let linear =
                |at: usize| (f64::from(u8::from_str_radix(&colour[at..at + 2], 16).unwrap()) / 255.0).powf(2.2);
            0.2126 * linear(1) + 0.7152 * linear(3) + 0.0722 * linear(5)
        };
        let scale: Vec<f64> = (0..=50).map(|k| luminance(scale_colour(f64::from(k) / 50.0))).collect();
        assert!(scale.windows(2).all(|l| l[0] > l[1]), "{scale:?}");
        assert!(scale[0] > 0.8 && scale[50] < 0.02);
        let share = |share| Share::Known { share, few: false }.fill(1.0);
        assert_ne!(share(0.0), share(1e-9));
    }

    #[test]
    fn a_row_of_the_table_is_a_row_of_y_and_an_unknown_share_is_empty() {
        let map = map(2, 2, |i, j| [(8, 2), (0, 0), (4, 5), (3, 1)][2 * j + i]);
        let expected = "x_lower,x_upper,y_lower,y_upper,samples,failures,share\n\
                        10,15,10,15,8,2,0.25\n15,20,10,15,0,0,\n10,15,15,20,4,5,\n15,20,15,20,3,1,0.3333333333333333\n";
        assert_eq!(map.csv(), expected);
        assert!(words(&map.figure().svg()).contains("failures are more than samples: 1 of 4 cells"));
    }

    #[test]
    fn rows_of_y_run_upwards() {
        let map = map(1, 2, |_, j| (100, [1, 99][j]));
        let svg = map.figure().svg();
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
            assert!(words(&map.figure().svg()).contains(why), "{why}");
            assert_eq!(map.csv().lines().count(), 1);
        }
    }

    #[test]
    fn all_zero_all_failed_all_empty_one_cell_and_endless_names_make_a_picture() {
        assert!(words(&map(5, 5, |_, _| (50, 0)).figure().svg()).contains("No sample failed."));
        assert!(words(&map(5, 5, |_, _| (0, 0)).figure().svg()).contains("No cell has samples."));
        assert_eq!(cells(&map(1, 1, |_, _| (50, 50)).figure().svg()), (1, 0));
        let mut long = map(100, 100, |i, j| ((i + j) as u64, (j / 3) as u64));
        long.x.name = "gap & <speed> ".repeat(40);
        long.y.name = "x".repeat(400);
        let svg = long.figure().svg();
        words(&svg);
        assert!(!svg.contains("NaN"));
        assert_eq!(svg, long.figure().svg());
    }
}
