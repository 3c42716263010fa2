//! Grids of concrete cases: what `map` sweeps.
//!
//! Here live the parameters and axes, the way from a cell to its case and from a grid to lane plans, the presets, and
//! the swept map with its differences. Here lives no physics, and no drawing. Cases and plans go to [`crate::engine`],
//! maps to [`crate::report`]. The cases of the JRC's simulator also serve [`crate::interop::conformance`].

mod axis;
#[allow(clippy::module_inception)]
mod grid;
mod grid_text;
pub mod jrc_case;
mod map;
mod parameter;
mod plan;
pub mod presets;
mod robustness;
mod run;

pub use axis::{GridAxis, MAX_VALUES};
pub(crate) use grid::check_complete;
pub use grid::{CaseStyle, Grid, GridParts, MAX_CELLS, MAX_PANELS};
pub use grid_text::{GridText, Variations};
pub use map::{Agreement, CellOutcome, GridMap, boundary, count, runs};
pub use parameter::{MapParameter, MapQuantity, PARAMETERS, Point};
pub use plan::{GridPart, GridPlan};
pub use robustness::{Perturbation, SPEED_MPS, without_reaction};
pub use run::{Against, Map, MapGrids, MapOptions, MapResult, MappedGrid};

pub use crate::scenario::{LATERAL_DISTANCE_M, PlainCase};
