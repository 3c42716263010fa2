//! A concrete case: what is simulated before headway and driver model are chosen. A recorded scenario,
//! each of its parameterizations, a sampled point, a row of a table and a `simulate` call are all cases.

use super::{Category, Lateral, Speed};

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
