//! Grids of concrete cases: what `map` sweeps.
//!
//! This module contains parameters and axes, the conversion of cells to cases and of grids to lane plans, the presets,
//! and the swept map. It contains no physics and no drawing. Cases and plans go to
//! [`lanesweep_engine`], maps to the report. The conformance tests use the cases of
//! the JRC's simulator.

mod axis;
mod grid_text;
pub mod jrc_case;
mod map;
mod parameter;
mod plan;
pub mod presets;
mod robustness;
mod run;

pub use axis::GridAxis;
pub use grid_text::GridText;
use jrc_case::Front;
pub use map::{CellOutcome, GridMap, boundary, runs};
pub use parameter::{MapParameter, PARAMETERS, Point};
pub use plan::{GridPart, GridPlan};
pub use robustness::{Perturbation, VARIED};
pub(crate) use robustness::{is_size, without_reaction};
pub use run::{Map, MapGrids, MapOptions, MapResult, MappedGrid};

pub use lanesweep_model::scenario::CaseQuantity;

use std::ops::Deref;

use lanesweep_model::driver::ModelId;
use lanesweep_model::profile::Profile;
use lanesweep_model::scenario::{Case, Category};
use lanesweep_support::ranges::refuse_repeats;
use lanesweep_support::{Error, Place, Result, option};

/// Maximum number of cells of a grid.
const MAX_CELLS: usize = 1_000_000;

/// Maximum number of panels of a grid: a sheet shows every one.
const MAX_PANELS: usize = 1000;

/// How a point becomes a case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum CaseStyle {
    /// As `simulate` makes it: see [`PlainCase`](lanesweep_model::scenario::PlainCase).
    Plain,
    /// As the JRC's simulator makes it.
    Jrc,
    /// The same with the lateral run-up of the JRC's comparison sweep of cut-ins, which also aborts CCHDM at large TTC.
    JrcComparison,
}

/// A grid of cases of one category. Cells are numbered panel by panel, within a panel row by row of `y` from its first
/// value, within a row along `x`.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    parts: GridParts,
    panels: Vec<Vec<f64>>,
    perturbation: Option<Perturbation>,
}

/// Definition of a grid.
#[derive(Debug, Clone, PartialEq)]
pub struct GridParts {
    /// Name, for files and tables.
    pub name: String,
    /// Kind of scenario.
    pub category: Category,
    /// Horizontal axis.
    pub x: GridAxis,
    /// Vertical axis.
    pub y: GridAxis,
    /// Every combination of their values is a panel.
    pub panel_axes: Vec<GridAxis>,
    /// Values that are equal in every cell.
    pub fixed: Vec<(&'static MapParameter, f64)>,
    /// How a point becomes a case.
    pub style: CaseStyle,
    /// Each model starts at its own distance (`jrc_case::native_distance`) instead of a gap or headway.
    pub native_gap: bool,
    /// Skips panels in which the ego is not faster than the other vehicle.
    pub closing_only: bool,
}

impl GridParts {
    /// A grid of plain cases without panels and fixed values.
    pub fn new(name: &str, category: Category, x: GridAxis, y: GridAxis) -> GridParts {
        GridParts {
            name: name.to_owned(),
            category,
            x,
            y,
            panel_axes: Vec::new(),
            fixed: Vec::new(),
            style: CaseStyle::Plain,
            native_gap: false,
            closing_only: false,
        }
    }
}

impl Deref for Grid {
    type Target = GridParts;

