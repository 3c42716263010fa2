//! Densities: what published programs give, what must hold of any, and the way from a scenario to a point and to a case.

use crate::common::mined::{self, scenarios_of};
use crate::common::{golden_json, near, numbers, with_threads};

use lanesweep::prelude::*;
use lanesweep::scenario::parameterization::{Family, ParameterizationOptions, Reduction, Sizes, SvdLateral, Variable};
use lanesweep::scenario::{Case, DataProvenance, Driven, Lateral, Side};
use lanesweep::stats::density::{
    Bandwidth, BandwidthRule, Kde, LeaveOneOut, ParameterSpace, SearchEnd, ValidFraction, normal_cdf,
};
use lanesweep::stats::random::Stream;
use rayon::prelude::*;
use serde_json::Value;

/// Probability of the box between two corners. Infinite bounds are allowed.
fn probability(kde: &Kde, lower: &[f64], upper: &[f64]) -> f64 {
    let spread = kde.spread();
    let inside = |point: &Vec<f64>| -> f64 {
        let below = |bound: f64, j: usize| normal_cdf((bound - point[j]) / spread[j]);
        (0..spread.len()).map(|j| below(upper[j], j) - below(lower[j], j)).product()
    };
    kde.points().iter().map(inside).sum::<f64>() / kde.points().len() as f64
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

fn assert_near(ours: f64, theirs: f64, tolerance: f64, what: &str) {
    assert!(near(ours, theirs, tolerance), "{what}: {ours} instead of {theirs}");
}

fn names(d: usize) -> Vec<&'static str> {
    ["x1", "x2", "x3", "x4", "x5", "x6", "x7"][..d].to_vec()
}

fn with_bandwidth(points: Vec<Vec<f64>>, scale: Vec<f64>, value: f64) -> Kde {
    let bandwidth =
        Bandwidth { value, rule: BandwidthRule::Wide, silverman: value, end: SearchEnd::Inside, likelihood: None };
    Kde::from_parts(points, scale, bandwidth).unwrap()
}

#[test]
fn scale_bandwidth_density_and_probabilities_are_those_of_the_published_program() {
    for case in golden_json("kde.json")["cases"].as_array().unwrap() {
        let data: Vec<Vec<f64>> = numbers(&case["data"]);
        let (n, d) = (data.len(), data[0].len());
        let wide = Kde::fit(data.clone(), &names(d), BandwidthRule::Wide).unwrap();
        for (ours, theirs) in wide.scale().iter().zip(numbers::<f64>(&case["std_used"])) {
            assert_near(*ours, theirs, 1e-9, "scale");
        }
        let silverman = number(&case["silverman"]);
        assert_near(wide.bandwidth().silverman, silverman, 1e-12, "Silverman's bandwidth");
        assert_near(wide.bandwidth().value, number(&case["bandwidth_default"]), 2e-5, "bandwidth");
        assert_eq!(wide.bandwidth().end, SearchEnd::Inside);
        let narrow = Kde::fit(data.clone(), &names(d), BandwidthRule::Reduction).unwrap();
        assert_near(narrow.bandwidth().value, number(&case["bandwidth_maxbw_silverman"]), 2e-5, "bounded bandwidth");
        assert_eq!(narrow.bandwidth().end, SearchEnd::Upper);
        // The likelihood knows no rule, and its interval ends where twice its fall is the quantile of χ².
        assert_eq!(narrow.bandwidth().likelihood, wide.bandwidth().likelihood);
        let likelihood = wide.bandwidth().likelihood.unwrap();
        assert_near(likelihood.best, wide.bandwidth().value, 2e-3, "maximum of the likelihood");

        let scaled: Vec<Vec<f64>> =
            data.iter().map(|p| p.iter().zip(wide.scale()).map(|(v, s)| v / s).collect()).collect();
        let scores = LeaveOneOut::new(&scaled);
        for end in [likelihood.low, likelihood.high] {
            let fall = scores.log_likelihood(likelihood.best) - scores.log_likelihood(end);
            assert!((2.0 * fall - 3.841).abs() < 0.1, "{end}: {fall}");
        }
        let logs: f64 = wide.scale().iter().map(|s| s.ln()).sum();
        for score in case["loo_scores"].as_array().unwrap() {
            // At narrow bandwidths the program lets distant kernels underflow; its search does not go there.
            let Some(theirs) = score[2].as_f64().filter(|_| number(&score[0]) > 0.5) else { continue };
            let ours = scores.log_likelihood(number(&score[0])) - n as f64 * logs;
            assert_near(ours, theirs, 1e-11, "leave-one-out likelihood");
        }

        let theirs = with_bandwidth(data, wide.scale().to_vec(), number(&case["bandwidth_default"]));
        let mixture = theirs.mixture().unwrap();
        let mut sum = 0.0;
        let queries: Vec<Vec<f64>> = numbers(&case["query"]);
        let golden = numbers::<f64>(&case["density"]).into_iter().zip(numbers::<f64>(&case["cdf"]));
        for (x, (density, cdf)) in queries.iter().zip(golden) {
            let log_density = mixture.log_density(x);
            assert!((log_density.exp() / density - 1.0).abs() < 1e-9, "density {} {density}", log_density.exp());
            let ours = probability(&theirs, &vec![f64::NEG_INFINITY; d], x);
            assert!((ours - cdf).abs() < 1e-9, "cdf {ours} {cdf}");
            sum += log_density;
        }
        assert_near(sum, number(&case["loglik_sum"]), 1e-9, "sum of log densities");
        if let Some(inside) = case["box"]["prob"].as_f64() {
            let ours = probability(&theirs, &numbers(&case["box"]["lower"]), &numbers(&case["box"]["upper"]));
            assert_near(ours, inside, 1e-9, "probability of a box");
        }
    }
}

