//! Reg157: the performance model of UN R157, 5.2.5.2 (cut-in): brake at 6 m/s² once the time to collision
//! at lane intrusion falls below what 6 m/s² and 0.35 s need.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::profile::rounded_down_s;
use super::{
    AttentionRule, Bound, DriverModel, DriverProfile, DriverState, Hazard, SHORT_STEP_S, View, delay_bound_s,
    delay_steps, latched_braking,
};
use crate::category::Category;
use crate::scalar::{Flag, Real};

/// Constants of the model as a profile gives them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Reg157Profile {
    /// The clause that defines these numbers, as sheets name it.
    pub clause: String,
    /// The check is active below this lateral gap, m, if there is no `lane_intrusion_m` (0.5 m is 0.3 m beyond the
    /// marking for lanes of 3.5 m and an ego of 1.9 m).
    pub lateral_gate_m: f64,
    /// The check is active once the other vehicle's near edge is this far beyond the marking of the ego's lane, m (R157,
    /// 5.2.5.2: 0.3 m). 0: `lateral_gate_m` holds for lanes and vehicles of every width.
    pub lane_intrusion_m: f64,
    /// A time to collision exists only while the gap closes (the regulation); otherwise the model also reacts to |TTC|
    /// of an opening gap (the JRC's simulator, the paper).
    pub ttc_only_while_closing: bool,
    /// Reaction time, s (R157: 0.35 s).
    pub reaction_time_s: f64,
    /// Deceleration, m/s², reached at once (R157: 6 m/s²).
    pub deceleration_mps2: f64,
    /// Margin added to the threshold, s. It is not in the regulation: the public simulators use 0.1 s. Without it the
    /// model collides in 80–100 % of LVD runs, which contradicts the paper's table.
    pub margin_s: f64,
    /// Further margin, in time steps; with it the reaction time is rounded up to whole steps, as the driver applies it.
    /// The regulation's threshold is exactly the time that braking needs, so without an extra step rounding decides
    /// contacts.
    pub margin_steps: f64,
    /// Time for which lateral movement must have been visible before the model may react to a vehicle that starts
    /// before its lane intrusion, s (R157: 0.72 s; 0 disables the rule).
    pub visible_lateral_movement_s: f64,
    /// Categories in which the model brakes from the first step, without a check.
    pub always_unsafe: Vec<Category>,
}

/// The model at one time step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reg157<R> {
    always_unsafe: bool,
    only_while_closing: bool,
    /// Gate as a lateral gap, m, if there is no lane intrusion.
    lateral_gate: R,
    /// m; 0: none.
    lane_intrusion: R,
    /// 1/(2·deceleration), s²/m, precomputed so that a lane never divides.
    half_inverse_deceleration: R,
    /// reaction time + margin, s.
    constant: R,
    deceleration: R,
    delay_steps: u32,
    dt: R,
}

impl DriverProfile for Reg157Profile {
    type Model<R: Real> = Reg157<R>;

    fn resolve<R: Real>(&self, dt_s: f64, category: Category) -> Reg157<R> {
        Reg157 {
            always_unsafe: self.always_unsafe.contains(&category),
            only_while_closing: self.ttc_only_while_closing,
            lateral_gate: R::from_f64(self.lateral_gate_m),
            lane_intrusion: R::from_f64(self.lane_intrusion_m),
            half_inverse_deceleration: R::from_f64(1.0 / (2.0 * self.deceleration_mps2)),
            constant: R::from_f64(self.reaction_and_margin_s(dt_s)),
            deceleration: R::from_f64(self.deceleration_mps2),
            delay_steps: delay_steps(self.reaction_time_s, dt_s),
            dt: R::from_f64(dt_s),
        }
    }

    fn bounds(&self) -> Vec<(&'static str, f64, Bound)> {
        vec![
            ("deceleration_mps2", self.deceleration_mps2, Bound::DECELERATION),
            ("reaction_time_s", self.reaction_time_s, Bound::DELAY),
            ("margin_s", self.margin_s, Bound::DELAY),
            ("margin_steps", self.margin_steps, Bound::STEPS),
            ("visible_lateral_movement_s", self.visible_lateral_movement_s, Bound::DELAY),
            ("lateral_gate_m", self.lateral_gate_m, Bound::SIGNED_DISTANCE),
            ("lane_intrusion_m", self.lane_intrusion_m, Bound::DISTANCE),
        ]
    }

    /// The margin must cover the delay that whole steps add: half a step and the rounding up of the reaction time.
    fn time_step_bounds(&self, dt_s: f64) -> Vec<(&'static str, f64)> {
        let steps = f64::from(delay_steps(self.reaction_time_s, dt_s));
        let late_s = steps * dt_s - self.reaction_time_s + dt_s / 2.0;
        let longest_s = self.margin_s.max(SHORT_STEP_S);
        // A margin below half a step has another purpose (0 is the regulation's text) and does not bound the step.
        let is_late = dt_s <= longest_s && self.margin_s >= dt_s / 2.0 && late_s > self.margin_s + 1e-9;
        let margin_bound_s = if is_late { rounded_down_s(self.reaction_time_s / steps) } else { longest_s };
        vec![
            ("reaction_time_s", delay_bound_s(self.reaction_time_s)),
            ("visible_lateral_movement_s", delay_bound_s(self.visible_lateral_movement_s)),
            ("margin_s", margin_bound_s),
        ]
    }

