//! A concrete scenario as it is played: vehicles with their paths, the road they need, and what is said about them.
//!
//! A path says where a vehicle is, step by step: the trace, and beyond its end the others' own motion.

use crate::engine::{LaneCase, Trace};
use crate::model::scalar::Real;
use crate::scenario::{Category, Side, Tables};
use crate::{Error, Place, Result};

/// Who drives the ego.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EgoMotion {
    /// It follows the path that the driver model drove.
    Model,
    /// The user's own controller; only its start is written.
    External,
}

/// One vehicle.
#[derive(Debug, Clone, PartialEq)]
pub struct PlayedVehicle {
    /// Name of the entity.
    pub name: &'static str,
    /// Length, m, > 0.
    pub length_m: f64,
    /// Width, m, > 0.
    pub width_m: f64,
    /// Its centre, step by step; at least two vertices.
    pub path: Vec<Vertex>,
}

/// The rear axle lies this share of the length behind the centre: OpenSCENARIO places a vehicle by its rear axle.
const REAR_AXLE_SHARE: f64 = 0.3;

impl PlayedVehicle {
    /// From the centre of the rear axle, the reference point of OpenSCENARIO, forward to the centre of the box, m, in
    /// whole millimetres.
    pub fn centre_offset_m(&self) -> f64 {
        (REAR_AXLE_SHARE * self.length_m * 1e3).round() / 1e3
    }

    /// Distance of the axles, m: they lie symmetrically about the centre.
    pub fn wheelbase_m(&self) -> f64 {
        2.0 * self.centre_offset_m()
    }
}

/// One concrete scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct Concrete {
    /// Lane key, or what stands for one.
    pub key: String,
    /// Kind of scenario.
    pub category: Category,
    /// Who drives the ego.
    pub ego: EgoMotion,
    /// On which side the others are at positive lateral positions.
    pub side: Side,
    /// Width of every lane of the road, m.
    pub lane_width_m: f64,
    /// The ego first.
    pub vehicles: Vec<PlayedVehicle>,
    /// The concrete parameters: names with units, values.
    pub parameters: Vec<(String, f64)>,
    /// What is said of the lane and its outcome, in order.
    pub properties: Vec<(String, String)>,
    /// The data are the program's own.
    pub is_synthetic: bool,
}

/// Vertices of one vehicle at most: a file of some 200 MB.
pub const MAX_VERTICES: usize = 1_000_000;

impl Concrete {
    /// End of the scenario, s.
    pub fn end_s(&self) -> f64 {
        self.vehicles.iter().filter_map(|vehicle| vehicle.path.last()).map(|v| v.time_s).fold(0.0, f64::max)
    }

    /// When the boxes of two vehicles that are not the ego's first overlap, s. In a cut-out the vehicle that cuts out may
    /// drive through the one ahead of it.
    pub fn others_overlap_s(&self) -> Option<f64> {
        let [_, other, ahead] = &self.vehicles[..] else { return None };
        let (length_m, width_m) = ((other.length_m + ahead.length_m) / 2.0, (other.width_m + ahead.width_m) / 2.0);
        let overlap = |(a, b): &(&Vertex, &Vertex)| (a.x_m - b.x_m).abs() < length_m && (a.y_m - b.y_m).abs() < width_m;
        other.path.iter().zip(&ahead.path).find(overlap).map(|(at, _)| at.time_s)
    }

    /// A position across the road as the world has it: left is positive.
    pub fn world_y_m(&self, y_m: f64) -> f64 {
        // No negative zero.
        self.side.sign() * y_m + 0.0
    }

    /// Checks what no type says.
    ///
    /// # Errors
    /// [`Error::Input`] naming the lane, for numbers that are not finite and paths that are no trajectory or too long.
    pub fn check(&self) -> Result<()> {
        let place = || Place::item(format!("lane {}", self.key));
        for vehicle in &self.vehicles {
            let count = vehicle.path.len();
            if !(2..=MAX_VERTICES).contains(&count) {
                let problem = format!("the path of {} has {count} vertices", vehicle.name);
                let help = format!(
                    "2 to {MAX_VERTICES} can be written: use a longer time step or a shorter option `duration`"
                );
                return Err(Error::input(place(), problem, help));
            }
            let is_finite = |v: &Vertex| v.time_s.is_finite() && v.x_m.is_finite() && v.y_m.is_finite();
            if let Some(at) = vehicle.path.iter().position(|v| !is_finite(v)) {
                let problem = format!("{} leaves the numbers at step {at}", vehicle.name);
                return Err(Error::input(place(), problem, "such a motion cannot be played: correct the scenario"));
            }
        }
        Ok(())
    }
}

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