#[test]
fn draws_have_the_moments_of_the_density_and_any_part_can_be_drawn_alone() {
    let data: Vec<Vec<f64>> = numbers(&golden_json("kde.json")["cases"][2]["data"]);
    let kde = Kde::fit(data.clone(), &names(3), BandwidthRule::Wide).unwrap();
    let stream = Stream { seed: 157, purpose: 2 };
    let n = 200_000;
    let draws: Vec<Vec<f64>> = (0..n).into_par_iter().map(|index| kde.draw(&stream, index)).collect();
    assert_eq!(draws[1234], kde.draw(&stream, 1234));
    for j in 0..3 {
        let moments = |set: &[Vec<f64>]| {
            let mean = set.iter().map(|x| x[j]).sum::<f64>() / set.len() as f64;
            (mean, set.iter().map(|x| (x[j] - mean).powi(2)).sum::<f64>() / set.len() as f64)
        };
        let ((mean, variance), (of_draws, variance_of_draws)) = (moments(&data), moments(&draws));
        let expected = variance + kde.spread()[j].powi(2);
        assert!((mean - of_draws).abs() < 5.0 * (expected / n as f64).sqrt(), "{mean} {of_draws}");
        assert!((variance_of_draws / expected - 1.0).abs() < 0.02, "{variance_of_draws} {expected}");
    }
    // As many draws below a point as the density says.
    let x = [1.0, 1.5, 6.0];
    let below = draws.iter().filter(|d| (0..3).all(|j| d[j] <= x[j])).count() as f64 / n as f64;
    let expected = probability(&kde, &[f64::NEG_INFINITY; 3], &x);
    assert!((below - expected).abs() < 5.0 * (expected * (1.0 - expected) / n as f64).sqrt(), "{below} {expected}");
}

#[test]
fn the_bits_of_a_fit_do_not_depend_on_the_number_of_threads() {
    let stream = Stream { seed: 5, purpose: 5 };
    let source = with_bandwidth(vec![vec![0.0, 10.0], vec![3.0, -4.0]], vec![1.0, 2.0], 1.0);
    let points = (0..2000).map(|index| source.draw(&stream, index)).collect::<Vec<_>>();
    let fit = || Kde::fit(points.clone(), &names(2), BandwidthRule::Wide).unwrap();
    let (one, three) = (with_threads(1, fit), with_threads(3, fit));
    assert_eq!(one, three);
    let bits = |kde: &Kde| kde.mixture().unwrap().log_density(&[1.0, 1.0]).to_bits();
    assert_eq!(bits(&one), bits(&three));
}

fn kept(category: Category) -> Vec<&'static Scenario> {
    mined::kept(scenarios_of(4), category)
}

