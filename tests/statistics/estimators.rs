//! What the estimators of rare failures promise, on problems whose probability is known. Coverage over many repeats:
//! `tests/statistics/estimator_coverage.rs`.

use lanesweep::stats::density::Mixture;
use lanesweep::stats::estimate::{
    BlockSums, CrossEntropy, Importance, Pilot, StandardNormal, Subset, Technique, Verdict, Warning, WeightSums,
    WeightedDraw, balance_heuristic, cross_entropy, defended, from_pilot, importance, importance_sums, subset,
};

use crate::common::reliability::{
    four_branch, four_branch_probability, linear, silverman, tail, two_sided, unit_mixture,
};

fn close(got: f64, expected: f64) -> bool {
    (got / expected - 1.0).abs() < 1e-9
}

#[test]
fn the_author_s_estimates_are_reproduced() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/importance_sampling.json");
    let text = std::fs::read_to_string(path).expect("the golden file");
    let golden: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let column = |table: &str, k: usize| -> Vec<f64> {
        golden[table][k].as_array().expect("a column").iter().map(|v| v.as_f64().expect("a number")).collect()
    };
    let number = |path: &str| golden.pointer(path).and_then(|v| v.as_f64()).expect("a number");
    let of = |table: &str, ratio: &dyn Fn(usize) -> f64, response: &dyn Fn(usize) -> f64| -> WeightSums {
        let tries = column(table, 1);
        let leaves: Vec<WeightSums> = (0..tries.len())
            .map(|i| {
                let (weight, response, tries) = (ratio(i), response(i), tries[i] as u32);
                WeightedDraw { weight, response, tries, is_void: false, is_thin: false }.into()
            })
            .collect();
        BlockSums::of_leaves(0, &leaves).total().expect("sums")
    };
    // P_valid of the density is estimated by the Monte Carlo sample's tries.
    let mc_tries = column("mc", 1);
    let validity = mc_tries.len() as f64 / mc_tries.iter().sum::<f64>();
    let (f, g) = (column("is_", 2), column("is_", 3));
    let ratio = |i: usize| f[i] / g[i] / validity;
    let (result, injury) = (column("is_", 0), column("is_", 4));
    // Σ (x − mean)² / N² over the N valid draws: the proposal's share of valid points is taken as known.
    let author_sigma = |sums: &WeightSums| {
        let p = sums.unbiased();
        (sums.failing_squared / (sums.tries as f64).powi(2) - p * p / sums.draws as f64).sqrt()
    };
    let collision = of("is_", &ratio, &|i| f64::from(u8::from(result[i] < 0.0)));
    assert!(close(collision.unbiased(), number("/is_collision/estimate")));
    assert!(close(author_sigma(&collision), number("/is_collision/sigma")));
    assert!(close(collision.figures().self_normalised, number("/extra_self_normalised")));
    assert!(close(collision.figures().effective_size, number("/extra_ess")));
    assert!(close(collision.figures().effective_size_failures, number("/extra_ess_failures")));
    let injured = of("is_", &ratio, &|i| injury[i]);
    assert!(close(injured.unbiased(), number("/is_injury/estimate")));
    assert!(close(author_sigma(&injured), number("/is_injury/sigma")));
    let factor = collision.draws as f64 / collision.tries as f64 / validity;
    assert!(close(factor, number("/truncation_factor")));
}

#[test]
fn sums_of_a_proposal_are_the_same_bits_in_any_division_of_the_indices() {
    let density = StandardNormal { dimensions: 2 };
    let proposal = defended(Mixture::of_kernels(vec![vec![2.0, 2.0]], &[0.7, 0.7]).unwrap(), &density, 0.1).unwrap();
    let of = |range| importance_sums(&density, &proposal, &linear(3.0), 9, range).unwrap();
    let whole = of(0..20_000);
    let mut parts = of(7001..20_000);
    parts.merge(of(0..123)).unwrap();
    parts.merge(of(123..7001)).unwrap();
    assert_eq!(parts, whole);
    let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(one_thread.install(|| of(0..20_000)), whole);
}

