//! What the estimators of rare failures promise, on problems whose probability is known.

use lanesweep::stats::density::Mixture;
use lanesweep::stats::estimate::{
    BlockSums, Density, Estimate, Goal, Importance, LimitState, Search, SearchRun, Truncated, Verdict, Warning,
    WeightSums, importance_sums,
};

use crate::common::reliability::{
    StandardNormal, adaptive, four_branch, four_branch_probability, importance, linear, tail, two_sided, unit_mixture,
};
use crate::common::{golden_json, numbers, with_threads};

/// At most so many draws of the density, in the search and again beside the final draws.
const CRUDE: u64 = 1_000_000;

/// The default search, ± 20 % at 95 %.
fn found(density: &dyn Density, limit_state: &dyn LimitState, seed: u64) -> (Vec<Estimate>, SearchRun) {
    let goal = Goal { half_width: 0.2, max_draws: 100_000, max_crude: CRUDE };
    adaptive(density, limit_state, &Search { crude: CRUDE, ..Search::default() }, &goal, seed, 0.95).unwrap()
}

fn close(got: f64, expected: f64) -> bool {
    (got / expected - 1.0).abs() < 1e-9
}

#[test]
fn the_author_s_estimates_are_reproduced() {
    let golden = golden_json("importance_sampling.json");
    let column = |table: &str, k: usize| -> Vec<f64> { numbers(&golden[table][k]) };
    let number = |path: &str| golden.pointer(path).and_then(|v| v.as_f64()).expect("a number");
    let of = |table: &str, ratio: &dyn Fn(usize) -> f64, response: &dyn Fn(usize) -> f64| -> WeightSums {
        let tries = column(table, 1);
        let leaves: Vec<WeightSums> = (0..tries.len())
            .map(|i| {
                let mut sums = WeightSums { draws: tries[i] as u64, ..WeightSums::default() };
                if response(i) > 0.0 {
                    sums.add_failure(ratio(i) * response(i), false);
                }
                sums
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
    let valid = f.len() as f64;
    let author_sigma = |sums: &WeightSums| {
        let p = sums.probability();
        (sums.failing_squared / (sums.draws as f64).powi(2) - p * p / valid).sqrt()
    };
    let collision = of("is_", &ratio, &|i| f64::from(u8::from(result[i] < 0.0)));
    assert!(close(collision.probability(), number("/is_collision/estimate")));
    assert!(close(author_sigma(&collision), number("/is_collision/sigma")));
    assert!(close(collision.figures().effective_failures, number("/extra_ess_failures")));
    let injured = of("is_", &ratio, &|i| injury[i]);
    assert!(close(injured.probability(), number("/is_injury/estimate")));
    assert!(close(author_sigma(&injured), number("/is_injury/sigma")));
    let factor = valid / collision.draws as f64 / validity;
    assert!(close(factor, number("/truncation_factor")));
}

#[test]
fn sums_of_a_proposal_are_the_same_bits_in_any_division_of_the_indices_and_a_search_with_one_thread() {
    let density = StandardNormal { dimensions: 2 };
    let proposal = Mixture::of_kernels(vec![vec![2.0, 2.0]], &[0.7, 0.7]).unwrap();
    let options = Importance { seed: 9, draws: 20_000, crude_per_draw: 3 };
    let of = |range| importance_sums(&density, &proposal, &linear(3.0), &options, range).unwrap().remove(0);
    let whole = of(0..20_000);
    let mut parts = of(7001..20_000);
    parts.merge(of(0..123)).unwrap();
    parts.merge(of(123..7001)).unwrap();
    assert_eq!(parts, whole);
    assert_eq!(with_threads(1, || of(0..20_000)), whole);
    let search = || found(&StandardNormal { dimensions: 4 }, &linear(4.0), 8);
    assert_eq!(with_threads(1, search), search());
}

/// Checks the estimate of the first question, which lies within a fraction of the truth.
fn assert_found(
    what: &str,
    density: &dyn Density,
    limit_state: &dyn LimitState,
    seed: u64,
    (truth, by): (f64, f64),
) -> Estimate {
    let estimate = found(density, limit_state, seed).0.remove(0);
    assert!((estimate.probability / truth - 1.0).abs() < by, "{what}: {estimate:?} beside {truth}");
    estimate
}

#[test]
fn a_search_finds_the_linear_limit_s_probability_in_any_dimension() {
    for (beta, dimensions) in [(2.0, 2), (3.5, 5), (5.0, 10)] {
        let estimate = assert_found("linear", &StandardNormal { dimensions }, &linear(beta), 3, (tail(beta), 0.15));
        // A million draws of the density do not exclude other failures of a probability below 3.7e-6.
        let is_bounded = tail(beta) > 7.4e-6;
        assert_eq!(estimate.trust.draws() == Verdict::Sound, is_bounded, "{estimate:?}");
        assert!(is_bounded || estimate.interval.high > 3e-6, "{estimate:?}");
    }
}

#[test]
fn a_search_finds_every_branch() {
    for (near, far) in [(3.0, 3.5), (5.0, 5.2)] {
        let (density, truth) = (StandardNormal { dimensions: 2 }, four_branch_probability(near, far));
        let (estimates, search) = found(&density, &four_branch(near, far), 1);
        assert!((estimates[0].probability / truth - 1.0).abs() < 0.15, "{:?}", estimates[0]);
        let proposal = search.proposal.unwrap();
        for (x, y) in [(1.0, 1.0), (-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0)] {
            let is_near = |k: &usize| proposal.mean(*k)[0] * x > 1.0 && proposal.mean(*k)[1] * y > 1.0;
            assert!((0..proposal.weights().len()).any(|k| is_near(&k)), "nothing in the direction of {x}, {y}");
        }
    }
}

/// The first guide falls towards a place without failures, and 0.01 above them: levels lead away.
#[test]
fn a_guide_that_misleads_costs_draws_but_not_the_estimate() {
    let away = |points: &[Vec<f64>]| {
        let value = |x: &Vec<f64>| if x[0] > 3.0 { -1.0 } else { 0.01 + libm::exp(0.1 * x[0]) };
        Ok(points.iter().map(value).collect())
    };
    let (estimates, _) = found(&StandardNormal { dimensions: 3 }, &away, 2);
    let estimate = &estimates[0];
    assert!(estimate.interval.holds(tail(3.0)), "{estimate:?}");
}

/// Two ways to fail: one is far away and easily found, since the guide falls towards it; the other is likely, behind a
/// rise of the guide.
#[test]
fn failures_in_the_tails_do_not_hide_more_likely_ones() {
    let pocket = |points: &[Vec<f64>]| {
        let value = |x: &Vec<f64>| {
            if x[0] < -6.0 || x[1] > 4.2 { -1.0 } else { libm::exp(0.5 * x[0]) }
        };
        Ok(points.iter().map(value).collect())
    };
    let truth = tail(4.2) + tail(6.0);
    for seed in 0..2 {
        assert_found("pocket", &StandardNormal { dimensions: 2 }, &pocket, seed, (truth, 0.3));
    }
}

struct Halves;

impl LimitState for Halves {
    fn questions(&self) -> usize {
        3
    }

    fn evaluate(&self, points: &[Vec<f64>]) -> lanesweep::Result<Vec<f64>> {
        Ok(points.iter().flat_map(|x| [2.5 - x[0], 4.0 - x[0], 4.5 + x[1]]).collect())
    }
}

#[test]
fn one_search_answers_several_questions_with_the_same_draws() {
    let (estimates, _) = found(&StandardNormal { dimensions: 2 }, &Halves, 5);
    for (estimate, beta) in estimates.iter().zip([2.5, 4.0, 4.5]) {
        assert!((estimate.probability / tail(beta) - 1.0).abs() < 0.25, "{beta}: {estimate:?}");
        assert_eq!(estimate.trust.draws() == Verdict::Sound, beta < 4.5, "{beta}: {estimate:?}");
        assert_eq!(estimate.runs, estimates[0].runs);
    }
}

#[test]
fn a_truncated_density_is_searched_within_its_valid_region() {
    let half = Truncated::with_validity(unit_mixture(2), |x: &[f64]| x[1] > 0.0, 0.5).unwrap();
    // x₀ + x₁ > 4√2 with x₁ > 0: most of the tail, twice its density.
    let truth = {
        let (steps, width) = (200_000, 12.0 / 200_000.0);
        let density = |y: f64| libm::exp(-0.5 * y * y) / (2.0 * std::f64::consts::PI).sqrt();
        let of = |i: i32| (f64::from(i) + 0.5) * width;
        2.0 * (0..steps).map(|i| density(of(i)) * tail(4.0 * std::f64::consts::SQRT_2 - of(i)) * width).sum::<f64>()
    };
    assert_found("half", &half, &linear(4.0), 4, (truth, 0.15));
}

#[test]
fn a_proposal_that_misses_a_way_to_fail_makes_the_interval_wider_but_not_wrong() {
    let density = StandardNormal { dimensions: 2 };
    let one_side = || Mixture::of_kernels(vec![vec![2.7, 0.0]], &[0.6, 1.0]).unwrap();
    let other = Mixture::of_kernels(vec![vec![-2.7, 0.0]], &[0.6, 1.0]).unwrap();
    let both = Mixture::join(&[(0.5, &one_side()), (0.5, &other)]).unwrap();
    let truth = 2.0 * tail(2.5);
    let repeats = 200;
    let of = |proposal: &Mixture, crude_per_draw| -> Vec<Estimate> {
        let options = |seed| Importance { seed, draws: 2000, crude_per_draw };
        let run = |seed| importance(&density, proposal, &two_sided(2.5), &options(seed), 0.95).unwrap().remove(0);
        (0..repeats).map(run).collect()
    };
    let held = |all: &[Estimate]| all.iter().filter(|estimate| estimate.interval.holds(truth)).count();
    let width = |all: &[Estimate]| all.iter().map(|e| e.relative_half_width).sum::<f64>() / repeats as f64;
    // Half of the failures are met by one or two draws of the density, by ten, by none of a good proposal's concern.
    let [few, some, good] = [of(&one_side(), 1), of(&one_side(), 10), of(&both, 1)];
    for (name, all) in [("few", &few), ("some", &some), ("good", &good)] {
        assert!(held(all) >= 184, "{name}: {} of {repeats} intervals hold {truth}", held(all));
    }
    assert!(width(&good) < width(&some) && width(&some) < width(&few));
    // Without draws of the density nothing tells what is missed: half of the probability, in every run.
    assert!(held(&of(&one_side(), 0)) < 20);
}

#[test]
fn a_search_without_failures_is_followed_by_draws_of_the_density_that_bound_the_probability() {
    let never = |points: &[Vec<f64>]| Ok(vec![1.0; points.len()]);
    let (estimates, _) = found(&StandardNormal { dimensions: 2 }, &never, 1);
    let estimate = &estimates[0];
    assert_eq!((estimate.probability, estimate.trust.draws()), (0.0, Verdict::Doubtful));
    assert!((3.6e-6..3.8e-6).contains(&estimate.interval.high), "{estimate:?}");
    assert!(estimate.trust.warnings.contains(&Warning::NoFailures));
}
