//! A concrete case: the input of a simulation, without headway and driver model. A recorded scenario, each of its
//! parameterizations, a sampled point, a row of a table and a `simulate` call are all cases.
//!
//! [`PlainCase`] is a case given by a few numbers: constant speeds or one deceleration, and a lane change at constant
//! lateral speed. `simulate` reads one from flags; each cell of a map is one.

use super::category::Category;
use super::motion::{Lateral, Motion, Speed, Tables};
use super::profile::{CutOutTarget, Profile};
use lanesweep_support::readable::value;
use lanesweep_support::{Error, Place, Result};

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
    /// Width of the ego's lane and of its neighbours, > 0.
    pub lane_width_m: f64,
    /// Initial and planned speed of the ego, ≥ 0.
    pub ego_speed_mps: f64,
    /// Cutter, cutting-out vehicle or leader. The headway sets its gap to the ego.
    pub principal: Participant,
    /// Cut-out only: the vehicle ahead of the principal one.
    pub ahead: Option<Ahead>,
    /// Duration of the scenario or time of its last parameter event, whichever is later, s. The run lasts at least this
    /// long.
    pub horizon_s: f64,
}

impl Case {
    /// Time from which the vehicle that cuts out drives through the one ahead of it, s. `None` without a vehicle ahead,
    /// and for a profile that stops a vehicle that hits the one ahead.
    pub fn drives_through_s(&self, profile: &Profile) -> Option<f64> {
        let ahead = self.ahead.as_ref().filter(|_| profile.frame.cut_out_target != CutOutTarget::Exposed)?;
        let (dt_s, mut tables) = (profile.frame.dt_s, Tables::default());
        let mut motion = |of: &Participant| Motion::encode(&of.speed, &of.lateral, dt_s, &mut tables);
        let (cutter, front) = (motion(&self.principal), motion(&ahead.vehicle));
        let half_lengths_m = (self.principal.length_m + ahead.vehicle.length_m) / 2.0;
        let half_widths_m = (self.principal.width_m + ahead.vehicle.width_m) / 2.0;
        let mut apart_m = ahead.gap_m + half_lengths_m;
        for step in 0..profile.step_cap() {
            if step > 0 {
                apart_m += (front.speed(&tables, step) - cutter.speed(&tables, step)) * dt_s;
            }
            let beside_m = cutter.lateral(&tables, step).position - front.lateral(&tables, step).position;
            let (time_s, is_beside) = (f64::from(step) * dt_s, beside_m.abs() >= half_widths_m);
            if apart_m.abs() < half_lengths_m && !is_beside {
                return Some(time_s);
            }
            // After its last event each stays where it is across the road.
            if is_beside && time_s > self.horizon_s + dt_s {
                break;
            }
        }
        None
    }
}

/// The vehicle ahead of the cutting-out one.
#[derive(Debug, Clone, PartialEq)]
pub struct Ahead {
    /// The vehicle; it stays in the middle of the ego's lane.
    pub vehicle: Participant,
    /// D: gap from the cutting-out vehicle's front to this one's rear at t = 0, m.
    pub gap_m: f64,
}

/// Default width of a lane, m. A lane change covers one width.
pub const LANE_WIDTH_M: f64 = 3.5;

/// Parameters; speeds in m/s, lengths in m. Fields that do not apply to the category are ignored.
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
    /// Speed at which the acceleration ends; `None`: at standstill or never.
    pub end_speed_mps: Option<f64>,
    /// Lane changes: lateral speed, ≥ 0; 0 means no change.
    pub lateral_speed_mps: f64,
    /// Cut-in: lateral distance at the start; cut-out: at the end; > 0.
    pub lateral_distance_m: f64,
    /// Cut-out: speed of the vehicle ahead, ≥ 0.
    pub ahead_speed_mps: f64,
    /// Cut-out: gap between the two, ≥ 0.
    pub ahead_gap_m: f64,
    /// Length of every vehicle but the ego, > 0.
    pub length_m: f64,
    /// Width of every vehicle but the ego, > 0.
    pub width_m: f64,
    /// Length of the ego, > 0.
    pub ego_length_m: f64,
    /// Width of the ego, > 0.
    pub ego_width_m: f64,
    /// Width of the lanes, > 0.
    pub lane_width_m: f64,
    /// Duration, s, > 0; afterwards speed and lateral position are held. `None`: all motions run to their ends.
    pub duration_s: Option<f64>,
}

