//! Maps: the grids of a category under a profile, planned, then swept.

use std::sync::Arc;

use super::Grid;
use super::map::GridMap;
use super::plan::GridPlan;
use super::presets::{self, Preset, Presets};
use super::robustness::Perturbation;
use lanesweep_engine::{CpuBackend, Executor, SweepSummary};
use lanesweep_model::criterion::Criterion;
use lanesweep_model::driver::ModelId;
use lanesweep_model::profile::Profile;
use lanesweep_model::scenario::Category;
use lanesweep_support::Result;

/// The cells of a map.
#[derive(Debug, Clone)]
pub enum MapGrids {
    /// Predefined grids of a category, with their models.
    Preset(Presets, Category),
    /// One grid.
    Own(Box<Grid>),
}

/// Options of maps.
#[derive(Debug, Clone)]
pub struct MapOptions {
    /// Cells.
    pub grids: MapGrids,
    /// Models; `None`: those of the presets, or all models for a user's grid.
    pub models: Option<Vec<ModelId>>,
    /// Criterion of the published results.
    pub criterion: Criterion,
    /// Also sweep every grid with each [`Perturbation`]: cells whose verdict changes are undecided.
    pub robust: bool,
}

/// Planned maps.
///
/// ```
/// use lanesweep::engine::{CpuBackend, Executor};
/// use lanesweep::model::criterion::Criterion;
/// use lanesweep::model::driver::ModelId;
/// use lanesweep::model::profile::Profile;
/// use lanesweep::run::grid::{Map, MapGrids, MapOptions, presets::Presets};
/// use lanesweep::scenario::Category;
///
/// # fn main() -> lanesweep::Result<()> {
/// let options = MapOptions {
///     grids: MapGrids::Preset(Presets::Jrc, Category::Lvd),
///     models: Some(vec![ModelId::Rss]),
///     criterion: Criterion::Collision,
///     robust: false,
/// };
/// let map = Map::plan(options, &Profile::load("jrc-2021")?)?;
/// assert_eq!(map.lane_count(), 209);
/// let result = map.run(&Executor::new(CpuBackend::lane_arithmetic()))?;
/// assert_eq!(result.grids[0].map.failures(0, Criterion::Collision), 4);
/// # Ok(())
/// # }
/// ```
pub struct Map {
    grids: Vec<PlannedGrid>,
}

struct PlannedGrid {
    plan: GridPlan,
    /// Perturbed plans of the same cells.
    perturbed: Vec<(Perturbation, GridPlan)>,
    known_percent: Vec<Option<f64>>,
    is_chosen_to_match: bool,
}

/// A swept grid with its published results.
pub struct MappedGrid {
    /// Grid and plans.
    pub plan: GridPlan,
    /// The verdicts.
    pub map: GridMap,
    /// Published crash rates, per cent, by model of the map.
    pub known_percent: Vec<Option<f64>>,
    /// The grid was chosen to reproduce a published rate, so agreement confirms nothing.
    pub is_chosen_to_match: bool,
}

/// Swept maps.
pub struct MapResult {
    /// One per grid.
    pub grids: Vec<MappedGrid>,
    /// How the sweeps went.
    pub summary: SweepSummary,
}

impl Map {
    /// Plans every cell of every grid with every model.
    ///
    /// # Errors
    /// [`lanesweep_support::Error::Usage`] without a model, and for an invalid case.
    pub fn plan(options: MapOptions, profile: &Profile) -> Result<Map> {
        let is_published = matches!(options.grids, MapGrids::Preset(Presets::Jrc, _))
            && options.criterion == Criterion::Collision
            && *profile == Profile::load(presets::JRC_PROFILE)?;
        let presets = match options.grids {
            MapGrids::Preset(presets, category) => presets.of(category, profile)?,
            MapGrids::Own(grid) => {
                let (models, known_percent) = (ModelId::ALL.to_vec(), Vec::new());
                vec![Preset { grid: *grid, models, known_percent, is_chosen_to_match: false }]
            }
        };
        let mut grids = Vec::new();
        for preset in presets {
            let models = options.models.as_ref().unwrap_or(&preset.models);
            let plan = GridPlan::new(preset.grid.clone(), profile, models)?;
            let all = plan.grid.perturbations().into_iter().filter(|_| options.robust);
            let perturbed = all.map(|by| Ok((by, plan.perturbed(profile, by)?))).collect::<Result<_>>()?;
            let known = |model: &ModelId| if is_published { preset.known(*model) } else { None };
            grids.push(PlannedGrid {
                plan,
                perturbed,
                known_percent: models.iter().map(known).collect(),
                is_chosen_to_match: preset.is_chosen_to_match && is_published,
            });
        }
        Ok(Map { grids })
    }

    /// Every grid's plans.
    fn plans(&self) -> impl Iterator<Item = &GridPlan> {
        self.grids.iter().flat_map(|grid| grid.perturbed.iter().map(|(_, plan)| plan).chain([&grid.plan]))
    }

    /// Number of units that the run sweeps, including those of the unreacting ego.
    pub fn unit_count(&self) -> u64 {
        let parts = self.plans().flat_map(|plan| &plan.parts);
        parts.map(|part| part.plan.unit_count() + part.unreacting.unit_count()).sum()
    }

    /// Lanes of driver models in all plans.
    pub fn lane_count(&self) -> u64 {
        self.plans().map(GridPlan::lane_count).sum()
    }

    /// Sweeps every grid.
    ///
    /// # Errors
    /// As [`GridMap::sweep`].
    pub fn run(self, executor: &Executor) -> Result<MapResult> {
        let mut summary = SweepSummary { device_s: Some(0.0), ..SweepSummary::default() };
        let reference = CpuBackend::reference();
        let binary64 = Executor { backend: Arc::new(&reference), fallback: None, recheck: None, ..executor.clone() };
        let mut sweep = |plan: &GridPlan, executor: &Executor| -> Result<GridMap> {
            let (map, of_map) = GridMap::sweep(plan, executor)?;
            summary.add(&of_map);
            Ok(map)
        };
        let mut grids = Vec::new();
        for PlannedGrid { plan, perturbed, known_percent, is_chosen_to_match } in self.grids {
            let mut map = sweep(&plan, executor)?;
            for (by, plan) in perturbed {
                map.mark_undecided(&sweep(&plan, if by.is_binary64() { &binary64 } else { executor })?);
            }
            map.drives_through = plan.drives_through()?;
            grids.push(MappedGrid { plan, map, known_percent, is_chosen_to_match });
        }
        Ok(MapResult { grids, summary })
    }
}
