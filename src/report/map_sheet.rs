//! A sheet of `map`: small multiples of one grid. Each combination of speeds has a plot; each cell has the look of its
//! kind, and lines separate the kinds.
//!
//! Kinds differ in lightness and, where two are equally light, in hatching, so that colour-blind readers and grey
//! prints can distinguish them. A page with three plots in a row stays readable at the width of a column.

use super::plot::{Cells, Figure, Fill, FilledCell, Hatch, Height, INK, Plot, PlotAxis, Rule};
use crate::run::check::Answer;
use crate::run::grid::{Agreement, CellOutcome, Grid, boundary, runs};

/// A sheet.
pub struct MapSheet<'a> {
    /// Heading; wrapped when long.
    pub title: String,
    /// Line below the heading; wrapped when long.
    pub subtitle: String,
    /// The grid.
    pub grid: &'a Grid,
    /// Kinds of cells: name and look.
    pub kinds: Vec<(String, Fill)>,
    /// Kind of every cell, in the grid's order.
    pub cells: Vec<u8>,
    /// Per cell: whether it is not preventable. Its boundary is drawn if known.
    pub not_preventable: Option<Vec<bool>>,
    /// Notes at the foot.
    pub notes: Vec<String>,
}

/// Colour of the boundary of cases that are not preventable.
const BOUNDARY: &str = "#c40000";

/// Name and look of an outcome.
pub fn outcome(outcome: CellOutcome) -> (String, Fill) {
    let (colour, hatch) = match outcome {
        CellOutcome::NoConflict => NO_CONFLICT,
        CellOutcome::Pass => ("#f7f1dc", Hatch::None),
        CellOutcome::Fail => ("#6f86ad", Hatch::None),
        CellOutcome::FailByReaction => ("#6f86ad", Hatch::Rising),
        CellOutcome::Undecided => UNDECIDED,
    };
    kind(outcome.label(), colour, hatch)
}

/// Name and look of an agreement of two verdicts.
pub fn agreement(agreement: Agreement, first: &str, second: &str) -> (String, Fill) {
    let label = agreement.label();
    match agreement {
        Agreement::BothPass => kind(label, "#f7f1dc", Hatch::None),
        Agreement::BothFail => kind(label, "#b9b9b9", Hatch::None),
        Agreement::OnlyFirst => kind(format!("only {first} fails"), "#0072b2", Hatch::Rising),
        Agreement::OnlySecond => kind(format!("only {second} fails"), "#e08a00", Hatch::Falling),
        Agreement::NoConflict => kind(label, NO_CONFLICT.0, NO_CONFLICT.1),
        Agreement::Undecided => kind(label, UNDECIDED.0, UNDECIDED.1),
    }
}

/// The same look in every map. In grey print the second colour is midway between pass and fail.
const NO_CONFLICT: (&str, Hatch) = ("#ffffff", Hatch::Grey);
const UNDECIDED: (&str, Hatch) = ("#f0b429", Hatch::Crossed);

fn kind(name: impl Into<String>, colour: &str, hatch: Hatch) -> (String, Fill) {
    (name.into(), Fill { colour: colour.to_owned(), hatch, ..Fill::default() })
}

impl MapSheet<'_> {
    /// The sheet as a figure.
    pub fn figure(&self) -> Figure {
        let panels = self.grid.panels().len();
        Figure {
            title: self.title.clone(),
            subtitle: Some(self.subtitle.clone()),
            plots: (0..panels).map(|panel| self.plot(panel)).collect(),
            caption: match &self.not_preventable {
                Some(cells) if !cells.contains(&true) => {
                    "Black lines: the boundary, between cells of different kinds. In no cell do CCHDM and FSM both collide."
                }
                _ => "Black lines: the boundary, between cells of different kinds.",
            }
            .to_owned(),
            notes: ("Notes:", self.notes.clone()),
        }
    }

    fn plot(&self, panel: usize) -> Plot {
        let (across, up) = (self.grid.x().edges(), self.grid.y().edges());
        let kind = |i: usize, j: usize| usize::from(self.cells[self.grid.cell(panel, i, j)]);
        let mut cells = Cells { key: self.key(), ..Cells::default() };
        for (number, (_, fill)) in self.kinds.iter().enumerate() {
            for j in 0..self.grid.y().len() {
                for (from, to) in runs(self.grid.x().len(), &|i| kind(i, j) == number) {
                    let corners = [(across[from], up[j]), (across[to], up[j + 1])];
                    cells.cells.push(FilledCell { corners, fill: fill.clone(), tip: String::new() });
                }
            }
        }
        let at = |(i, j): (usize, usize)| (across[i], up[j]);
        let lines = boundary(self.grid, &kind).into_iter().map(|(a, b)| vec![at(a), at(b)]);
        let attributes = "class=\"boundary\" stroke-linecap=\"square\"".to_owned();
        let rule = Rule { runs: lines.collect(), colour: INK, width_px: 1.8, attributes, ..Rule::default() };
        let not_preventable = self.not_preventable.iter().filter(|cells| cells.contains(&true)).map(|cells| {
            let kind = |i: usize, j: usize| usize::from(cells[self.grid.cell(panel, i, j)]);
            let lines = boundary(self.grid, &kind).into_iter().map(|(a, b)| vec![at(a), at(b)]);
            let count = cells.iter().filter(|is_not_preventable| **is_not_preventable).count();
            let (word, all) = (Answer::NotPreventable.label(), cells.len());
            Rule {
                runs: lines.collect(),
                name: format!("around what is {word}, CCHDM and FSM both collide: {count} of {all}"),
                colour: BOUNDARY,
                width_px: 2.2,
                dash: "5 3",
                attributes: "class=\"not-preventable\"".to_owned(),
            }
        });
        let layers = [cells.into(), rule.into()].into_iter().chain(not_preventable.map(Into::into));
        let axis = |title, edges: &[f64]| PlotAxis::exactly(title, edges[0], edges[edges.len() - 1]);
        Plot {
            heading: self.panel_name(panel),
            x: axis(self.grid.x().parameter.title(), &across),
            y: axis(self.grid.y().parameter.title(), &up),
            layers: layers.collect(),
            height: Height::OfWidth(if self.grid.panels().len() == 1 { 0.6 } else { 0.8 }),
            ..Plot::default()
        }
    }

    /// The kinds with their counts.
    fn key(&self) -> Vec<(String, Fill)> {
        let named = |(number, (name, fill)): (usize, &(String, Fill))| {
            let count = self.cells.iter().filter(|c| usize::from(**c) == number).count();
            (format!("{name}: {count} of {}", self.cells.len()), fill.clone())
        };
        self.kinds.iter().enumerate().map(named).collect()
    }

    fn panel_name(&self, panel: usize) -> String {
        let axes = self.grid.panel_axes().iter().zip(&self.grid.panels()[panel]);
        let word = |key: &str| match key.split_once("_speed") {
            Some((vehicle, _)) => vehicle.to_owned(),
            None => key.rsplit_once('_').map_or(key, |(name, _)| name).replace('_', " "),
        };
        let units: Vec<&str> = self.grid.panel_axes().iter().map(|a| a.parameter.unit).collect();
        let parts: Vec<String> = axes
            .enumerate()
            .map(|(at, (axis, value))| {
                // If several units are the same, only the last is shown.
                let unit = if units[at + 1..].contains(&units[at]) { "" } else { units[at] };
                format!("{} {value} {unit}", word(axis.parameter.key)).trim_end().to_owned()
            })
            .collect();
        parts.join(", ")
    }
}