impl PlainCase {
    /// Returns the case; no event is later than `time_cap_s`.
    ///
    /// # Errors
    /// [`Error::Usage`] if speed, acceleration and end speed contradict one another, or if the acceleration contradicts
    /// the category.
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
            ego_length_m: self.ego_length_m,
            ego_width_m: self.ego_width_m,
            lane_width_m: self.lane_width_m,
            ego_speed_mps: self.ego_speed_mps,
            principal: participant(speed, lateral),
            ahead,
            horizon_s: self.duration_s.unwrap_or(until_s.max(change_s)).min(time_cap_s),
        })
    }

    /// Speed of the other vehicle when its acceleration ends, m/s; no event is later than `time_cap_s`.
    ///
    /// # Errors
    /// As [`PlainCase::case`].
    pub(crate) fn last_speed_mps(&self, time_cap_s: f64) -> Result<f64> {
        let until_s = self.acceleration_until_s(time_cap_s)?.min(time_cap_s);
        Ok((self.speed_mps + self.acceleration_mps2 * until_s).max(0.0))
    }

    fn acceleration_until_s(&self, time_cap_s: f64) -> Result<f64> {
        self.check_speeds()?;
        let (from_mps, to_mps) = (self.speed_mps, self.end_speed_mps.unwrap_or(0.0));
        let until_s = match (self.acceleration_mps2, self.end_speed_mps) {
            (0.0, _) => 0.0,
            (a, None) if a > 0.0 => time_cap_s,
            (a, _) => (to_mps - from_mps) / a,
        };
        Ok(until_s.min(self.duration_s.unwrap_or(f64::INFINITY)))
    }

    /// Checks that the acceleration leads from the initial to the end speed, and that the leader of an LVD does not
    /// accelerate.
    fn check_speeds(&self) -> Result<()> {
        let (acceleration, from_mps) = (self.acceleration_mps2, self.speed_mps);
        let wrong = |key: &str, problem: String, help: &str| Err(Error::usage(Place::item(key), problem, help));
        if self.category == Category::Lvd && acceleration > 0.0 {
            let problem = format!("{acceleration} m/s² would make the leader of an LVD faster");
            return wrong("acceleration", problem, "a deceleration is negative; give a number of at most 0");
        }
        let Some(end_mps) = self.end_speed_mps else { return Ok(()) };
        let (change_mps, from, end) = (end_mps - from_mps, value(from_mps), value(end_mps));
        if acceleration == 0.0 && change_mps != 0.0 {
            let problem = format!("{end} m/s cannot be reached from {from} m/s without an acceleration");
            return wrong("end_speed", problem, "give an acceleration too, or leave the end speed out");
        }
        if acceleration != 0.0 && change_mps == 0.0 {
            let problem = format!("{end} m/s is the initial speed: {acceleration} m/s² would have no effect");
            return wrong("end_speed", problem, "change the end speed, or leave out the acceleration");
        }
        if acceleration * change_mps < 0.0 {
            let problem = format!("{end} m/s cannot be reached from {from} m/s with {acceleration} m/s²");
            return wrong("end_speed", problem, "change the sign of the acceleration or the end speed");
        }
        Ok(())
    }

    /// The lateral motion and its duration, s.
    fn lateral(&self) -> (Lateral, f64) {
        let (rate_mps, distance_m) = (self.lateral_speed_mps, self.lateral_distance_m);
        let covered_m = distance_m.min(rate_mps * self.duration_s.unwrap_or(f64::INFINITY));
        let change_s = if rate_mps > 0.0 { covered_m / rate_mps } else { 0.0 };
        let lateral = match self.category {
            Category::Lvd => return (Lateral::Centred, 0.0),
            // Without lateral speed a kinematic change would be over at once.
            Category::CutIn if rate_mps <= 0.0 => {
                Lateral::Sampled { position_m: vec![distance_m], towards_mps: vec![0.0] }
            }
            Category::CutOut if rate_mps <= 0.0 => Lateral::Centred,
            Category::CutIn => {
                Lateral::Kinematic { start_m: distance_m, rate_mps: -rate_mps, end_m: distance_m - covered_m }
            }
            Category::CutOut => Lateral::Kinematic { start_m: 0.0, rate_mps, end_m: covered_m },
        };
        (lateral, change_s)
    }
}

/// Refuses a time headway for an ego at rest, because it defines no distance.
///
/// # Errors
/// [`Error::Usage`].
pub fn check_headway(ego_speed_mps: f64, thw_s: Option<f64>) -> Result<()> {
    match thw_s {
        Some(thw_s) if ego_speed_mps == 0.0 => Err(Error::usage(
            Place::item("thw"),
            format!("{thw_s} s of an ego at rest is no distance"),
            "give the initial gap in metres, or a speed of the ego above 0",
        )),
        _ => Ok(()),
    }
}
