//! Where every vehicle of a lane is, step by step: the trace, and beyond its end the others' own motion.

use crate::engine::{LaneCase, Trace};
use crate::model::scalar::Real;
use crate::scenario::Tables;

/// A vehicle's centre at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vertex {
    /// Time, s.
    pub time_s: f64,
    /// Along the road, m; the ego's centre starts at 0.
    pub x_m: f64,
    /// Across the road, m; 0 is the middle of the ego's lane.
    pub y_m: f64,
    /// Speed along the road, m/s.
    pub v_mps: f64,
}

/// The ego's path, then those of the others, each with one vertex per step from 0 to `last_step`.
///
/// Up to the trace's last step they are the trace, bit for bit. Beyond it the others follow the motion of the case
/// (which holds its last speed and lateral position for ever), as the lane would have moved them; the ego keeps its
/// last speed.
pub fn paths<R: Real>(trace: &Trace, case: &LaneCase<R>, tables: &Tables<R>, last_step: u32) -> Vec<Vec<Vertex>> {
    let dt_s = trace.dt_s;
    let traced = trace.steps.iter().take(last_step as usize + 1);
    let mut all: Vec<Vec<Vertex>> = vec![Vec::with_capacity(last_step as usize + 1); 1 + trace.vehicles];
    for step in traced {
        all[0].push(Vertex { time_s: step.time_s, x_m: step.x_ego_m, y_m: 0.0, v_mps: step.v_ego_mps });
        for (path, other) in all[1..].iter_mut().zip(&step.others) {
            path.push(Vertex { time_s: step.time_s, x_m: other.x_m, y_m: other.y_m, v_mps: other.v_mps });
        }
    }
    for (at, path) in all.iter_mut().enumerate() {
        for step in path.len() as u32..=last_step {
            let Some(&before) = path.last() else { break };
            let (v_mps, y_m) = match at.checked_sub(1) {
                None => (before.v_mps, before.y_m),
                Some(other) => {
                    let motion = &case.others[other].motion;
                    (motion.speed(tables, step).to_f64(), motion.lateral(tables, step).position.to_f64())
                }
            };
            path.push(Vertex { time_s: trace.time_s(step), x_m: before.x_m + v_mps * dt_s, y_m, v_mps });
        }
    }
    all
}
