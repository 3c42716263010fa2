//! How cases cover the ranges of a density: marginals, pairs, and the empty boxes with their share of the exposure.

use serde_json::{Value, json};

use super::case_identity::NOT_CONSIDERED;
use super::html::{Page, PageFigure, Section};
use super::plot::{Cells, Figure, Fill, FilledCell, Height, INK, Look, Mark, Plot, PlotAxis, Series, quantity};
use crate::Result;
use crate::scenario::parameterization::Parameter;
use crate::stats::coverage::{EmptyBox, empty_boxes, exposure_draws};
use crate::stats::density::DensityModel;
use crate::support::readable::{count_of, significant, value};
use crate::support::table::{Column, Digits, Table};

/// Bins of a range.
const BINS: usize = 20;
/// More cases than this are not searched for boxes: the time grows with the square.
const MAX_CASES: usize = 10_000;
/// Points of a plot.
const MAX_POINTS: usize = 400;

/// The coverage of a density in three forms.
pub struct CoverageSheet {
    /// The page.
    pub html: String,
    /// The numbers for programs.
    pub json: Value,
    /// The most exposed empty box, in a sentence for the terminal.
    pub text: String,
}

/// Cases against the exposure of a density.
struct Coverage<'a> {
    density: &'a DensityModel,
    /// What the cases are.
    cases: String,
    points: Vec<Vec<f64>>,
    draws: Vec<Vec<f64>>,
    ranges: Vec<[f64; 2]>,
    seed: u64,
    about: &'a [(&'static str, String)],
    boxes: Vec<EmptyBox>,
}

