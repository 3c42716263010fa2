//! By how much the random events of the traffic are raised above the published rates.

/// Time between two decisions of one driver, s.
pub(super) const DECISION_S: f64 = 0.2;
/// Shortest time from the end of a lane change to the thought of another, s.
pub(super) const SETTLE_S: f64 = 4.0;
/// Lane changes get in each other's way: to raise their rate by a factor f, their hazard is raised by f
/// to this power.
const CROWDING: f64 = 1.85;
/// Raised lane changes provoke brakings by themselves: to raise the rate of hard brakings by a factor f,
/// the hazard of the scheduled ones is raised by f to this power.
const PROVOKED: f64 = 0.5;

/// By how much the hazards are multiplied.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hazards {
    pub brakings: f64,
    pub lane_changes: f64,
}

impl Hazards {
    /// As published.
    pub const UNRAISED: Hazards = Hazards { brakings: 1.0, lane_changes: 1.0 };

    /// What raises the rates of both by this factor.
    pub fn raised(factor: f64) -> Hazards {
        // Both powers come from crowding, which there is none of below the published rates.
        let power = |exponent| if factor > 1.0 { libm::pow(factor, exponent) } else { factor };
        Hazards { brakings: power(PROVOKED), lane_changes: power(CROWDING) }
    }
}
