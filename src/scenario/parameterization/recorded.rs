//! S: the scenario as recorded, then the last speeds and the last lateral position held.

use super::series::{TimeGrid, lateral_on_grid, speed_on_grid};
use super::vehicle_ahead;
use crate::Result;
use crate::scenario::{Ahead, Case, Category, Lateral, Other, Participant, Scenario};

/// The case of the recorded scenario on a time grid. Fails for a cut-out without a vehicle ahead.
pub fn recorded_case(scenario: &Scenario, grid: impl Into<TimeGrid>) -> Result<Case> {
    let grid = grid.into();
    let (fps, duration_s) = (scenario.fps, scenario.duration_s());
    let speed = |other: &Other| speed_on_grid(&other.v, fps, duration_s, grid);
    let target = &scenario.target;
    let lateral = if scenario.category == Category::Lvd {
        Lateral::Centred
    } else {
        let (position_m, towards_mps) = lateral_on_grid(&target.y, fps, duration_s, grid);
        Lateral::Sampled { position_m, towards_mps }
    };
    let ahead = match scenario.category {
        Category::CutOut => {
            let (lead, gap_m) = vehicle_ahead(scenario)?;
            let vehicle = Participant {
                length_m: lead.length,
                width_m: lead.width,
                speed: speed(lead),
                lateral: Lateral::Centred,
            };
            Some(Ahead { vehicle, gap_m })
        }
        Category::CutIn | Category::Lvd => None,
    };
    Ok(Case {
        category: scenario.category,
        ego_length_m: scenario.ego.length,
        ego_width_m: scenario.ego.width,
        // In LVD the ego starts at the leader's speed, in S as well.
        ego_speed_mps: if scenario.category == Category::Lvd { target.v[0].max(0.0) } else { scenario.ego.v0 },
        principal: Participant { length_m: target.length, width_m: target.width, speed: speed(target), lateral },
        ahead,
        horizon_s: duration_s,
    })
}
