//! From a grid to lane plans. If the gap is an axis, its values are the plan's headways, and a unit is a row of cells
//! whose lanes share one case. Otherwise a unit is a cell whose case contains the gap. Models with different initial
//! distances have separate plans. Each plan has a second one: the same cases with an ego that never reacts.

use std::sync::Arc;

use lanesweep_engine::{Block, CaseTable, Headway, LaneCase, LanePlan};
use lanesweep_model::driver::ModelId;
use lanesweep_model::profile::Profile;
use lanesweep_support::{Error, Place, Result};

use super::axis::GridAxis;
use super::parameter::MapParameter;
use super::robustness::{Perturbation, without_reaction};
use super::{CaseQuantity, Grid, jrc_case};

/// Name of the only variant.
const VARIANT: &str = "cell";

/// A grid with the plans of its lanes.
pub struct GridPlan {
    /// The grid.
    pub grid: Grid,
    /// Models, in order; each belongs to exactly one part.
    pub models: Vec<ModelId>,
    /// The plans.
    pub parts: Vec<GridPart>,
}

/// The lanes of some models on all cells.
pub struct GridPart {
    /// The plan. Its units form an interval, so it can be split like any other plan.
    pub plan: LanePlan,
    /// The same cases with an ego that never reacts: one lane per cell. A collision there is a conflict.
    pub unreacting: LanePlan,
    layout: Layout,
}

/// Mapping of units and headways to cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Layout {
    /// A unit is a cell.
    Cells,
    /// Headways are the horizontal axis; a unit is a row.
    HeadwaysAcross,
    /// Headways are the vertical axis; a unit is a column of a panel.
    HeadwaysUp,
}

impl GridPlan {
    /// Plans every cell with every model.
    ///
    /// # Errors
    /// [`lanesweep_support::Error::Usage`] without a model, and for an invalid case.
    pub fn new(grid: Grid, profile: &Profile, models: &[ModelId]) -> Result<GridPlan> {
        let profile = grid.profile(profile);
        let mut groups: Vec<Vec<ModelId>> = Vec::new();
        if grid.native_gap {
            // Models with the same distance at two speeds share a plan.
            let distances = |model| [0.0, 40.0].map(|v| jrc_case::native_distance(&profile, model, v));
            for &model in models {
                match groups.iter_mut().find(|group| distances(group[0]) == distances(model)) {
                    Some(group) => group.push(model),
                    None => groups.push(vec![model]),
                }
            }
        } else {
            groups.push(models.to_vec());
        }
        let parts = groups.into_iter().map(|group| GridPart::new(&grid, &profile, group)).collect::<Result<_>>()?;
        Ok(GridPlan { grid, models: models.to_vec(), parts })
    }

    /// The same cells with perturbed cases or a perturbed time step.
    ///
    /// # Errors
    /// As [`GridPlan::new`].
    pub(super) fn perturbed(&self, profile: &Profile, perturbation: Perturbation) -> Result<GridPlan> {
        GridPlan::new(self.grid.perturbed(perturbation, profile), &perturbation.profile(profile)?, &self.models)
    }

    /// Per cell, whether the vehicle that cuts out drives through the one ahead of it.
    ///
    /// # Errors
    /// As [`Grid::case`].
    pub(super) fn drives_through(&self) -> Result<Vec<bool>> {
        let Some(part) = self.parts.first() else { return Ok(Vec::new()) };
        let profile = &part.plan.profile;
        (0..self.grid.cell_count())
            .map(|cell| Ok(self.grid.case(cell, profile)?.drives_through_s(profile).is_some()))
            .collect()
    }

    /// Number of lanes of driver models.
    pub fn lane_count(&self) -> u64 {
        self.parts.iter().map(|part| part.plan.lane_count()).sum()
    }
}

