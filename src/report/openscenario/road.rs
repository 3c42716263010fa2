//! The road of a scenario as ASAM OpenDRIVE 1.7: straight and level, with as many equal lanes as the vehicles need, all
//! in the ego's direction.

use super::DATE;
use super::concrete::{Concrete, number};
use crate::records::PROGRAM;

/// A straight road along x. The middle of the ego's lane is y = 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Road {
    /// Start, m.
    pub start_m: f64,
    /// Length, m.
    pub length_m: f64,
    /// Width of every lane, m.
    pub lane_width_m: f64,
    /// Lanes to the left of the ego's.
    pub left_lanes: u32,
    /// Lanes to the right of the ego's.
    pub right_lanes: u32,
}

/// Road before the first vehicle and after the last, m.
const MARGIN_M: f64 = 100.0;

/// Additional road for an external ego that continues, m.
const BEYOND_M: f64 = 500.0;

/// Maximum number of lanes on one side; vehicles farther out are beside the road.
const MAX_LANES: u32 = 20;

impl Road {
    /// The road that contains every vertex of every vehicle.
    pub(super) fn around(scenario: &Concrete) -> Road {
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
        let start_m = (first - MARGIN_M).floor();
        let width = scenario.lane_width_m;
        // At least one lane on each side, for vehicles that cut in or out.
        let lanes = |reach_m: f64| ((reach_m / width - 0.5).ceil().max(1.0) as u32).min(MAX_LANES);
        Road {
            start_m,
            length_m: (last + MARGIN_M + BEYOND_M).ceil() - start_m,
            lane_width_m: width,
            left_lanes: lanes(left),
            right_lanes: lanes(right),
        }
    }

    /// Lateral position of the reference line, m: the left edge.
    fn reference_y_m(&self) -> f64 {
        (f64::from(self.left_lanes) + 0.5) * self.lane_width_m
    }
}

/// The road's file.
pub(super) fn road_file(road: &Road) -> String {
    let (lanes, top_m) = (road.left_lanes + 1 + road.right_lanes, road.reference_y_m());
    let (north, west) = (number(top_m), number(road.start_m));
    let lane_of =
        |at: u32| lane(&format!("-{at}"), Some(road.lane_width_m), if at == lanes { "solid" } else { "broken" });
    format!(
        r#"<?xml version="1.0" encoding="UTF-8"?>
<OpenDRIVE>
  <header revMajor="1" revMinor="7" name="straight road" version="1.00" date="{DATE}" {extent} vendor="{PROGRAM}"/>
  <road name="straight" length="{length}" id="1" junction="-1" rule="RHT">
    <type s="0" type="motorway"/>
    <planView>
      <geometry s="0" x="{west}" y="{north}" hdg="0" length="{length}">
        <line/>
      </geometry>
    </planView>
    <lanes>
      <laneSection s="0">
        <center>
{edge}        </center>
        <right>
{lanes}        </right>
      </laneSection>
    </lanes>
  </road>
</OpenDRIVE>
"#,
        extent = format_args!(
            "north=\"{north}\" south=\"{}\" east=\"{}\" west=\"{west}\"",
            number(top_m - f64::from(lanes) * road.lane_width_m),
            number(road.start_m + road.length_m),
        ),
        length = number(road.length_m),
        edge = lane("0", None, "solid"),
        lanes = (1..=lanes).map(lane_of).collect::<String>(),
    )
}

/// A lane with the line at its right; for the centre lane, at the road's left edge.
fn lane(id: &str, width_m: Option<f64>, line: &str) -> String {
    let kind = if width_m.is_some() { "driving" } else { "none" };
    let width = width_m.map_or(String::new(), |width_m| {
        format!("            <width sOffset=\"0\" a=\"{}\" b=\"0\" c=\"0\" d=\"0\"/>\n", number(width_m))
    });
    format!(
        r#"          <lane id="{id}" type="{kind}" level="false">
{width}            <roadMark sOffset="0" type="{line}" weight="standard" color="standard" width="0.15"/>
          </lane>
"#
    )
}
