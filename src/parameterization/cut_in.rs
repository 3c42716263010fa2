//! Cut-in 1–4: the cutter's speed constant or with constant acceleration, its lane change at constant
//! lateral speed or instantaneous.

use super::options::{LateralStart, ParameterizationOptions};
use super::series::{accelerated, lateral_speed};
use crate::scenario::{Case, Category, Lateral, Participant, Scenario, Speed};
use crate::{Error, Result};

pub fn case(key: &str, scenario: &Scenario, options: &ParameterizationOptions) -> Result<Case> {
    let target = &scenario.target;
    let duration_s = scenario.duration_s();
    let start_m = match options.lateral_start {
        LateralStart::LaneWidth => options.lane_change_m,
        LateralStart::Recorded => target.y[0].abs(),
    };
    let rate_mps = lateral_speed(scenario, options);
    let moving = Lateral::Kinematic { start_m, rate_mps: -rate_mps, end_m: 0.0 };
    let change_s = start_m / rate_mps;
    let constant = Speed::constant(target.v[0]);
    let changing = accelerated(target, duration_s, options);
    let (speed, lateral, horizon_s) = match key {
        "1" => (constant, moving, change_s),
        "2" => (changing, moving, change_s.max(duration_s)),
        "3" => (constant, Lateral::Centred, 0.0),
        "4" => (changing, Lateral::Centred, duration_s),
        _ => return Err(Error::Internal(format!("cut-in parameterization {key} is not kinematic"))),
    };
    Ok(Case {
        category: Category::CutIn,
        ego_length_m: scenario.ego.length,
        ego_width_m: scenario.ego.width,
        ego_speed_mps: scenario.ego.v0,
        principal: Participant { length_m: target.length, width_m: target.width, speed, lateral },
        ahead: None,
        horizon_s,
    })
}
