//! The road of a scenario as ASAM OpenDRIVE 1.7: straight and level, with as many equal lanes as the vehicles need, all
//! in the ego's direction.

use super::DATE;
use super::concrete::{Concrete, number};
use crate::records::PROGRAM;

/// Road before the first vehicle and after the last, m.
const MARGIN_M: f64 = 100.0;

/// Additional road for an external ego that continues, m.
const BEYOND_M: f64 = 500.0;

/// Maximum number of lanes on one side; vehicles farther out are beside the road.
const MAX_LANES: u32 = 20;

/// The road that contains every vertex of every vehicle, straight along x; the middle of the ego's lane is y = 0.
pub(super) fn road_file(scenario: &Concrete) -> String {
    let (mut first, mut last, mut left, mut right) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
    for vehicle in &scenario.vehicles {
        for vertex in &vehicle.path {
            first = first.min(vertex.x_m - vehicle.length_m);
            last = last.max(vertex.x_m + vehicle.length_m);
            let y_m = scenario.world_y_m(vertex.y_m);
            left = left.max(y_m);
            right = right.max(-y_m);
        }
    }
    let (west_m, width_m) = ((first - MARGIN_M).floor(), scenario.lane_width_m);
    let length_m = (last + MARGIN_M + BEYOND_M).ceil() - west_m;
    // At least one lane on each side, for vehicles that cut in or out.
    let beside = |reach_m: f64| ((reach_m / width_m - 0.5).ceil().max(1.0) as u32).min(MAX_LANES);
    let (left, lanes) = (beside(left), beside(left) + 1 + beside(right));
    // The reference line is the left edge.
    let north_m = (f64::from(left) + 0.5) * width_m;
    let lane = |at: u32| {
        let line = if at == lanes { "solid" } else { "broken" };
        format!(include_str!("../templates/openscenario/lane.xml"), id = at, width = number(width_m), line = line)
    };
    format!(
        include_str!("../templates/openscenario/road.xodr"),
        date = DATE,
        program = PROGRAM,
        north = number(north_m),
        south = number(north_m - f64::from(lanes) * width_m),
        east = number(west_m + length_m),
        west = number(west_m),
        length = number(length_m),
        lanes = (1..=lanes).map(lane).collect::<String>(),
    )
}
