//! The step from which a driver may react to a vehicle, as far as it depends only on that vehicle's motion: visibility
//! and perception rules of UN R157. It is computed once per case, so a lane holds one step index per model instead of
//! perception state. Twin: `shaders/shared/attention.wgsl`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::category::Category;
use crate::scalar::Real;

use super::delay_steps;

/// "Never" as a step index.
pub const NEVER: u32 = u32::MAX;

/// [`AttentionRule::kind`]: from the first step on.
const ALWAYS: u32 = 0;
/// [`AttentionRule::kind`]: once lateral movement has been visible for the required time.
const VISIBLE_MOVEMENT: u32 = 1;
/// [`AttentionRule::kind`]: once a vehicle beside the ego's path has deviated from the centre of its lane for the
/// required time.
const CUTTING_IN: u32 = 2;
/// [`AttentionRule::kind`]: once the vehicle in the ego's path has deviated from the centre of the ego's lane for the
/// required time; the vehicle ahead of it becomes visible at the same step.
const CUTTING_OUT: u32 = 3;
/// [`AttentionRule::kind`]: once the vehicle decelerates; the vehicle ahead of it becomes visible at the same step.
const DECELERATION: u32 = 4;

/// Minimum lateral movement per step that counts as movement, m: larger than rounding.
const MOVEMENT_M: f64 = 1e-9;

/// Relative tolerance by which a loss of speed must exceed the trigger. It is larger than the rounding of speeds, so
/// that a lead exactly at the trigger does not exceed it.
const ROUNDING: f64 = 1e-9;

/// What the driver does while the lead has lost speed without decelerating more than the trigger. The text of Annex 3
/// does not say; its charts contain such leads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BelowTrigger {
    /// It does not react (the text alone).
    Never,
    /// It reacts without the perception time, from the step at which the lead begins to lose speed, whatever follows. A
    /// lead whose first loss exceeds the trigger is perceived first.
    DelayOnly,
    /// It reacts from the first step on, whatever the lead does (the JRC's simulator).
    AtOnce,
}

/// What the driver must perceive of the principal vehicle before it may react.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AttentionRule<R> {
    /// `ALWAYS`, `VISIBLE_MOVEMENT`, `CUTTING_IN`, `CUTTING_OUT` or `DECELERATION`.
    pub kind: u32,
    /// Steps from the event to the reaction.
    pub delay_steps: u32,
    /// Deceleration: the behaviour below the trigger, a [`BelowTrigger`].
    pub below_trigger: u32,
    /// Movement: lane intrusion, m beyond the marking. Deviation: normal wandering, m. Deceleration: loss of speed per
    /// step, m/s.
    pub threshold: R,
}

/// Sizes across the road that decide when the principal vehicle is perceived.
#[derive(Debug, Clone, Copy)]
pub struct LaneGeometry<R> {
    /// (W_e + W_o)/2, m.
    pub half_widths: R,
    /// Width of the lanes, m.
    pub lane_width: R,
    /// From the ego's side to the marking of its lane, m.
    pub marking_gap: R,
}

/// Distance from the ego's path to the centre of the lane that a cutter comes from, m; from beyond the neighbouring lane,
/// to its start.
#[inline]
pub fn lane_centre<R: Real>(start: R, lane_width: R) -> R {
    let is_farther = start.abs() - lane_width > lane_width * R::HALF;
    if is_farther { start.abs() } else { lane_width }
}

impl AttentionRule<f64> {
    /// From the first step on.
    pub(super) fn always() -> Self {
        AttentionRule { kind: ALWAYS, delay_steps: 0, below_trigger: 0, threshold: 0.0 }
    }

    /// Once lateral movement has been visible for `visible_s`. At once for a vehicle that starts after its lane
    /// intrusion, because its movement before the start is unknown; also in LVD, which has no lateral movement.
    pub(super) fn after_visible_movement(visible_s: f64, lane_intrusion_m: f64, dt_s: f64, category: Category) -> Self {
        if visible_s <= 0.0 || category == Category::Lvd {
            return Self::always();
        }
        let delay_steps = delay_steps(visible_s, dt_s);
        AttentionRule { kind: VISIBLE_MOVEMENT, delay_steps, threshold: lane_intrusion_m, ..Self::always() }
    }

    /// Once a vehicle that cuts in has deviated from the centre of its lane towards the ego by more than `wandering_m`
    /// for the perception time (Annex 3). A vehicle that starts in the ego's path is perceived at once. For one from
    /// beyond the neighbouring lane, the deviation is that from its start.
    pub(super) fn cutting_in(wandering_m: f64, perception_s: f64, dt_s: f64) -> Self {
        Self::deviation(CUTTING_IN, wandering_m, perception_s, dt_s)
    }

    /// The same for a vehicle that cuts out. If it starts outside the ego's path, the vehicle ahead is visible at once.
    pub(super) fn cutting_out(wandering_m: f64, perception_s: f64, dt_s: f64) -> Self {
        Self::deviation(CUTTING_OUT, wandering_m, perception_s, dt_s)
    }