impl GridPart {
    fn new(grid: &Grid, profile: &Profile, models: Vec<ModelId>) -> Result<GridPart> {
        let layout = if is_distance(grid.x.parameter) {
            Layout::HeadwaysAcross
        } else if is_distance(grid.y.parameter) {
            Layout::HeadwaysUp
        } else {
            Layout::Cells
        };
        let fixed = grid.fixed.iter().find(|(parameter, _)| is_distance(parameter));
        let headways = match (layout, fixed) {
            (Layout::HeadwaysAcross, _) => headways(&grid.x),
            (Layout::HeadwaysUp, _) => headways(&grid.y),
            (Layout::Cells, Some((parameter, value))) => vec![headway(parameter, *value)],
            (Layout::Cells, None) => vec![Headway::GapM(0.0)],
        };
        let dt_s = profile.frame.dt_s;
        let mut source = CaseTable::new([1]);
        let mut names = Vec::new();
        for unit in 0..grid.cell_count() / headways.len() {
            let cell = layout.cell(grid, unit, 0);
            let case = grid.case(cell, profile).map_err(|error| of_cell(grid, cell, error))?;
            let mut case = LaneCase::encode(&case, profile, &mut source.tables);
            let of_cell = layout == Layout::Cells && fixed.is_none();
            let gap_m = if of_cell { models.first().map_or(0.0, |m| grid.gap_m(cell, *m, profile)) } else { 0.0 };
            for other in &mut case.others {
                other.gap_offset += gap_m + grid.added_gap_m(cell, dt_s);
            }
            source.blocks[0].cases.push(case);
            let varies = |parameter: &MapParameter| layout == Layout::Cells || !is_distance(parameter);
            let values = grid.values(cell).into_iter().filter(|(parameter, _)| varies(parameter));
            names.push(written(values));
        }
        let block = Block::new(grid.category, names.into_iter().collect(), vec![VARIANT.to_owned()]);
        let source = Arc::new(source);
        let plan = |profile: Profile, models, headways, block| {
            LanePlan::new(profile, models, headways, vec![block], source.clone())
        };
        let unreacting = plan(without_reaction(profile), vec![ModelId::Reg157], headways.clone(), block.clone())?;
        Ok(GridPart { plan: plan(profile.clone(), models, headways, block)?, unreacting, layout })
    }

    /// The cell of a lane's unit and headway.
    pub(crate) fn cell(&self, grid: &Grid, unit: u64, headway: usize) -> usize {
        self.layout.cell(grid, unit as usize, headway)
    }
}

impl Layout {
    fn cell(self, grid: &Grid, unit: usize, headway: usize) -> usize {
        let (nx, ny) = (grid.x.len(), grid.y.len());
        match self {
            Layout::Cells => unit,
            Layout::HeadwaysAcross => grid.cell(unit / ny, headway, unit % ny),
            Layout::HeadwaysUp => grid.cell(unit / nx, unit % nx, headway),
        }
    }
}

/// Adds the cell to an error about a case.
fn of_cell(grid: &Grid, cell: usize, error: Error) -> Error {
    let Error::Usage { place, problem, help } = error else { return error };
    Error::usage(Place::item(format!("cell {}, {place}", written(grid.values(cell)))), problem, help)
}

/// `gap_m=20,lateral_speed_mps=1`.
fn written(values: impl IntoIterator<Item = (&'static MapParameter, f64)>) -> String {
    let values = values.into_iter().map(|(parameter, value)| format!("{}={value}", parameter.key));
    values.collect::<Vec<_>>().join(",")
}

fn is_distance(parameter: &MapParameter) -> bool {
    matches!(parameter.quantity, CaseQuantity::Gap | CaseQuantity::Thw)
}

fn headway(parameter: &MapParameter, value: f64) -> Headway {
    match parameter.quantity {
        CaseQuantity::Thw => Headway::thw(parameter.si(value)),
        _ => Headway::GapM(parameter.si(value)),
    }
}

fn headways(axis: &GridAxis) -> Vec<Headway> {
    axis.values.iter().map(|&value| headway(axis.parameter, value)).collect()
}
