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

use super::{CaseStyle, Grid, GridParts, GridText};

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

    /// The grids of a category. If the profile starts its runs as the JRC's simulator does (`start_shift`), the cases of the
    /// JRC's grids are made as in the simulator; otherwise as [`CaseStyle::Plain`].
    ///
    /// # Errors
    /// None for the grids as defined here.
    pub fn of(self, category: Category, profile: &Profile) -> Result<Vec<Preset>> {
        use ModelId::{Cchdm, Fsm, Reg157, Rss};
        let (is_jrc, is_cut_in) = (self == Presets::Jrc, category == Category::CutIn);
        let style = match (is_jrc && profile.frame.start_shift, category) {
            (false, _) => CaseStyle::Plain,
            (true, Category::CutIn) => CaseStyle::JrcComparison,
            (true, _) => CaseStyle::Jrc,
        };
        let preset = |&(name, _, x, y, panel, set): &GridRow| {
            let [panel, set] = [panel, set].map(|texts| texts.iter().map(|text| (*text).to_owned()).collect());
            let (native_gap, [x, y]) = (is_jrc && !is_cut_in, [x, y].map(|text| Some(text.to_owned())));
            let text = GridText { x, y, panel, set, native_gap, closing_only: is_cut_in };
            let grid = Grid::new(GridParts { name: name.to_owned(), style, ..text.parts(category)? })?;
            let models = if is_jrc && !is_cut_in { vec![Cchdm, Rss, Fsm] } else { ModelId::ALL.to_vec() };
            let known_percent = match name {
                "cut_in_low" => vec![(Fsm, 5.7), (Rss, 5.5), (Reg157, 14.1), (Cchdm, 23.4)],
                "cut_in_high" => vec![(Fsm, 11.8), (Rss, 10.6), (Reg157, 20.4), (Cchdm, 25.3)],
                "lvd" => vec![(Fsm, 0.0), (Cchdm, 0.0), (Rss, 1.9)],
                _ => Vec::new(),
            };
            Ok(Preset { grid, models, known_percent, is_chosen_to_match: name == "lvd" })
        };
        let rows: &[GridRow] = if is_jrc { &JRC } else { &R157 };
        rows.iter().filter(|row| row.1 == category).map(preset).collect()
    }
}

/// Name, category, horizontal and vertical axis, axes of the panels, and values of all cells, as on the command line.
type GridRow = (&'static str, Category, &'static str, &'static str, &'static [&'static str], &'static [&'static str]);

/// The JRC's grids.
#[rustfmt::skip] // a table
const JRC: [GridRow; 4] = [
    ("cut_in_low", Category::CutIn, "gap_m=1..59/1", "lateral_speed_mps=0..1.7/0.1", &["ego_speed_kmh=10..60/10", "other_speed_kmh=10..60/10"], &[]),
    ("cut_in_high", Category::CutIn, "gap_m=1..119/2", "lateral_speed_mps=0..1.7/0.1", &["ego_speed_kmh=70..130/20", "other_speed_kmh=10..130/30"], &[]),
    ("lvd", Category::Lvd, "deceleration_mps2=0..9/0.5", "ego_speed_kmh=30..130/10", &[], &[]),
    ("cut_out", Category::CutOut, "ahead_gap_m=10..100/2", "lateral_speed_mps=0.5..2.5/0.1", &["ego_speed_kmh=60..120/10"], &["ahead_speed_kmh=0"]),
];

/// The critical scenarios of Annex 3 (guidance on traffic disturbances, data sheets) in two speed ranges: up to 60 km/h
/// (00 series of amendments) and up to 130 km/h (01 series).
///
/// The regulation specifies varied and fixed quantities. Cut-in: initial gap and lateral speed for pairs of speeds.
/// Cut-out: both vehicles at one speed, a headway of 2 s, a stationary vehicle ahead, its distance and the lateral
/// speed. Deceleration: a headway of 2 s and up to 1 g. We chose the steps and the ranges of gaps and lateral speeds
/// (1.8 m/s is the annex's example).
#[rustfmt::skip] // a table
const R157: [GridRow; 6] = [
    ("cut_in_to_60", Category::CutIn, "gap_m=1..60/1", "lateral_speed_mps=0.1..1.8/0.1", &["ego_speed_kmh=20..60/10", "other_speed_kmh=10..50/10"], &[]),
    ("cut_in_to_130", Category::CutIn, "gap_m=2..120/2", "lateral_speed_mps=0.1..1.8/0.1", &["ego_speed_kmh=70..130/20", "other_speed_kmh=10..110/20"], &[]),
    ("cut_out_to_60", Category::CutOut, "ahead_gap_m=2..60/2", "lateral_speed_mps=0.1..1.8/0.1", &["ego_speed_kmh=10..60/10"], &["thw_s=2", "ahead_speed_kmh=0"]),
    ("cut_out_to_130", Category::CutOut, "ahead_gap_m=2..120/2", "lateral_speed_mps=0.1..1.8/0.1", &["ego_speed_kmh=70..130/20"], &["thw_s=2", "ahead_speed_kmh=0"]),
    ("lvd_to_60", Category::Lvd, "deceleration_mps2=0.2..10/0.2", "ego_speed_kmh=10..60/2", &[], &["thw_s=2"]),
    ("lvd_to_130", Category::Lvd, "deceleration_mps2=0.2..10/0.2", "ego_speed_kmh=62..130/4", &[], &["thw_s=2"]),
];