    fn deviation(kind: u32, wandering_m: f64, perception_s: f64, dt_s: f64) -> Self {
        if wandering_m <= 0.0 {
            return Self::always();
        }
        let delay_steps = delay_steps(perception_s, dt_s);
        AttentionRule { kind, delay_steps, threshold: wandering_m, ..Self::always() }
    }

    /// Once the perception time has passed after the vehicle decelerated more than the trigger.
    pub(super) fn after_deceleration(trigger_mps2: f64, perception_s: f64, below: BelowTrigger, dt_s: f64) -> Self {
        if trigger_mps2 <= 0.0 || below == BelowTrigger::AtOnce {
            return Self::always();
        }
        AttentionRule {
            kind: DECELERATION,
            delay_steps: delay_steps(perception_s, dt_s),
            below_trigger: below as u32,
            threshold: trigger_mps2 * dt_s * (1.0 + ROUNDING),
        }
    }
}

impl<R: Real> AttentionRule<R> {
    /// Rounds the constants once to another arithmetic; exact to a wider one.
    pub fn cast<S: Real>(&self) -> AttentionRule<S> {
        let AttentionRule { kind, delay_steps, below_trigger, threshold } = *self;
        AttentionRule { kind, delay_steps, below_trigger, threshold: S::from_f64(threshold.to_f64()) }
    }

    /// Whether the driver may react to a vehicle from the first step on, whatever its speed does: any vehicle, or one that
    /// stays in the ego's path.
    pub fn attends_at_once(&self, stays_in_path: bool) -> bool {
        self.kind == ALWAYS || (self.kind == CUTTING_IN && stays_in_path)
    }

