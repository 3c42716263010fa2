//! CCHDM: the careful and competent human driver of UN R157, Annex 3. It perceives a cut-in, coasts during the delay,
//! then ramps up to 0.774 g.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{
    AttentionRule, BelowTrigger, Bound, DriverModel, DriverProfile, DriverState, Hazard, View, delay_bound_s,
    delay_steps, latched_braking,
};
use crate::category::Category;
use crate::scalar::{Flag, Real};

/// Constants of the model as a profile gives them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CchdmProfile {
    /// The check is active below this lateral gap, m; 0 means that the vehicles overlap laterally.
    pub lateral_gate_m: f64,
    /// Time to collision at which the driver reacts, s (Annex 3: 2.0 s).
    pub ttc_s: f64,
    /// A time to collision exists only while the gap closes (the regulation); otherwise the driver also reacts to
    /// |TTC| of an opening gap (the JRC's simulator, the paper).
    pub ttc_only_while_closing: bool,
    /// Delay between perception and braking, s (the paper 0.6 s; Annex 3 and the JRC 0.75 s).
    pub delay_s: f64,
    /// Deceleration during the delay, with the foot off the accelerator, m/s² (0.4).
    pub coasting_mps2: f64,
    /// Jerk of the ramp, m/s³ (12.65).
    pub jerk_mps3: f64,
    /// Maximum deceleration, m/s² (0.774 g).
    pub max_deceleration_mps2: f64,
    /// Categories in which the driver brakes from the first moment of attention, without a TTC check.
    pub always_unsafe: Vec<Category>,
    /// Lateral wandering that counts as normal, m: risk perception begins beyond it (Annex 3: 0.375 m). 0 disables the
    /// perception rule.
    pub wandering_m: f64,
    /// Risk perception time after the wandering or the deceleration trigger is exceeded, s (Annex 3: 0.4 s).
    pub perception_time_s: f64,
    /// Cut-out: danger is a time headway of at most this value, s, instead of the TTC (Annex 3: 2.0 s), and the driver
    /// then brakes to standstill. 0 keeps the TTC check.
    pub cut_out_headway_s: f64,
    /// Tolerance added to the gap of that headway, m, so that a gap rounded to centimetres still counts as the intended
    /// headway.
    pub cut_out_headway_tolerance_m: f64,
    /// Cut-in: when braking ends.
    pub cut_in_braking: CutInBraking,
    /// LVD: perception begins once the leader decelerates more than this, m/s² (Annex 3: 5 m/s²); 0 disables the rule.
    pub lead_deceleration_trigger_mps2: f64,
    /// LVD: what the driver does where the leader never exceeds the trigger.
    pub lvd_below_threshold: BelowTrigger,
    /// The JRC's cut-in sweep aborts a run at any step with lateral overlap and |TTC| above `ttc_s`.
    pub abort_on_large_ttc: bool,
}

/// When braking for a vehicle that cuts in ends. The tables of Annex 3 do not specify it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum CutInBraking {
    /// At each step at which the TTC exceeds `ttc_s` (the JRC's simulator). Braking can then restart and end
    /// repeatedly, while the gap closes slowly.
    WhileUnsafe,
    /// Once the ego is no faster than the vehicle ahead.
    UntilEqualSpeeds,
}

/// The model at one time step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cchdm<R> {
    always_unsafe: bool,
    until_equal_speeds: bool,
    only_while_closing: bool,
    lateral_gate: R,
    ttc: R,
    /// Danger is a headway of at most this value, s; 0: danger is a TTC.
    headway: R,
    headway_tolerance: R,
    coasting: R,
    jerk_per_step: R,
    max_deceleration: R,
    delay_steps: u32,
    dt: R,
}

impl DriverProfile for CchdmProfile {
    type Model<R: Real> = Cchdm<R>;

    fn resolve<R: Real>(&self, dt_s: f64, category: Category) -> Cchdm<R> {
        Cchdm {
            always_unsafe: self.always_unsafe.contains(&category),
            until_equal_speeds: category == Category::CutIn && self.cut_in_braking == CutInBraking::UntilEqualSpeeds,
            only_while_closing: self.ttc_only_while_closing,
            lateral_gate: R::from_f64(self.lateral_gate_m),
            ttc: R::from_f64(self.ttc_s),
            headway: R::from_f64(if category == Category::CutOut { self.cut_out_headway_s } else { 0.0 }),
            headway_tolerance: R::from_f64(self.cut_out_headway_tolerance_m),
            coasting: R::from_f64(self.coasting_mps2),
            jerk_per_step: R::from_f64(self.jerk_mps3 * dt_s),
            max_deceleration: R::from_f64(self.max_deceleration_mps2),
            delay_steps: delay_steps(self.delay_s, dt_s),
            dt: R::from_f64(dt_s),
        }
    }

    fn bounds(&self) -> Vec<(&'static str, f64, Bound)> {
        vec![
            ("jerk_mps3", self.jerk_mps3, Bound::JERK),
            ("max_deceleration_mps2", self.max_deceleration_mps2, Bound::DECELERATION),
            ("ttc_s", self.ttc_s, Bound::DELAY),
            ("delay_s", self.delay_s, Bound::DELAY),
            ("coasting_mps2", self.coasting_mps2, Bound::ACCELERATION),
            ("wandering_m", self.wandering_m, Bound::DISTANCE),
            ("perception_time_s", self.perception_time_s, Bound::DELAY),
            ("cut_out_headway_s", self.cut_out_headway_s, Bound::DELAY),
            ("cut_out_headway_tolerance_m", self.cut_out_headway_tolerance_m, Bound::DISTANCE),
            ("lead_deceleration_trigger_mps2", self.lead_deceleration_trigger_mps2, Bound::ACCELERATION),
            ("lateral_gate_m", self.lateral_gate_m, Bound::SIGNED_DISTANCE),
        ]
    }

