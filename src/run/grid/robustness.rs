//! Robust verdicts: whether a verdict is unchanged by a tenth of the time step and by a measurement error of each input
//! ([`VARIED`]). If not, the case is *undecided*: rounding decides it, or measurements are not accurate enough.

use super::parameter::{MapQuantity, PARAMETERS, Point};
use crate::Result;
use crate::model::profile::{MAX_STEPS, Profile};
use crate::scenario::Category;

/// Change of a gap, a lateral distance, a width or a length, m.
pub(crate) const GAP_M: f64 = 0.01;
/// Change of a speed along the road, m/s: 0.1 km/h.
pub(crate) const SPEED_MPS: f64 = 0.1 / 3.6;
/// Change of a lateral speed, m/s.
const LATERAL_SPEED_MPS: f64 = 0.01;
/// Change of a deceleration, m/s².
const DECELERATION_MPS2: f64 = 0.05;
/// The changes in words; a case has those of its inputs.
pub const VARIED: &str = "a tenth of the time step; 0.1 km/h of a speed along the road; 0.01 m/s of the lateral speed; 0.05 m/s² of a \
                          deceleration; 1 cm of a gap, of the lateral distance, of the lane's width or of a vehicle's size";

/// An input that varies.
#[derive(Debug, PartialEq)]
pub struct Variation {
    quantity: MapQuantity,
    /// SI units.
    by: f64,
    more: &'static str,
    less: &'static str,
}

const fn variation(quantity: MapQuantity, by: f64, more: &'static str, less: &'static str) -> Variation {
    Variation { quantity, by, more, less }
}

const VARIATIONS: [Variation; 14] = [
    variation(MapQuantity::Gap, GAP_M, "gap + 1 cm", "gap - 1 cm"),
    variation(MapQuantity::EgoSpeed, SPEED_MPS, "ego + 0.1 km/h", "ego - 0.1 km/h"),
    variation(MapQuantity::OtherSpeed, SPEED_MPS, "other + 0.1 km/h", "other - 0.1 km/h"),
    variation(MapQuantity::LateralSpeed, LATERAL_SPEED_MPS, "lateral speed + 0.01 m/s", "lateral speed - 0.01 m/s"),
    variation(MapQuantity::LateralDistance, GAP_M, "lateral distance + 1 cm", "lateral distance - 1 cm"),
    variation(MapQuantity::Deceleration, DECELERATION_MPS2, "deceleration + 0.05 m/s²", "deceleration - 0.05 m/s²"),
    variation(MapQuantity::EndSpeed, SPEED_MPS, "end speed + 0.1 km/h", "end speed - 0.1 km/h"),
    variation(MapQuantity::AheadSpeed, SPEED_MPS, "vehicle ahead + 0.1 km/h", "vehicle ahead - 0.1 km/h"),
    variation(MapQuantity::AheadGap, GAP_M, "gap of the vehicle ahead + 1 cm", "gap of the vehicle ahead - 1 cm"),
    variation(MapQuantity::Length, GAP_M, "length + 1 cm", "length - 1 cm"),
    variation(MapQuantity::Width, GAP_M, "width + 1 cm", "width - 1 cm"),
    variation(MapQuantity::EgoLength, GAP_M, "ego's length + 1 cm", "ego's length - 1 cm"),
    variation(MapQuantity::EgoWidth, GAP_M, "ego's width + 1 cm", "ego's width - 1 cm"),
    variation(MapQuantity::LaneWidth, GAP_M, "lane's width + 1 cm", "lane's width - 1 cm"),
];

