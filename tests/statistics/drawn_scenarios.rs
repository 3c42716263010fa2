//! What densities draw: scenarios of their category, not only points with a case.

use crate::common::mined::{self, provenance, scenarios_of};

use lanesweep::prelude::*;
use lanesweep::run::sampling::{SAMPLE_PURPOSE, generator_of};
use lanesweep::scenario::parameterization::{
    ParameterizationOptions, ReducedScenario, Reduction, SeriesScale, SvdBasis, SvdLateral, fit_svd,
};
use lanesweep::stats::random::Stream;

fn kept(category: Category) -> Vec<&'static Scenario> {
    mined::kept(scenarios_of(8), category)
}

fn options(svd_lateral: SvdLateral) -> ParameterizationOptions {
    ParameterizationOptions { svd_lateral, ..ParameterizationOptions::default() }
}

fn density(id: Parameterization, parameterization: ParameterizationOptions) -> DensityModel {
    let fit = FitOptions { parameterization, valid_draws: 20_000, ..FitOptions::default() };
    DensityModel::fit(id, scenarios_of(8), &provenance(), &fit).unwrap().model
}

/// The fraction of draws that are refused because of where the target starts or ends.
fn misplaced(density: &DensityModel) -> f64 {
    let refused = density.valid.refused.iter().filter(|refused| refused.parameter.starts_with("lateral_"));
    refused.map(|refused| refused.draws).sum::<u64>() as f64 / density.valid.draws as f64
}

/// Lateral distance in the lane beside the ego's, and in the ego's.
fn distances(reduced: &ReducedScenario, category: Category) -> (f64, f64) {
    let (first, last) = (reduced.y[0].abs(), reduced.y[reduced.y.len() - 1].abs());
    if category == Category::CutIn { (first, last) } else { (last, first) }
}

#[test]
fn every_draw_starts_and_ends_in_the_lanes_of_its_category_and_densities_of_one_side_lose_few() {
    let profile = Profile::load("paper").unwrap();
    for id in Parameterization::ALL.into_iter().filter(|id| id.coefficients().is_some()) {
        let [both, one] = [SvdLateral::Signed, SvdLateral::Mirrored].map(|svd_lateral| {
            let density = density(id, options(svd_lateral));
            let stream = Stream { seed: 7, purpose: SAMPLE_PURPOSE };
            let generator = generator_of(&density.space, &density.kde, &density.sizes, &profile, stream).unwrap();
            for index in 0..2000 {
                let drawn = generator.draw(index);
                let point = &drawn.values[..density.space.dimensions()];
                let reduced = density.space.reduced(&point.iter().map(|&v| f64::from(v)).collect::<Vec<_>>()).unwrap();
                let what = format!("{} {svd_lateral:?}, draw {index}", id.name());
                assert!(!drawn.is_void() && reduced.v[0] <= 100.0 && reduced.v_ego <= 100.0, "{what}");
                if id.category != Category::Lvd {
                    let (outside, inside) = distances(&reduced, id.category);
                    // Lanes are drawn in binary32.
                    assert!((1.7499..=5.2501).contains(&outside), "{what}: {outside} m outside");
                    assert!(inside <= 1.7501, "{what}: {inside} m inside");
                }
            }
            misplaced(&density)
        });
        if id.category != Category::Lvd {
            eprintln!("{}: {:.2} % signed, {:.2} % mirrored", id.name(), 100.0 * both, 100.0 * one);
            assert!(one < 0.02 && both > 2.0 * one && both > 0.02, "{}: {both} and {one}", id.name());
        }
    }
    assert_eq!(FitOptions::default().parameterization, options(SvdLateral::Mirrored));
    // Refused draws are counted by the bound that they break.
    let density = density(Parameterization::find(Category::CutOut, "g").unwrap(), options(SvdLateral::Signed));
    let valid = &density.valid;
    assert_eq!(valid.refused.iter().map(|refused| refused.draws).sum::<u64>(), valid.draws - valid.valid);
    assert!(valid.refused.is_sorted_by(|a, b| a.draws >= b.draws), "{:?}", valid.refused);
    let end = valid.refused.iter().find(|refused| refused.parameter == "lateral_end_m").unwrap();
    assert_eq!(end.bound, "1.75 … 5.25");
}

#[test]
fn a_recorded_scenario_that_starts_in_the_ego_s_lane_keeps_its_kernel() {
    let mut some: Vec<Scenario> = kept(Category::CutIn).into_iter().cloned().collect();
    // The lane change began before the ego's data set.
    some[0].target.y.iter_mut().for_each(|y| *y *= 0.1);
    let fit = FitOptions { valid_draws: 1000, ..FitOptions::default() };
    let id = Parameterization::find(Category::CutIn, "7").unwrap();
    let fitted = DensityModel::fit(id, &some, &provenance(), &fit).unwrap();
    assert_eq!((fitted.left_out.len(), fitted.model.kde.points().len()), (0, some.len()));
    assert!(!fitted.model.space.is_valid(&fitted.model.kde.points()[0]), "a draw at that place is refused");
}

/// Root mean square error of the target's speed that `d` coefficients rebuild, m/s, and how much of direction `d` is
/// lateral.
fn speed_error(basis: &SvdBasis, rows: &[Vec<f64>], d: usize) -> (f64, f64) {
    let error = |z: &Vec<f64>| {
        let rebuilt = basis.reconstruct(&basis.coefficients(z, d));
        (50..100).map(|k| (rebuilt[k] - z[k]).powi(2)).sum::<f64>() / 50.0
    };
    let lateral = basis.directions[d - 1][..50].iter().map(|v| v * v).sum();
    ((rows.iter().map(error).sum::<f64>() / rows.len() as f64).sqrt(), lateral)
}

#[test]
fn the_unit_of_a_mirrored_series_keeps_the_speeds_among_the_first_directions() {
    for (category, series, d) in [(Category::CutIn, 2, 3), (Category::CutOut, 3, 4)] {
        let kept = kept(category);
        let of = |svd_lateral| {
            let reduction = Reduction::fit(category, &kept, &options(svd_lateral)).unwrap();
            let rows: Vec<Vec<f64>> = kept.iter().map(|s| reduction.vector(s).unwrap()).collect();
            (speed_error(&reduction.basis, &rows, d), rows)
        };
        let ((signed, of_signed), _) = of(SvdLateral::Signed);
        let ((mirrored, of_mirrored), rows) = of(SvdLateral::Mirrored);
        // The same rows with their own spread as unit.
        let own = fit_svd(&rows, (series, None), 50, 7, SeriesScale::PerInstant, "own spread").unwrap();
        let (own, of_own) = speed_error(&own, &rows, d);
        eprintln!(
            "{category:?}, {d} coefficients: speed off by {signed:.2} m/s signed, {mirrored:.2} mirrored, {own:.2} with its \
             own spread; direction {d} is {:.0}, {:.0}, {:.0} % lateral",
            100.0 * of_signed,
            100.0 * of_mirrored,
            100.0 * of_own
        );
        assert!(mirrored < 1.1 * signed, "{category:?}: {mirrored} m/s, signed {signed} m/s");
        assert!(own > 1.3 * mirrored, "{category:?}: {own} m/s, mirrored {mirrored} m/s");
    }
}
