//! The grids of the JRC's evidence, and the shares of crashes that are known of them.
//!
//! The cut-in grids are the JRC's. Its public simulator has no grid for the other two categories; theirs are ours:
//! the leader's decelerations were chosen to give the known share of RSS, and the cut-outs complete the size of the evidence,
//! 140,793 simulations: 4 models × 29,970 cut-ins, 3 × 209 decelerations, 3 × 6,762 cut-outs. No share of Reg157 is
//! known of the latter two: it is left out there unless it is asked for.

use crate::Result;
use crate::model::driver::ModelId;
use crate::model::profile::Profile;
use crate::scenario::Category;

use super::axis::GridAxis;
use super::grid::{CaseStyle, Grid, GridParts};
use super::parameter::MapParameter;

/// A grid with its models and what is known of it.
pub struct Preset {
    /// The grid.
    pub grid: Grid,
    /// Models unless told otherwise.
    pub models: Vec<ModelId>,
    /// Known shares of crashes in per cent, as published: one decimal.
    pub known_percent: Vec<(ModelId, f64)>,
    /// The grid is ours and was chosen so that a known share comes out: that it does confirms nothing.
    pub is_chosen_to_match: bool,
}

impl Preset {
    /// The known share of a model, per cent.
    pub fn known(&self, model: ModelId) -> Option<f64> {
        self.known_percent.iter().find(|(m, _)| *m == model).map(|(_, share)| *share)
    }
}

/// Names of the presets.
pub const NAMES: [&str; 1] = ["jrc"];
/// The profile of the JRC's simulator.
pub const JRC_PROFILE: &str = "jrc-2021";

/// The JRC's grids of a category. Cases are made as its simulator makes them where the profile starts its runs as it
/// does (`start_shift`), and as [`CaseStyle::Plain`] otherwise.
///
/// # Errors
/// None on the grids as they stand.
pub fn jrc(category: Category, profile: &Profile) -> Result<Vec<Preset>> {
    use ModelId::{Cchdm, Fsm, Reg157, Rss};
    let is_jrc = profile.frame.start_shift;
    let style = match (is_jrc, category) {
        (false, _) => CaseStyle::Plain,
        (true, Category::CutIn) => CaseStyle::JrcComparison,
        (true, _) => CaseStyle::Jrc,
    };
    let range = |key, ends, step| GridAxis::range(category, key, ends, step);
    let parts = |name: &str, x, y| GridParts {
        name: name.to_owned(),
        category,
        x,
        y,
        panel_axes: Vec::new(),
        fixed: Vec::new(),
        style,
        native_gap: true,
        closing_only: false,
        panel_rows: None,
    };
    let following = vec![Cchdm, Rss, Fsm];
    match category {
        Category::CutIn => {
            let grid = |name, ego: (f64, f64, f64), other: (f64, f64, f64), gap: (f64, f64, f64)| {
                let x = range("gap_m", (gap.0, gap.1), gap.2)?;
                let y = range("lateral_speed_mps", (0.0, 1.7), 0.1)?;
                Grid::new(GridParts {
                    panel_axes: vec![
                        range("ego_speed_kmh", (ego.0, ego.1), ego.2)?,
                        range("other_speed_kmh", (other.0, other.1), other.2)?,
                    ],
                    native_gap: false,
                    closing_only: true,
                    ..parts(name, x, y)
                })
            };
            let low = grid("cut_in_low", (10.0, 60.0, 10.0), (10.0, 60.0, 10.0), (1.0, 59.0, 1.0))?;
            let high = grid("cut_in_high", (70.0, 130.0, 20.0), (10.0, 130.0, 30.0), (1.0, 119.0, 2.0))?;
            let known = |shares: [f64; 4]| [Fsm, Rss, Reg157, Cchdm].into_iter().zip(shares).collect();
            let preset = |grid, shares| Preset {
                grid,
                models: ModelId::ALL.to_vec(),
                known_percent: known(shares),
                is_chosen_to_match: false,
            };
            Ok(vec![preset(low, [5.7, 5.5, 14.1, 23.4]), preset(high, [11.8, 10.6, 20.4, 25.3])])
        }
        Category::Lvd => {
            let (x, y) = (range("deceleration_mps2", (0.0, 9.0), 0.5)?, range("ego_speed_kmh", (30.0, 130.0), 10.0)?);
            let grid = Grid::new(parts("lvd", x, y))?;
            let known_percent = vec![(Fsm, 0.0), (Cchdm, 0.0), (Rss, 1.9)];
            Ok(vec![Preset { grid, models: following, known_percent, is_chosen_to_match: true }])
        }
        Category::CutOut => {
            let x = range("ahead_gap_m", (10.0, 100.0), 2.0)?;
            let y = range("lateral_speed_mps", (0.5, 2.5), 0.1)?;
            let fixed = vec![(MapParameter::find(category, "ahead_speed_kmh", "preset")?, 0.0)];
            let panel_axes = vec![range("ego_speed_kmh", (60.0, 120.0), 10.0)?];
            let grid = Grid::new(GridParts { panel_axes, fixed, ..parts("cut_out", x, y) })?;
            Ok(vec![Preset { grid, models: following, known_percent: Vec::new(), is_chosen_to_match: false }])
        }
    }
}
