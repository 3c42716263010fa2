//! AEB: an automatic emergency brake after UN R152 (cars and vans). Brakes late and to the end: from a short time
//! to collision on until nothing closes in any more.
//!
//! An example of how a model is added, not a regulation's model: what R152 does not say is marked illustrative.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Bound, DriverModel, DriverProfile, DriverState, Hazard, View, delay_steps, latched_braking};
use crate::category::Category;
use crate::scalar::Real;

/// Constants of the model as a profile gives them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AebProfile {
    /// Time to collision at which the system intervenes, s (illustrative: R152 asks for results in tests, not
    /// for an instant).
    pub trigger_ttc_s: f64,
    /// From the trigger to the first brake pressure, s (illustrative).
    pub delay_s: f64,
    /// Jerk of the ramp, m/s³ (illustrative).
    pub jerk_mps3: f64,
    /// Largest deceleration, m/s² (R152, 5.2.1.2: emergency braking demands at least 5.0 m/s²).
    pub max_deceleration_mps2: f64,
}

/// For profiles without a table `[aeb]`.
impl Default for AebProfile {
    fn default() -> Self {
        AebProfile { trigger_ttc_s: 1.5, delay_s: 0.2, jerk_mps3: 20.0, max_deceleration_mps2: 5.0 }
    }
}

/// The model at one time step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aeb<R> {
    trigger_ttc: R,
    jerk_per_step: R,
    max_deceleration: R,
    delay_steps: u32,
    dt: R,
}

impl DriverProfile for AebProfile {
    type Model<R: Real> = Aeb<R>;

    fn resolve<R: Real>(&self, dt_s: f64, _category: Category) -> Aeb<R> {
        Aeb {
            trigger_ttc: R::from_f64(self.trigger_ttc_s),
            jerk_per_step: R::from_f64(self.jerk_mps3 * dt_s),
            max_deceleration: R::from_f64(self.max_deceleration_mps2),
            delay_steps: delay_steps(self.delay_s, dt_s),
            dt: R::from_f64(dt_s),
        }
    }

    fn bounds(&self) -> Vec<(&'static str, f64, Bound)> {
        vec![
            ("trigger_ttc_s", self.trigger_ttc_s, Bound::TIME),
            ("delay_s", self.delay_s, Bound::DELAY),
            ("jerk_mps3", self.jerk_mps3, Bound::JERK),
            ("max_deceleration_mps2", self.max_deceleration_mps2, Bound::DECELERATION),
        ]
    }
}

impl<R: Real> DriverModel<R> for Aeb<R> {
    #[inline(always)]
    fn initial(&self) -> DriverState<R> {
        DriverState { deceleration: R::ZERO, delay_steps: self.delay_steps }
    }

    /// Unsafe iff h ≤ 0 and dv > 0 and (g/dv ≤ trigger, multiplied out, or the ego is braking already): an
    /// intervention ends with the closing, not with a TTC that braking has just made longer.
    #[inline(always)]
    fn check(&self, view: &View<R>) -> Hazard<R> {
        let dv = view.closing();
        let in_path = !view.lateral_gap.is_positive() & dv.is_positive();
        let soon = view.gap.is_at_most(self.trigger_ttc * dv);
        let intervening = view.a_ego.is_negative();
        Hazard { is_unsafe: !view.is_behind() & in_path & (soon | intervening), demand: self.max_deceleration }
    }

    fn shader_constants(&self) -> Vec<(&'static str, f64)> {
        vec![
            ("driver_trigger_ttc", self.trigger_ttc.to_f64()),
            ("driver_jerk_per_step", self.jerk_per_step.to_f64()),
            ("driver_max_deceleration", self.max_deceleration.to_f64()),
            ("driver_delay_steps", f64::from(self.delay_steps)),
        ]
    }

    /// Hold the speed for the delay, then ramp up to the largest deceleration.
    #[inline(always)]
    fn react(&self, state: DriverState<R>, hazard: &Hazard<R>, v_ego: R) -> (DriverState<R>, R) {
        let braking = (state.deceleration + self.jerk_per_step).smaller(hazard.demand);
        latched_braking(state, R::ZERO, braking, v_ego, self.dt)
    }
}
