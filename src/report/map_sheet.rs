//! A sheet of `map`: small multiples of one grid. Each combination of speeds has a plot, each cell the look of its kind,
//! and lines part the kinds.
//!
//! Kinds differ in lightness and, where two are equally light, in hatching: they can be told apart by colour-blind
//! readers and in grey print. What a page of three plots in a row shows stays readable at the width of a column.

use super::plot::{Cells, Figure, Fill, FilledCell, Hatch, Height, INK, Plot, PlotAxis, Rule};
use crate::run::grid::{Grid, boundary, runs};

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
    /// Is each cell preventable? Its boundary is drawn where that is known.
    pub preventable: Option<Vec<bool>>,
    /// Lines at the foot.
    pub notes: Vec<String>,
}

/// Kind of an undecided cell among the outcomes.
pub const UNDECIDED: u8 = 2;
/// Colour of the boundary of preventable cases.
const BOUNDARY: &str = "#c40000";

/// A cell in which nothing fails, one in which it does, and one whose verdict a perturbation changes.
pub fn outcomes(with_undecided: bool) -> Vec<(String, Fill)> {
    let kinds = [kind("pass", "#f7f1dc", Hatch::None), kind("fail", "#6f86ad", Hatch::None), undecided()];
    kinds.into_iter().take(if with_undecided { 3 } else { 2 }).collect()
}

fn undecided() -> (String, Fill) {
    kind("undecided", "#e69f00", Hatch::None)
}

/// The kinds of a difference, in the order of [`crate::run::grid::Agreement::ALL`].
pub fn agreements(first: &str, second: &str, with_undecided: bool) -> Vec<(String, Fill)> {
    let kinds = [
        kind("both pass", "#f7f1dc", Hatch::None),
        kind("both fail", "#b9b9b9", Hatch::None),
        kind(format!("only {first} fails"), "#0072b2", Hatch::Rising),
        kind(format!("only {second} fails"), "#e08a00", Hatch::Falling),
        kind("undecided", "#ffffff", Hatch::Grey),
    ];
    kinds.into_iter().take(if with_undecided { 5 } else { 4 }).collect()
}

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
            caption: match &self.preventable {
                None => "Black lines: the boundary, between cells of different kinds.",
                Some(cells) if cells.iter().all(|is_preventable| *is_preventable) => {
                    "Black lines: the boundary, between cells of different kinds. Every case is preventable: CCHDM or FSM \
                     avoids it."
                }
                Some(_) => {
                    "Black lines: the boundary, between cells of different kinds. Red dashes: the boundary of preventable \
                     cases, which CCHDM or FSM avoids."
                }
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
        let rule = Rule { runs: lines.collect(), colour: INK, width_px: 1.8, dash: "", attributes };
        let preventable = self.preventable.iter().map(|cells| {
            let kind = |i: usize, j: usize| usize::from(cells[self.grid.cell(panel, i, j)]);
            let lines = boundary(self.grid, &kind).into_iter().map(|(a, b)| vec![at(a), at(b)]);
            let attributes = "class=\"preventable\"".to_owned();
            Rule { runs: lines.collect(), colour: BOUNDARY, width_px: 2.2, dash: "5 3", attributes }
        });
        let layers = [cells.into(), rule.into()].into_iter().chain(preventable.map(Into::into));
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
                // A unit stands once where all are the same.
                let unit = if units[at + 1..].contains(&units[at]) { "" } else { units[at] };
                format!("{} {value} {unit}", word(axis.parameter.key)).trim_end().to_owned()
            })
            .collect();
        parts.join(", ")
    }
}
