//! A concrete scenario as it is played: vehicles with their paths, the road they need, and what is said about them.

use super::path::Vertex;
use crate::scenario::{Category, Side};
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
