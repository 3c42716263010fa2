//! Robust verdicts: whether a verdict is unchanged by a tenth of the time step and by a measurement error of each input
//! ([`VARIED`]). If not, the case is *undecided*: rounding decides it, or measurements are not accurate enough.

use super::parameter::Point;
use lanesweep_model::profile::{MAX_STEPS, Profile};
use lanesweep_model::scenario::{CaseNumber, CaseQuantity, Category, NUMBERS};
use lanesweep_support::Result;

/// The changes in words; a case has those of its inputs.
pub const VARIED: &str = "a tenth of the time step; 0.1 km/h of a speed along the road; 0.01 m/s of the lateral speed; 0.05 m/s² of a \
                          deceleration; 1 cm of a gap, of the lateral distance, of the lane's width or of a vehicle's size";

/// A small change of a case or of how it is computed. The changes of inputs have the size of a usual measurement error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Perturbation {
    label: &'static str,
    /// The quantity that changes, and by how much in SI units; `None` for the time step.
    change: Option<(CaseQuantity, f64)>,
}

impl Perturbation {
    /// A tenth of the time step, in binary64: shows the effect of steps and rounding. Half a step would keep half of
    /// the step error, and round a delay as the whole step does.
    pub const FINER_STEP: Perturbation = Perturbation { label: "a tenth of the time step", change: None };

    /// All that a category has, in the order of messages.
    pub(crate) fn all(category: Category) -> Vec<Perturbation> {
        // The gap first: it decides most often.
        let ordered = [CaseQuantity::Gap.number()].into_iter();
        let ordered = ordered.chain(NUMBERS.iter().filter(|number| number.quantity != CaseQuantity::Gap));
        let varied = ordered.filter(|number| number.categories.contains(&category));
        let both = varied.filter_map(|&CaseNumber { quantity, error, .. }| {
            let (si, [more, less]) = error?;
            Some([(more, si), (less, -si)].map(|(label, by)| Perturbation { label, change: Some((quantity, by)) }))
        });
        std::iter::once(Perturbation::FINER_STEP).chain(both.flatten()).collect()
    }

    /// Description.
    pub fn label(self) -> &'static str {
        self.label
    }

    /// Whether it changes a size or a place across the road, which the JRC's cases fix.
    pub(super) fn is_of_geometry(self) -> bool {
        self.change.is_some_and(|(quantity, _)| is_size(quantity))
    }

    /// Change of the initial gap, m.
    pub(crate) fn gap_m(self) -> f64 {
        self.change.filter(|(quantity, _)| *quantity == CaseQuantity::Gap).map_or(0.0, |(_, by_m)| by_m)
    }

    /// The profile for the perturbed case.
    ///
    /// # Errors
    /// [`lanesweep_support::Error::Usage`] for a time step that is too short.
    pub(crate) fn profile(self, profile: &Profile) -> Result<Profile> {
        if self.change.is_some() {
            return Ok(profile.clone());
        }
        let frame = &profile.frame;
        profile.clone().with_dt((frame.dt_s / 10.0).max(frame.time_cap_s / MAX_STEPS).min(frame.dt_s))
    }

    /// Whether the perturbed case is computed in binary64, independent of the sweep's arithmetic.
    pub(super) fn is_binary64(self) -> bool {
        self.change.is_none()
    }

    /// The same point with another value of an input, except the gap. An input that the point does not have, and a
    /// value that would make the case contradictory, stay as they are.
    pub(super) fn of_inputs(self, mut point: Point) -> Point {
        let Some((quantity, by)) = self.change.filter(|(quantity, _)| *quantity != CaseQuantity::Gap) else {
            return point;
        };
        if let Some(other_mps) = point.value(CaseQuantity::OtherSpeed) {
            point = point.with(CaseQuantity::OtherSpeed, other_mps);
        }
        let Some(from) = point.value(quantity) else { return point };
        let to = from + by;
        let end_mps = point.get(CaseQuantity::EndSpeed);
        let crosses = |speed_mps: Option<f64>, from, to| speed_mps.is_some_and(|at| (from - at) * (to - at) <= 0.0);
        let is_no_case = match quantity {
            // A headway of a stationary ego is no distance.
            CaseQuantity::EgoSpeed => to <= 0.0,
            CaseQuantity::OtherSpeed => crosses(end_mps, from, to.max(0.0)),
            CaseQuantity::EndSpeed => crosses(point.get(CaseQuantity::OtherSpeed), from, to.max(0.0)),
            // Without a deceleration, and for its sign.
            CaseQuantity::Deceleration => from * to <= 0.0,
            CaseQuantity::AheadSpeed | CaseQuantity::AheadGap => false,
            _ => to <= 0.0,
        };
        let has_no_sign = quantity != CaseQuantity::Deceleration;
        if is_no_case { point } else { point.with(quantity, if has_no_sign { to.max(0.0) } else { to }) }
    }

    /// The same with another gap too; a time headway is changed by the time equivalent of 1 cm.
    pub(crate) fn of_point(self, point: Point) -> Point {
        let point = self.of_inputs(point);
        let ego_mps = point.get(CaseQuantity::EgoSpeed).unwrap_or(0.0);
        match (point.get(CaseQuantity::Gap), point.get(CaseQuantity::Thw)) {
            (Some(gap_m), _) => point.with(CaseQuantity::Gap, (gap_m + self.gap_m()).max(0.0)),
            (None, Some(thw_s)) if ego_mps > 0.0 => {
                point.with(CaseQuantity::Thw, (thw_s + self.gap_m() / ego_mps).max(0.0))
            }
            _ => point,
        }
    }
}

/// Whether a quantity is a size or a place across the road.
pub(crate) fn is_size(quantity: CaseQuantity) -> bool {
    use CaseQuantity::{EgoLength, EgoWidth, LaneWidth, LateralDistance, Length, Width};
    [Length, Width, EgoLength, EgoWidth, LaneWidth, LateralDistance].contains(&quantity)
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
