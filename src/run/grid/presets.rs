//! Predefined grids: the JRC's evidence with its published crash rates, and the critical scenarios of the regulation's
//! annex.
//!
//! The JRC published its cut-in grids. Its public simulator has no grid for the other two categories, so we chose
//! theirs. The leader's decelerations were chosen to reproduce the published crash rate of RSS. The cut-outs complete
//! the size of the evidence, 140,793 simulations: 4 models × 29,970 cut-ins, 3 × 209 decelerations, 3 × 6,762 cut-outs.
//! No crash rate of Reg157 is published for these two; it runs there only if requested.

use lanesweep_model::driver::ModelId;
use lanesweep_model::profile::Profile;
use lanesweep_model::scenario::Category;
use lanesweep_support::Result;

use super::axis::GridAxis;
use super::parameter::MapParameter;
use super::{CaseStyle, Grid, GridParts};

/// A grid with its models and published results.
pub struct Preset {
    /// The grid.
    pub grid: Grid,
    /// Default models.
    pub models: Vec<ModelId>,
    /// Published crash rates, per cent, with one decimal.
    pub known_percent: Vec<(ModelId, f64)>,
    /// The grid was chosen by us to reproduce a published rate, so agreement confirms nothing.
    pub is_chosen_to_match: bool,
}

impl Preset {
    /// The published crash rate of a model, per cent; `None` if there is none.
    pub fn known(&self, model: ModelId) -> Option<f64> {
        self.known_percent.iter().find(|(m, _)| *m == model).map(|(_, share)| *share)
    }
}

/// Predefined grids.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Presets {
    /// The JRC's evidence for the regulation.
    Jrc,
    /// The critical scenarios of the regulation's Annex 3.
    R157,
}

/// The profile of the JRC's simulator.
pub const JRC_PROFILE: &str = "jrc-2021";

impl Presets {
    /// All, in the order of messages.
    pub const ALL: [Presets; 2] = [Presets::Jrc, Presets::R157];

    /// Name on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Presets::Jrc => "jrc",
            Presets::R157 => "r157",
        }
    }

    /// Finds a preset by name.
    pub fn find(name: &str) -> Option<Presets> {
        Presets::ALL.into_iter().find(|presets| presets.name() == name)
    }

    /// Name of the default profile.
    pub fn profile(self) -> &'static str {
        match self {
            Presets::Jrc => JRC_PROFILE,
            Presets::R157 => "un-r157",
        }
    }

    /// The grids of a category, with cases as the profile makes them.
    ///
    /// # Errors
    /// None for the grids as defined here.
    pub fn of(self, category: Category, profile: &Profile) -> Result<Vec<Preset>> {
        match self {
            Presets::Jrc => jrc(category, profile),
            Presets::R157 => r157(category),
        }
    }
}

/// The JRC's grids of a category. If the profile starts its runs as the JRC's simulator does (`start_shift`), cases are
/// made as in the simulator; otherwise as [`CaseStyle::Plain`].
///
/// # Errors
/// None for the grids as defined here.
fn jrc(category: Category, profile: &Profile) -> Result<Vec<Preset>> {
    use ModelId::{Cchdm, Fsm, Reg157, Rss};
    let is_jrc = profile.frame.start_shift;
    let style = match (is_jrc, category) {
        (false, _) => CaseStyle::Plain,
        (true, Category::CutIn) => CaseStyle::JrcComparison,
        (true, _) => CaseStyle::Jrc,
    };
    let range = |key, ends, step| GridAxis::range(category, key, ends, step);
    let parts = |name, x, y| GridParts { style, native_gap: true, ..GridParts::new(name, category, x, y) };
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

/// The critical scenarios of Annex 3 (guidance on traffic disturbances, data sheets) in two speed ranges: up to 60 km/h
/// (00 series of amendments) and up to 130 km/h (01 series).
///
/// The regulation specifies varied and fixed quantities. Cut-in: initial gap and lateral speed for pairs of speeds.
/// Cut-out: both vehicles at one speed, a headway of 2 s, a stationary vehicle ahead, its distance and the lateral
/// speed. Deceleration: a headway of 2 s and up to 1 g. We chose the steps and the ranges of gaps and lateral speeds
/// (1.8 m/s is the annex's example).
fn r157(category: Category) -> Result<Vec<Preset>> {
    let range = |key, ends, step| GridAxis::range(category, key, ends, step);
    let fixed = |values: &[(&str, f64)]| -> Result<Vec<(&'static MapParameter, f64)>> {
        values.iter().map(|(key, value)| Ok((MapParameter::find(category, key, "preset")?, *value))).collect()
    };
    let grid = |name: &str, x: GridAxis, y: GridAxis, panel_axes, values: &[(&str, f64)]| -> Result<Preset> {
        let (closing_only, fixed) = (category == Category::CutIn, fixed(values)?);
        let grid = Grid::new(GridParts { closing_only, panel_axes, fixed, ..GridParts::new(name, category, x, y) })?;
        let models = ModelId::ALL.to_vec();
        Ok(Preset { grid, models, known_percent: Vec::new(), is_chosen_to_match: false })
    };
    let lateral = || range("lateral_speed_mps", (0.1, 1.8), 0.1);
    let ego = |from, to, step| range("ego_speed_kmh", (from, to), step);
    match category {
        Category::CutIn => {
            let panels = |ego, from, to, step| -> Result<Vec<GridAxis>> {
                Ok(vec![ego, range("other_speed_kmh", (from, to), step)?])
            };
            let low = panels(ego(20.0, 60.0, 10.0)?, 10.0, 50.0, 10.0)?;
            let high = panels(ego(70.0, 130.0, 20.0)?, 10.0, 110.0, 20.0)?;
            Ok(vec![
                grid("cut_in_to_60", range("gap_m", (1.0, 60.0), 1.0)?, lateral()?, low, &[])?,
                grid("cut_in_to_130", range("gap_m", (2.0, 120.0), 2.0)?, lateral()?, high, &[])?,
            ])
        }
        Category::CutOut => {
            let held = [("thw_s", 2.0), ("ahead_speed_kmh", 0.0)];
            let across = |to| range("ahead_gap_m", (2.0, to), 2.0);
            Ok(vec![
                grid("cut_out_to_60", across(60.0)?, lateral()?, vec![ego(10.0, 60.0, 10.0)?], &held)?,
                grid("cut_out_to_130", across(120.0)?, lateral()?, vec![ego(70.0, 130.0, 20.0)?], &held)?,
            ])
        }
        Category::Lvd => {
            let across = || range("deceleration_mps2", (0.2, 10.0), 0.2);
            let held = [("thw_s", 2.0)];
            Ok(vec![
                grid("lvd_to_60", across()?, ego(10.0, 60.0, 2.0)?, Vec::new(), &held)?,
                grid("lvd_to_130", across()?, ego(62.0, 130.0, 4.0)?, Vec::new(), &held)?,
            ])
        }
    }
}
