//! Directions of travel: the line of the road for each, and who drives along which.

use super::boxes::Sized;
use super::pieces::Piece;
use super::preset::{Preset, RoadSource};
use super::raw::RawRecording;
use super::road::{OnRoad, Path, RoadLine, dot, median};

/// A piece on its carriageway.
pub(super) struct Placed {
    pub piece: Piece,
    pub sized: Sized,
    pub is_forward: bool,
    pub on: Vec<OnRoad>,
}

/// Maximum number of paths that the road is fitted to.
const FITTED_PATHS: usize = 400;
/// Time between positions that the road is fitted to, s.
const FITTED_STEP_S: f64 = 0.2;

/// The lines of the backward and forward carriageway, and whether each piece drives forward.
pub(super) fn road(
    pieces: &[Piece],
    raw: &RawRecording,
    preset: &Preset,
    rate_hz: f64,
) -> Option<([Option<RoadLine>; 2], Vec<bool>)> {
    let displacement = |piece: &Piece| {
        let (a, b) = (piece.samples.xy_m(0), piece.samples.xy_m(piece.samples.len() - 1));
        [b[0] - a[0], b[1] - a[1]]
    };
    let given = |piece: &Piece| raw.vehicles[piece.vehicle].direction;
    let along = match preset.road {
        RoadSource::X => Some([1.0, 0.0]),
        RoadSource::Y => Some([0.0, 1.0]),
        RoadSource::Tracks => None,
    };
    if let Some(along) = along {
        let line = RoadLine::straight([0.0; 2], along);
        let is_forward = |piece: &Piece| given(piece).unwrap_or_else(|| dot(along, displacement(piece))) >= 0.0;
        return Some(([Some(line.reversed()), Some(line)], pieces.iter().map(is_forward).collect()));
    }
    let stride = (FITTED_STEP_S * rate_hz).round().max(1.0) as usize;
    let path = |piece: &Piece| -> Path {
        let last = piece.samples.len() - 1;
        (0..=last).filter(|k| k % stride == 0 || *k == last).map(|k| piece.samples.xy_m(k)).collect()
    };
    let size = |piece: &Piece| libm::hypot(displacement(piece)[0], displacement(piece)[1]);
    let longest = pieces.iter().max_by(|a, b| size(a).total_cmp(&size(b)))?;
    if size(longest) < 1.0 {
        return None;
    }
    let first = RoadLine::fit(&[path(longest)])?;
    let gain = |piece: &Piece| {
        let (a, b) = (piece.samples.xy_m(0), piece.samples.xy_m(piece.samples.len() - 1));
        first.project(b).s_m - first.project(a).s_m
    };
    let mut forward: Vec<bool> =
        pieces.iter().map(|piece| given(piece).unwrap_or_else(|| gain(piece)) >= 0.0).collect();
    // Forward is towards +x, or +y on a road along y.
    let travel = displacement(longest);
    let leads = if travel[0].abs() > 0.2 * travel[1].abs() { travel[0] } else { travel[1] };
    let longest_is_forward = gain(longest) >= 0.0;
    if (leads >= 0.0) != longest_is_forward && raw.vehicles.iter().all(|vehicle| vehicle.direction.is_none()) {
        forward.iter_mut().for_each(|is| *is = !*is);
    }
    let line = |is_forward: bool| {
        let mut here: Vec<&Piece> =
            pieces.iter().zip(&forward).filter(|(_, is)| **is == is_forward).map(|(piece, _)| piece).collect();
        here.sort_by(|a, b| size(b).total_cmp(&size(a)).then(a.vehicle.cmp(&b.vehicle)));
        // Every n-th of them, from the longest on.
        let every = here.len().div_ceil(FITTED_PATHS).max(1);
        RoadLine::fit(&here.into_iter().step_by(every).map(path).collect::<Vec<_>>())
    };
    let (backward_line, forward_line) = (line(false), line(true));
    let lines = match (backward_line, forward_line) {
        (Some(backward), Some(forward)) if backward.is_straight() && forward.is_straight() => {
            [Some(forward.reversed()), Some(forward)]
        }
        (backward, forward) => [backward, forward],
    };
    Some((lines, forward))
}

/// How far to the left of the forward vehicles the oncoming ones are, m; `None` without both.
pub(super) fn oncoming_left_m(lines: &[Option<RoadLine>; 2], placed: &[Placed]) -> Option<f64> {
    let line = lines[1].as_ref()?;
    let middle = |of: &Placed| line.project(of.piece.samples.xy_m(of.piece.samples.len() / 2)).d_m;
    let of_side = |is_forward: bool| {
        let mut d: Vec<f64> = placed.iter().filter(|of| of.is_forward == is_forward).take(500).map(middle).collect();
        (d.len() >= 3).then(|| median(&mut d))
    };
    Some(of_side(false)? - of_side(true)?)
}
