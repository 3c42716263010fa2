//! The boxes of vehicles: sizes, classes, and the way from the reference point to the middle.

use super::pieces::Piece;
use super::preset::{Preset, Reference};
use super::road::{median, unit};
use super::samples::{HEADING_X, HEADING_Y, LENGTH, Sample, Samples, WIDTH, X, Y};
use crate::trajectory::VehicleClass;

/// Length and width where the file has none, m.
const USUAL_CAR_M: [f64; 2] = [4.6, 1.9];
const USUAL_TRUCK_M: [f64; 2] = [12.0, 2.5];
/// A vehicle of this length is a lorry if no class tells, m.
const TRUCK_FROM_M: f64 = 7.0;

pub(super) fn is_ignored(vehicle: &Samples, classes: &[String], preset: &Preset) -> bool {
    vehicle.len() == 0 || vehicle.class(classes).is_some_and(|class| begins_so(class, &preset.classes.ignored))
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
}

/// The box of a piece of a vehicle's track; what its samples do not tell is that of all of the vehicle's.
pub(super) fn sized(piece: &Samples, vehicle: &Samples, classes: &[String], preset: &Preset) -> Sized {
    let class = piece.class(classes).or(vehicle.class(classes)).map_or("", String::as_str);
    let size_m = |of: &Samples, column: usize| Some(median(&mut of.changes(column))).filter(|size| !size.is_nan());
    let [length_m, width_m] = [LENGTH, WIDTH].map(|column| size_m(piece, column).or_else(|| size_m(vehicle, column)));
    let is_named_truck = begins_so(class, &preset.classes.truck);
    let is_long = |from_m: f64| length_m.is_some_and(|length_m| length_m >= from_m);
    let is_truck = match preset.classes.truck_from_m {
        Some(from_m) => is_long(from_m) && (preset.classes.truck.is_empty() || is_named_truck || class.is_empty()),
        None if preset.classes.truck.is_empty() || class.is_empty() => is_long(TRUCK_FROM_M),
        None => is_named_truck,
    };
    let usual = if is_truck { USUAL_TRUCK_M } else { USUAL_CAR_M };
    Sized {
        length_m: length_m.unwrap_or(usual[0]),
        width_m: width_m.unwrap_or(usual[1]),
        class: if is_truck { VehicleClass::Truck } else { VehicleClass::Car },
        is_assumed: length_m.is_none() || width_m.is_none(),
    }
}

/// Moves the positions from the reference point to the middle of the box along the heading of each sample, or the last one
/// before it. Returns what is left to do along the road, in lengths of the box, where the piece has no heading. `travel` is that
/// of the recording.
pub(super) fn centre(piece: &mut Piece, preset: &Preset, travel: [f64; 2]) -> f64 {
    let of = &piece.sized;
    let along = match preset.reference {
        Reference::Centre => return 0.0,
        Reference::Front => -0.5,
        Reference::Rear => 0.5,
        Reference::Corner => 0.0,
    };
    let mut headings = (0..piece.samples.len()).map(|k| piece.samples.heading(k));
    let is_corner = preset.reference == Reference::Corner;
    let first = headings.find(|heading| !heading[0].is_nan());
    let Some(mut heading) = first.or(is_corner.then_some(travel)) else { return along };
    let mut samples: Vec<Sample> = piece.samples.to_vec();
    for sample in &mut samples {
        if !sample[HEADING_X].is_nan() {
            heading = [sample[HEADING_X], sample[HEADING_Y]];
        }
        // The box of a corner lies along the axes: its larger extent along the one that the vehicle drives along.
        let is_along_x = heading[0].abs() >= heading[1].abs();
        let (x_m, y_m) = if is_along_x { (of.length_m, of.width_m) } else { (of.width_m, of.length_m) };
        let by = match is_corner {
            true => [x_m / 2.0, preset.axes.y_sign() * y_m / 2.0],
            false => unit(heading).unwrap_or_default().map(|part| along * of.length_m * part),
        };
        (sample[X], sample[Y]) = (sample[X] + by[0], sample[Y] + by[1]);
    }
    piece.samples = samples.iter().collect();
    0.0
}
