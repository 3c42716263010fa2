//! FSM: the Fuzzy Safety Model (Mattas et al. 2020; UN R157, Annex 3). Two fuzzy surrogates, proactive (PFS) and
//! critical (CFS), determine how hard the driver brakes.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    Bound, DriverModel, DriverProfile, DriverState, Hazard, View, delay_bound_s, delay_steps, latched_braking,
};
use crate::category::Category;
use crate::scalar::{Flag, Real};

/// Which acceleration the CFS step divides by if the ego would be slower than the other vehicle after τ.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum CfsStep {
    /// The ego's present acceleration (the JRC's simulator).
    Present,
    /// The acceleration limited to comfort (the regulation's text).
    Limited,
}

/// Constants of the model as a profile gives them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FsmProfile {
    /// τ: reaction time, s (0.75).
    pub reaction_time_s: f64,
    /// b_comf: comfortable deceleration, m/s² (4).
    pub comfortable_deceleration_mps2: f64,
    /// b_max: maximum deceleration that the surrogates assume, m/s² (6).
    pub max_surrogate_deceleration_mps2: f64,
    /// b_lead: deceleration the leader may reach, m/s² (7).
    pub lead_deceleration_mps2: f64,
    /// d1: safety margin, m (2), used twice.
    pub margin_m: f64,
    /// Added to the ego's time to pass the other vehicle in the lateral gate, s (0.1).
    pub lateral_gate_margin_s: f64,
    /// Jerk of the ramp, m/s³ (12.65).
    pub jerk_mps3: f64,
    /// Cap of the deceleration, m/s² (0.774 g; never reached with b_max = 6).
    pub max_deceleration_mps2: f64,
    /// Acceleration in the CFS step.
    pub cfs_step: CfsStep,
}

/// The model at one time step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fsm<R> {
    tau: R,
    half_tau: R,
    b_comf: R,
    b_span: R,
    half_inverse_comf: R,
    half_inverse_max: R,
    half_inverse_lead: R,
    margin: R,
    gate_margin: R,
    limited_step: bool,
    jerk_per_step: R,
    max_deceleration: R,
    delay_steps: u32,
    dt: R,
}

impl DriverProfile for FsmProfile {
    type Model<R: Real> = Fsm<R>;

    fn resolve<R: Real>(&self, dt_s: f64, _category: Category) -> Fsm<R> {
        let (comf, max) = (self.comfortable_deceleration_mps2, self.max_surrogate_deceleration_mps2);
        Fsm {
            tau: R::from_f64(self.reaction_time_s),
            half_tau: R::from_f64(self.reaction_time_s / 2.0),
            b_comf: R::from_f64(comf),
            b_span: R::from_f64(max - comf),
            half_inverse_comf: R::from_f64(1.0 / (2.0 * comf)),
            half_inverse_max: R::from_f64(1.0 / (2.0 * max)),
            half_inverse_lead: R::from_f64(1.0 / (2.0 * self.lead_deceleration_mps2)),
            margin: R::from_f64(self.margin_m),
            gate_margin: R::from_f64(self.lateral_gate_margin_s),
            limited_step: self.cfs_step == CfsStep::Limited,
            jerk_per_step: R::from_f64(self.jerk_mps3 * dt_s),
            max_deceleration: R::from_f64(self.max_deceleration_mps2),
            delay_steps: delay_steps(self.reaction_time_s, dt_s),
            dt: R::from_f64(dt_s),
        }
    }

    fn bounds(&self) -> Vec<(&'static str, f64, Bound)> {
        vec![
            ("comfortable_deceleration_mps2", self.comfortable_deceleration_mps2, Bound::DECELERATION),
            ("max_surrogate_deceleration_mps2", self.max_surrogate_deceleration_mps2, Bound::DECELERATION),
            ("lead_deceleration_mps2", self.lead_deceleration_mps2, Bound::DECELERATION),
            ("jerk_mps3", self.jerk_mps3, Bound::JERK),
            ("max_deceleration_mps2", self.max_deceleration_mps2, Bound::DECELERATION),
            ("reaction_time_s", self.reaction_time_s, Bound::DELAY),
            ("margin_m", self.margin_m, Bound::DISTANCE),
            ("lateral_gate_margin_s", self.lateral_gate_margin_s, Bound::DELAY),
        ]
    }

    fn time_step_bounds(&self, _dt_s: f64) -> Vec<(&'static str, f64)> {
        vec![("reaction_time_s", delay_bound_s(self.reaction_time_s))]
    }
}

