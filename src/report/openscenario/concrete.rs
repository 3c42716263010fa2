//! A concrete scenario for export: vehicles with their paths, the road they need, and properties.
//!
//! A path gives a vehicle's position step by step: from the trace, and after its end from the vehicle's own motion.

use lanesweep_engine::{LaneCase, Trace};
use lanesweep_model::scalar::Real;
use lanesweep_model::scenario::{Category, Side, Tables};
use lanesweep_support::{Error, Place, Result, option};

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

/// Distance of the rear axle behind the centre, as a fraction of the length: OpenSCENARIO positions a vehicle by its
/// rear axle.
const REAR_AXLE_FRACTION: f64 = 0.3;

impl PlayedVehicle {
    /// Distance from the centre of the rear axle, the reference point of OpenSCENARIO, forward to the centre of the
    /// box, m, rounded to millimetres.
    pub(super) fn centre_offset_m(&self) -> f64 {
        (REAR_AXLE_FRACTION * self.length_m * 1e3).round() / 1e3
    }
}

/// One concrete scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct Concrete {
    /// Lane key, or a substitute.
    pub key: String,
    /// Kind of scenario.
    pub category: Category,
    /// Who drives the ego.
    pub ego: EgoMotion,
    /// Side of the other vehicles at positive lateral positions.
    pub side: Side,
    /// Width of every lane of the road, m.
    pub lane_width_m: f64,
    /// The ego first.
    pub vehicles: Vec<PlayedVehicle>,
    /// The concrete parameters: names with units, values.
    pub parameters: Vec<(String, f64)>,
    /// Properties of the lane and its outcome, in order, its key first.
    pub properties: Vec<(&'static str, String)>,
    /// Whether the data are synthetic.
    pub is_synthetic: bool,
}

/// Maximum number of vertices of a vehicle: a file of about 200 MB.
const MAX_VERTICES: usize = 1_000_000;

impl Concrete {
    /// End of the scenario, s.
    pub(super) fn end_s(&self) -> f64 {
        self.vehicles.iter().filter_map(|vehicle| vehicle.path.last()).map(|v| v.time_s).fold(0.0, f64::max)
    }

    /// Time of the first overlap between two vehicles other than the ego, s. In a cut-out the cutting-out vehicle may
    /// drive through the one ahead of it.
    pub(super) fn others_overlap_s(&self) -> Option<f64> {
        let [_, other, ahead] = &self.vehicles[..] else { return None };
        let (length_m, width_m) = ((other.length_m + ahead.length_m) / 2.0, (other.width_m + ahead.width_m) / 2.0);
        let overlap = |(a, b): &(&Vertex, &Vertex)| (a.x_m - b.x_m).abs() < length_m && (a.y_m - b.y_m).abs() < width_m;
        other.path.iter().zip(&ahead.path).find(overlap).map(|(at, _)| at.time_s)
    }

    /// A lateral position in world coordinates, m: left is positive.
    pub(super) fn world_y_m(&self, y_m: f64) -> f64 {
        // + 0.0 avoids a negative zero.
        self.side.sign() * y_m + 0.0
    }

    /// Checks what types cannot express.
    ///
    /// # Errors
    /// [`Error::Input`] naming the lane, for numbers that are not finite, and for paths that are too short or too long.
    pub(crate) fn check(&self) -> Result<()> {
        let place = || Place::item(format!("lane {}", self.key));
        for vehicle in &self.vehicles {
            let count = vehicle.path.len();
            if !(2..=MAX_VERTICES).contains(&count) {
                let problem = format!("the path of {} has {count} vertices", vehicle.name);
                let duration = option("duration");
                let help =
                    format!("2 to {MAX_VERTICES} can be written: use a longer time step or a shorter {duration}");
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

/// The ego's path, then those of the other vehicles, each with one vertex per step from 0 to `last_step`.
///
/// Up to the trace's last step they equal the trace, bit for bit. After it the others follow the motion of the case, as
/// the lane would have moved them (the last speed and lateral position are held). The ego keeps its last speed.
pub(crate) fn paths<R: Real>(
    trace: &Trace,
    case: &LaneCase<R>,
    tables: &Tables<R>,
    last_step: u32,
) -> Vec<Vec<Vertex>> {
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

/// Formats a number as the shortest text that reads back to the same bits, without negative zero.
pub(super) fn number(value: f64) -> String {
    (value + 0.0).to_string()
}
