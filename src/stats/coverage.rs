//! How points cover ranges: the largest and the most exposed intervals and rectangles without a point, exact, with their
//! share of the exposure.

use rayon::prelude::*;
use serde::Serialize;

use crate::Result;
use crate::random::Stream;
use crate::stats::density::DensityModel;
use crate::stats::estimate::{Density, Interval, Truncated, clopper_pearson};

/// [`Stream::purpose`] of the draws.
const COVERAGE_PURPOSE: u32 = 0x636f_7672;
/// Draws of a density: half of them choose the boxes, the others measure them.
const DRAWS: u64 = 40_000;
/// Level of the intervals.
const LEVEL: f64 = 0.95;

/// Values in two quantities, ends excluded. The second side of an interval is unbounded.
type Sides = [[f64; 2]; 2];

/// An interval of one quantity, or a rectangle of two, without a point inside, whatever the other quantities are. It cannot
/// grow without a point or leaving the ranges.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EmptyBox {
    /// Its quantities with their ends, one or two.
    pub sides: Vec<(usize, [f64; 2])>,
    /// Length or area, as a fraction of that of the ranges.
    pub size: f64,
    /// None is larger.
    pub is_largest: bool,
    /// None had more of the draws that choose.
    pub is_most_exposed: bool,
    /// Of the draws that measure, those inside.
    pub inside: u64,
    /// Fraction of the draws that measure, with the interval of Clopper and Pearson.
    pub exposure: (f64, Interval),
}

/// Valid draws of a density, in the order of their indices: the exposure. The same seed gives the same draws.
///
/// # Errors
/// None for a density that was fitted or read.
pub fn exposure_draws(density: &DensityModel, seed: u64) -> Result<Vec<Vec<f64>>> {
    let is_valid = |latent: &[f64]| density.space.is_valid(&density.values(latent));
    let truncated = Truncated::with_validity(density.mixture()?, is_valid, density.valid.estimate)?;
    let stream = Stream { seed, purpose: COVERAGE_PURPOSE };
    let drawn = (0..DRAWS).into_par_iter().filter_map(|index| truncated.draw(&stream, index));
    Ok(drawn.map(|draw| density.values(&draw.point)).collect())
}

/// The largest and the most exposed empty box of each quantity and of each pair, the most exposed first. Points and draws have a
/// value per range. A range of no length has no box.
///
/// The time grows with the square of the number of points.
pub fn empty_boxes(points: &[Vec<f64>], draws: &[Vec<f64>], ranges: &[[f64; 2]]) -> Vec<EmptyBox> {
    let all = (0..ranges.len()).filter(|at| ranges[*at][0] < ranges[*at][1]);
    let singles = all.clone().map(|at| vec![at]);
    let pairs = all.clone().flat_map(|x| all.clone().filter(move |y| x < *y).map(move |y| vec![x, y]));
    let quantities: Vec<Vec<usize>> = singles.chain(pairs).collect();
    let found = quantities.par_iter().map(|of| boxes_of(of, points, draws, ranges));
    let mut found: Vec<EmptyBox> = found.collect::<Vec<_>>().concat();
    // A stable sort: equal ones stay in the order of their quantities.
    found.sort_by(|a, b| b.inside.cmp(&a.inside).then(b.size.total_cmp(&a.size)));
    found
}

fn boxes_of(of: &[usize], points: &[Vec<f64>], draws: &[Vec<f64>], ranges: &[[f64; 2]]) -> Vec<EmptyBox> {
    const ALL: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];
    let place = |point: &Vec<f64>| [point[of[0]], of.get(1).map_or(0.0, |at| point[*at])];
    let range = [ranges[of[0]], of.get(1).map_or(ALL, |at| ranges[*at])];
    let points: Vec<[f64; 2]> = points.iter().map(place).collect();
    let candidates = if of.len() == 1 { intervals(points, range) } else { rectangles(points, range) };
    let mut choosing: Vec<[f64; 2]> = draws.iter().step_by(2).map(place).collect();
    choosing.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut heights: Vec<f64> = choosing.iter().map(|draw| draw[1]).collect();
    heights.sort_by(f64::total_cmp);
    let measuring: Vec<[f64; 2]> = draws.iter().skip(1).step_by(2).map(place).collect();
    let length = |side: &[f64; 2], range: &[f64; 2]| match range[1].is_finite() {
        true => (side[1] - side[0]) / (range[1] - range[0]),
        false => 1.0,
    };
    let size = |sides: &Sides| length(&sides[0], &range[0]) * length(&sides[1], &range[1]);
    let (mut largest, mut exposed) = (None::<(f64, Sides)>, None::<(usize, Sides)>);
    for sides in candidates {
        let of_sides = size(&sides);
        if largest.is_none_or(|(best, _)| of_sides > best) {
            largest = Some((of_sides, sides));
        }
        let from = choosing.partition_point(|draw| draw[0] <= sides[0][0]);
        let to = choosing.partition_point(|draw| draw[0] < sides[0][1]).max(from);
        let [below, above] = sides[1].map(|end| heights.partition_point(|height| *height < end));
        // No more are inside than between its ends in one quantity.
        if exposed.is_none_or(|(best, _)| to - from > best && above - below > best) {
            let inside = choosing[from..to].iter().filter(|draw| is_inside(draw, &sides)).count();
            if exposed.is_none_or(|(best, _)| inside > best) {
                exposed = Some((inside, sides));
            }
        }
    }
    let finished = |sides: Sides, is_largest: bool, is_most_exposed: bool| {
        let inside = measuring.iter().filter(|draw| is_inside(draw, &sides)).count() as u64;
        let interval = clopper_pearson(inside, measuring.len() as u64, LEVEL);
        let share = inside as f64 / measuring.len().max(1) as f64;
        let sides_of = of.iter().copied().zip(sides).collect();
        let exposure = (share, interval);
        EmptyBox { sides: sides_of, size: size(&sides), is_largest, is_most_exposed, inside, exposure }
    };
    match (largest, exposed.filter(|(inside, _)| *inside > 0)) {
        (Some((_, a)), Some((_, b))) if a != b => vec![finished(b, false, true), finished(a, true, false)],
        (Some((_, a)), of) => vec![finished(a, true, of.is_some())],
        _ => Vec::new(),
    }
}

