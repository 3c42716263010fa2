//! When a driver may react to a vehicle at all, as far as that depends on the vehicle's own motion only:
//! visibility and perception rules of UN R157. Worked out once on the host, so a lane holds one step index
//! per model instead of perception state.

use crate::scenario::Category;

/// Motion of the vehicle that is perceived, one value per step.
pub struct Attention<'a> {
    /// Kind of scenario.
    pub category: Category,
    /// Time step, s.
    pub dt_s: f64,
    /// Lateral position of its centre relative to the middle of the ego's lane, m.
    pub lateral_m: &'a [f64],
    /// Speed, m/s.
    pub speed_mps: &'a [f64],
    /// (W_e + W_o)/2, m.
    pub half_widths_m: f64,
}

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

impl Attention<'_> {
    /// First step at which lateral movement has been visible for `visible_s`; 0 for a vehicle that starts
    /// inside the gate and in LVD, where there is nothing to see.
    pub fn after_visible_movement(&self, visible_s: f64, lateral_gate_m: f64) -> u32 {
        let starts_inside = self.lateral_m.first().is_none_or(|y| y.abs() - self.half_widths_m <= lateral_gate_m);
        if visible_s <= 0.0 || starts_inside || self.category == Category::Lvd {
            return 0;
        }
        let begin = self.lateral_m.windows(2).position(|y| (y[1] - y[0]).abs() > 1e-9);
        begin.map_or(NEVER, |k| k as u32 + super::delay_steps(visible_s, self.dt_s))
    }

    /// First step at which the deviation from the vehicle's own lane centre has been perceived (Annex 3):
    /// more than the wandering for the perception time, or the perception travel beyond it.
    pub fn after_wandering(&self, rule: Perception) -> u32 {
        if rule.wandering_m <= 0.0 {
            return 0;
        }
        let Some(&start) = self.lateral_m.first() else { return NEVER };
        let deviation = |y: f64| (y - start).abs();
        let Some(begin) = self.lateral_m.iter().position(|&y| deviation(y) > rule.wandering_m) else { return NEVER };
        let by_time = begin as u32 + super::delay_steps(rule.time_s, self.dt_s);
        let by_travel = self
            .lateral_m
            .iter()
            .position(|&y| deviation(y) > rule.wandering_m + rule.travel_m)
            .map_or(NEVER, |k| k as u32);
        by_time.min(by_travel)
    }

    /// First step at which the vehicle decelerates more than the trigger.
    pub fn after_deceleration(&self, trigger_mps2: f64) -> u32 {
        if trigger_mps2 <= 0.0 {
            return 0;
        }
        let limit = trigger_mps2 * self.dt_s;
        self.speed_mps.windows(2).position(|v| v[0] - v[1] > limit).map_or(NEVER, |k| k as u32 + 1)
    }
}
