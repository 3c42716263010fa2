//! Mixtures that cover the failures of a pool: a fit to the weighted failures, and Gaussians around design points.

use rayon::prelude::*;

use super::evaluated_points::Pool;
use crate::density::Mixture;
use lanesweep_support::Result;

/// A fit is widened: most of its weight in copies with this much more variance …
const NARROW: (f64, f64) = (0.75, 1.2);
/// … the rest in wide copies. Beyond the limit failures become rare more slowly than a Gaussian.
const WIDE: (f64, f64) = (0.25, 4.0);
/// A fit uses the points that carry this fraction of the weight.
const CARRIED: f64 = 0.998;
/// Maximum number of points of a fit.
const FITTED: usize = 1200;
/// Maximum number of components of a fit.
const COMPONENTS: usize = 16;
/// Maximum number of failures among which design points are looked for.
const CANDIDATES: usize = 4000;
/// Maximum number of design points.
const DESIGNS: usize = 100;
/// Design points whose weight is below e⁻⁸ of the largest are left out …
const NEGLIGIBLE: f64 = 8.0;
/// … and those of a kernel that are further by this square of a distance than its nearest failure.
const FAR: f64 = 14.0;

/// A mixture fitted to points with weights; the number of components is chosen by held-out likelihood.
pub(super) fn fitted(pool: &Pool, points: &[usize], weights: &[f64], seed: u64) -> Result<Mixture> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|a, b| weights[*b].total_cmp(&weights[*a]).then(a.cmp(b)));
    let (all, mut sum) = (weights.iter().sum::<f64>(), 0.0);
    order.retain(|at| {
        let is_kept = sum < CARRIED * all;
        sum += weights[*at];
        is_kept
    });
    if order.len() > FITTED {
        let step = order.len() as f64 / FITTED as f64;
        order = (0..FITTED).map(|i| order[(i as f64 * step) as usize]).collect();
    }
    let kept: Vec<Vec<f64>> = order.iter().map(|at| pool.points[points[*at]].clone()).collect();
    let weights: Vec<f64> = order.iter().map(|at| weights[*at]).collect();
    let fit = Mixture::fit(&kept, &weights, COMPONENTS, seed)?;
    Mixture::join(&[(NARROW.0, &fit.scaled(NARROW.1)?), (WIDE.0, &fit.scaled(WIDE.1)?)])
}

/// Maximum number of failures whose mean is a design point: their scatter along the limit averages out.
const AVERAGED: usize = 10;

/// A design point of a kernel.
struct Design {
    log_weight: f64,
    kernel: usize,
    point: Vec<f64>,
}

/// Gaussians of the kernels' own shape around design points: of each kernel, the mean of the
/// failures that are nearest in units of the kernel. Where the failures of a kernel lie beyond a plane, f/g of such a Gaussian is bounded, however wide they are
/// along the plane (Schuëller and Stix, "A critical appraisal of methods to determine failure probabilities", Structural
/// Safety 4, 1987). A kernel has several where failures lie in several directions (Der Kiureghian and Dakessian,
/// "Multiple design points in first and second-order reliability", Structural Safety 20, 1998).
///
/// `heat` in (0, 1]: weights are the kernels' times exp(−heat·β²/2), with β the distance. Below 1, distant design points
/// are drawn from too. `stretch` scales the covariances.
pub(super) fn designs(kernels: &Mixture, pool: &Pool, failures: &[usize], heat: f64, stretch: f64) -> Result<Mixture> {
    let n = kernels.weights().len();
    let mut failures = failures.to_vec();
    if failures.len() > CANDIDATES {
        failures.sort_by(|a, b| pool.log_f[*b].total_cmp(&pool.log_f[*a]).then(a.cmp(b)));
        failures.truncate(CANDIDATES);
    }
    let white = |kernel| failures.iter().map(|at| kernels.whitened(kernel, &pool.points[*at])).collect::<Vec<_>>();
    let is_shared = kernels.shares_factor();
    let all = if is_shared { white(0) } else { Vec::new() };
    let max_points = match n {
        0..=4 => 8,
        5..=60 => 4,
        _ => 2,
    };
    let of_kernel = |kernel: usize| -> Vec<Design> {
        let own = if is_shared { Vec::new() } else { white(kernel) };
        let points = if is_shared { &all } else { &own };
        let centre = kernels.whitened(kernel, kernels.mean(kernel));
        let away = |a: &[f64], b: &[f64]| -> f64 {
            a.iter().zip(b).zip(&centre).map(|((a, b), centre)| (a - centre) * (b - centre)).sum()
        };
        let squares: Vec<f64> = points.iter().map(|z| away(z, z)).collect();
        let nearest = squares.iter().copied().fold(f64::INFINITY, f64::min);
        let near = |at: &(f64, usize)| at.0 <= nearest + FAR;
        let mut order: Vec<(f64, usize)> = squares.into_iter().zip(0..).filter(near).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut taken: Vec<(f64, Vec<usize>)> = Vec::new();
        for (square, at) in order {
            // A failure in the direction of a design point is covered by it.
            let covers = |(of, members): &(f64, Vec<usize>)| away(&points[members[0]], &points[at]) >= 0.5 * of;
            match taken.iter().position(covers) {
                Some(design) if taken[design].1.len() < AVERAGED => taken[design].1.push(at),
                None if taken.len() < max_points => taken.push((square, vec![at])),
                _ => (),
            }
        }
        let weight = libm::log(kernels.weights()[kernel]);
        let design = |(square, members): (f64, Vec<usize>)| {
            let mean = |j| members.iter().map(|at| pool.points[failures[*at]][j]).sum::<f64>() / members.len() as f64;
            Design {
                log_weight: weight - 0.5 * heat * square,
                kernel,
                point: (0..kernels.dimensions()).map(mean).collect(),
            }
        };
        taken.into_iter().map(design).collect()
    };
    let found: Vec<Vec<Design>> = (0..n).into_par_iter().map(of_kernel).collect();
    let mut list: Vec<Design> = found.into_iter().flatten().collect();
    // The sort is stable, so designs of equal weight keep the order of their kernels.
    list.sort_by(|a, b| b.log_weight.total_cmp(&a.log_weight));
    let top = list[0].log_weight;
    list.retain(|design| design.log_weight > top - NEGLIGIBLE);
    list.truncate(DESIGNS);
    let scale = stretch.sqrt();
    let (factors, factor_of) = match is_shared {
        true => (vec![kernels.factor(0) * scale], vec![0; list.len()]),
        false => (list.iter().map(|design| kernels.factor(design.kernel) * scale).collect(), (0..list.len()).collect()),
    };
    let weights = list.iter().map(|design| libm::exp(design.log_weight - top)).collect();
    let means = list.into_iter().map(|design| design.point).collect();
    Mixture::new(weights, means, factors, factor_of)
}