/// The coverage by the recorded cases, or by `tested` ones with their name; the page tells `about` the run. Ranges that are not given are those of the recorded
/// cases.
///
/// # Errors
/// As [`exposure_draws`].
pub fn sheet(
    density: &DensityModel,
    tested: Option<(&str, Vec<Vec<f64>>)>,
    given: &[(String, [f64; 2])],
    seed: u64,
    about: &[(&'static str, String)],
) -> Result<CoverageSheet> {
    let recorded = density.kde.points();
    let (cases, points) = match tested {
        Some((name, points)) => (format!("cases of {name}"), points),
        None => ("recorded cases".to_owned(), recorded.to_vec()),
    };
    let range = |(at, parameter): (usize, &Parameter)| {
        let values = || recorded.iter().map(|point| point[at]);
        let own = [values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max)];
        given.iter().find(|(name, _)| *name == parameter.name).map_or(own, |(_, range)| *range)
    };
    let ranges: Vec<[f64; 2]> = density.space.parameters().iter().enumerate().map(range).collect();
    let draws = exposure_draws(density, seed)?;
    let is_searched = points.len() <= MAX_CASES;
    let mut boxes = if is_searched { empty_boxes(&points, &draws, &ranges) } else { Vec::new() };
    // A rectangle over a whole range says less than the interval of its other quantity.
    boxes.retain(|of| of.sides.len() == 1 || of.sides.iter().all(|(at, side)| *side != ranges[*at]));
    let of = Coverage { density, cases, points, draws, ranges, seed, about, boxes };
    Ok(CoverageSheet { html: of.html(), json: of.json(), text: of.text() })
}

impl Coverage<'_> {
    fn json(&self) -> Value {
        json!({
            "cases": self.cases,
            "number": self.points.len(),
            "draws": self.draws.len(),
            "seed": self.seed,
            "quantities": self.quantities().records(),
            "boxes": self.boxes,
        })
    }

    fn text(&self) -> String {
        let cases = format!("{} {}", count_of(self.points.len()), self.cases);
        self.boxes.first().map_or(cases.clone(), |of| {
            let (share, interval) = of.exposure;
            let [share, low, high] = [share, interval.low, interval.high].map(|part| significant(100.0 * part, 2));
            format!("none of {cases} in {}: {share} % of the density's draws [{low}, {high}]", self.sides(of))
        })
    }

    fn parameter(&self, at: usize) -> &Parameter {
        &self.density.space.parameters()[at]
    }

    /// `v_ego_mps 20 to 25, gap_m 3 to 9`.
    fn sides(&self, of: &EmptyBox) -> String {
        let side = |(at, [low, high]): &(usize, [f64; 2])| {
            format!("{} {} to {}", self.parameter(*at).name, value(*low), value(*high))
        };
        of.sides.iter().map(side).collect::<Vec<_>>().join(", ")
    }

    fn holds(&self, at: usize, value: f64) -> bool {
        (self.ranges[at][0]..=self.ranges[at][1]).contains(&value)
    }

    /// Values of a quantity in each bin of its range.
    fn bins(&self, of: &[Vec<f64>], at: usize) -> [usize; BINS] {
        let [low, high] = self.ranges[at];
        let mut bins = [0; BINS];
        for value in of.iter().map(|point| point[at]).filter(|value| self.holds(at, *value)) {
            bins[(((value - low) / (high - low) * BINS as f64) as usize).min(BINS - 1)] += 1;
        }
        bins
    }

    fn quantities(&self) -> Table {
        let outside = |of: &[Vec<f64>], at: usize| of.len() - self.bins(of, at).iter().sum::<usize>();
        let empty = |at: usize| self.bins(&self.points, at).iter().filter(|count| **count == 0).count();
        Table::of(0..self.ranges.len())
            .column("quantity", |at| self.parameter(at).name.as_str())
            .column("unit", |at| self.parameter(at).unit.as_str())
            .column("from", |at| self.ranges[at][0])
            .column("to", |at| self.ranges[at][1])
            .column("cases_inside", |at| self.points.len() - outside(&self.points, at))
            .column("cases_outside", |at| outside(&self.points, at))
            .column(percent("draws_outside_percent"), |at| {
                100.0 * outside(&self.draws, at) as f64 / self.draws.len().max(1) as f64
            })
            .column(percent("empty_bins_percent"), |at| 100.0 * empty(at) as f64 / BINS as f64)
            .build()
            .captioned(format!("Ranges in {BINS} bins: the given ones, else those of the recorded cases"))
    }

    fn boxes(&self) -> Table {
        Table::of(&self.boxes)
            .column("box without a case", |of| self.sides(of))
            .column("found as", |of| match (of.is_largest, of.is_most_exposed) {
                (true, true) => "largest, most exposed",
                (true, false) => "largest",
                _ => "most exposed",
            })
            .column(percent("size %"), |of| 100.0 * of.size)
            .column("draws inside", |of| of.inside)
            .column(percent("exposure %"), |of| 100.0 * of.exposure.0)
            .column(percent("low %"), |of| 100.0 * of.exposure.1.low)
            .column(percent("high %"), |of| 100.0 * of.exposure.1.high)
            .build()
            .captioned("Boxes without a case, the most exposed first")
    }

    fn html(&self) -> String {
        let (id, space) = (self.density.space.id(), &self.density.space);
        let half = self.draws.len() / 2;
        let names: Vec<&str> = space.parameters().iter().map(|parameter| parameter.name.as_str()).collect();
        let scenarios = self.density.kde.points().len();
        let own = [
            (
                "Other scenarios and quantities",
                format!(
                    "{} with {}, as the filters of mining keep them; sizes are means, and nothing else varies",
                    id.category.label(),
                    names.join(", ")
                ),
            ),
            (
                "Exposure beyond the data",
                format!("between and beyond {} scenarios it follows from the form of the density", count_of(scenarios)),
            ),
            (
                "Sufficient coverage",
                "no share is called enough; boxes of three or more quantities are not searched".to_owned(),
            ),
        ];
        let boxes = format!(
            "No case lies inside a box, on its edges some may. Of each quantity and each pair: the largest box, and the one with the most of {0} draws, unless an interval holds it; {0} other draws measure \
             the exposure, with the interval of Clopper and Pearson at 95 %. Size: fraction of the ranges. A sample of N draws has N times the exposure in a box, on average. More than {1} cases are not searched.",
            count_of(half),
            count_of(MAX_CASES)
        );
        Page {
            title: format!("Coverage: {} {}", id.category.label(), id.key),
            lead: format!(
                "{} {} against {} draws of the density over {} recorded scenarios. {}",
                count_of(self.points.len()),
                self.cases,
                count_of(self.draws.len()),
                count_of(scenarios),
                self.density.provenance.data
            ),
            synthetic: self.density.provenance.synthetic,
            sections: vec![
                Section::new("boxes", "Empty boxes")
                    .intro(boxes)
                    .tables([self.boxes()])
                    .fact("seed of the draws", self.seed.to_string())
                    .fact("SHA-256 of the density", self.density.content_sha256().unwrap_or_default())
                    .facts(self.about.iter().cloned()),
                Section::new("quantities", "Quantities")
                    .tables([self.quantities()])
                    .figures([PageFigure::new(&self.marginals().svg(), &[])]),
                Section::new("pairs", "Pairs").figures([PageFigure::new(&self.pairs().svg(), &[])]),
                Section::new("not-considered", "Not considered").facts(own).facts(NOT_CONSIDERED),
            ],
            ..Page::default()
        }
        .html()
    }

    fn axis(&self, at: usize) -> PlotAxis {
        let (parameter, [low, high]) = (self.parameter(at), self.ranges[at]);
        PlotAxis::exactly(format!("{} in {}", quantity(&parameter.name), parameter.unit), low, high)
    }

    fn marginals(&self) -> Figure {
        let plot = |at: usize| {
            let [low, high] = self.ranges[at];
            let width = (high - low) / BINS as f64;
            let share = |of: &[Vec<f64>]| {
                let all = of.len().max(1) as f64;
                let bar = |(bin, count): (usize, usize)| (low + (bin as f64 + 0.5) * width, 100.0 * count as f64 / all);
                self.bins(of, at).into_iter().enumerate().map(bar).collect::<Vec<_>>()
            };
            let look = |index| Look::of(index, 2);
            Plot {
                heading: quantity(&self.parameter(at).name),
                x: self.axis(at),
                y: PlotAxis::new("in %"),
                series: vec![
                    Series::new("cases", &[Mark::Bars(width)], share(&self.points)).with_look(look(0)),
                    Series::new("draws of the density", &[Mark::Line], share(&self.draws)).with_look(look(1)),
                ],
                ..Plot::default()
            }
        };
        let has_range = |at: &usize| self.ranges[*at][0] < self.ranges[*at][1];
        Figure {
            title: "Cases and exposure in each quantity".to_owned(),
            plots: (0..self.ranges.len()).filter(has_range).map(plot).collect(),
            caption: format!("Fraction of all cases and of all draws per bin, {BINS} bins."),
            is_wide: true,
            ..Figure::default()
        }
    }

    fn pairs(&self) -> Figure {
        let count = self.ranges.len();
        let of = |pair: &[usize; 2]| {
            let mut boxes: Vec<&EmptyBox> =
                self.boxes.iter().filter(|of| of.sides.iter().map(|side| side.0).eq(*pair)).collect();
            // The most exposed one lies above the largest.
            boxes.sort_by_key(|of| of.is_most_exposed);
            boxes
        };
        let fill = |is_exposed: bool| Fill {
            colour: if is_exposed { "#f6c9a8" } else { "#e8e8e8" }.to_owned(),
            opacity: None,
        };
        let step = self.points.len().div_ceil(MAX_POINTS).max(1);
        let plot = |[x, y]: [usize; 2]| {
            let cell = |of: &EmptyBox| FilledCell {
                corners: [0, 1].map(|end| (of.sides[0].1[end], of.sides[1].1[end])),
                fill: fill(of.is_most_exposed),
                tip: format!("{}: {} % of the draws", self.sides(of), significant(100.0 * of.exposure.0, 2)),
            };
            let key = [("most exposed empty box", true), ("largest empty box", false)];
            let is_in = |point: &&Vec<f64>| self.holds(x, point[x]) && self.holds(y, point[y]);
            let points = self.points.iter().step_by(step).filter(is_in).map(|point| (point[x], point[y]));
            let look = Look { colour: INK, marker_px: 2.2, ..Look::of(0, 1) };
            Plot {
                heading: format!("{}, {}", quantity(&self.parameter(x).name), quantity(&self.parameter(y).name)),
                x: self.axis(x),
                y: self.axis(y),
                cells: Some(Cells {
                    cells: of(&[x, y]).into_iter().map(cell).collect(),
                    key: key.map(|(name, is_exposed)| (name.to_owned(), fill(is_exposed))).to_vec(),
                }),
                series: vec![Series::new("cases", &[Mark::Points], points).with_look(look)],
                height: Height::OfWidth(0.8),
                ..Plot::default()
            }
        };
        let pairs = (0..count).flat_map(|x| (x + 1..count).map(move |y| [x, y]));
        let some = if step > 1 { format!(" One in {step} cases is drawn.") } else { String::new() };
        Figure {
            title: "Cases and empty boxes in pairs of quantities".to_owned(),
            plots: pairs.filter(|pair| !of(pair).is_empty()).map(plot).collect(),
            caption: format!("One colour where the most exposed box is also the largest.{some}"),
            is_wide: true,
            ..Figure::default()
        }
    }
}

fn percent(name: &'static str) -> Column {
    Column::from(name).digits(Digits::Significant(3)).null("–")
}
