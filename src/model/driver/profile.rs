//! What every driver model's constants in a profile can do.

use super::{AttentionRule, DriverModel};
use crate::model::case::Category;
use crate::model::scalar::Real;

/// Physical range of a constant, in its unit. What passes is finite in binary32 and not subnormal, and so is what models
/// work out of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bound {
    /// Unit; empty for a ratio.
    pub unit: &'static str,
    /// Smallest size, above 0.
    pub smallest: f64,
    /// Largest size.
    pub largest: f64,
    /// 0 is in the range as well.
    pub has_zero: bool,
    /// So are the negative numbers of these sizes.
    pub has_negative: bool,
}

impl Bound {
    /// A deceleration, m/s².
    pub const DECELERATION: Bound = Bound::new("m/s²", 0.001, 100.0);
    /// An acceleration or deceleration that may be none, m/s².
    pub const ACCELERATION: Bound = Bound::DECELERATION.or_zero();
    /// A jerk, m/s³.
    pub const JERK: Bound = Bound::new("m/s³", 0.001, 1e6);
    /// A time, s.
    pub const TIME: Bound = Bound::new("s", 0.001, 1000.0);
    /// A delay that may be none, s.
    pub const DELAY: Bound = Bound::TIME.or_zero();
    /// A time step, s.
    pub const TIME_STEP: Bound = Bound::new("s", 1e-6, 1.0);
    /// The longest a run may take, s: an hour, where encounters last seconds.
    pub const TIME_CAP: Bound = Bound::new("s", 0.001, 3600.0);
    /// A length or width of a vehicle, m.
    pub const SIZE: Bound = Bound::new("m", 0.1, 100.0);
    /// A distance that may be none, m.
    pub const DISTANCE: Bound = Bound::new("m", 0.001, 100.0).or_zero();
    /// A distance with a sign, m.
    pub const SIGNED_DISTANCE: Bound = Bound { has_negative: true, ..Bound::DISTANCE };
    /// A number of time steps that may be none.
    pub const STEPS: Bound = Bound::new("steps", 1.0, 1000.0).or_zero();
    /// A ratio.
    pub const RATIO: Bound = Bound::new("", 0.001, 1000.0);

    /// From a smallest size above 0 to a largest one.
    pub const fn new(unit: &'static str, smallest: f64, largest: f64) -> Bound {
        Bound { unit, smallest, largest, has_zero: false, has_negative: false }
    }

    const fn or_zero(self) -> Bound {
        Bound { has_zero: true, ..self }
    }

    /// Does the value lie in the range?
    pub fn holds(self, value: f64) -> bool {
        let has_size = (self.smallest..=self.largest).contains(&value.abs());
        (self.has_zero && value == 0.0) || (has_size && (self.has_negative || value > 0.0))
    }

    /// Smallest and largest value.
    pub fn ends(self) -> [f64; 2] {
        let least = if self.has_zero { 0.0 } else { self.smallest };
        [if self.has_negative { -self.largest } else { least }, self.largest]
    }
}

impl std::fmt::Display for Bound {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Bound { unit, smallest, largest, has_zero, has_negative } = self;
        let zero = if *has_zero { "0, or " } else { "" };
        let space = if unit.is_empty() { "" } else { " " };
        let sign = if *has_negative { " of either sign" } else { "" };
        write!(f, "{zero}{smallest} to {largest}{space}{unit}{sign}")
    }
}

/// Steps that a delay takes at least: rounded up to whole ones it is then longer by less than a third.
const DELAY_STEPS: f64 = 3.0;

/// Time step up to which no delay bounds it, s: that of the simulators that the models come from.
pub const SHORT_STEP_S: f64 = 0.1;

/// Longest time step that a delay allows, s; any where there is no delay.
pub fn delay_bound_s(delay_s: f64) -> f64 {
    if delay_s > 0.0 { rounded_down_s(delay_s / DELAY_STEPS).max(SHORT_STEP_S) } else { f64::INFINITY }
}

/// A time step in whole tenths of a millisecond.
pub(super) fn rounded_down_s(step_s: f64) -> f64 {
    // 0.6/3 lies below 0.2.
    ((step_s + 1e-9) * 1e4).floor() / 1e4
}

/// Constants of a driver model as a profile gives them.
pub trait DriverProfile {
    /// The model in a lane's arithmetic.
    type Model<R: Real>: DriverModel<R>;

    /// Plain constants at a time step, in a category; worked out in f64 and rounded once.
    fn resolve<R: Real>(&self, dt_s: f64, category: Category) -> Self::Model<R>;

    /// Every constant that is a number: key, value, range.
    fn bounds(&self) -> Vec<(&'static str, f64, Bound)>;

    /// What bounds the time step `dt_s`: key, longest step that it allows, s. [`delay_bound_s`] gives that of a delay.
    /// Derivation: docs/src/methods/lane.md, time step.
    fn time_step_bounds(&self, _dt_s: f64) -> Vec<(&'static str, f64)> {
        Vec::new()
    }

    /// What has to be seen of the principal vehicle before the driver may react; worked out in f64.
    fn attention(&self, _dt_s: f64, _category: Category) -> AttentionRule<f64> {
        AttentionRule::always()
    }

    /// A run is aborted at lateral overlap with |TTC| above this, s; 0 never aborts.
    fn abort_above_ttc_s(&self) -> f64 {
        0.0
    }
}
