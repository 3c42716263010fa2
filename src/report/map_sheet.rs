//! A sheet of `map`: small multiples of one grid. Each combination of speeds has a plot, a row per speed of the ego, a
//! column per speed of the other vehicle; each cell has the colour of its kind, and lines separate the kinds.
//!
//! Kinds differ in lightness, from white to nearly black, so that colour-blind readers and grey prints can distinguish
//! them.

use super::plot::{Cells, Figure, FilledCell, Height, INK, Plot, PlotAxis, Rule};
use lanesweep_run::check::Answer;
use lanesweep_run::grid::{CellOutcome, Grid, boundary, runs};

/// A sheet.
pub(super) struct MapSheet<'a> {
    /// The grid.
    pub grid: &'a Grid,
    /// Outcomes that tables and legends count.
    pub outcomes: &'a [CellOutcome],
    /// Outcome of every cell, in the grid's order.
    pub cells: Vec<CellOutcome>,
    /// Per cell: whether it is not preventable. Its boundary is drawn if known.
    pub not_preventable: Option<Vec<bool>>,
}

/// Colour of the boundary of cases that are not preventable.
pub(super) const BOUNDARY: &str = "#c40000";
/// More plots in a row than this make a wide sheet; and how many a row has at most.
const MAX_NARROW: usize = 3;
const MAX_COLUMNS: usize = 8;

/// Colour of an outcome.
pub(super) fn colour(outcome: CellOutcome) -> &'static str {
    match outcome {
        CellOutcome::NoConflict => "#ffffff",
        CellOutcome::Pass => "#f3dfa2",
        CellOutcome::Fail => "#4a6fa5",
        CellOutcome::FailByReaction => "#14203c",
        CellOutcome::Undecided => "#e69f00",
        CellOutcome::NoTraffic => "#8a8a8a",
    }
}

impl MapSheet<'_> {
    /// The sheet as a figure with these notes at its foot.
    pub(super) fn figure(&self, title: String, subtitle: String, notes: Vec<String>) -> Figure {
        let (columns, plots) = self.trellis();
        let none = match &self.not_preventable {
            Some(cells) if !cells.contains(&true) => " In no cell do CCHDM and FSM both collide.",
            _ => "",
        };
        Figure {
            title,
            subtitle: Some(subtitle),
            plots,
            columns,
            is_wide: columns > MAX_NARROW,
            caption: format!("Black lines: the boundary, between cells of different kinds.{none}"),
            notes: ("Notes:", notes),
        }
    }

    /// The plots, and how many are in a row (0: any). The last quantity of the panels has a column per value, the others
    /// a row per combination; one that is not in the grid leaves its place empty.
    fn trellis(&self) -> (usize, Vec<Plot>) {
        let (panels, last) = (self.grid.panels(), self.grid.panel_axes.len().saturating_sub(1));
        let mut values: Vec<f64> = panels.iter().filter_map(|panel| panel.get(last).copied()).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        if last == 0 || values.len() < 2 {
            return (0, (0..panels.len()).map(|panel| self.plot(panel, 0)).collect());
        }
        let mut rows: Vec<&[f64]> = panels.iter().map(|panel| &panel[..last]).collect();
        rows.dedup();
        // Many columns continue on a second line.
        let columns = values.len().div_ceil(values.len().div_ceil(MAX_COLUMNS));
        let of_row = |row: &&[f64]| {
            let place = |value: &f64| {
                let found = panels.iter().position(|panel| panel[..last] == **row && panel[last] == *value);
                found.map_or(Plot::default(), |panel| self.plot(panel, last))
            };
            let mut plots: Vec<Plot> = values.iter().map(place).collect();
            plots.resize_with(values.len().next_multiple_of(columns), Plot::default);
            let names = row.iter().enumerate().map(|(axis, value)| self.value_name(axis, *value));
            plots[0].row = names.collect::<Vec<_>>().join(", ");
            plots
        };
        (columns, rows.iter().flat_map(of_row).collect())
    }

    /// `first`: of the panel's values, those from here on are in the heading.
    fn plot(&self, panel: usize, first: usize) -> Plot {
        let (across, up) = (self.grid.x.edges(), self.grid.y.edges());
        let kind = |i: usize, j: usize| self.cells[self.grid.cell(panel, i, j)] as usize;
        let mut cells = Cells { key: self.key(), ..Cells::default() };
        for outcome in self.outcomes {
            for j in 0..self.grid.y.len() {
                for (from, to) in runs(self.grid.x.len(), &|i| kind(i, j) == *outcome as usize) {
                    let corners = [(across[from], up[j]), (across[to], up[j + 1])];
                    cells.cells.push(FilledCell { corners, colour: colour(*outcome), tip: "" });
                }
            }
        }
        let at = |(i, j): (usize, usize)| (across[i], up[j]);
        let lines = |kind: &dyn Fn(usize, usize) -> usize| {
            boundary(self.grid, kind).into_iter().map(|(a, b)| vec![at(a), at(b)]).collect()
        };
        let attributes = "class=\"boundary\" stroke-linecap=\"square\"";
        let rule = Rule { runs: lines(&kind), colour: INK, width_px: 1.2, attributes, ..Rule::default() };
        let not_preventable = self.not_preventable.iter().filter(|cells| cells.contains(&true)).map(|cells| {
            let count = cells.iter().filter(|is_not_preventable| **is_not_preventable).count();
            let (word, all) = (Answer::NotPreventable.label(), self.possible_cells());
            Rule {
                runs: lines(&|i, j| usize::from(cells[self.grid.cell(panel, i, j)])),
                name: format!("around what is {word}, CCHDM and FSM both collide: {count} of {all}"),
                colour: BOUNDARY,
                width_px: 1.8,
                dash: "5 3",
                attributes: "class=\"not-preventable\"",
                ..Rule::default()
            }
        });
        let axis = |title, edges: &[f64]| PlotAxis::new(title, edges[0], edges[edges.len() - 1]);
        Plot {
            heading: self.panel_name(panel, first),
            x: axis(self.grid.x.parameter.title(), &across),
            y: axis(self.grid.y.parameter.title(), &up),
            cells: Some(cells),
            rules: std::iter::once(rule).chain(not_preventable).collect(),
            height: Height::OfWidth(if self.grid.panels().len() == 1 { 0.6 } else { 0.8 }),
            ..Plot::default()
        }
    }

    /// The outcomes that occur, with their counts.
    fn key(&self) -> Vec<(String, &'static str)> {
        let named = |outcome: &CellOutcome| {
            let count = self.cells.iter().filter(|of| *of == outcome).count();
            let (name, is_possible) = (outcome.label(), *outcome != CellOutcome::NoTraffic);
            let all = if is_possible { self.possible_cells() } else { self.cells.len() };
            (count > 0).then(|| (format!("{name}: {count} of {all}"), colour(*outcome)))
        };
        self.outcomes.iter().filter_map(named).collect()
    }

    fn possible_cells(&self) -> usize {
        self.cells.iter().filter(|outcome| **outcome != CellOutcome::NoTraffic).count()
    }

    /// `ego 90 km/h`.
    fn value_name(&self, axis: usize, value: f64) -> String {
        let parameter = self.grid.panel_axes[axis].parameter;
        format!("{} {value} {}", parameter.name(), parameter.unit).trim_end().to_owned()
    }

    fn panel_name(&self, panel: usize, first: usize) -> String {
        let values = self.grid.panels()[panel].iter().enumerate().skip(first);
        values.map(|(at, value)| self.value_name(at, *value)).collect::<Vec<_>>().join(", ")
    }
}