/// A small change of a case or of how it is computed. The changes of inputs have the size of a usual measurement error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Perturbation {
    /// A tenth of the time step, in binary64: shows the effect of steps and rounding. Half a step would keep half of
    /// the step error, and round a delay as the whole step does.
    FinerStep,
    /// More of an input.
    More(&'static Variation),
    /// Less of it.
    Less(&'static Variation),
}

impl Perturbation {
    /// All that a category has, in the order of messages.
    pub(crate) fn all(category: Category) -> Vec<Perturbation> {
        let has = |of: &&Variation| {
            PARAMETERS.iter().any(|known| known.quantity == of.quantity && known.categories.contains(&category))
        };
        let varied = VARIATIONS.iter().filter(has);
        let both = varied.flat_map(|of| [Perturbation::More(of), Perturbation::Less(of)]);
        std::iter::once(Perturbation::FinerStep).chain(both).collect()
    }

    /// Description.
    pub(crate) fn label(self) -> &'static str {
        match self {
            Perturbation::FinerStep => "a tenth of the time step",
            Perturbation::More(of) => of.more,
            Perturbation::Less(of) => of.less,
        }
    }

    /// The quantity that changes, and by how much in SI units; `None` for the time step.
    fn change(self) -> Option<(MapQuantity, f64)> {
        match self {
            Perturbation::FinerStep => None,
            Perturbation::More(of) => Some((of.quantity, of.by)),
            Perturbation::Less(of) => Some((of.quantity, -of.by)),
        }
    }

    /// Whether it changes a size or a place across the road, which the JRC's cases fix.
    pub(super) fn is_of_geometry(self) -> bool {
        use MapQuantity::{EgoLength, EgoWidth, LaneWidth, LateralDistance, Length, Width};
        let fixed = [LateralDistance, Length, Width, EgoLength, EgoWidth, LaneWidth];
        self.change().is_some_and(|(quantity, _)| fixed.contains(&quantity))
    }

    /// Change of the initial gap, m.
    pub(crate) fn gap_m(self) -> f64 {
        self.change().filter(|(quantity, _)| *quantity == MapQuantity::Gap).map_or(0.0, |(_, by_m)| by_m)
    }

    /// The profile for the perturbed case.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] for a time step that is too short.
    pub(crate) fn profile(self, profile: &Profile) -> Result<Profile> {
        match self {
            Perturbation::FinerStep => {
                let frame = &profile.frame;
                profile.clone().with_dt((frame.dt_s / 10.0).max(frame.time_cap_s / MAX_STEPS).min(frame.dt_s))
            }
            _ => Ok(profile.clone()),
        }
    }

    /// Whether the perturbed case is computed in binary64, independent of the sweep's arithmetic.
    pub(super) fn is_binary64(self) -> bool {
        self == Perturbation::FinerStep
    }

    /// The same point with another value of an input, except the gap. An input that the point does not have, and a
    /// value that would make the case contradictory, stay as they are.
    pub(super) fn of_inputs(self, mut point: Point) -> Point {
        let Some((quantity, by)) = self.change().filter(|(quantity, _)| *quantity != MapQuantity::Gap) else {
            return point;
        };
        if let Some(other_mps) = point.value(MapQuantity::OtherSpeed) {
            point = point.with(MapQuantity::OtherSpeed, other_mps);
        }
        let Some(from) = point.value(quantity) else { return point };
        let to = from + by;
        let end_mps = point.get(MapQuantity::EndSpeed);
        let crosses = |speed_mps: Option<f64>, from, to| speed_mps.is_some_and(|at| (from - at) * (to - at) <= 0.0);
        let is_no_case = match quantity {
            // A headway of a stationary ego is no distance.
            MapQuantity::EgoSpeed => to <= 0.0,
            MapQuantity::OtherSpeed => crosses(end_mps, from, to.max(0.0)),
            MapQuantity::EndSpeed => crosses(point.get(MapQuantity::OtherSpeed), from, to.max(0.0)),
            // Without a deceleration, and for its sign.
            MapQuantity::Deceleration => from * to <= 0.0,
            MapQuantity::AheadSpeed | MapQuantity::AheadGap => false,
            _ => to <= 0.0,
        };
        let has_no_sign = quantity != MapQuantity::Deceleration;
        if is_no_case { point } else { point.with(quantity, if has_no_sign { to.max(0.0) } else { to }) }
    }

    /// The same with another gap too; a time headway is changed by the time equivalent of 1 cm.
    pub(crate) fn of_point(self, point: Point) -> Point {
        let point = self.of_inputs(point);
        let ego_mps = point.get(MapQuantity::EgoSpeed).unwrap_or(0.0);
        match (point.get(MapQuantity::Gap), point.get(MapQuantity::Thw)) {
            (Some(gap_m), _) => point.with(MapQuantity::Gap, (gap_m + self.gap_m()).max(0.0)),
            (None, Some(thw_s)) if ego_mps > 0.0 => {
                point.with(MapQuantity::Thw, (thw_s + self.gap_m() / ego_mps).max(0.0))
            }
            _ => point,
        }
    }
}

/// The profile under which Reg157 never reacts: the ego keeps its speed. A collision there is a conflict.
pub(crate) fn without_reaction(profile: &Profile) -> Profile {
    let mut without = profile.clone();
    without.reg157.always_unsafe.clear();
    // No lateral gap is below this.
    (without.reg157.lateral_gate_m, without.reg157.lane_intrusion_m) = (-100.0, 0.0);
    // The delays of a driver that never reacts do not limit the time step.
    (without.reg157.reaction_time_s, without.reg157.visible_lateral_movement_s) = (0.0, 0.0);
    without.reg157.margin_s = 10.0;
    without
}