    fn attention(&self, dt_s: f64, category: Category) -> AttentionRule<f64> {
        AttentionRule::after_visible_movement(self.visible_lateral_movement_s, self.lane_intrusion_m, dt_s, category)
    }
}

impl Reg157Profile {
    /// Lateral gap at the lane intrusion, m; `marking_gap_m` is from the ego's side to the marking of its lane.
    pub fn intrusion_gap_m(&self, marking_gap_m: f64) -> f64 {
        if self.lane_intrusion_m > 0.0 { marking_gap_m - self.lane_intrusion_m } else { self.lateral_gate_m }
    }

    /// Time that reaction and margins add to the braking time in the threshold, s.
    pub fn reaction_and_margin_s(&self, dt_s: f64) -> f64 {
        if self.margin_steps == 0.0 {
            return self.reaction_time_s + self.margin_s;
        }
        let steps = f64::from(delay_steps(self.reaction_time_s, dt_s)) + self.margin_steps;
        steps * dt_s + self.margin_s
    }
}

impl<R: Real> Reg157<R> {
    /// Lateral gap at the lane intrusion, m.
    #[inline(always)]
    pub fn intrusion_gap(&self, marking_gap: R) -> R {
        if self.lane_intrusion > R::ZERO { marking_gap - self.lane_intrusion } else { self.lateral_gate }
    }

    /// TTC threshold dv/(2·6) + 0.35 + margin, s, at closing speed `dv`.
    pub fn ttc_threshold(&self, dv: R) -> R {
        dv * self.half_inverse_deceleration + self.constant
    }
}

impl<R: Real> DriverModel<R> for Reg157<R> {
    const SEES_LATERAL_SPEED: bool = false;
    const SEES_OWN_ACCELERATION: bool = false;
    const KEEPS_DECELERATION: bool = false;

    #[inline(always)]
    fn safe_gap(&self, v_ego: R, v_other: R) -> R {
        let dv = v_ego - v_other;
        if self.always_unsafe { R::INFINITY } else { (dv.abs() * self.ttc_threshold(dv)).larger(R::ZERO) }
    }

    #[inline(always)]
    fn ignores(&self, lateral_gap: R, _lateral_towards: R, marking_gap: R) -> Flag {
        !Flag::of(self.always_unsafe) & !lateral_gap.is_at_most(self.intrusion_gap(marking_gap))
    }

    #[inline(always)]
    fn initial(&self) -> DriverState<R> {
        DriverState { deceleration: R::ZERO, delay_steps: self.delay_steps }
    }

    /// Unsafe iff h ≤ gate and |g/dv| ≤ dv/(2·6) + 0.35 + margin: absolute TTC on the left, signed dv on the right;
    /// where a TTC exists only while the gap closes, dv > 0.
    #[inline(always)]
    fn check(&self, view: &View<R>) -> Hazard<R> {
        let dv = view.closing();
        let near = view.lateral_gap.is_at_most(self.intrusion_gap(view.marking_gap));
        let moves = dv.is_positive() | (dv.is_negative() & !Flag::of(self.only_while_closing));
        let soon = moves & view.gap.abs().is_at_most(dv.abs() * self.ttc_threshold(dv));
        let is_unsafe = !view.is_behind() & (Flag::of(self.always_unsafe) | (near & soon));
        Hazard { is_unsafe, demand: self.deceleration }
    }

    fn shader_constants(&self) -> Vec<(&'static str, f64)> {
        vec![
            ("driver_always_unsafe", f64::from(u8::from(self.always_unsafe))),
            ("driver_only_while_closing", f64::from(u8::from(self.only_while_closing))),
            ("driver_lateral_gate", self.lateral_gate.to_f64()),
            ("driver_lane_intrusion", self.lane_intrusion.to_f64()),
            ("driver_half_inverse_deceleration", self.half_inverse_deceleration.to_f64()),
            ("driver_constant", self.constant.to_f64()),
            ("driver_deceleration", self.deceleration.to_f64()),
            ("driver_delay_steps", f64::from(self.delay_steps)),
        ]
    }

    /// Holds the speed for 0.35 s, then brakes at 6 m/s² at once, without a jerk limit.
    #[inline(always)]
    fn react(&self, state: DriverState<R>, hazard: &Hazard<R>, v_ego: R) -> (DriverState<R>, R) {
        latched_braking(state, R::ZERO, hazard.demand, v_ego, self.dt)
    }
}
