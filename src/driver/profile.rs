//! What every driver model's constants in a profile can do.

use super::{AttentionRule, DriverModel};
use crate::scalar::Real;
use crate::scenario::Category;

/// Range of a constant; every one is finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bound {
    /// Above this.
    Above(f64),
    /// This or more.
    AtLeast(f64),
}

impl Bound {
    /// Does the value lie in the range?
    pub fn holds(self, value: f64) -> bool {
        value.is_finite()
            && match self {
                Bound::Above(limit) => value > limit,
                Bound::AtLeast(limit) => value >= limit,
            }
    }
}

impl std::fmt::Display for Bound {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Bound::Above(limit) => write!(f, "a number above {limit}"),
            Bound::AtLeast(limit) => write!(f, "a number of at least {limit}"),
        }
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

    /// Constants with a range: key, value, range.
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
