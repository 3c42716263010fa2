//! A concrete case: what is simulated before headway and driver model are chosen. A recorded scenario,
//! each of its parameterizations, a sampled point, a row of a table and a `simulate` call are all cases.

use serde::{Deserialize, Serialize};

use super::motion::{Lateral, Speed};

/// The three kinds of scenario of UN R157, Annex 3.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Category {
    /// Another vehicle changes into the ego's lane in front of it.
    CutIn,
    /// The leader leaves the ego's lane and uncovers a slower vehicle.
    CutOut,
    /// The leader decelerates.
    Lvd,
}

impl Category {
    /// All, in the order of every table.
    pub const ALL: [Category; 3] = [Category::CutIn, Category::CutOut, Category::Lvd];

    /// Name in files and keys: `cut_in`, `cut_out`, `lvd`.
    pub fn key(self) -> &'static str {
        match self {
            Category::CutIn => "cut_in",
            Category::CutOut => "cut_out",
            Category::Lvd => "lvd",
        }
    }

    /// Name in running text and tables: `cut-in`, `cut-out`, `LVD`.
    pub fn label(self) -> &'static str {
        match self {
            Category::CutIn => "cut-in",
            Category::CutOut => "cut-out",
            Category::Lvd => "LVD",
        }
    }

    /// From either name.
    pub fn parse(text: &str) -> Option<Category> {
        let folded = text.to_ascii_lowercase().replace('-', "_");
        Category::ALL.into_iter().find(|c| c.key() == folded)
    }
}

/// A vehicle other than the ego.
#[derive(Debug, Clone, PartialEq)]
pub struct Participant {
    /// Length, m, > 0.
    pub length_m: f64,
    /// Width, m, > 0.
    pub width_m: f64,
    /// Speed along the road.
    pub speed: Speed,
    /// Motion across the road.
    pub lateral: Lateral,
}

/// One concrete case. Lengths in m, speeds in m/s, times in s.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// Kind of scenario.
    pub category: Category,
    /// Length of the ego, > 0.
    pub ego_length_m: f64,
    /// Width of the ego, > 0.
    pub ego_width_m: f64,
    /// Initial and planned speed of the ego, ≥ 0.
    pub ego_speed_mps: f64,
    /// Cutter, cutting-out vehicle or leader. The headway sets its gap to the ego.
    pub principal: Participant,
    /// Cut-out only: the vehicle ahead of the principal one.
    pub ahead: Option<Ahead>,
    /// Later of the scenario's duration and its last parameter event: the run goes on at least so long.
    pub horizon_s: f64,
}

/// The vehicle ahead of the cutting-out one.
#[derive(Debug, Clone, PartialEq)]
pub struct Ahead {
    /// The vehicle; it stays in the middle of the ego's lane.
    pub vehicle: Participant,
    /// D: gap from the cutting-out vehicle's front to this one's rear at t = 0, m.
    pub gap_m: f64,
}
