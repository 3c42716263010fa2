//! Directions of travel: the line of the road for each, and who drives along which.

use std::collections::BTreeMap;

use super::pieces::Piece;
use super::preset::{Preset, RoadSource};
use super::road::{OnRoad, Path, RoadLine, dot, median};

/// A piece on its carriageway.
pub(super) struct Placed {
    pub piece: Piece,
    pub is_forward: bool,
    pub on: Vec<OnRoad>,
}

/// Maximum number of paths that the road is fitted to.
const FITTED_PATHS: usize = 400;
/// Time between positions that the road is fitted to, s.
const FITTED_STEP_S: f64 = 0.2;
/// Standard deviation of the kernel over lateral positions within which vehicles tell the direction of a place, m.
const KERNEL_M: f64 = 0.7;
/// What is farther away tells nothing, m.
const REACH_M: f64 = 8.0;
/// Raster of these positions, m.
const RASTER_M: f64 = 0.25;

/// The lines of the backward and forward carriageway, and whether each piece belongs to the forward one.
pub(super) fn road(pieces: &[Piece], preset: &Preset, rate_hz: f64) -> Option<([Option<RoadLine>; 2], Vec<bool>)> {
    let along = match preset.road {
        RoadSource::X => Some([1.0, 0.0]),
        RoadSource::Y => Some([0.0, 1.0]),
        RoadSource::Tracks => None,
    };
    let stride = (FITTED_STEP_S * rate_hz).round().max(1.0) as usize;
    let path = |piece: &Piece| -> Path {
        let last = piece.samples.len() - 1;
        (0..=last).filter(|k| k % stride == 0 || *k == last).map(|k| piece.samples.xy_m(k)).collect()
    };
    if let Some(along) = along {
        let line = RoadLine::straight([0.0; 2], along);
        let is_forward = |piece: &Piece| piece.direction.unwrap_or_else(|| dot(along, piece.travel_m())) >= 0.0;
        let forward = settled(pieces, &pieces.iter().map(is_forward).collect::<Vec<_>>(), &line, path);
        return Some(([Some(line.reversed()), Some(line)], forward));
    }
    let size = |piece: &Piece| libm::hypot(piece.travel_m()[0], piece.travel_m()[1]);
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
        pieces.iter().map(|piece| piece.direction.unwrap_or_else(|| gain(piece)) >= 0.0).collect();
    // Forward is towards +x, or +y on a road along y.
    let travel = longest.travel_m();
    let leads = if travel[0].abs() > 0.2 * travel[1].abs() { travel[0] } else { travel[1] };
    let longest_is_forward = gain(longest) >= 0.0;
    if (leads >= 0.0) != longest_is_forward && pieces.iter().all(|piece| piece.direction.is_none()) {
        forward.iter_mut().for_each(|is| *is = !*is);
    }
    let line = |forward: &[bool], is_forward: bool| {
        let mut here: Vec<&Piece> =
            pieces.iter().zip(forward).filter(|(_, is)| **is == is_forward).map(|(piece, _)| piece).collect();
        here.sort_by(|a, b| size(b).total_cmp(&size(a)).then(a.vehicle.cmp(&b.vehicle)));
        // Every n-th of them, from the longest on.
        let every = here.len().div_ceil(FITTED_PATHS).max(1);
        RoadLine::fit(&here.into_iter().step_by(every).map(path).collect::<Vec<_>>())
    };
    let mut lines = [false, true].map(|side| line(&forward, side));
    let driven = |side: bool| -> f64 {
        pieces.iter().zip(&forward).filter(|(_, is)| **is == side).map(|(of, _)| size(of)).sum()
    };
    let of_most =
        if driven(true) < driven(false) { lines[0].as_ref().map(RoadLine::reversed) } else { lines[1].clone() };
    let settled = settled(pieces, &forward, &of_most?, path);
    if settled != forward {
        lines = [false, true].map(|side| line(&settled, side));
    }
    if let [Some(backward), Some(forward)] = &lines
        && backward.is_straight()
        && forward.is_straight()
    {
        lines[0] = Some(forward.reversed());
    }
    Some((lines, settled))
}

/// The directions of pieces that first have those of their travel. What stands, or reverses, is of the direction in which most
/// metres are driven where it is across the road: nothing is a carriageway within the lanes of another. A heading, if most of
/// them fit the travel, tells more than these where few metres are driven.
fn settled(pieces: &[Piece], forward: &[bool], line: &RoadLine, path: impl Fn(&Piece) -> Path) -> Vec<bool> {
    let paths: Vec<Vec<OnRoad>> = pieces.iter().map(|piece| line.project_all(&path(piece))).collect();
    let heading = |(piece, forward): (&Piece, &bool)| {
        let along = line.directions(&[piece.samples.xy_m(0)])[0];
        let sum: f64 = (0..piece.samples.len()).map(|k| dot(along, piece.samples.heading(k))).sum();
        let mean = sum / piece.samples.len() as f64;
        (mean.abs() > 0.9).then_some((mean > 0.0, (mean > 0.0) == *forward))
    };
    let headings: Vec<Option<(bool, bool)>> = pieces.iter().zip(forward).map(heading).collect();
    let known = || headings.iter().flatten();
    let is_trusted = 10 * known().filter(|(_, fits)| *fits).count() > 9 * known().count();
    let by_heading = |k: usize| headings[k].filter(|_| is_trusted && pieces[k].direction.is_none()).map(|(is, _)| is);
    let first: Vec<bool> = (0..pieces.len()).map(|k| by_heading(k).unwrap_or(forward[k])).collect();
    let cell = |on: &OnRoad| (on.d_m / RASTER_M).floor() as i64;
    let mut driven_m: BTreeMap<i64, [f64; 2]> = BTreeMap::new();
    for (path, is_forward) in paths.iter().zip(&first) {
        let mut last_s_m = path[0].s_m;
        for on in path {
            driven_m.entry(cell(on)).or_default()[usize::from(*is_forward)] += (on.s_m - last_s_m).abs();
            last_s_m = on.s_m;
        }
    }
    let weight = |cells: i64| libm::exp(-0.5 * (cells as f64 * RASTER_M / KERNEL_M).powi(2));
    let reach = (REACH_M / RASTER_M) as i64;
    let near = |at: i64| {
        let add =
            |sum: [f64; 2], (other, by_m): (&i64, &[f64; 2])| [0, 1].map(|k| sum[k] + weight(at - other) * by_m[k]);
        driven_m.range(at.saturating_sub(reach)..=at.saturating_add(reach)).fold([0.0; 2], add)
    };
    let near_m: BTreeMap<i64, [f64; 2]> = driven_m.keys().map(|at| (*at, near(*at))).collect();
    let settle = |k: usize| {
        let [own_m, other_m] = [first[k], !first[k]].map(|side| {
            let sum: f64 = paths[k].iter().map(|on| near_m[&cell(on)][usize::from(side)]).sum();
            sum / paths[k].len() as f64
        });
        let least_m: f64 = if by_heading(k).is_some() { 1.0 } else { 0.0 };
        first[k] != (pieces[k].direction.is_none() && other_m > least_m.max(2.0 * own_m))
    };
    (0..pieces.len()).map(settle).collect()
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
