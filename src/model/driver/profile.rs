//! The interface of every driver model's constants in a profile, and their ranges.

use super::{AttentionRule, DriverModel};
use crate::category::Category;
use crate::scalar::Real;

/// Physical range of a constant, in its unit. A value in the range is finite and not subnormal in binary32, and so are
/// the values that models derive from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bound {
    /// Unit; empty for a ratio.
    pub unit: &'static str,
    /// Minimum magnitude, > 0.
    pub smallest: f64,
    /// Maximum magnitude.
    pub largest: f64,
    /// 0 is in the range too.
    pub has_zero: bool,
    /// Negative numbers of these magnitudes are in the range too.
    pub has_negative: bool,
}

impl Bound {
    /// A deceleration that a driver demands, m/s². A smaller number is one in g.
    pub(crate) const DECELERATION: Bound = Bound::new("m/s²", 1.0, 100.0);
    /// A lateral acceleration, m/s²: RSS has less than 1 in use.
    pub(super) const LATERAL_ACCELERATION: Bound = Bound::new("m/s²", 0.001, 100.0);
    /// An acceleration or deceleration, or 0, m/s².
    pub(super) const ACCELERATION: Bound = Bound::LATERAL_ACCELERATION.or_zero();
    /// A jerk, m/s³.
    pub(crate) const JERK: Bound = Bound::new("m/s³", 0.001, 1e6);
    /// A time, s.
    pub(crate) const TIME: Bound = Bound::new("s", 0.001, 60.0);
    /// A delay, or 0, s.
    pub(super) const DELAY: Bound = Bound::TIME.or_zero();
    /// A time step, s.
    pub const TIME_STEP: Bound = Bound::new("s", 1e-6, 1.0);
    /// Maximum duration of a run, s: one hour; encounters last seconds.
    pub(crate) const TIME_CAP: Bound = Bound::new("s", 0.001, 3600.0);
    /// A length or width of a vehicle, m.
    pub(crate) const SIZE: Bound = Bound::new("m", 0.1, 100.0);
    /// A distance, or 0, m.
    pub(crate) const DISTANCE: Bound = Bound::new("m", 0.001, 100.0).or_zero();
    /// A signed distance, m.
    pub(super) const SIGNED_DISTANCE: Bound = Bound { has_negative: true, ..Bound::DISTANCE };
    /// A number of time steps, or 0.
    pub(super) const STEPS: Bound = Bound::new("steps", 1.0, 1000.0).or_zero();
    /// A ratio of decelerations.
    pub(crate) const RATIO: Bound = Bound::new("", 0.001, 10.0);

    /// From a minimum magnitude above 0 and a maximum.
    pub const fn new(unit: &'static str, smallest: f64, largest: f64) -> Bound {
        Bound { unit, smallest, largest, has_zero: false, has_negative: false }
    }

    const fn or_zero(self) -> Bound {
        Bound { has_zero: true, ..self }
    }

    /// Whether the value is in the range.
    pub fn holds(self, value: f64) -> bool {
        let has_size = (self.smallest..=self.largest).contains(&value.abs());
        (self.has_zero && value == 0.0) || (has_size && (self.has_negative || value > 0.0))
    }

    /// Minimum and maximum value.
    pub fn ends(self) -> [f64; 2] {
        let min = if self.has_zero { 0.0 } else { self.smallest };
        [if self.has_negative { -self.largest } else { min }, self.largest]
    }
}

impl std::fmt::Display for Bound {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Bound { unit, smallest, largest, has_zero, has_negative, .. } = self;
        let zero = if *has_zero { "0, or " } else { "" };
        let space = if unit.is_empty() { "" } else { " " };
        let sign = if *has_negative { " of either sign" } else { "" };
        write!(f, "{zero}{smallest} to {largest}{space}{unit}{sign}")
    }
}

/// Minimum number of steps in a delay. Rounding up to whole steps then lengthens the delay by less than a third.
const DELAY_STEPS: f64 = 3.0;

/// Time step up to which delays set no bound, s: that of the simulators the models come from.
pub(crate) const SHORT_STEP_S: f64 = 0.1;

/// Maximum time step for a delay, s; unbounded for a delay of 0.
pub(crate) fn delay_bound_s(delay_s: f64) -> f64 {
    if delay_s > 0.0 { rounded_down_s(delay_s / DELAY_STEPS).max(SHORT_STEP_S) } else { f64::INFINITY }
}

/// The time step rounded down to 0.1 ms.
pub(super) fn rounded_down_s(step_s: f64) -> f64 {
    // In binary64, 0.6/3 is less than 0.2.
    ((step_s + 1e-9) * 1e4).floor() / 1e4
}

/// Constants of a driver model as a profile gives them.
pub trait DriverProfile {
    /// The model in a lane's arithmetic.
    type Model<R: Real>: DriverModel<R>;

    /// Resolves the constants for a time step and a category; computed in f64 and rounded once.
    fn resolve<R: Real>(&self, dt_s: f64, category: Category) -> Self::Model<R>;

    /// Every numeric constant: key, value, range.
    fn bounds(&self) -> Vec<(&'static str, f64, Bound)>;

    /// Bounds of the time step `dt_s`: key, maximum step, s. `delay_bound_s` gives the bound of a delay. Derivation:
    /// docs/src/methods/lane.md, time step.
    fn time_step_bounds(&self, _dt_s: f64) -> Vec<(&'static str, f64)> {
        Vec::new()
    }

    /// What the driver must perceive of the principal vehicle before it may react; computed in f64.
    fn attention(&self, _dt_s: f64, _category: Category) -> AttentionRule<f64> {
        AttentionRule::always()
    }

    /// The run is aborted at lateral overlap with |TTC| above this value, s; 0 never aborts.
    fn abort_above_ttc_s(&self) -> f64 {
        0.0
    }
}