    /// First steps at which the driver may react to the principal vehicle and to the one ahead of it, or [`NEVER`].
    /// `lateral` (m) and `speed` (m/s) give the principal vehicle's motion at steps below `steps`. Nothing after a step
    /// decides whether the driver reacts at that step.
    #[inline]
    pub fn attend_from(
        &self,
        steps: u32,
        geometry: LaneGeometry<R>,
        lateral: impl Fn(u32) -> R,
        speed: impl Fn(u32) -> R,
    ) -> [u32; 2] {
        if self.kind == ALWAYS || steps == 0 {
            return [0; 2];
        }
        let LaneGeometry { half_widths, lane_width, marking_gap } = geometry;
        let start = lateral(0);
        let is_in_path = start.abs() <= half_widths;
        let is_seen = match self.kind {
            VISIBLE_MOVEMENT => start.abs() - half_widths <= marking_gap - self.threshold,
            CUTTING_IN => is_in_path,
            CUTTING_OUT => !is_in_path,
            _ => false,
        };
        if is_seen {
            return [0; 2];
        }
        let centre = lane_centre(start, lane_width);
        let delay_only = self.kind == DECELERATION && self.below_trigger == BelowTrigger::DelayOnly as u32;
        let mut event = NEVER;
        let (mut lateral_before, mut speed_before) = (start, speed(0));
        for step in 0..steps {
            let (position, v) = (lateral(step), speed(step));
            let happens = match self.kind {
                VISIBLE_MOVEMENT => (position - lateral_before).abs() > R::from_f64(MOVEMENT_M),
                DECELERATION => speed_before - v > self.threshold,
                CUTTING_OUT => position.abs() > self.threshold,
                _ => centre - position.abs() > self.threshold,
            };
            if delay_only && !happens && speed_before - v > R::ZERO {
                event = step;
                break;
            }
            if happens {
                // Movement becomes visible at the step where it begins.
                let from = if self.kind == VISIBLE_MOVEMENT { step.saturating_sub(1) } else { step };
                event = from + self.delay_steps;
                break;
            }
            lateral_before = position;
            speed_before = v;
        }
        let waits_with_ahead = self.kind == CUTTING_OUT || self.kind == DECELERATION;
        [event, if waits_with_ahead { event } else { 0 }]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GEOMETRY: LaneGeometry<f64> = LaneGeometry { half_widths: 1.9, lane_width: 3.5, marking_gap: 0.8 };

    fn first(rule: AttentionRule<f64>, lateral: impl Fn(u32) -> f64) -> u32 {
        rule.attend_from(100, GEOMETRY, lateral, |_| 20.0)[0]
    }

    #[test]
    fn a_deviation_is_perceived_after_its_time() {
        let rule = AttentionRule::cutting_in(0.375, 0.4, 0.1);
        // At 1 m/s the deviation exceeds 0.375 m at step 4.
        assert_eq!(first(rule, |i| 3.5 - 0.1 * f64::from(i)), 4 + 4);
        assert_eq!(first(rule, |i| 3.5 - f64::from(i)), 1 + 4);
        assert_eq!(first(rule, |_| 3.5), NEVER);
    }

    /// A recording that begins within the lane change has less to show, and the driver reacts no later.
    #[test]
    fn the_deviation_is_that_from_the_centre_of_the_lane_wherever_the_data_begin() {
        let rule = AttentionRule::cutting_in(0.375, 0.4, 0.1);
        let whole = |i: u32| 3.5 - 0.1 * f64::from(i);
        for cut in [0, 3, 4, 9, 15] {
            assert_eq!(first(rule, |i| whole(i + cut)), 4_u32.saturating_sub(cut) + 4, "{cut}");
        }
        // Outwards from the centre is no deviation towards the ego; from beyond the next lane the start counts.
        assert_eq!(first(rule, |_| 4.0), NEVER);
        assert_eq!(first(rule, |i| 7.0 - 0.1 * f64::from(i)), 4 + 4);
        let leaves = AttentionRule::cutting_out(0.375, 0.4, 0.1);
        assert_eq!(first(leaves, |i| 0.3 + 0.1 * f64::from(i)), 1 + 4);
    }

    /// Parameterizations 3, 4, c and d place the other vehicle at its final position from the start.
    #[test]
    fn a_lane_change_that_is_over_at_the_start_is_seen_at_once() {
        let [cuts_in, cuts_out] = [AttentionRule::cutting_in, AttentionRule::cutting_out].map(|of| of(0.375, 0.4, 0.1));
        assert_eq!(cuts_in.attend_from(100, GEOMETRY, |_| 0.1, |_| 20.0), [0, 0]);
        assert_eq!(cuts_in.attend_from(100, GEOMETRY, |_| 3.3, |_| 20.0), [NEVER, 0]);
        assert_eq!(cuts_out.attend_from(100, GEOMETRY, |_| 0.1, |_| 20.0), [NEVER, NEVER]);
        assert_eq!(cuts_out.attend_from(100, GEOMETRY, |_| -3.5, |_| 20.0), [0, 0]);
    }

    #[test]
    fn movement_counts_from_the_step_that_it_begins_at_and_not_after_the_lane_intrusion() {
        let rule = AttentionRule::after_visible_movement(0.72, 0.3, 0.1, Category::CutIn);
        assert_eq!(first(rule, |i| if i < 5 { 3.5 } else { 3.5 - 0.1 * f64::from(i - 4) }), 4 + 8);
        // Its edge is 0.3 m beyond the marking of a lane of 3.5 m at 2.4 m, and of one of 3.0 m at 2.15 m.
        assert_eq!(first(rule, |_| 2.39), 0);
        assert_eq!(first(rule, |_| 2.41), NEVER);
        let narrow = LaneGeometry { lane_width: 3.0, marking_gap: 0.55, ..GEOMETRY };
        assert_eq!(rule.attend_from(100, narrow, |_| 2.39, |_| 20.0)[0], NEVER);
        assert_eq!(AttentionRule::after_visible_movement(0.72, 0.3, 0.1, Category::Lvd), AttentionRule::always());
    }

    #[test]
    fn a_deceleration_beyond_the_trigger_is_perceived_and_others_by_option() {
        let rule = |below| AttentionRule::after_deceleration(5.0, 0.4, below, 0.1);
        let braking = |by: f64| move |i: u32| if i < 3 { 20.0 } else { 20.0 - by * f64::from(i - 2) };
        for below in [BelowTrigger::Never, BelowTrigger::DelayOnly] {
            assert_eq!(rule(below).attend_from(50, GEOMETRY, |_| 0.0, braking(0.6)), [3 + 4; 2], "{below:?}");
        }
        assert_eq!(rule(BelowTrigger::AtOnce), AttentionRule::always());
        let soft = |below| rule(below).attend_from(50, GEOMETRY, |_| 0.0, braking(0.4));
        assert_eq!(soft(BelowTrigger::Never), [NEVER; 2]);
        assert_eq!(soft(BelowTrigger::DelayOnly), [3; 2]);
        assert_eq!(rule(BelowTrigger::DelayOnly).attend_from(50, GEOMETRY, |_| 0.0, |_| 20.0), [NEVER; 2]);
        // A lead exactly at the trigger, at time steps with different rounding of the speeds.
        for dt_s in [0.1, 0.04, 0.01, 0.001] {
            let rule = AttentionRule::after_deceleration(5.0, 0.4, BelowTrigger::Never, dt_s);
            for v in [60.0 / 3.6, 20.0, 130.0 / 3.6] {
                assert_eq!(rule.attend_from(50, GEOMETRY, |_| 0.0, |i| v - f64::from(i) * (5.0 * dt_s)), [NEVER; 2]);
            }
        }
    }

    /// What a lead does later does not decide an earlier reaction.
    #[test]
    fn a_lead_that_brakes_harder_later_is_reacted_to_from_its_first_loss_of_speed() {
        let rule = AttentionRule::after_deceleration(5.0, 0.4, BelowTrigger::DelayOnly, 0.1);
        let brakes_twice = |i: u32| 20.0 - 0.4 * f64::from(i) - 0.4 * f64::from(i.saturating_sub(22));
        assert_eq!(rule.attend_from(50, GEOMETRY, |_| 0.0, brakes_twice), [1; 2]);
    }
}