    fn deref(&self) -> &GridParts {
        &self.parts
    }
}

impl Grid {
    /// Checks that every quantity is given once, that none is missing, and that there are not too many cells.
    ///
    /// # Errors
    /// [`Error::Usage`] with the parameter.
    pub fn new(parts: GridParts) -> Result<Grid> {
        let axes = || [&parts.x, &parts.y].into_iter().chain(&parts.panel_axes);
        let fixed = parts.fixed.iter().map(|(parameter, _)| *parameter);
        let given: Vec<&MapParameter> = axes().map(|axis| axis.parameter).chain(fixed).collect();
        MapParameter::refuse_repeats(&given)?;
        for axis in axes() {
            refuse_repeats(|| Place::item(axis.parameter.key), axis.values.iter().map(|v| (v.to_bits(), v)))?;
        }
        let has = |quantity| given.iter().any(|p| p.quantity == quantity);
        check_complete(parts.category, parts.native_gap, &has)?;
        let panels = combinations(&parts.panel_axes)?;
        let (nx, ny) = (parts.x.len(), parts.y.len());
        let cells = panels.len().saturating_mul(nx).saturating_mul(ny);
        if cells > MAX_CELLS {
            let problem = format!("{} panels of {nx} × {ny} cells are {cells} cells", panels.len());
            let help = format!("use longer steps or fewer panels: {MAX_CELLS} cells at most");
            return Err(Error::usage(Place::item(parts.name), problem, help));
        }
        let mut grid = Grid { parts, panels, perturbation: None };
        grid.leave_out_backwards();
        if grid.closing_only {
            grid.leave_out_receding()?;
        }
        Ok(grid)
    }

    /// Leaves out the panels whose relative speed makes the other vehicle drive backwards. If all do, their cases are
    /// refused later.
    fn leave_out_backwards(&mut self) {
        let other_mps = |panel: &Vec<f64>| self.panel_point(panel).get(CaseQuantity::OtherSpeed);
        let (left, kept): (Vec<_>, Vec<_>) =
            self.panels.iter().cloned().partition(|panel| other_mps(panel).is_some_and(|mps| mps < 0.0));
        let Some(first) = left.first().filter(|_| !kept.is_empty()) else { return };
        let values = self.panel_axes.iter().zip(first).map(|(axis, value)| format!("{}={value}", axis.parameter.key));
        tracing::warn!(
            "{} of {} panels are left out: the other vehicle would drive backwards, first at {}",
            left.len(),
            self.panels.len(),
            values.collect::<Vec<_>>().join(", ")
        );
        self.panels = kept;
    }

    fn leave_out_receding(&mut self) -> Result<()> {
        let speeds = |point: &Point| point.get(CaseQuantity::EgoSpeed).zip(point.get(CaseQuantity::OtherSpeed));
        let mut kept = Vec::new();
        for panel in &self.panels {
            let Some((ego_mps, other_mps)) = speeds(&self.panel_point(panel)) else {
                let problem = "the speeds of both vehicles must be the panel's or fixed".to_owned();
                let help = format!("give both by {} or {}, or leave `map.closing` out", option("panel"), option("set"));
                return Err(Error::usage(Place::item("map.closing"), problem, help));
            };
            if ego_mps > other_mps {
                kept.push(panel.clone());
            }
        }
        if kept.is_empty() {
            let problem = "in no panel is the ego faster than the other vehicle".to_owned();
            return Err(Error::usage(
                Place::item("map.closing"),
                problem,
                "give other speeds, or leave `map.closing` out",
            ));
        }
        self.panels = kept;
        Ok(())
    }

    /// The panels: a value for each panel axis. At least one.
    pub fn panels(&self) -> &[Vec<f64>] {
        &self.panels
    }

    /// Number of cells.
    pub fn cell_count(&self) -> usize {
        self.panels.len() * self.x.len() * self.y.len()
    }

    /// Index of a cell from panel, horizontal index and vertical index.
    pub fn cell(&self, panel: usize, i: usize, j: usize) -> usize {
        (panel * self.y.len() + j) * self.x.len() + i
    }

    /// Panel, horizontal index and vertical index of a cell below [`Grid::cell_count`].
    pub fn places(&self, cell: usize) -> (usize, usize, usize) {
        let (nx, ny) = (self.x.len(), self.y.len());
        (cell / (nx * ny), cell % nx, cell / nx % ny)
    }

    /// The values of a cell in the units of their parameters: first the panel's, then `y`, then `x`.
    pub fn values(&self, cell: usize) -> Vec<(&'static MapParameter, f64)> {
        let (panel, i, j) = self.places(cell);
        let of_panel = self.panel_axes.iter().map(|a| a.parameter).zip(self.panels[panel].iter().copied());
        of_panel.chain([(self.y.parameter, self.y.values[j]), (self.x.parameter, self.x.values[i])]).collect()
    }