fn space(id: Parameterization, options: &ParameterizationOptions, with_thw: bool) -> ParameterSpace {
    let reduction = Reduction::fit(id.category, &kept(id.category), options).unwrap();
    ParameterSpace::new(id, options, Some(&reduction), with_thw).unwrap()
}

fn facts() -> DataProvenance {
    DataProvenance {
        data: "SYNTHETIC DATA".to_owned(),
        synthetic: true,
        scenarios_sha256: "0".repeat(64),
        driven: Some(Driven { hours: Some(10.0), kilometres: Some(1000.0) }),
    }
}

fn model(category: Category, key: &str) -> DensityModel {
    let id = Parameterization::find(category, key).unwrap();
    let options = FitOptions { valid_draws: 20_000, with_thw: true, ..Default::default() };
    DensityModel::fit(id, scenarios_of(4), &facts(), &options).unwrap().model
}

/// Equal up to the rounding of T = (v0 − v1)/ā.
fn assert_same_case(ours: &Case, theirs: &Case, what: &str) {
    let [ours, theirs] = [ours, theirs].map(|case| format!("{case:?}"));
    let parts = |text: &'_ str| text.split([' ', ',', '(', ')', '[', ']']).map(str::to_owned).collect::<Vec<_>>();
    let (ours, theirs) = (parts(&ours), parts(&theirs));
    assert_eq!(ours.len(), theirs.len(), "{what}");
    for (a, b) in ours.iter().zip(&theirs) {
        match (a.parse::<f64>(), b.parse::<f64>()) {
            (Ok(a), Ok(b)) => assert!((a - b).abs() <= 1e-9 * (1.0 + b.abs()), "{what}: {a} instead of {b}"),
            _ => assert_eq!(a, b, "{what}"),
        }
    }
}

/// A point of a decomposition with left-positive series belongs to the left.
fn mirrored(mut case: Case) -> Case {
    if let Lateral::Sampled { position_m, .. } = &mut case.principal.lateral {
        position_m.iter_mut().for_each(|y| *y = -*y);
    }
    case
}

#[test]
fn the_point_of_a_scenario_gives_the_case_that_the_study_makes_of_it() {
    for svd_lateral in [SvdLateral::Signed, SvdLateral::Mirrored] {
        let options = ParameterizationOptions { svd_lateral, ..ParameterizationOptions::default() };
        let mut compared = 0;
        for id in Parameterization::ALL {
            let space = space(id, &options, true);
            for scenario in kept(id.category) {
                let what = format!("{} under {}", scenario.id, id.key);
                let point = space.point(scenario).unwrap();
                space.check(&point).unwrap_or_else(|invalid| panic!("{what}: {invalid}"));
                assert_eq!(space.thw_s(&point), scenario.start_headway_s(), "{what}");
                let ours = space.case(&point, &Sizes::of(scenario), 0.04).unwrap();
                let theirs = id.case(scenario, 0.04, &options, space.reduction()).unwrap();
                let from_right = svd_lateral == SvdLateral::Signed && scenario.side == Side::Right;
                if id.variables().contains(&Variable::MeanDeceleration) {
                    assert_same_case(&ours, &theirs, &what);
                } else if from_right {
                    assert_eq!(mirrored(ours), theirs, "{what}");
                } else {
                    assert_eq!(ours, theirs, "{what}");
                }
                compared += 1;
            }
        }
        assert!(compared > 19 * 20, "{compared}");
    }
}

#[test]
fn an_instance_that_no_registry_lists_encodes_and_decodes() {
    let options = ParameterizationOptions::default();
    let kept = kept(Category::Lvd);
    let reduction = Reduction::fit(Category::Lvd, &kept, &options).unwrap();
    let six = Parameterization { category: Category::Lvd, key: "svd-6", family: Family::Svd(6) };
    let point = six.encode(kept[0], &options, Some(&reduction)).unwrap();
    assert_eq!(point.len(), six.parameters(&options).len());
    let decoded = six.decode(&point, &Sizes::of(kept[0]), 0.04, &options, Some(&reduction)).unwrap();
    assert_eq!(decoded, six.case(kept[0], 0.04, &options, Some(&reduction)).unwrap());
    assert!(six.encode(kept[0], &options, None).is_err(), "without a decomposition");
    let decoded = six.decode(&point[1..], &Sizes::of(kept[0]), 0.04, &options, Some(&reduction));
    assert!(decoded.is_err(), "without a coefficient");
}

