//! Cut-out a–d: speeds constant or with constant accelerations, the lane change at constant lateral speed
//! or instantaneous. The gap D to the vehicle ahead stays.

use super::options::ParameterizationOptions;
use super::series::{accelerated, lateral_speed, mean_acceleration};
use super::{Sizes, lead_size, vehicle_ahead};
use crate::scenario::{Ahead, Case, Category, Lateral, Participant, Scenario, Speed};
use crate::{Error, Result};

/// What describes a kinematic cut-out; a, c and d use a part of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CutOutParameters {
    /// Speed of the cutting-out vehicle at t = 0, m/s, ≥ 0.
    pub v_target_mps: f64,
    /// b, d: its acceleration over [0, T], m/s².
    pub acceleration_target_mps2: f64,
    /// a, b: size of its lateral speed, m/s, > 0; `None` where the parameterization has none.
    pub lateral_speed_mps: Option<f64>,
    /// Speed of the ego, m/s, ≥ 0.
    pub v_ego_mps: f64,
    /// Speed of the vehicle ahead at t = 0, m/s, ≥ 0.
    pub v_lead_mps: f64,
    /// b, d: its acceleration over [0, T], m/s².
    pub acceleration_lead_mps2: f64,
    /// D: gap between the two at t = 0, m.
    pub gap_lead_m: f64,
    /// b, d: T, s, ≥ 0.
    pub duration_s: f64,
}

impl CutOutParameters {
    /// Those of a mined scenario; an error for one without the vehicle ahead.
    pub fn of(scenario: &Scenario, options: &ParameterizationOptions) -> Result<Self> {
        let (lead, gap_lead_m) = vehicle_ahead(scenario)?;
        let target = &scenario.target;
        let duration_s = scenario.duration_s();
        Ok(CutOutParameters {
            v_target_mps: target.v[0],
            acceleration_target_mps2: mean_acceleration(target, duration_s),
            lateral_speed_mps: Some(lateral_speed(scenario, options)),
            v_ego_mps: scenario.ego.v0,
            v_lead_mps: lead.v[0],
            acceleration_lead_mps2: mean_acceleration(lead, duration_s),
            gap_lead_m,
            duration_s,
        })
    }

    /// The case under the parameterization `key`.
    ///
    /// # Errors
    /// [`Error::Internal`] for a or b without a lateral speed, and for another key; [`Error::Input`] without the size of
    /// the vehicle ahead.
    pub fn case(&self, key: &str, sizes: &Sizes, options: &ParameterizationOptions) -> Result<Case> {
        let CutOutParameters { v_target_mps, lateral_speed_mps, v_lead_mps, duration_s, .. } = *self;
        let end_m = options.lane_change_m;
        let changes_lane = || -> Result<(Lateral, f64)> {
            let missing = || Error::Internal(format!("cut-out {key} has no lateral speed"));
            let speed_mps = lateral_speed_mps.ok_or_else(missing)?;
            Ok((Lateral::Kinematic { start_m: 0.0, rate_mps: speed_mps, end_m }, end_m / speed_mps))
        };
        let gone = Lateral::Kinematic { start_m: end_m, rate_mps: 0.0, end_m };
        let constant = (Speed::constant(v_target_mps), Speed::constant(v_lead_mps));
        let changing = (
            accelerated(v_target_mps, self.acceleration_target_mps2, duration_s, options),
            accelerated(v_lead_mps, self.acceleration_lead_mps2, duration_s, options),
        );
        let ((speed, lead_speed), lateral, horizon_s) = match key {
            "a" => {
                let (moving, change_s) = changes_lane()?;
                (constant, moving, change_s)
            }
            "b" => {
                let (moving, change_s) = changes_lane()?;
                (changing, moving, change_s.max(duration_s))
            }
            "c" => (constant, gone, 0.0),
            "d" => (changing, gone, duration_s),
            _ => return Err(Error::Internal(format!("cut-out parameterization {key} is not kinematic"))),
        };
        let Sizes { ego, target, .. } = sizes;
        let lead = lead_size(sizes)?;
        Ok(Case {
            category: Category::CutOut,
            ego_length_m: ego.length_m,
            ego_width_m: ego.width_m,
            ego_speed_mps: self.v_ego_mps,
            principal: Participant { length_m: target.length_m, width_m: target.width_m, speed, lateral },
            ahead: Some(Ahead {
                vehicle: Participant {
                    length_m: lead.length_m,
                    width_m: lead.width_m,
                    speed: lead_speed,
                    lateral: Lateral::Centred,
                },
                gap_m: self.gap_lead_m,
            }),
            horizon_s,
        })
    }
}
