//! A scenario found in a recording: written by `mine`, read by every parameterization.
//!
//! Fields, names and signs are those of the scenario files (JSON Lines): SI units, f64, series at the recording's rate
//! over [frame0, frame1]. `y` is relative to the centre of the ego's lane, and positive on the side the principal
//! vehicle comes from (cut-in) or leaves to (cut-out).

use std::fmt::Display;

use serde::{Deserialize, Serialize};

use super::parameterization::ReducedScenario;
use crate::category::Category;
use lanesweep_support::{Error, Place, Result, option};

/// Side of the ego's lane, in the direction of travel.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// Left, `d > 0`.
    #[default]
    Left,
    /// Right, `d < 0`.
    Right,
}

impl Side {
    /// +1 for left, −1 for right; multiplied by it, the scenario's `y` becomes left-positive.
    pub fn sign(self) -> f64 {
        match self {
            Side::Left => 1.0,
            Side::Right => -1.0,
        }
    }
}

/// The ego at the start of a scenario.
#[derive(Debug, Default, Clone, PartialEq, Serialize, Deserialize)]
pub struct Ego {
    /// Initial speed, m/s, ≥ 0.
    pub v0: f64,
    /// Length, m, > 0.
    pub length: f64,
    /// Width, m, > 0.
    pub width: f64,
}

/// Another vehicle over the whole scenario.
#[derive(Debug, Default, Clone, PartialEq, Serialize, Deserialize)]
pub struct Other {
    /// Length, m, > 0.
    pub length: f64,
    /// Width, m, > 0.
    pub width: f64,
    /// Speed along the road, m/s, one value per sample.
    pub v: Vec<f64>,
    /// Lateral position of the centre relative to the ego's lane centre, m, one value per sample.
    pub y: Vec<f64>,
}

/// The id of a mined scenario: `{recording}_{category}_{ego}_{target}_{frame0}`.
pub fn mined_id(recording: &str, category: Category, ego: &dyn Display, target: &dyn Display, frame0: i64) -> String {
    format!("{recording}_{}_{ego}_{target}_{frame0}", category.key())
}

/// One mined scenario. Unknown fields of a file are ignored; optional ones may be absent.
#[derive(Debug, Default, Clone, PartialEq, Serialize, Deserialize)]
pub struct Scenario {
    /// Stable key: [`mined_id`].
    pub id: String,
    /// Kind of scenario.
    pub category: Category,
    /// Recording that contains it.
    #[serde(default)]
    pub recording: String,
    /// Ego vehicle.
    #[serde(default)]
    pub ego_id: u32,
    /// Principal other vehicle: cutter, cutting-out vehicle, leader.
    #[serde(default)]
    pub target_id: u32,
    /// Cut-out only: the vehicle ahead of the cutting-out one.
    #[serde(default)]
    pub lead_id: Option<u32>,
    /// First frame.
    #[serde(default)]
    pub frame0: i64,
    /// Last frame of the series; the first frame without the tags.
    #[serde(default)]
    pub frame1: i64,
    /// Samples per second of the series.
    pub fps: f64,
    /// Whether it passed the filters of its category.
    #[serde(default = "yes")]
    pub kept: bool,
    /// Why it was kept or rejected.
    #[serde(default)]
    pub reason: String,
    /// The ego.
    pub ego: Ego,
    /// Width of the ego's lane, m.
    #[serde(default = "super::parameterization::default_lane_width_m")]
    pub lane_width: f64,
    /// Side that the target comes from or leaves to; LVD: side of the lane centre where it starts.
    pub side: Side,
    /// Principal other vehicle.
    pub target: Other,
    /// Cut-out only: the vehicle ahead of the cutting-out one.
    #[serde(default)]
    pub lead: Option<Other>,
    /// Observed time headway at the start, s, bumper to bumper.
    #[serde(default)]
    pub thw0: Option<f64>,
    /// Observed gap at the start, m, bumper to bumper.
    #[serde(default)]
    pub gap0: Option<f64>,
    /// Cut-out only: gap from the cutting-out vehicle to the one ahead at the start, m, bumper to bumper.
    #[serde(rename = "D", default)]
    pub lead_gap: Option<f64>,
    /// Largest recorded deceleration of the target over the scenario, m/s².
    #[serde(default)]
    pub peak_decel: Option<f64>,
    /// Whether the lane change began before the ego's data set.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub truncated_start: Option<bool>,
    /// What ended the scenario: `lc_end`, `leader`, `ego_lane`, `data_end`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end_cause: Option<String>,
    /// First frame of the second item (the target becomes or ceases to be leader).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame_switch: Option<i64>,
    /// LVD: the untrimmed half-open interval of the tags: first frame with them, first frame without.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tag_frames: Option<[i64; 2]>,
    /// Synthetic data from the generator: results are not statements about real traffic.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub synthetic: bool,
    /// In the plan of a study: S' that are given as series, in the order of the plan's variants.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub replays: Vec<ReducedScenario>,
    /// In the plan of a study: the fold of its cross-validation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fold: Option<usize>,
}

fn yes() -> bool {
    true
}

impl Scenario {
    /// Duration T = (n − 1)/fps, s.
    pub fn duration_s(&self) -> f64 {
        (self.target.v.len().saturating_sub(1)) as f64 / self.fps
    }

    /// Recorded gap at the start divided by the speed at which a lane's ego starts (LVD: the leader's), s. `None` if
    /// neither gap nor headway is known, or the ego stands.
    pub fn start_headway_s(&self) -> Option<f64> {
        let leader = self.target.v.first().copied().unwrap_or(0.0);
        let ego_mps = if self.category == Category::Lvd { leader } else { self.ego.v0 };
        self.gap0.filter(|_| ego_mps > 0.0).map(|gap_m| gap_m / ego_mps).or(self.thw0)
    }

    /// Recorded gap at the start, m: `gap0`, else `thw0` times the ego's speed.
    ///
    /// # Errors
    /// [`Error::Input`] if neither is given.
    pub fn start_gap_m(&self) -> Result<f64> {
        self.gap0.or(self.thw0.map(|thw_s| thw_s * self.ego.v0)).ok_or_else(|| {
            Error::input(
                Place::item(format!("scenario {}", self.id)).column("gap0"),
                format!("the recorded gap at the start is absent, but {} starts from it", option("thw = observed")),
                "give gap0 (m) or thw0 (s), or headways in seconds",
            )
        })
    }
}
