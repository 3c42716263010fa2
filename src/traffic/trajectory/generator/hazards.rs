//! Factors on the published rates of random events.

/// Time between two decisions of one driver, s.
pub(super) const DECISION_S: f64 = 0.2;
/// Minimum time from the end of a lane change to the next decision, s.
pub(super) const SETTLE_S: f64 = 4.0;
/// Lane changes obstruct each other: to raise their rate by a factor f, their hazard is multiplied by f to this
/// power.
const CROWDING: f64 = 1.56;

/// Factors on the hazards.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hazards {
    pub brakings: f64,
    pub lane_changes: f64,
}

impl Hazards {
    /// As published.
    pub const UNRAISED: Hazards = Hazards { brakings: 1.0, lane_changes: 1.0 };

    /// The factors that raise both rates by `factor`.
    pub fn raised(factor: f64) -> Hazards {
        // There is no crowding below the published rates.
        let lane_changes = if factor > 1.0 { libm::pow(factor, CROWDING) } else { factor };
        Hazards { brakings: factor, lane_changes }
    }
}
