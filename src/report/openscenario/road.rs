//! The road of a scenario as ASAM OpenDRIVE 1.7: straight and level, with as many equal lanes as the vehicles need, all
//! in the ego's direction.

use super::concrete::Concrete;
use super::elements::{Elements, number};
use super::{AUTHOR, DATE};
use crate::Result;

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

/// Builds the road's file.
///
/// # Errors
/// None for finite numbers.
pub(super) fn road_file(road: &Road) -> Result<Vec<u8>> {
    let text = |text: &str| text.to_owned();
    let mut xml = Elements::new()?;
    let lanes = road.left_lanes + 1 + road.right_lanes;
    let top = road.reference_y_m();
    xml.open("OpenDRIVE", vec![])?;
    xml.empty(
        "header",
        vec![
            ("revMajor", text("1")),
            ("revMinor", text("7")),
            ("name", text("straight road")),
            ("version", text("1.00")),
            ("date", text(DATE)),
            ("north", number(top)),
            ("south", number(top - f64::from(lanes) * road.lane_width_m)),
            ("east", number(road.start_m + road.length_m)),
            ("west", number(road.start_m)),
            ("vendor", text(AUTHOR)),
        ],
    )?;
    let length = number(road.length_m);
    xml.open(
        "road",
        vec![
            ("name", text("straight")),
            ("length", length.clone()),
            ("id", text("1")),
            ("junction", text("-1")),
            ("rule", text("RHT")),
        ],
    )?;
    xml.empty("type", vec![("s", text("0")), ("type", text("motorway"))])?;
    xml.open("planView", vec![])?;
    xml.open(
        "geometry",
        vec![("s", text("0")), ("x", number(road.start_m)), ("y", number(top)), ("hdg", text("0")), ("length", length)],
    )?;
    xml.empty("line", vec![])?;
    xml.close()?;
    xml.close()?;
    xml.open("lanes", vec![])?;
    xml.open("laneSection", vec![("s", text("0"))])?;
    xml.open("center", vec![])?;
    lane(&mut xml, 0, None, "solid")?;
    xml.close()?;
    xml.open("right", vec![])?;
    for at in 1..=lanes {
        lane(&mut xml, at, Some(road.lane_width_m), if at == lanes { "solid" } else { "broken" })?;
    }
    xml.finish()
}

/// A lane with the line at its right; for the centre lane, at the road's left edge.
fn lane(xml: &mut Elements, at: u32, width_m: Option<f64>, line: &str) -> Result<()> {
    let text = |text: &str| text.to_owned();
    let kind = if width_m.is_some() { "driving" } else { "none" };
    let id = if at == 0 { text("0") } else { format!("-{at}") };
    xml.open("lane", vec![("id", id), ("type", text(kind)), ("level", text("false"))])?;
    if let Some(width) = width_m {
        let zero = || text("0");
        xml.empty(
            "width",
            vec![("sOffset", zero()), ("a", number(width)), ("b", zero()), ("c", zero()), ("d", zero())],
        )?;
    }
    xml.empty(
        "roadMark",
        vec![
            ("sOffset", text("0")),
            ("type", text(line)),
            ("weight", text("standard")),
            ("color", text("standard")),
            ("width", text("0.15")),
        ],
    )?;
    xml.close()
}