#[test]
fn every_kind_of_impossible_point_is_refused_by_its_parameter() {
    let options = ParameterizationOptions::default();
    let find = |category, key| space(Parameterization::find(category, key).unwrap(), &options, true);
    let refused = |space: &ParameterSpace, point: &[f64]| space.check(point).unwrap_err().parameter;
    let two = find(Category::CutIn, "2");
    // v_target, lateral speed, v_ego, acceleration, T, THW
    let good = [20.0, 1.0, 25.0, -0.5, 3.0, 1.2];
    two.check(&good).unwrap();
    for (at, value, parameter) in [
        (0, -0.1, "v_target_mps"),
        (1, 0.0009, "lateral_speed_mps"),
        (2, -1e-9, "v_ego_mps"),
        (3, f64::NAN, "acceleration_target_mps2"),
        (4, 0.09, "duration_s"),
        (4, 1e9, "duration_s"),
        (5, 0.0, "thw_s"),
        (0, f64::INFINITY, "v_target_mps"),
    ] {
        let mut point = good;
        point[at] = value;
        assert_eq!(refused(&two, &point), parameter);
        assert!(!two.is_valid(&point) && two.case(&point, &Sizes::of(kept(Category::CutIn)[0]), 0.04).is_err());
    }
    assert_eq!(refused(&two, &good[..5]), "number of parameters");
    let i = find(Category::Lvd, "i");
    i.check(&[20.0, 10.0, 2.0, 1.0]).unwrap();
    assert_eq!(refused(&i, &[20.0, 20.0, 2.0, 1.0]), "v1_mps");
    assert_eq!(refused(&i, &[20.0, 10.0, 0.0, 1.0]), "mean_deceleration_mps2");
    assert_eq!(refused(&i, &[20.0, 19.9, 2.0, 1.0]), "duration_s");
    assert_eq!(refused(&i, &[20.0, 10.0, 1e-9, 1.0]), "duration_s");
    let b = find(Category::CutOut, "b");
    let at = b.parameters().iter().position(|p| p.name == "gap_lead_m").unwrap();
    let mut point = b.point(kept(Category::CutOut)[0]).unwrap();
    point[at] = -0.1;
    assert_eq!(refused(&b, &point), "gap_lead_m");
}

#[test]
fn a_reconstruction_is_refused_where_its_own_duration_speed_or_gap_is_impossible() {
    let options = ParameterizationOptions::default();
    for (category, key) in [(Category::CutIn, "7"), (Category::CutOut, "g"), (Category::Lvd, "v")] {
        let space = space(Parameterization::find(category, key).unwrap(), &options, false);
        let reduction = space.reduction().unwrap();
        let (mut refused, mut clamped) = (std::collections::BTreeSet::new(), 0);
        let stream = Stream { seed: 8, purpose: 3 };
        let points: Vec<Vec<f64>> = kept(category).iter().map(|s| space.point(s).unwrap()).collect();
        let far = Kde::fit(points, &names(space.dimensions()), BandwidthRule::Wide).unwrap();
        let speeds = match category {
            Category::CutIn => 50..100,
            Category::CutOut => 50..150,
            Category::Lvd => 0..50,
        };
        for mut point in (0..4000).map(|index| far.draw(&stream, index)) {
            point.iter_mut().for_each(|c| *c *= 6.0);
            let z = reduction.basis.reconstruct(&point);
            let column = |variable| reduction.column(variable).map_or(1.0, |c| z[c]);
            let [duration, ego, gap] = [Variable::Duration, Variable::EgoSpeed, Variable::LeadGap].map(column);
            let possible = (0.1..=600.0).contains(&duration) && ego >= 0.0 && gap >= 0.0;
            match space.check(&point) {
                Ok(()) => assert!(possible),
                Err(invalid) => {
                    assert!(!possible, "{invalid}");
                    refused.insert(invalid.parameter);
                }
            }
            if possible && z[speeds.clone()].iter().any(|v| *v < 0.0) {
                let reduced = space.reduced(&point).unwrap();
                assert!(reduced.v.iter().chain(&reduced.v_lead).all(|v| *v >= 0.0));
                clamped += 1;
            }
        }
        assert!(refused.contains("duration_s") && refused.contains("v_ego_mps"), "{key}: {refused:?}");
        assert!(clamped > 0, "{key}: speeds inside a series are set to 0, not refused");
    }
}