    /// The point of a cell, in SI units, fixed values included.
    pub fn point(&self, cell: usize) -> Point {
        let (panel, i, j) = self.places(cell);
        let mut point = self.panel_point(&self.panels[panel]);
        point.set(self.y.parameter, self.y.values[j]);
        point.set(self.x.parameter, self.x.values[i]);
        self.perturbation.map_or(point, |perturbation| perturbation.of_inputs(point))
    }

    /// The same cells with a perturbed case each; sizes that the grid does not set are those of the profile.
    fn perturbed(&self, perturbation: Perturbation, profile: &Profile) -> Grid {
        let mut grid = Grid { perturbation: Some(perturbation), ..self.clone() };
        let is_set = |quantity| self.values(0).iter().chain(&self.fixed).any(|(known, _)| known.quantity == quantity);
        let frame = &profile.frame;
        for (quantity, size_m) in
            [(CaseQuantity::Length, frame.default_length_m), (CaseQuantity::Width, frame.default_width_m)]
        {
            let parameter = PARAMETERS.iter().find(|known| known.quantity == quantity);
            grid.parts.fixed.extend(parameter.filter(|_| !is_set(quantity)).map(|parameter| (parameter, size_m)));
        }
        grid
    }

    /// The perturbations of the cells' inputs.
    pub fn perturbations(&self) -> Vec<Perturbation> {
        let mut all = Perturbation::all(self.category);
        all.retain(|by| self.style == CaseStyle::Plain || !by.is_of_geometry());
        all
    }

    fn panel_point(&self, panel: &[f64]) -> Point {
        let mut point = Point::default();
        for (parameter, value) in &self.fixed {
            point.set(parameter, *value);
        }
        for (axis, value) in self.panel_axes.iter().zip(panel) {
            point.set(axis.parameter, *value);
        }
        point
    }

    /// The profile for sweeping the grid: the JRC's comparison sweep has its own rules.
    pub(crate) fn profile(&self, profile: &Profile) -> Profile {
        let mut profile = profile.clone();
        if self.style == CaseStyle::JrcComparison {
            profile.cchdm.abort_on_large_ttc = true;
            let of = |cell| run_up(self.style, &self.point(cell), profile.frame.dt_s);
            let longest = (0..self.cell_count()).map(of).max().unwrap_or(0);
            profile.frame.time_cap_s += f64::from(longest) * profile.frame.dt_s;
        }
        profile
    }

    /// The case of a cell.
    ///
    /// # Errors
    /// [`Error::Usage`] for contradictory values, as [`PlainCase::case`](lanesweep_model::scenario::PlainCase::case).
    pub fn case(&self, cell: usize, profile: &Profile) -> Result<Case> {
        let (point, dt_s) = (self.point(cell), profile.frame.dt_s);
        let value = |quantity, otherwise: f64| point.get(quantity).unwrap_or(otherwise);
        let ego_mps = value(CaseQuantity::EgoSpeed, 0.0);
        let other_mps = value(CaseQuantity::OtherSpeed, ego_mps);
        let lateral_mps = value(CaseQuantity::LateralSpeed, 0.0);
        if self.style == CaseStyle::Plain {
            return point.plain_case(self.category, profile)?.case(profile.frame.time_cap_s);
        }
        Ok(match self.category {
            Category::CutIn => {
                jrc_case::cut_in(ego_mps, other_mps, lateral_mps, run_up(self.style, &point, dt_s), dt_s)
            }
            Category::Lvd => {
                let (end, deceleration) = (value(CaseQuantity::EndSpeed, 0.0), value(CaseQuantity::Deceleration, 0.0));
                jrc_case::lvd(ego_mps, end, deceleration)
            }
            Category::CutOut => {
                let speed_mps = value(CaseQuantity::AheadSpeed, 0.0);
                let length_m = if speed_mps > 0.0 { jrc_case::LENGTH_M } else { jrc_case::STANDING_LENGTH_M };
                let front = Front { speed_mps, length_m, distance_m: value(CaseQuantity::AheadGap, 0.0) };
                jrc_case::cut_out(ego_mps, lateral_mps, front, dt_s)
            }
        })
    }

