//! The decomposition, the sinusoid and their goldens.

use crate::common::{golden_json, near, numbers, shared};

use lanesweep::Result;
use lanesweep::scenario::parameterization::{SeriesScale, SvdBasis, fit_svd};

fn svd(rows: &[Vec<f64>], series: usize, what: &str) -> Result<SvdBasis> {
    fit_svd(rows, (series, None), 50, 5, SeriesScale::PerInstant, what)
}

fn check_case(case: &serde_json::Value, basis: &SvdBasis, data: &[Vec<f64>]) {
    let ours =
        [("weights", &basis.weights), ("singular_values", &basis.singular_values), ("explained", &basis.explained())];
    for (key, ours) in ours {
        for (ours, theirs) in ours.iter().zip(numbers(&case[key])) {
            assert!(near(*ours, theirs, 1e-8), "{key}: {ours} {theirs}");
        }
    }
    for (d, rec) in case["rec"].as_object().unwrap().iter().filter(|(_, rec)| rec.is_array()) {
        let ours = basis.reconstruct(&basis.coefficients(&data[0], d.parse().unwrap()));
        for (ours, theirs) in ours.iter().zip(numbers(rec)) {
            assert!(near(*ours, theirs, 1e-6), "reconstruction with {d}: {ours} {theirs}");
        }
    }
}

/// All coefficients together give the scenario back.
#[test]
fn weights_singular_values_and_reconstructions_equal_those_of_numpy() {
    let golden = golden_json("svd.json");
    for (series, data) in [(1, "lvd_data"), (2, "cutin_data")] {
        let data: Vec<Vec<f64>> = numbers(&golden[data]);
        let basis = svd(&data, series, "golden scenarios").unwrap();
        check_case(&golden["cases"][series], &basis, &data);
        for z in data.iter().filter(|_| series == 1) {
            let rebuilt = basis.reconstruct(&basis.coefficients(z, basis.singular_values.len()));
            assert!(z.iter().zip(&rebuilt).all(|(a, b)| (a - b).abs() < 1e-9));
        }
    }
}

#[test]
fn the_explained_variance_of_288_real_cut_ins_is_the_published_one() {
    let Some(path) = shared("golden/tno_cutin_288.csv") else { return };
    let rows: Vec<Vec<f64>> =
        csv::Reader::from_path(path).unwrap().deserialize::<Vec<f64>>().map(|row| row.unwrap()).collect();
    assert_eq!(rows.len(), 288);
    let basis = svd(&rows, 2, "TNO cut-ins").unwrap();
    for (ours, published) in basis.explained().iter().zip([39.9, 73.6, 99.3, 99.8, 100.0]) {
        assert!((100.0 * ours - published).abs() < 0.1, "{} instead of {published} %", 100.0 * ours);
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
