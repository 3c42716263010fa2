//! Lengths and widths of a lane's vehicles. A lane knows the ego's width and half the sums of two lengths: where the
//! lengths themselves are not told, they are chosen so that the sums, and with them every gap and contact, stay.

use crate::engine::LaneCase;
use crate::scenario::parameterization::{Sizes, VehicleSize};
use crate::{Error, Place, Result};

/// Sizes of a lane's vehicles and where they come from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnownSizes {
    /// The sizes.
    pub sizes: Sizes,
    /// The lengths are of the scenario; otherwise only their sums are.
    pub are_lengths_known: bool,
}

/// Most that told sizes may differ from the lane's, m: the rounding of binary32.
const TOLERANCE_M: f64 = 1e-3;

/// The sizes of a case's vehicles: those told, where they are the lane's; otherwise an ego of `ego_length_m`, or
/// shorter where the sums leave no more.
///
/// # Errors
/// [`Error::Input`] where the sizes told are not those of the lane.
pub fn sizes_of_case(lane: &str, case: &LaneCase<f64>, told: Option<&Sizes>, ego_length_m: f64) -> Result<KnownSizes> {
    let is_pair = case.pair != 0;
    let sums = |of: fn(&crate::engine::LaneOther<f64>) -> f64| case.others.each_ref().map(|o| 2.0 * of(o));
    let (lengths, widths) = (sums(|o| o.half_lengths), sums(|o| o.half_widths));
    let Some(told) = told else {
        let shortest = if is_pair { lengths[0].min(lengths[1]) } else { lengths[0] };
        // Every vehicle has a length.
        let ego = ego_length_m.min(shortest / 2.0);
        let size = |at: usize| VehicleSize { length_m: lengths[at] - ego, width_m: widths[at] - case.ego_width };
        let sizes = Sizes {
            ego: VehicleSize { length_m: ego, width_m: case.ego_width },
            target: size(0),
            lead: is_pair.then(|| size(1)),
        };
        return Ok(KnownSizes { sizes, are_lengths_known: false });
    };
    let others = [Some(told.target), told.lead.filter(|_| is_pair)];
    let mut pairs = vec![("width of the ego", told.ego.width_m, case.ego_width)];
    for (at, other) in others.iter().enumerate().filter_map(|(at, other)| Some((at, other.as_ref()?))) {
        pairs.push(("sum of two lengths", told.ego.length_m + other.length_m, lengths[at]));
        pairs.push(("sum of two widths", told.ego.width_m + other.width_m, widths[at]));
    }
    if let Some((what, told, lane_has)) = pairs.iter().find(|(_, a, b)| (a - b).abs() > TOLERANCE_M) {
        let problem = format!("the {what} is {told} m by the scenarios and {lane_has} m in the run");
        let help =
            "give the scenario file of the run (option `scenarios`), or leave it out: every gap and contact stays";
        return Err(Error::input(Place::item(format!("lane {lane}")), problem, help));
    }
    if is_pair && told.lead.is_none() {
        let help = "give the scenario file of the run (option `scenarios`), or leave it out";
        return Err(Error::input(Place::item(format!("lane {lane}")), "the vehicle ahead has no size", help));
    }
    Ok(KnownSizes { sizes: *told, are_lengths_known: true })
}