    /// The initial gap of a cell's lane of a model, m, bumper to bumper at the nominal start.
    pub fn gap_m(&self, cell: usize, model: ModelId, profile: &Profile) -> f64 {
        let point = self.point(cell);
        let ego_mps = point.get(CaseQuantity::EgoSpeed).unwrap_or(0.0);
        if self.native_gap {
            return jrc_case::native_distance(profile, model, ego_mps);
        }
        let of_headway = point.get(CaseQuantity::Thw).map(|thw_s| thw_s * ego_mps);
        point.get(CaseQuantity::Gap).or(of_headway).unwrap_or(0.0)
    }

    /// The gap that a run-up and a perturbation add to a cell's gap, m.
    fn added_gap_m(&self, cell: usize, dt_s: f64) -> f64 {
        let point = self.point(cell);
        let ego_mps = point.get(CaseQuantity::EgoSpeed).unwrap_or(0.0);
        let other_mps = point.get(CaseQuantity::OtherSpeed).unwrap_or(ego_mps);
        let of_run_up = jrc_case::gap_before_run_up(0.0, ego_mps, other_mps, run_up(self.style, &point, dt_s), dt_s);
        of_run_up + self.perturbation.map_or(0.0, Perturbation::gap_m)
    }
}

/// Number of steps of a case's lateral run-up.
fn run_up(style: CaseStyle, point: &Point, dt_s: f64) -> u32 {
    match (style, point.get(CaseQuantity::LateralSpeed)) {
        (CaseStyle::JrcComparison, Some(lateral_mps)) => jrc_case::run_up_steps(lateral_mps, dt_s),
        _ => 0,
    }
}

/// Checks that all quantities required by the category are given once.
///
/// # Errors
/// [`Error::Usage`] with the quantity that is missing or duplicate.
fn check_complete(category: Category, native_gap: bool, has: &dyn Fn(CaseQuantity) -> bool) -> Result<()> {
    let missing = |what: &str, example: &str| {
        let problem = format!("a map of {}s needs {what}", category.label());
        let help =
            format!("give it by {}, {}, {} or {} {example}", option("x"), option("y"), option("panel"), option("set"));
        Err(Error::usage(Place::item(what), problem, help))
    };
    let has_gap = has(CaseQuantity::Gap) || has(CaseQuantity::Thw);
    match CaseQuantity::needed(category).iter().find(|needed| !has(**needed)) {
        None => {}
        Some(CaseQuantity::EgoSpeed) => return missing("the ego's speed", "ego_speed_kmh=60"),
        Some(CaseQuantity::LateralSpeed) => return missing("the lateral speed", "lateral_speed_mps=1"),
        Some(CaseQuantity::Deceleration) => return missing("the leader's deceleration", "deceleration_mps2=6"),
        Some(_) => return missing("the gap to the vehicle ahead", "ahead_gap_m=50"),
    }
    if has(CaseQuantity::Gap) && has(CaseQuantity::Thw) || native_gap && has_gap {
        let problem = "the initial distance is given twice".to_owned();
        let help = "keep one of gap_m, thw_s and `map.native_gap`";
        return Err(Error::usage(Place::item("gap_m, thw_s"), problem, help));
    }
    if !native_gap && !has_gap {
        return missing("the initial distance", "thw_s=2 (or `map.native_gap`)");
    }
    Ok(())
}

/// Every combination of the axes' values, the last axis fastest; one empty combination if there is no axis.
fn combinations(axes: &[GridAxis]) -> Result<Vec<Vec<f64>>> {
    let count = axes.iter().fold(1_usize, |n, axis| n.saturating_mul(axis.len()));
    if count > MAX_PANELS {
        let problem = format!("they make {count} panels");
        let help = format!("give fewer values: a sheet has {MAX_PANELS} panels at most");
        return Err(Error::usage(Place::option("panel"), problem, help));
    }
    let mut panels = vec![Vec::new()];
    for axis in axes {
        let with = |panel: &Vec<f64>, value: f64| panel.iter().copied().chain([value]).collect::<Vec<f64>>();
        panels = panels.iter().flat_map(|panel| axis.values.iter().map(move |&v| with(panel, v))).collect();
    }
    Ok(panels)
}
