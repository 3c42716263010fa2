//! Cut-in 1–4: the cutter's speed constant or with constant acceleration, its lane change at constant
//! lateral speed or instantaneous.

use super::Sizes;
use super::options::{LateralStart, ParameterizationOptions};
use super::series::{accelerated, lateral_speed, mean_acceleration};
use crate::scenario::{Case, Category, Lateral, Participant, Scenario, Speed};
use crate::{Error, Result};

/// What describes a kinematic cut-in; 1, 3 and 4 use a part of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CutInParameters {
    /// Speed of the cutter at t = 0, m/s, ≥ 0.
    pub v_target_mps: f64,
    /// 2, 4: its acceleration over [0, T], m/s².
    pub acceleration_target_mps2: f64,
    /// 1, 2: size of its lateral speed, m/s, > 0; `None` where the parameterization has none.
    pub lateral_speed_mps: Option<f64>,
    /// 1, 2: lateral distance from which it comes, m, > 0.
    pub start_m: f64,
    /// Speed of the ego, m/s, ≥ 0.
    pub v_ego_mps: f64,
    /// 2, 4: T, s, ≥ 0.
    pub duration_s: f64,
}

impl CutInParameters {
    /// Those of a mined scenario.
    pub fn of(scenario: &Scenario, options: &ParameterizationOptions) -> Self {
        let target = &scenario.target;
        let duration_s = scenario.duration_s();
        CutInParameters {
            v_target_mps: target.v[0],
            acceleration_target_mps2: mean_acceleration(target, duration_s),
            lateral_speed_mps: Some(lateral_speed(scenario, options)),
            start_m: match options.lateral_start {
                LateralStart::LaneWidth => options.lane_change_m,
                LateralStart::Recorded => target.y[0].abs(),
            },
            v_ego_mps: scenario.ego.v0,
            duration_s,
        }
    }

    /// The case under the parameterization `key`.
    ///
    /// # Errors
    /// [`Error::Internal`] for 1 or 2 without a lateral speed, and for another key.
    pub fn case(&self, key: &str, sizes: &Sizes, options: &ParameterizationOptions) -> Result<Case> {
        let CutInParameters { start_m, lateral_speed_mps, duration_s, .. } = *self;
        let changes_lane = || -> Result<(Lateral, f64)> {
            let missing = || Error::Internal(format!("cut-in {key} has no lateral speed"));
            let speed_mps = lateral_speed_mps.ok_or_else(missing)?;
            Ok((Lateral::Kinematic { start_m, rate_mps: -speed_mps, end_m: 0.0 }, start_m / speed_mps))
        };
        let constant = Speed::constant(self.v_target_mps);
        let changing = accelerated(self.v_target_mps, self.acceleration_target_mps2, duration_s, options);
        let (speed, lateral, horizon_s) = match key {
            "1" => {
                let (moving, change_s) = changes_lane()?;
                (constant, moving, change_s)
            }
            "2" => {
                let (moving, change_s) = changes_lane()?;
                (changing, moving, change_s.max(duration_s))
            }
            "3" => (constant, Lateral::Centred, 0.0),
            "4" => (changing, Lateral::Centred, duration_s),
            _ => return Err(Error::Internal(format!("cut-in parameterization {key} is not kinematic"))),
        };
        let Sizes { ego, target, .. } = sizes;
        Ok(Case {
            category: Category::CutIn,
            ego_length_m: ego.length_m,
            ego_width_m: ego.width_m,
            ego_speed_mps: self.v_ego_mps,
            principal: Participant { length_m: target.length_m, width_m: target.width_m, speed, lateral },
            ahead: None,
            horizon_s,
        })
    }
}
