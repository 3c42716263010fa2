//! When a driver may react to a vehicle at all, as far as that depends on the vehicle's own motion only:
//! visibility and perception rules of UN R157. Worked out once per case, before its lanes, so a lane holds one
//! step index per model instead of perception state. Twin: `shaders/shared/attention.wgsl`.

use crate::model::case::Category;
use crate::model::scalar::Real;

use super::delay_steps;

/// Thresholds of a perception rule; see the models' profiles for units and clauses.
#[derive(Debug, Clone, Copy)]
pub struct Perception {
    /// Lateral wandering that counts as normal, m.
    pub wandering_m: f64,
    /// Perception time, s.
    pub time_s: f64,
    /// Lateral travel that ends the perception early, m.
    pub travel_m: f64,
}

/// "Never" as a step index.
pub const NEVER: u32 = u32::MAX;

/// [`AttentionRule::kind`]: from the first step on.
pub const ALWAYS: u32 = 0;
/// [`AttentionRule::kind`]: once lateral movement has been visible for some time.
pub const VISIBLE_MOVEMENT: u32 = 1;
/// [`AttentionRule::kind`]: once a deviation from the vehicle's own lane centre has been perceived.
pub const WANDERING: u32 = 2;
/// [`AttentionRule::kind`]: once it decelerates.
pub const DECELERATION: u32 = 3;

/// Lateral movement per step from which on a vehicle moves, m: more than rounding.
const MOVEMENT_M: f64 = 1e-9;

/// What has to be seen of the principal vehicle before a driver may react.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AttentionRule<R> {
    /// [`ALWAYS`], [`VISIBLE_MOVEMENT`], [`WANDERING`] or [`DECELERATION`].
    pub kind: u32,
    /// Steps from the event to the reaction.
    pub delay_steps: u32,
    /// 1 where the driver waits as long with the vehicle ahead of the principal one (cut-outs, leader decelerations).
    pub with_ahead: u32,
    /// Movement: the lateral gate, m. Wandering: the normal wandering, m. Deceleration: loss of speed in a step, m/s.
    pub threshold: R,
    /// Wandering: lateral travel that ends the delay, m.
    pub travel: R,
}

impl AttentionRule<f64> {
    /// From the first step on.
    pub fn always() -> Self {
        AttentionRule { kind: ALWAYS, delay_steps: 0, with_ahead: 0, threshold: 0.0, travel: 0.0 }
    }

    /// Once lateral movement has been visible for `visible_s`; at once for a vehicle that starts inside the gate and
    /// in LVD, where there is nothing to see.
    pub fn after_visible_movement(visible_s: f64, lateral_gate_m: f64, dt_s: f64, category: Category) -> Self {
        if visible_s <= 0.0 || category == Category::Lvd {
            return Self::always();
        }
        let delay_steps = delay_steps(visible_s, dt_s);
        AttentionRule { kind: VISIBLE_MOVEMENT, delay_steps, threshold: lateral_gate_m, ..Self::always() }
    }

    /// Once the deviation from the vehicle's own lane centre has been perceived (Annex 3): more than the wandering
    /// for the perception time, or the perception travel beyond it. In a cut-out the vehicle ahead is seen as late. A
    /// vehicle whose lane change is over at the start has nothing left to deviate: what it was to show is seen at once.
    pub fn after_wandering(rule: Perception, dt_s: f64, category: Category) -> Self {
        if rule.wandering_m <= 0.0 {
            return Self::always();
        }
        AttentionRule {
            kind: WANDERING,
            delay_steps: delay_steps(rule.time_s, dt_s),
            with_ahead: u32::from(category == Category::CutOut),
            threshold: rule.wandering_m,
            travel: rule.wandering_m + rule.travel_m,
        }
    }

    /// Once the vehicle decelerates more than the trigger.
    pub fn after_deceleration(trigger_mps2: f64, dt_s: f64) -> Self {
        if trigger_mps2 <= 0.0 {
            return Self::always();
        }
        AttentionRule { kind: DECELERATION, with_ahead: 1, threshold: trigger_mps2 * dt_s, ..Self::always() }
    }

    /// The host's one rounding.
    pub fn cast<R: Real>(&self) -> AttentionRule<R> {
        AttentionRule {
            kind: self.kind,
            delay_steps: self.delay_steps,
            with_ahead: self.with_ahead,
            threshold: R::from_f64(self.threshold),
            travel: R::from_f64(self.travel),
        }
    }
}

impl AttentionRule<f32> {
    /// In the arithmetic of a lane, exactly.
    pub fn widen<R: Real>(&self) -> AttentionRule<R> {
        AttentionRule {
            kind: self.kind,
            delay_steps: self.delay_steps,
            with_ahead: self.with_ahead,
            threshold: R::from_f64(self.threshold.into()),
            travel: R::from_f64(self.travel.into()),
        }
    }
}

