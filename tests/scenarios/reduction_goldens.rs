//! The decomposition, the sinusoid and their goldens.

use crate::common;

use lanesweep::scenario::parameterization::{SeriesScale, SvdBasis, fit_svd};

fn rows(value: &serde_json::Value) -> Vec<Vec<f64>> {
    serde_json::from_value(value.clone()).unwrap()
}

fn near(ours: f64, theirs: f64, tolerance: f64) -> bool {
    (ours - theirs).abs() <= tolerance * (1.0 + theirs.abs())
}

fn check_case(case: &serde_json::Value, basis: &SvdBasis, data: &[Vec<f64>]) {
    let list = |key: &str| -> Vec<f64> { serde_json::from_value(case[key].clone()).unwrap() };
    for (ours, theirs) in basis.weights.iter().zip(list("weights")) {
        assert!(near(*ours, theirs, 1e-8), "weight {ours} {theirs}");
    }
    for (ours, theirs) in basis.singular_values.iter().zip(list("singular_values")) {
        assert!(near(*ours, theirs, 1e-8), "singular value {ours} {theirs}");
    }
    for (ours, theirs) in basis.explained().iter().zip(list("explained")) {
        assert!(near(*ours, theirs, 1e-8), "explained {ours} {theirs}");
    }
    for (d, rec) in case["rec"].as_object().unwrap() {
        let d: usize = d.parse().unwrap();
        let theirs: Vec<f64> = match rec {
            serde_json::Value::Array(_) => serde_json::from_value(rec.clone()).unwrap(),
            _ => continue,
        };
        let ours = basis.reconstruct(&basis.coefficients(&data[0], d));
        for (o, t) in ours.iter().zip(theirs) {
            assert!(near(*o, t, 1e-6), "reconstruction with {d}: {o} {t}");
        }
    }
}

#[test]
fn weights_singular_values_and_reconstructions_equal_those_of_numpy() {
    let text = std::fs::read_to_string(common::golden("svd.json")).unwrap();
    let golden: serde_json::Value = serde_json::from_str(&text).unwrap();
    let (lvd, cut_in) = (rows(&golden["lvd_data"]), rows(&golden["cutin_data"]));
    let cases = golden["cases"].as_array().unwrap();
    check_case(&cases[1], &fit_svd(&lvd, (1, None), 50, 5, SeriesScale::PerInstant, "golden LVDs").unwrap(), &lvd);
    check_case(
        &cases[2],
        &fit_svd(&cut_in, (2, None), 50, 5, SeriesScale::PerInstant, "golden cut-ins").unwrap(),
        &cut_in,
    );
}

#[test]
fn the_explained_variance_of_288_real_cut_ins_is_the_published_one() {
    let Some(path) = common::shared("golden/tno_cutin_288.csv") else { return };
    let mut reader = csv::Reader::from_path(path).unwrap();
    let rows: Vec<Vec<f64>> =
        reader.records().map(|r| r.unwrap().iter().map(|x| x.parse().unwrap()).collect()).collect();
    assert_eq!(rows.len(), 288);
    let basis = fit_svd(&rows, (2, None), 50, 5, SeriesScale::PerInstant, "TNO cut-ins").unwrap();
    for (ours, published) in basis.explained().iter().zip([39.9, 73.6, 99.3, 99.8, 100.0]) {
        assert!((100.0 * ours - published).abs() < 0.1, "{} instead of {published} %", 100.0 * ours);
    }
}

#[test]
fn all_coefficients_together_give_the_scenario_back() {
    let text = std::fs::read_to_string(common::golden("svd.json")).unwrap();
    let golden: serde_json::Value = serde_json::from_str(&text).unwrap();
    let data = rows(&golden["lvd_data"]);
    let basis = fit_svd(&data, (1, None), 50, 5, SeriesScale::PerInstant, "golden LVDs").unwrap();
    for z in &data {
        let rebuilt = basis.reconstruct(&basis.coefficients(z, basis.singular_values.len()));
        assert!(z.iter().zip(&rebuilt).all(|(a, b)| (a - b).abs() < 1e-9));
    }
}

#[test]
fn too_few_scenarios_and_a_missing_spread_are_errors_that_say_what_to_do() {
    let few = vec![vec![1.0, 2.0, 3.0]; 4];
    let error = fit_svd(&few, (1, None), 2, 5, SeriesScale::PerInstant, "cut-in scenarios").unwrap_err();
    assert!(error.to_string().contains("4 scenarios are too few"), "{error}");
    assert!(error.help().unwrap().contains("at least 6"), "{error:?}");
    let same = vec![vec![1.0, 2.0, 3.0]; 9];
    let error = fit_svd(&same, (1, None), 2, 5, SeriesScale::PerInstant, "cut-in scenarios").unwrap_err();
    assert!(error.to_string().contains("cannot be scaled"), "{error}");
}
