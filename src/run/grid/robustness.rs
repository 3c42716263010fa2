//! Robust verdicts: does a verdict survive a tenth of the time step, a centimetre of gap, a tenth of a kilometre per hour? A case
//! whose verdict does not is *undecided*: rounding decides it, or a measurement would have to be better than it is.

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
    /// A tenth of the time step, in binary64: what steps and rounding decide. Half a step would keep half of the error of
    /// whole steps, and round a delay as the step itself does.
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

    /// What it is, in words.
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

    /// What is added to the initial gap, m.
    pub fn gap_m(self) -> f64 {
        match self {
            Perturbation::GapMore => GAP_M,
            Perturbation::GapLess => -GAP_M,
            _ => 0.0,
        }
    }

    /// The profile that the changed case runs under.
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

    /// Is the changed case computed in binary64, whatever the sweep computes in?
    pub fn is_binary64(self) -> bool {
        self == Perturbation::FinerStep
    }

    /// The same point with other speeds; a vehicle without a speed of its own has the ego's. A speed stays where its change
    /// would make the case a contradiction.
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
        // Beyond its end speed, or with a headway at rest, it would be no case.
        let is_no_case = match quantity {
            MapQuantity::EgoSpeed => to_mps == 0.0,
            _ => point.get(MapQuantity::EndSpeed).is_some_and(|end| (from_mps - end) * (to_mps - end) <= 0.0),
        };
        if is_no_case { point } else { point.with(quantity, to_mps) }
    }

    /// The same point with another gap or other speeds; a time headway becomes longer or shorter by the centimetre.
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

/// The profile under which Reg157 never reacts: the ego keeps its speed. What collides there is a conflict.
pub fn without_reaction(profile: &Profile) -> Profile {
    let mut without = profile.clone();
    without.reg157.always_unsafe.clear();
    // No vehicle overlaps the ego so far across the road.
    without.reg157.lateral_gate_m = -100.0;
    // The delays of a driver that never reacts bound no time step.
    (without.reg157.reaction_time_s, without.reg157.visible_lateral_movement_s) = (0.0, 0.0);
    without.reg157.margin_s = 10.0;
    without
}
