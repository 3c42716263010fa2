//! Robust verdicts: whether a verdict is unchanged by a tenth of the time step, 1 cm of gap, or 0.1 km/h of speed. If
//! not, the case is *undecided*: rounding decides it, or measurements are not accurate enough.

use super::parameter::{MapQuantity, Point};
use crate::Result;
use crate::model::profile::{MAX_STEPS, Profile};

/// Change of the initial gap, m.
pub const GAP_M: f64 = 0.01;
/// Change of a speed, m/s: 0.1 km/h.
pub const SPEED_MPS: f64 = 0.1 / 3.6;

/// A small change of a case or of how it is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Perturbation {
    /// A tenth of the time step, in binary64: shows the effect of steps and rounding. Half a step would keep half of
    /// the step error, and round a delay as the whole step does.
    FinerStep,
    /// One centimetre of initial gap more.
    GapMore,
    /// One centimetre less.
    GapLess,
    /// The ego is 0.1 km/h faster.
    EgoFaster,
    /// The ego is 0.1 km/h slower.
    EgoSlower,
    /// The other vehicle is 0.1 km/h faster.
    OtherFaster,
    /// The other vehicle is 0.1 km/h slower.
    OtherSlower,
}

impl Perturbation {
    /// All, in the order of messages.
    pub const ALL: [Perturbation; 7] = [
        Perturbation::FinerStep,
        Perturbation::GapMore,
        Perturbation::GapLess,
        Perturbation::EgoFaster,
        Perturbation::EgoSlower,
        Perturbation::OtherFaster,
        Perturbation::OtherSlower,
    ];

    /// Description.
    pub fn label(self) -> &'static str {
        match self {
            Perturbation::FinerStep => "a tenth of the time step",
            Perturbation::GapMore => "gap + 1 cm",
            Perturbation::GapLess => "gap - 1 cm",
            Perturbation::EgoFaster => "ego + 0.1 km/h",
            Perturbation::EgoSlower => "ego - 0.1 km/h",
            Perturbation::OtherFaster => "other + 0.1 km/h",
            Perturbation::OtherSlower => "other - 0.1 km/h",
        }
    }

    /// Change of the initial gap, m.
    pub fn gap_m(self) -> f64 {
        match self {
            Perturbation::GapMore => GAP_M,
            Perturbation::GapLess => -GAP_M,
            _ => 0.0,
        }
    }

    /// The profile for the perturbed case.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] for a time step that is too short.
    pub fn profile(self, profile: &Profile) -> Result<Profile> {
        match self {
            Perturbation::FinerStep => {
                let frame = &profile.frame;
                profile.clone().with_dt((frame.dt_s / 10.0).max(frame.time_cap_s / MAX_STEPS).min(frame.dt_s))
            }
            _ => Ok(profile.clone()),
        }
    }

    /// Whether the perturbed case is computed in binary64, independent of the sweep's arithmetic.
    pub fn is_binary64(self) -> bool {
        self == Perturbation::FinerStep
    }

    /// The same point with other speeds; a vehicle without its own speed has the ego's. A speed that would make the
    /// case contradictory stays unchanged.
    pub fn of_speeds(self, mut point: Point) -> Point {
        let ego_mps = point.get(MapQuantity::EgoSpeed).unwrap_or(0.0);
        let (quantity, by_mps) = match self {
            Perturbation::EgoFaster => (MapQuantity::EgoSpeed, SPEED_MPS),
            Perturbation::EgoSlower => (MapQuantity::EgoSpeed, -SPEED_MPS),
            Perturbation::OtherFaster => (MapQuantity::OtherSpeed, SPEED_MPS),
            Perturbation::OtherSlower => (MapQuantity::OtherSpeed, -SPEED_MPS),
            _ => return point,
        };
        let other_mps = point.get(MapQuantity::OtherSpeed).unwrap_or(ego_mps);
        point = point.with(MapQuantity::OtherSpeed, other_mps);
        let from_mps = point.get(quantity).unwrap_or(0.0);
        let to_mps = (from_mps + by_mps).max(0.0);
        // A speed below the end speed, or a headway of a stationary ego, makes the case invalid.
        let is_no_case = match quantity {
            MapQuantity::EgoSpeed => to_mps == 0.0,
            _ => point.get(MapQuantity::EndSpeed).is_some_and(|end| (from_mps - end) * (to_mps - end) <= 0.0),
        };
        if is_no_case { point } else { point.with(quantity, to_mps) }
    }

    /// The same point with another gap or other speeds; a time headway is changed by the time equivalent of 1 cm.
    pub fn of_point(self, point: Point) -> Point {
        let point = self.of_speeds(point);
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
pub fn without_reaction(profile: &Profile) -> Profile {
    let mut without = profile.clone();
    without.reg157.always_unsafe.clear();
    // No lateral gap is below this.
    (without.reg157.lateral_gate_m, without.reg157.lane_intrusion_m) = (-100.0, 0.0);
    // A lane that ends at the cap then still closes in.
    without.frame.end_when_settled = true;
    // The delays of a driver that never reacts do not limit the time step.
    (without.reg157.reaction_time_s, without.reg157.visible_lateral_movement_s) = (0.0, 0.0);
    without.reg157.margin_s = 10.0;
    without
}
