//! The boxes of vehicles: sizes, classes, and the way from the reference point to the middle.

use super::pieces::Piece;
use super::preset::{Preset, Reference};
use super::raw::RawVehicle;
use super::road::median;
use crate::traffic::trajectory::VehicleClass;

/// Length and width where neither file nor preset has them, m.
const USUAL_CAR_M: [f64; 2] = [4.6, 1.9];
const USUAL_TRUCK_M: [f64; 2] = [12.0, 2.5];
/// A vehicle of this length is a lorry if no class tells, m.
const TRUCK_FROM_M: f64 = 7.0;

pub(super) fn is_ignored(vehicle: &RawVehicle, preset: &Preset) -> bool {
    vehicle.samples.is_empty() || vehicle.class.as_ref().is_some_and(|class| begins_so(class, &preset.classes.ignored))
}

pub(super) fn begins_so(class: &str, list: &[String]) -> bool {
    let class = class.to_lowercase();
    list.iter().any(|text| class.starts_with(&text.to_lowercase()))
}

/// A vehicle's box.
pub(super) struct Sized {
    pub length_m: f64,
    pub width_m: f64,
    pub class: VehicleClass,
    /// The file has no size.
    pub is_assumed: bool,
    /// It varies by more than a tenth.
    pub changes: bool,
}

/// The box of a piece of a vehicle's track.
pub(super) fn sized(piece: &Piece, vehicle: &RawVehicle, preset: &Preset) -> Sized {
    let [lengths_m, widths_m] = vehicle.sizes_m(&piece.samples);
    let class = vehicle.class_of(&piece.samples).unwrap_or_default();
    let class = class.as_str();
    let of = |sizes: &[f64]| {
        let value = median(&mut sizes.to_vec());
        (!value.is_nan()).then_some(value)
    };
    let (length_m, width_m) = (of(&lengths_m), of(&widths_m));
    let is_named_truck = begins_so(class, &preset.classes.truck);
    let truck_from_m = preset.classes.truck_from_m;
    let is_long = |from_m: f64| length_m.is_some_and(|length_m| length_m >= from_m);
    let is_truck = match truck_from_m {
        Some(from_m) => is_long(from_m) && (preset.classes.truck.is_empty() || is_named_truck || class.is_empty()),
        None if preset.classes.truck.is_empty() || class.is_empty() => is_long(TRUCK_FROM_M),
        None => is_named_truck,
    };
    let usual = usual_size_m(class, preset).unwrap_or(if is_truck { USUAL_TRUCK_M } else { USUAL_CAR_M });
    let varies = |sizes: &[f64]| {
        let (low, high) = sizes.iter().fold((f64::INFINITY, 0.0_f64), |(l, h), v| (l.min(*v), h.max(*v)));
        sizes.len() > 1 && high > 1.1 * low
    };
    Sized {
        length_m: length_m.unwrap_or(usual[0]),
        width_m: width_m.unwrap_or(usual[1]),
        class: if is_truck { VehicleClass::Truck } else { VehicleClass::Car },
        is_assumed: length_m.is_none() || width_m.is_none(),
        changes: varies(&lengths_m) || varies(&widths_m),
    }
}

/// Length and width in the preset of a class, or of the longest name there that its text begins with, m.
pub(super) fn usual_size_m(class: &str, preset: &Preset) -> Option<[f64; 2]> {
    let begins = |name: &&String| begins_so(class, std::slice::from_ref(name));
    let of_name = || preset.sizes.keys().filter(begins).max_by_key(|name| name.len());
    preset.sizes.get(class).or_else(|| preset.sizes.get(of_name()?)).or_else(|| preset.sizes.get("default")).copied()
}

/// Moves the positions from the reference point to the middle of the box.
pub(super) fn centre(piece: &mut Piece, of: &Sized, reference: Reference, has_heading: bool, y_sign: f64) {
    if reference == Reference::Centre || (reference != Reference::Corner && !has_heading) {
        return;
    }
    let (first, last) = (piece.samples.xy_m(0), piece.samples.xy_m(piece.samples.len() - 1));
    let travel = [last[0] - first[0], last[1] - first[1]];
    let mut samples = piece.samples.to_vec();
    for sample in &mut samples {
        let heading = if sample.heading[0].is_nan() { travel } else { sample.heading };
        let norm = libm::hypot(heading[0], heading[1]);
        if norm > 0.0 {
            let by = to_centre_m(reference, [heading[0] / norm, heading[1] / norm], of.length_m, of.width_m, y_sign);
            sample.xy_m = [sample.xy_m[0] + by[0], sample.xy_m[1] + by[1]];
        }
    }
    piece.samples = samples.iter().collect();
}

/// The vector from the reference point to the centre of the box, m, of a vehicle that faces along a unit vector.
fn to_centre_m(reference: Reference, heading: [f64; 2], length_m: f64, width_m: f64, y_sign: f64) -> [f64; 2] {
    let along = |metres: f64| heading.map(|part| metres * part);
    match reference {
        Reference::Centre => [0.0; 2],
        Reference::Front => along(-length_m / 2.0),
        Reference::Rear => along(length_m / 2.0),
        // The box lies along the axes: its larger extent along the one that the vehicle drives along.
        Reference::Corner => {
            let is_along_x = heading[0].abs() >= heading[1].abs();
            let (x_m, y_m) = if is_along_x { (length_m, width_m) } else { (width_m, length_m) };
            [x_m / 2.0, y_sign * y_m / 2.0]
        }
    }
}