#[test]
fn every_estimator_finds_the_linear_limit_s_probability() {
    for (beta, dimensions) in [(2.0, 2), (3.5, 5), (5.0, 10)] {
        let (density, truth) = (StandardNormal { dimensions }, tail(beta));
        let options = CrossEntropy::new(3, 2000, 8000);
        let moved = cross_entropy(&density, &linear(beta), &options).unwrap().estimate;
        assert!((moved.probability / truth - 1.0).abs() < 0.1, "{moved:?}");
        assert_eq!(moved.trust.verdict(), Verdict::Sound, "{moved:?}");
        let down = subset(&density, &linear(beta), &Subset::new(3, 5000)).unwrap().estimate;
        assert!((down.probability / truth - 1.0).abs() < 0.4, "{down:?}");
        let walked = subset(&unit_mixture(dimensions), &linear(beta), &Subset::new(3, 5000)).unwrap().estimate;
        assert!((walked.probability / truth).ln().abs() < 0.5, "{walked:?}");
    }
    let density = StandardNormal { dimensions: 2 };
    let found = from_pilot(&density, &linear(3.0), &silverman, &Pilot::guarded(5000), &Importance::new(1, 5000));
    assert!((found.unwrap().0.probability / tail(3.0) - 1.0).abs() < 0.15);
}

#[test]
fn the_four_branches_are_all_found() {
    let (density, truth) = (StandardNormal { dimensions: 2 }, four_branch_probability(3.0, 3.5));
    let moved = cross_entropy(&density, &four_branch(3.0, 3.5), &CrossEntropy::new(1, 2000, 8000)).unwrap();
    assert!((moved.estimate.probability / truth - 1.0).abs() < 0.08, "{:?}", moved.estimate);
    let down = subset(&density, &four_branch(3.0, 3.5), &Subset::new(1, 5000)).unwrap();
    assert!((down.estimate.probability / truth - 1.0).abs() < 0.3, "{:?}", down.estimate);
    assert!(down.failures.iter().any(|x| x[0] > 0.0) && down.failures.iter().any(|x| x[0] < 0.0));
}

#[test]
fn a_proposal_that_misses_a_way_to_fail_is_called_unusable() {
    let density = StandardNormal { dimensions: 2 };
    let one_side = || Mixture::of_kernels(vec![vec![2.7, 0.0]], &[0.6, 1.0]).unwrap();
    // With a defensive share the other side is met, rarely, by draws that the proposal hardly covers.
    let guarded = defended(one_side(), &density, 0.1).unwrap();
    let estimate = importance(&density, &guarded, &two_sided(2.5), &Importance::new(4, 10_000)).unwrap();
    assert!(estimate.trust.warnings.iter().any(|w| matches!(w, Warning::ModeMissed { .. })), "{estimate:?}");
    assert_eq!(estimate.trust.verdict(), Verdict::Unusable);
    // Without it only the mean weight tells.
    let estimate = importance(&density, &one_side(), &two_sided(2.5), &Importance::new(4, 10_000)).unwrap();
    assert!(estimate.trust.warnings.iter().any(|w| matches!(w, Warning::MeanWeightOff { .. })), "{estimate:?}");
    // Both sides as techniques: nothing to warn of.
    let other = Mixture::of_kernels(vec![vec![-2.7, 0.0]], &[0.6, 1.0]).unwrap();
    let (one, nominal) = (one_side(), unit_mixture(2));
    let both = [&one, &other, &nominal].map(|proposal| Technique { proposal, draws: 4000 });
    let estimate = balance_heuristic(&density, &both, &two_sided(2.5), 4, 0.95).unwrap();
    assert_eq!(estimate.trust.verdict(), Verdict::Sound, "{estimate:?}");
    assert!(estimate.interval.holds(2.0 * tail(2.5)));
}

#[test]
fn levels_that_lead_nowhere_are_reported_and_give_no_probability() {
    let density = StandardNormal { dimensions: 2 };
    let never = |points: &[Vec<f64>]| Ok(vec![1.0; points.len()]);
    let down = subset(&density, &never, &Subset::new(1, 500)).unwrap().estimate;
    assert_eq!((down.probability, down.trust.verdict()), (0.0, Verdict::Unusable));
    assert_eq!(down.interval.high, 1.0);
    let moved = cross_entropy(&density, &never, &CrossEntropy::new(1, 500, 500)).unwrap().estimate;
    assert_eq!((moved.probability, moved.trust.verdict()), (0.0, Verdict::Unusable));
}
