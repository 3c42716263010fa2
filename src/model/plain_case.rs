//! A concrete case from a handful of numbers: constant speeds or one deceleration, a lane change at constant lateral
//! speed. What `simulate` takes from flags and what a map's cells are.

use super::case::{Ahead, Case, Category, Participant};
use super::motion::{Lateral, Speed};
use crate::{Error, Place, Result};

/// Default lateral distance of a lane change, m.
pub const LATERAL_DISTANCE_M: f64 = 3.5;

/// The numbers; speeds in m/s, lengths in m. Fields that a category does not have are ignored.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlainCase {
    /// Kind of scenario.
    pub category: Category,
    /// Speed of the ego, ≥ 0.
    pub ego_speed_mps: f64,
    /// Initial speed of the other vehicle, ≥ 0.
    pub speed_mps: f64,
    /// Its acceleration, m/s².
    pub acceleration_mps2: f64,
    /// Speed at which the acceleration ends; without one, at standstill or never.
    pub end_speed_mps: Option<f64>,
    /// Lane changes: lateral speed, ≥ 0; at 0 there is no change.
    pub lateral_speed_mps: f64,
    /// Cut-in: lateral distance at the start; cut-out: at the end; > 0.
    pub lateral_distance_m: f64,
    /// Cut-out: speed of the vehicle ahead, ≥ 0.
    pub ahead_speed_mps: f64,
    /// Cut-out: gap between the two, ≥ 0.
    pub ahead_gap_m: f64,
    /// Length of every vehicle, > 0.
    pub length_m: f64,
    /// Width of every vehicle, > 0.
    pub width_m: f64,
}

impl PlainCase {
    /// The case; no event is later than `time_cap_s`.
    ///
    /// # Errors
    /// [`Error::Usage`] where the end speed cannot be reached.
    pub fn case(&self, time_cap_s: f64) -> Result<Case> {
        let until_s = self.acceleration_until_s(time_cap_s)?;
        let (lateral, change_s) = self.lateral();
        let participant =
            |speed, lateral| Participant { length_m: self.length_m, width_m: self.width_m, speed, lateral };
        let ahead = (self.category == Category::CutOut).then(|| Ahead {
            vehicle: participant(Speed::constant(self.ahead_speed_mps), Lateral::Centred),
            gap_m: self.ahead_gap_m,
        });
        let speed =
            Speed::Kinematic { initial_mps: self.speed_mps, acceleration_mps2: self.acceleration_mps2, until_s };
        Ok(Case {
            category: self.category,
            ego_length_m: self.length_m,
            ego_width_m: self.width_m,
            ego_speed_mps: self.ego_speed_mps,
            principal: participant(speed, lateral),
            ahead,
            horizon_s: until_s.max(change_s).min(time_cap_s),
        })
    }

    /// Its speed when its acceleration ends, m/s; no event is later than `time_cap_s`.
    ///
    /// # Errors
    /// As [`PlainCase::case`].
    pub fn last_speed_mps(&self, time_cap_s: f64) -> Result<f64> {
        let until_s = self.acceleration_until_s(time_cap_s)?.min(time_cap_s);
        Ok((self.speed_mps + self.acceleration_mps2 * until_s).max(0.0))
    }

    fn acceleration_until_s(&self, time_cap_s: f64) -> Result<f64> {
        let (initial_mps, end_mps) = (self.speed_mps, self.end_speed_mps.unwrap_or(0.0));
        match (self.acceleration_mps2, self.end_speed_mps) {
            (0.0, _) => Ok(0.0),
            (a, None) if a > 0.0 => Ok(time_cap_s),
            (a, _) if (end_mps - initial_mps) / a < 0.0 => Err(Error::usage(
                Place::item("end_speed"),
                format!("{end_mps} m/s cannot be reached from {initial_mps} m/s with {a} m/s²"),
                "change the sign of the acceleration or the end speed",
            )),
            (a, _) => Ok((end_mps - initial_mps) / a),
        }
    }

    /// The lateral motion and how long it lasts, s.
    fn lateral(&self) -> (Lateral, f64) {
        let (rate_mps, distance_m) = (self.lateral_speed_mps, self.lateral_distance_m);
        let change_s = if rate_mps > 0.0 { distance_m / rate_mps } else { 0.0 };
        let lateral = match self.category {
            Category::Lvd => return (Lateral::Centred, 0.0),
            // A kinematic change without speed would be over at once.
            Category::CutIn if rate_mps <= 0.0 => {
                Lateral::Sampled { position_m: vec![distance_m], towards_mps: vec![0.0] }
            }
            Category::CutOut if rate_mps <= 0.0 => Lateral::Centred,
            Category::CutIn => Lateral::Kinematic { start_m: distance_m, rate_mps: -rate_mps, end_m: 0.0 },
            Category::CutOut => Lateral::Kinematic { start_m: 0.0, rate_mps, end_m: distance_m },
        };
        (lateral, change_s)
    }
}