    fn time_step_bounds(&self, _dt_s: f64) -> Vec<(&'static str, f64)> {
        vec![("delay_s", delay_bound_s(self.delay_s)), ("perception_time_s", delay_bound_s(self.perception_time_s))]
    }

    fn attention(&self, dt_s: f64, category: Category) -> AttentionRule<f64> {
        let (wandering_m, perception_s) = (self.wandering_m, self.perception_time_s);
        match category {
            Category::CutIn => AttentionRule::cutting_in(wandering_m, perception_s, dt_s),
            Category::CutOut => AttentionRule::cutting_out(wandering_m, perception_s, dt_s),
            Category::Lvd => {
                let (trigger_mps2, below) = (self.lead_deceleration_trigger_mps2, self.lvd_below_threshold);
                AttentionRule::after_deceleration(trigger_mps2, perception_s, below, dt_s)
            }
        }
    }

    fn abort_above_ttc_s(&self) -> f64 {
        if self.abort_on_large_ttc { self.ttc_s } else { 0.0 }
    }
}

impl<R: Real> Cchdm<R> {
    /// Gap below which the driver sees danger, m, at the ego's speed and a closing speed `dv`: from a headway, or from
    /// a TTC.
    #[inline(always)]
    pub fn danger_gap(&self, v_ego: R, dv: R) -> R {
        let dv = if self.only_while_closing { dv.larger(R::ZERO) } else { dv.abs() };
        if self.headway > R::ZERO { self.headway * v_ego + self.headway_tolerance } else { self.ttc * dv }
    }
}

impl<R: Real> DriverModel<R> for Cchdm<R> {
    const SEES_LATERAL_SPEED: bool = false;
    const SEES_OWN_ACCELERATION: bool = false;

    #[inline(always)]
    fn safe_gap(&self, v_ego: R, v_other: R) -> R {
        if self.always_unsafe { R::INFINITY } else { self.danger_gap(v_ego, v_ego - v_other) }
    }

    #[inline(always)]
    fn ignores(&self, lateral_gap: R, _lateral_towards: R, _marking_gap: R) -> Flag {
        !Flag::of(self.always_unsafe) & !lateral_gap.is_at_most(self.lateral_gate)
    }

    /// The ramp starts at the coasting deceleration: the first braking step is 0.4 + jerk·dt.
    #[inline(always)]
    fn initial(&self) -> DriverState<R> {
        DriverState { deceleration: self.coasting, delay_steps: self.delay_steps }
    }

    /// Unsafe iff h ≤ gate and |g/dv| ≤ 2.0 s. Where |TTC| of an opening gap counts, the driver keeps braking below the
    /// other vehicle's speed until that gap exceeds 2 s of |dv|. With a headway: unsafe iff h ≤ gate and g ≤ 2.0 s · v_e.
    #[inline(always)]
    fn check(&self, view: &View<R>) -> Hazard<R> {
        let dv = view.closing();
        let near = view.lateral_gap.is_at_most(self.lateral_gate);
        let moves = dv.is_positive() | (dv.is_negative() & !Flag::of(self.only_while_closing));
        let danger_gap = self.danger_gap(view.v_ego, dv);
        let soon = moves & view.gap.abs().is_at_most(danger_gap);
        let soon = if self.headway > R::ZERO { view.gap.is_at_most(danger_gap) } else { soon };
        let is_unsafe = !view.is_behind() & (Flag::of(self.always_unsafe) | (near & soon));
        Hazard { is_unsafe, demand: self.max_deceleration }
    }

    #[inline(always)]
    fn keeps_braking(&self, state: &DriverState<R>, view: &View<R>) -> Flag {
        let has_begun = Flag::of(state.delay_steps != self.delay_steps) | state.deceleration.is_above(self.coasting);
        if self.until_equal_speeds {
            has_begun & view.closing().is_positive() & !view.is_behind()
        } else {
            Flag::of(self.headway > R::ZERO) & has_begun
        }
    }

    fn shader_constants(&self) -> Vec<(&'static str, f64)> {
        vec![
            ("driver_always_unsafe", f64::from(u8::from(self.always_unsafe))),
            ("driver_until_equal_speeds", f64::from(u8::from(self.until_equal_speeds))),
            ("driver_only_while_closing", f64::from(u8::from(self.only_while_closing))),
            ("driver_lateral_gate", self.lateral_gate.to_f64()),
            ("driver_ttc", self.ttc.to_f64()),
            ("driver_headway", self.headway.to_f64()),
            ("driver_headway_tolerance", self.headway_tolerance.to_f64()),
            ("driver_coasting", self.coasting.to_f64()),
            ("driver_jerk_per_step", self.jerk_per_step.to_f64()),
            ("driver_max_deceleration", self.max_deceleration.to_f64()),
            ("driver_delay_steps", f64::from(self.delay_steps)),
        ]
    }

    /// Coast at 0.4 m/s² during the delay, then ramp at 12.65 m/s³ up to 0.774 g.
    #[inline(always)]
    fn react(&self, state: DriverState<R>, hazard: &Hazard<R>, v_ego: R) -> (DriverState<R>, R) {
        let braking = (state.deceleration + self.jerk_per_step).smaller(hazard.demand);
        latched_braking(state, self.coasting, braking, v_ego, self.dt)
    }
}