/// 0 beyond the safe distance, 1 below the unsafe one, linear between.
#[inline(always)]
fn fuzzy<R: Real>(distance: R, safe: R, dangerous: R) -> R {
    // Computed before the selection, so that batches of lanes select without a branch; an unselected value may be NaN.
    let between = (distance - safe).exact_div(dangerous - safe);
    let is_safe = distance.is_at_least(safe);
    let is_dangerous = distance.is_at_most(dangerous);
    is_safe.choose(R::ZERO, is_dangerous.choose(R::ONE, between))
}

impl<R: Real> Fsm<R> {
    /// Proactive fuzzy surrogate: the leader may brake; 0 to 1.
    #[inline(always)]
    pub fn pfs(&self, v_ego: R, v_other: R, gap: R) -> R {
        let reaction = v_ego * self.tau;
        let lead_stop = v_other * v_other * self.half_inverse_lead;
        let d_safe = reaction + v_ego * v_ego * self.half_inverse_comf - lead_stop + self.margin;
        let d_unsafe = reaction + v_ego * v_ego * self.half_inverse_max - lead_stop;
        fuzzy(gap - self.margin, d_safe, d_unsafe)
    }

    /// Critical fuzzy surrogate: the present closing speed; 0 to 1.
    #[inline(always)]
    pub fn cfs(&self, v_ego: R, v_other: R, gap: R, a_ego: R) -> R {
        let a_limited = a_ego.larger(-self.b_comf);
        let v_new = v_ego + self.tau * a_limited;
        let dv = v_ego - v_other;
        let a_step = if self.limited_step { a_limited } else { a_ego };
        let dv_new = v_new - v_other;
        let d_new = (v_ego + a_limited * self.half_tau - v_other) * self.tau;
        let d_safe = d_new + dv_new * dv_new * self.half_inverse_comf;
        let d_unsafe = d_new + dv_new * dv_new * self.half_inverse_max;
        // g < dv²/(2|a|), without a division.
        let is_short = ((gap + gap) * a_step.abs()).is_below(dv * dv);
        let slower_then = is_short.choose(R::ONE, R::ZERO);
        let faster_then = fuzzy(gap, d_safe, d_unsafe);
        let closes = v_ego.is_above(v_other);
        closes.choose(v_new.is_below(v_other).choose(slower_then, faster_then), R::ZERO)
    }

    /// Lateral gate, only for h > 0. It is closed while the other vehicle moves away, while it is faster, or while it
    /// needs longer to come in than the ego needs to pass it: h/w > (D + (L_e+L_o)/2)/dv + 0.1.
    #[inline(always)]
    fn gate_is_open(&self, view: &View<R>) -> Flag {
        let dv = view.closing();
        let w = view.lateral_towards;
        let passing = view.gap + view.half_lengths + view.half_lengths;
        let slow = (view.lateral_gap * dv).is_above(w * (passing + self.gate_margin * dv));
        let closed = !w.is_positive() | dv.is_negative() | (dv.is_positive() & slow);
        !view.lateral_gap.is_positive() | !closed
    }
}

impl<R: Real> DriverModel<R> for Fsm<R> {
    /// The larger of the distances beyond which PFS and, without ego acceleration, CFS are 0.
    #[inline(always)]
    fn safe_gap(&self, v_ego: R, v_other: R) -> R {
        let own_stop = v_ego * self.tau + v_ego * v_ego * self.half_inverse_comf;
        let proactive = own_stop - v_other * v_other * self.half_inverse_lead + self.margin + self.margin;
        proactive.larger(self.steady_gap(v_ego, v_other))
    }

    /// The gate is closed for a vehicle outside the lane that does not come in.
    #[inline(always)]
    fn ignores(&self, lateral_gap: R, lateral_towards: R, _marking_gap: R) -> Flag {
        lateral_gap.is_positive() & !lateral_towards.is_positive()
    }

    const KNOWS_STEADY_FOLLOWING: bool = true;

    /// Distance beyond which CFS is 0 at every deceleration of the ego. Without deceleration it is the safe distance. A
    /// deceleration that leaves v_new above v_o shortens it; one above dv/τ stops the closing within half of dv·τ.
    #[inline(always)]
    fn steady_gap(&self, v_ego: R, v_other: R) -> R {
        let dv = (v_ego - v_other).larger(R::ZERO);
        dv * self.tau + dv * dv * self.half_inverse_comf
    }

