//! Cut-out a–d: speeds constant or with constant accelerations, the lane change at constant lateral speed
//! or instantaneous. The gap D to the vehicle ahead stays.

use super::options::ParameterizationOptions;
use super::series::{accelerated, lateral_speed};
use super::vehicle_ahead;
use crate::scenario::{Ahead, Case, Category, Lateral, Participant, Scenario, Speed};
use crate::{Error, Result};

pub fn case(key: &str, scenario: &Scenario, options: &ParameterizationOptions) -> Result<Case> {
    let target = &scenario.target;
    let (lead, gap_m) = vehicle_ahead(scenario)?;
    let duration_s = scenario.duration_s();
    let end_m = options.lane_change_m;
    let rate_mps = lateral_speed(scenario, options);
    let moving = Lateral::Kinematic { start_m: 0.0, rate_mps, end_m };
    let gone = Lateral::Kinematic { start_m: end_m, rate_mps: 0.0, end_m };
    let change_s = end_m / rate_mps;
    let constant = (Speed::constant(target.v[0]), Speed::constant(lead.v[0]));
    let changing = (accelerated(target, duration_s, options), accelerated(lead, duration_s, options));
    let ((speed, lead_speed), lateral, horizon_s) = match key {
        "a" => (constant, moving, change_s),
        "b" => (changing, moving, change_s.max(duration_s)),
        "c" => (constant, gone, 0.0),
        "d" => (changing, gone, duration_s),
        _ => return Err(Error::Internal(format!("cut-out parameterization {key} is not kinematic"))),
    };
    Ok(Case {
        category: Category::CutOut,
        ego_length_m: scenario.ego.length,
        ego_width_m: scenario.ego.width,
        ego_speed_mps: scenario.ego.v0,
        principal: Participant { length_m: target.length, width_m: target.width, speed, lateral },
        ahead: Some(Ahead {
            vehicle: Participant {
                length_m: lead.length,
                width_m: lead.width,
                speed: lead_speed,
                lateral: Lateral::Centred,
            },
            gap_m,
        }),
        horizon_s,
    })
}