#[test]
fn the_valid_share_counts_what_the_density_says() {
    // Ego speeds near 0: the share above it is known of the normal kernels.
    let id = Parameterization::find(Category::CutIn, "3").unwrap();
    let space = ParameterSpace::new(id, &ParameterizationOptions::default(), None, false).unwrap();
    let kde = with_bandwidth(vec![vec![1.0, 0.5], vec![2.0, 3.0]], vec![1.0, 1.0], 1.0);
    let expected = 0.5 * (normal_cdf(1.0) * normal_cdf(0.5) + normal_cdf(2.0) * normal_cdf(3.0));
    assert!((probability(&kde, &[0.0; 2], &[f64::INFINITY; 2]) - expected).abs() < 1e-14);
    let share = ValidFraction::count(&kde, &space, 100_000, 1).unwrap();
    assert!((share.estimate - expected).abs() < 0.006, "{} {expected}", share.estimate);
    assert!(share.low < expected && expected < share.high, "{share:?} {expected}");
    let nowhere = with_bandwidth(vec![vec![-100.0, -100.0]], vec![1.0, 1.0], 1.0);
    assert!(ValidFraction::count(&nowhere, &space, 1000, 1).is_err());
}

#[test]
fn a_density_file_gives_the_same_density_to_the_last_bit() {
    let dir = tempfile::tempdir().unwrap();
    for (category, key) in [(Category::CutIn, "2"), (Category::CutOut, "g"), (Category::Lvd, "iii")] {
        let written = model(category, key);
        let path = dir.path().join("density.json");
        write_density(&path, &written).unwrap();
        let read = read_density(&path).unwrap();
        assert_eq!(read.kde, written.kde);
        assert_eq!((&read.valid, read.sizes, read.exposure), (&written.valid, written.sizes, written.exposure));
        assert_eq!(read.provenance, written.provenance);
        assert_eq!(read.space.parameters(), written.space.parameters());
        assert_eq!(read.content_sha256().unwrap(), written.content_sha256().unwrap());
        assert_eq!(read.to_json().unwrap(), std::fs::read(&path).unwrap());
        let stream = Stream { seed: 4, purpose: 4 };
        let mut valid = 0;
        for point in (0..200).map(|index| read.kde.draw(&stream, index)) {
            assert_eq!(read.space.is_valid(&point), written.space.is_valid(&point));
            if read.space.is_valid(&point) {
                let case = |m: &DensityModel| m.space.case(&point, &m.sizes, 0.04).unwrap();
                assert_eq!(case(&read), case(&written));
                let log_density = |m: &DensityModel| m.kde.mixture().unwrap().log_density(&point);
                assert_eq!(log_density(&read), log_density(&written));
                valid += 1;
            }
        }
        assert!(valid > 100);
        assert_eq!(read.kde.mixture().unwrap().dimensions(), read.space.dimensions());
    }
}