fn is_inside(point: &[f64; 2], sides: &Sides) -> bool {
    point.iter().zip(sides).all(|(value, [low, high])| low < value && value < high)
}

/// The maximal intervals of the first quantity.
fn intervals(points: Vec<[f64; 2]>, range: Sides) -> Vec<Sides> {
    let mut ends: Vec<f64> = points.iter().filter(|point| is_inside(point, &range)).map(|point| point[0]).collect();
    ends.extend(range[0]);
    ends.sort_by(f64::total_cmp);
    ends.windows(2).filter(|pair| pair[0] < pair[1]).map(|pair| [[pair[0], pair[1]], range[1]]).collect()
}

/// All maximal rectangles, and some that are not. A maximal one reaches from floor to ceiling of the ranges, or has a point
/// on its lower edge, or on its upper edge and none on the lower one. From such a point a sweep up, or down to the floor, passes
/// the other points in order; each of them narrows the rectangle.
fn rectangles(points: Vec<[f64; 2]>, range: Sides) -> Vec<Sides> {
    let mut found = intervals(points.clone(), range);
    let [_, [floor, ceiling]] = range;
    let mut inside: Vec<[f64; 2]> = points.into_iter().filter(|point| is_inside(point, &range)).collect();
    inside.sort_by(|a, b| a[1].total_cmp(&b[1]).then(a[0].total_cmp(&b[0])));
    inside.dedup();
    // Narrows to the side of `x`; false if nothing is left.
    let narrow = |side: &mut [f64; 2], x: f64, other: f64| {
        side[usize::from(other > x)] = other;
        other != x
    };
    for (at, &[x, y]) in inside.iter().enumerate() {
        let is_within = |side: &[f64; 2], other: f64| side[0] < other && other < side[1];
        let mut side = range[0];
        let is_open = inside[at + 1..].iter().filter(|other| other[1] > y).all(|other| {
            let narrows = is_within(&side, other[0]);
            if narrows {
                found.push([side, [y, other[1]]]);
            }
            !narrows || narrow(&mut side, x, other[0])
        });
        found.extend(is_open.then_some([side, [y, ceiling]]));
        let mut side = range[0];
        let mut below = inside[..at].iter().rev().filter(|other| other[1] < y);
        let is_open = below.all(|other| !is_within(&side, other[0]) || narrow(&mut side, x, other[0]));
        found.extend(is_open.then_some([side, [floor, y]]));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    const UNIT: [f64; 2] = [0.0, 1.0];

    /// Seeded points of the unit square on a grid, so that values repeat.
    fn random(seed: u64, count: u64, grid: f64) -> Vec<Vec<f64>> {
        let stream = Stream { seed, purpose: 1 };
        let unit = |word: u32| ((f64::from(word) + 0.5) / 2_f64.powi(32) * grid).round() / grid;
        (0..count).map(|index| stream.words(index, 0)[..2].iter().map(|word| unit(*word)).collect()).collect()
    }

    fn area(sides: &Sides) -> f64 {
        sides.iter().map(|side| side[1] - side[0]).product()
    }

    /// Every rectangle whose edges are values of points or ends of the range.
    fn brute_force(points: &[Vec<f64>], value: &dyn Fn(&Sides) -> f64) -> f64 {
        let ends = |at: usize| {
            let mut ends: Vec<f64> = points.iter().map(|point| point[at]).chain(UNIT).collect();
            ends.sort_by(f64::total_cmp);
            ends.dedup();
            ends
        };
        let pairs = |ends: Vec<f64>| -> Vec<[f64; 2]> {
            ends.iter().enumerate().flat_map(|(at, low)| ends[at + 1..].iter().map(move |high| [*low, *high])).collect()
        };
        let (x, y) = (pairs(ends(0)), pairs(ends(1)));
        let all = x.iter().flat_map(|x| y.iter().map(move |y| [*x, *y]));
        let is_empty = |sides: &Sides| !points.iter().any(|point| is_inside(&[point[0], point[1]], sides));
        all.filter(is_empty).map(|sides| value(&sides)).fold(0.0, f64::max)
    }

    #[test]
    fn the_largest_and_the_most_exposed_rectangle_are_those_of_brute_force() {
        for seed in 0..60 {
            let grid = if seed % 2 == 0 { 8.0 } else { 1e9 };
            let points = random(seed, seed % 13, grid);
            let draws = random(1000 + seed, 400, 1e9);
            let boxes = empty_boxes(&points, &draws, &[UNIT, UNIT]);
            let of_pair = || boxes.iter().filter(|of| of.sides.len() == 2);
            let largest = of_pair().find(|of| of.is_largest).unwrap();
            assert!((largest.size - brute_force(&points, &area)).abs() < 1e-12, "seed {seed}");
            let choosing = |sides: &Sides| {
                draws.iter().step_by(2).filter(|draw| is_inside(&[draw[0], draw[1]], sides)).count() as f64
            };
            let exposed = of_pair().find(|of| of.is_most_exposed).unwrap();
            let sides = [exposed.sides[0].1, exposed.sides[1].1];
            assert_eq!(choosing(&sides), brute_force(&points, &choosing), "seed {seed}");
            for of in boxes.iter() {
                let is_in = |point: &Vec<f64>| of.sides.iter().all(|(at, [a, b])| *a < point[*at] && point[*at] < *b);
                assert!(!points.iter().any(is_in), "a box of seed {seed} holds a point");
            }
        }
    }

    #[test]
    fn a_planted_hole_is_found_and_its_share_of_a_uniform_exposure_is_its_area() {
        let is_outside = |p: &Vec<f64>| !(0.3 < p[0] && p[0] < 0.6 && 0.5 < p[1] && p[1] < 0.9);
        let points: Vec<Vec<f64>> = random(1, 4000, 1e9).into_iter().filter(is_outside).collect();
        let mut held = 0;
        for seed in 0..40 {
            let boxes = empty_boxes(&points, &random(2 + seed, 10_000, 1e9), &[UNIT, UNIT]);
            let of_pair = || boxes.iter().filter(|of| of.sides.len() == 2);
            assert_eq!(boxes[0].sides.len(), 2);
            // The largest box and the most exposed one.
            for (side, planted) in of_pair().flat_map(|of| of.sides.iter().zip([[0.3, 0.6], [0.5, 0.9]])) {
                assert!(side.1.iter().zip(planted).all(|(end, planted)| (end - planted).abs() < 0.02), "{side:?}");
            }
            let hole = of_pair().find(|of| of.is_largest).unwrap();
            held += usize::from(hole.exposure.1.holds(hole.size));
            let wide = boxes.iter().filter(|of| of.sides.len() == 1 && of.size > 0.01).count();
            assert_eq!(wide, 0, "no value of one quantity is missing");
        }
        // Of intervals at 95 %, fewer than 34 of 40 hold the truth once in 200 times.
        assert!(held >= 34, "{held} of 40 intervals hold the area");
    }

    #[test]
    fn degenerate_points_have_the_boxes_around_them() {
        let draws = random(3, 2000, 1e9);
        let sizes = |points: &[Vec<f64>]| {
            let boxes = empty_boxes(points, &draws, &[UNIT, UNIT]);
            boxes.into_iter().filter(|of| of.is_largest).map(|of| (of.sides.len(), of.size)).collect::<Vec<_>>()
        };
        let without = sizes(&[]);
        assert_eq!(without.len(), 3);
        assert!(without.iter().all(|(_, size)| *size == 1.0));
        // One point, several equal ones, and points on the ends of the ranges.
        for points in
            [vec![vec![0.25, 0.5]], vec![vec![0.25, 0.5]; 7], vec![vec![0.25, 0.5], vec![0.0, 0.5], vec![0.7, 1.0]]]
        {
            let mut of_pairs: Vec<f64> = sizes(&points).iter().filter(|of| of.0 == 2).map(|of| of.1).collect();
            assert_eq!(of_pairs.pop(), Some(0.75));
        }
        // A constant quantity has no range, so its pairs have no box.
        let constant: Vec<Vec<f64>> = random(4, 9, 1e9).iter().map(|p| vec![p[0], 0.5]).collect();
        let boxes = empty_boxes(&constant, &draws, &[UNIT, [0.5, 0.5]]);
        assert!(!boxes.is_empty() && boxes.iter().all(|of| of.sides.len() == 1 && of.sides[0].0 == 0));
    }
}