impl<R: Real> AttentionRule<R> {
    /// First step at which the driver may react to the principal vehicle and to the one ahead of it; [`NEVER`] where
    /// there is none. `lateral` (m) and `speed` (m/s) give the principal vehicle's motion at steps below `steps`;
    /// `half_widths` is (W_e + W_o)/2, m.
    #[inline]
    pub fn attend_from(
        &self,
        steps: u32,
        half_widths: R,
        lateral: impl Fn(u32) -> R,
        speed: impl Fn(u32) -> R,
    ) -> [u32; 2] {
        if self.kind == ALWAYS || steps == 0 {
            return [0; 2];
        }
        let start = lateral(0);
        if self.kind == VISIBLE_MOVEMENT && start.abs() - half_widths <= self.threshold {
            return [0; 2];
        }
        let is_in_path = start.abs() <= half_widths;
        let comes_in = self.with_ahead == 0;
        if self.kind == WANDERING && is_in_path == comes_in {
            return [0; 2];
        }
        let mut event = NEVER;
        let mut early = NEVER;
        let (mut lateral_before, mut speed_before) = (start, speed(0));
        for step in 0..steps {
            let (position, v) = (lateral(step), speed(step));
            let happens = match self.kind {
                VISIBLE_MOVEMENT => (position - lateral_before).abs() > R::from_f64(MOVEMENT_M),
                WANDERING => (position - start).abs() > self.threshold,
                _ => speed_before - v > self.threshold,
            };
            if happens && event == NEVER {
                // Movement is seen at the step that it begins from.
                let from = if self.kind == VISIBLE_MOVEMENT { step.saturating_sub(1) } else { step };
                event = from + self.delay_steps;
            }
            if self.kind == WANDERING && early == NEVER && (position - start).abs() > self.travel {
                early = step;
            }
            // No later step can change which of the two comes first.
            if early != NEVER || (event != NEVER && (self.kind != WANDERING || step >= event)) {
                break;
            }
            lateral_before = position;
            speed_before = v;
        }
        let from = event.min(early);
        [from, if self.with_ahead != 0 { from } else { 0 }]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERCEPTION: Perception = Perception { wandering_m: 0.375, time_s: 0.4, travel_m: 0.72 };

    fn first(rule: AttentionRule<f64>, lateral: impl Fn(u32) -> f64) -> u32 {
        rule.attend_from(100, 1.8, lateral, |_| 20.0)[0]
    }

    #[test]
    fn wandering_is_perceived_after_its_time_or_its_travel() {
        let rule = AttentionRule::after_wandering(PERCEPTION, 0.1, Category::CutIn);
        // 0.375 m are exceeded at step 4 with 1 m/s, and 1.095 m only at step 11.
        assert_eq!(first(rule, |i| 3.5 - 0.1 * f64::from(i)), 4 + 4);
        // With 10 m/s the travel is made at step 2.
        assert_eq!(first(rule, |i| 3.5 - f64::from(i)), 2);
        assert_eq!(first(rule, |_| 3.5), NEVER);
    }

    /// Parameterizations 3, 4, c and d have the other vehicle in its final place from the start.
    #[test]
    fn a_lane_change_that_is_over_at_the_start_is_seen_at_once() {
        let rule = |category| AttentionRule::after_wandering(PERCEPTION, 0.1, category);
        assert_eq!(rule(Category::CutIn).attend_from(100, 1.8, |_| 0.1, |_| 20.0), [0, 0]);
        assert_eq!(rule(Category::CutIn).attend_from(100, 1.8, |_| 1.9, |_| 20.0), [NEVER, 0]);
        assert_eq!(rule(Category::CutOut).attend_from(100, 1.8, |_| 0.1, |_| 20.0), [NEVER, NEVER]);
        assert_eq!(rule(Category::CutOut).attend_from(100, 1.8, |_| -3.5, |_| 20.0), [0, 0]);
    }

    #[test]
    fn movement_counts_from_the_step_that_it_begins_at_and_not_inside_the_gate() {
        let rule = AttentionRule::after_visible_movement(0.72, 0.5, 0.1, Category::CutIn);
        assert_eq!(first(rule, |i| if i < 5 { 3.5 } else { 3.5 - 0.1 * f64::from(i - 4) }), 4 + 8);
        assert_eq!(first(rule, |_| 2.0), 0);
        assert_eq!(AttentionRule::after_visible_movement(0.72, 0.5, 0.1, Category::Lvd), AttentionRule::always());
    }

    #[test]
    fn a_deceleration_is_seen_at_the_step_after_it() {
        let rule = AttentionRule::after_deceleration(5.0, 0.1);
        let braking = |i: u32| if i < 3 { 20.0 } else { 20.0 - 0.6 * f64::from(i - 2) };
        assert_eq!(rule.attend_from(50, 1.8, |_| 0.0, braking), [3, 3]);
        assert_eq!(rule.attend_from(50, 1.8, |_| 0.0, |_| 20.0), [NEVER, NEVER]);
    }
}