#[test]
fn white_space_may_change_but_lengths_must_fit() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("density.json");
    let written = model(Category::CutIn, "5");
    let good: Value = serde_json::from_slice(&written.to_json().unwrap()).unwrap();
    let place = lanesweep::Place::file(&path);
    let compact = serde_json::to_vec(&good).unwrap();
    assert_eq!(DensityModel::from_json(&compact, &place).unwrap().kde, written.kde);
    // A hand-made file is checked.
    for (pointer, value, expected) in [
        ("/kernels/3", serde_json::json!([1.0]), "kernel 4"),
        ("/scale", serde_json::json!([1.0, 1.0]), "2 numbers"),
        ("/scale/1", serde_json::json!(-1.0), "`c2` is -1e0 1; expected 1e-9"),
        ("/bandwidth/value", serde_json::json!(0.0), "0e0; expected 1e-9 to 1000"),
        ("/bandwidth/value", serde_json::json!(1e308), "1e308; expected 1e-9 to 1000"),
        ("/scale/1", serde_json::json!(1e-300), "`c2` is 1e-300 1; expected 1e-9 to 1000000 1"),
        ("/kernels/2/0", serde_json::json!(1e308), "kernel 3: `c1` is 1e308 1; expected −1000000 to 1000000 1"),
        ("/sizes/target/width_m", serde_json::json!(1e39), "expected 0.1 to 100 m"),
        ("/basis/mean", serde_json::json!([1.0]), "a row of 1 numbers"),
        ("/basis/weights/7", serde_json::json!(0.0), "a weight is not above 0"),
        ("/basis", Value::Null, "needs a decomposition"),
        ("/parameterization", serde_json::json!("9"), "there is no `9`"),
        ("/parameters/0/unit", serde_json::json!("km"), "unit and bounds"),
        ("/p_valid/estimate", serde_json::json!(1.5), "expected a fraction above 0"),
        ("/sizes/ego/length_m", serde_json::json!(0.0), "expected 0.1 to 100 m"),
    ] {
        let mut file = good.clone();
        *file.pointer_mut(pointer).unwrap() = value;
        let error = DensityModel::from_json(&serde_json::to_vec(&file).unwrap(), &place).unwrap_err().to_string();
        assert!(error.contains("density.json") && error.contains(expected), "{pointer}: {error}");
    }
}

#[test]
fn scenarios_without_a_headway_are_left_out_of_a_density_with_it_and_counted() {
    let id = Parameterization::find(Category::CutIn, "1").unwrap();
    let mut some: Vec<Scenario> = kept(Category::CutIn).into_iter().cloned().collect();
    some[0].thw0 = None;
    some[1].target.v[0] = 0.0;
    let options = FitOptions { valid_draws: 1000, with_thw: true, ..Default::default() };
    let fitted = DensityModel::fit(id, &some, &facts(), &options).unwrap();
    assert_eq!(fitted.left_out.len(), 1);
    assert!(fitted.left_out[0].to_string().contains("thw0"), "{}", fitted.left_out[0]);
    assert_eq!(fitted.model.provenance.left_out, 1);
    assert_eq!(fitted.model.kde.points().len(), some.len() - 1);
    assert_eq!(fitted.model.exposure.unwrap().events, some.len() as u64);
}

#[test]
fn edited_files_say_so_and_other_kinds_are_refused() {
    let place = lanesweep::Place::file(std::path::Path::new("density.json"));
    let written = String::from_utf8(model(Category::CutIn, "1").to_json().unwrap()).unwrap();
    // The checksum is calculated anew: an edited file says so, gets its own, and that stays.
    let again = |text: &str| {
        let read = DensityModel::from_json(text.as_bytes(), &place).unwrap();
        String::from_utf8(read.to_json().unwrap()).unwrap()
    };
    let edited = again(&written.replace("\"program\": \"lanesweep", "\"program\": \"another"));
    assert!(edited.contains("another") && again(&edited) == edited);
    assert!(edited.contains("; changed since `fit`") && !again(&written).contains("; changed since `fit`"));
    // Rates follow from what was counted.
    let driven = DataProvenance { driven: Some(Driven { hours: Some(2.0), kilometres: None }), ..mined::provenance() };
    let options = FitOptions { valid_draws: 1000, ..FitOptions::default() };
    let id = Parameterization::find(Category::CutIn, "1").unwrap();
    let fitted = DensityModel::fit(id, scenarios_of(4), &driven, &options).unwrap().model;
    let halved = String::from_utf8(fitted.to_json().unwrap()).unwrap().replace("\"hours\": 2.0", "\"hours\": 4.0");
    let rate = |of: &DensityModel| of.exposure.unwrap().per_hour.unwrap().estimate;
    let read = DensityModel::from_json(halved.as_bytes(), &place).unwrap();
    assert_eq!(2.0 * rate(&read), rate(&fitted));
    let other =
        written.replace("\"kernels\"", "\"mixture\": {\"kind\": \"copula\", \"weights\": [1.0]},\n  \"kernels\"");
    let error = DensityModel::from_json(other.as_bytes(), &place).unwrap_err();
    assert!(error.to_string().contains("a density of an earlier version of lanesweep"), "{error}");
}