    /// Unsafe iff PFS ≠ 0; demand PFS·b_comf.
    #[inline(always)]
    fn check_steady(&self, view: &View<R>) -> Hazard<R> {
        let pfs = self.pfs(view.v_ego, view.v_other, view.gap);
        Hazard { is_unsafe: pfs.is_positive(), demand: pfs * self.b_comf }
    }

    #[inline(always)]
    fn initial(&self) -> DriverState<R> {
        DriverState { deceleration: R::ZERO, delay_steps: self.delay_steps }
    }

    /// Unsafe iff the gate is open and CFS + PFS ≠ 0; demand CFS (b_max − b_comf) + b_comf if CFS > 0, else
    /// PFS·b_comf.
    #[inline(always)]
    fn check(&self, view: &View<R>) -> Hazard<R> {
        let pfs = self.pfs(view.v_ego, view.v_other, view.gap);
        let cfs = self.cfs(view.v_ego, view.v_other, view.gap, view.a_ego);
        let surrogate = pfs.is_positive() | cfs.is_positive();
        let demand = cfs.is_positive().choose(cfs * self.b_span + self.b_comf, pfs * self.b_comf);
        Hazard { is_unsafe: !view.is_behind() & surrogate & self.gate_is_open(view), demand }
    }

    fn shader_constants(&self) -> Vec<(&'static str, f64)> {
        vec![
            ("driver_tau", self.tau.to_f64()),
            ("driver_half_tau", self.half_tau.to_f64()),
            ("driver_b_comf", self.b_comf.to_f64()),
            ("driver_b_span", self.b_span.to_f64()),
            ("driver_half_inverse_comf", self.half_inverse_comf.to_f64()),
            ("driver_half_inverse_max", self.half_inverse_max.to_f64()),
            ("driver_half_inverse_lead", self.half_inverse_lead.to_f64()),
            ("driver_margin", self.margin.to_f64()),
            ("driver_gate_margin", self.gate_margin.to_f64()),
            ("driver_limited_step", f64::from(u8::from(self.limited_step))),
            ("driver_jerk_per_step", self.jerk_per_step.to_f64()),
            ("driver_max_deceleration", self.max_deceleration.to_f64()),
            ("driver_delay_steps", f64::from(self.delay_steps)),
        ]
    }

    /// Holds the speed for τ, then follows the demand: increases at 12.65 m/s³, decreases at once.
    #[inline(always)]
    fn react(&self, state: DriverState<R>, hazard: &Hazard<R>, v_ego: R) -> (DriverState<R>, R) {
        let ramp = (state.deceleration + self.jerk_per_step).smaller(self.max_deceleration);
        latched_braking(state, R::ZERO, ramp.smaller(hazard.demand), v_ego, self.dt)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// CFS alone sets the demand where it is above 0; otherwise PFS does; where both are 0 the situation is safe.
    #[test]
    fn the_critical_surrogate_decides_before_the_proactive_one() {
        let profile = crate::profile::Profile::load("paper").unwrap().fsm;
        let fsm: Fsm<f64> = profile.resolve(0.1, Category::CutIn);
        let comfort = profile.comfortable_deceleration_mps2;
        let span = profile.max_surrogate_deceleration_mps2 - comfort;
        let mut seen = [0; 4];
        for k in 0..4000 {
            let (v_ego, v_other) = (f64::from(k % 40), f64::from(k / 40 % 10) * 4.0);
            let (gap, a_ego) = (f64::from(k / 400) * 12.0 + 0.5, -f64::from(k % 3));
            let view = View {
                v_ego,
                a_ego,
                v_other,
                gap,
                lateral_gap: -1.0,
                lateral_towards: 0.0,
                half_lengths: 4.5,
                marking_gap: 0.8,
            };
            let (pfs, cfs) = (fsm.pfs(v_ego, v_other, gap), fsm.cfs(v_ego, v_other, gap, a_ego));
            let hazard = fsm.check(&view);
            let demand = if cfs > 0.0 { cfs * span + comfort } else { pfs * comfort };
            assert_eq!((hazard.is_unsafe.holds(), hazard.demand), (cfs > 0.0 || pfs > 0.0, demand), "{view:?}");
            seen[usize::from(cfs > 0.0) + 2 * usize::from(pfs > 0.0)] += 1;
        }
        assert!(seen[0] > 100 && seen[2] > 100 && seen[3] > 100, "{seen:?}");
    }
}
