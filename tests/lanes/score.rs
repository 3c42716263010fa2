//! What the score says about chosen verdicts, and that threads do not change a bit of it (nor chunks: `partial.rs`).

use crate::common::plans::{self, chunk, mixed, plan};
use crate::common::{golden_json, with_threads};
use lanesweep::engine::{Confusion, LaneKey, LanePlan, Partial, Verdicts};
use lanesweep::prelude::*;
use lanesweep::run::score::{ClaimVerdict, ScoreTable, best_parameterizations, check_claims, score};

const LVD: &[&str] = &["i", "ii", "iii", "iv", "v"];

fn part(plan: &LanePlan, units: std::ops::Range<u64>, lane: &dyn Fn(u64) -> Verdicts) -> Partial {
    Partial::from_chunk(plan, &chunk(plan, units, &|l| (lane(l), 1.0), false)).unwrap()
}

fn scored(plan: &LanePlan, lane: &dyn Fn(u64) -> Verdicts) -> (Partial, ScoreTable) {
    let counts = part(plan, 0..plan.unit_count(), lane);
    let table = score(plan, &counts, &ScoreOptions::default()).unwrap();
    (counts, table)
}

/// S fails at random; each variant repeats S but for a share (per mille) of lanes, where it is turned round.
fn noisy<'p>(plan: &'p LanePlan, wrong: &'p [u64]) -> impl Fn(u64) -> Verdicts + 'p {
    move |lane| {
        let key = plan.key(lane).unwrap();
        let recorded = plan.lane(&LaneKey { variant: 0, ..key });
        let fails = mixed(5, recorded) % 10 < 3;
        let turned = key.variant > 0 && mixed(7, lane) % 1000 < wrong[key.variant - 1];
        Verdicts(if fails != turned { 0b111 } else { 0 })
    }
}

#[test]
fn a_confusion_by_hand() {
    let scores = |tp, fn_, fp, tn| {
        let counts = Confusion { tp, fn_, fp, tn };
        (recall(&counts), precision(&counts), f1(&counts))
    };
    let by_hand = (Some(0.75), Some(0.6), Some(12.0 / 18.0));
    assert_eq!(scores(6_u64, 2, 4, 88), by_hand);
    assert_eq!(scores(6 << 40, 2 << 40, 4 << 40, 88 << 40), by_hand, "past 2^32 too");
    assert_eq!(scores(0, 0, 0, 100), (None, None, None));
    assert_eq!(scores(0, 3, 0, 7), (Some(0.0), None, Some(0.0)));
}

/// Verdicts on the paper's claims about cut-outs: so many scenarios fail per model; S' repeats S but for `c`, which never
/// fails, and `d`, which `d` says.
#[test]
fn claims_are_judged_by_scenarios_and_need_enough_of_them() {
    let plan = plan(&[(Category::CutOut, 400, &["a", "b", "c", "d", "e", "f", "g"])]);
    let verdict = |id: &str, failing: [u64; 4], is_d_bad: bool| {
        let lane = |lane: u64| {
            let key = plan.key(lane).unwrap();
            let fails = key.unit < failing[key.model] && key.variant != 3 && !(is_d_bad && key.variant == 4);
            Verdicts(if fails { 0b111 } else { 0 })
        };
        let (counts, table) = scored(&plan, &lane);
        check_claims(&table, &plan, &counts).into_iter().find(|of| of.claim.id == id).unwrap().verdict
    };
    for (id, failing, is_d_bad, expected) in [
        ("cut-out b = d", [200; 4], false, ClaimVerdict::Holds),
        ("cut-out b = d", [200; 4], true, ClaimVerdict::Contradicted),
        ("cut-out b = d", [9; 4], true, ClaimVerdict::TooFew),
        ("cut-out c FN", [200; 4], false, ClaimVerdict::Holds),
        ("cut-out c ~ 0", [200; 4], false, ClaimVerdict::Holds),
        ("cut-out failures", [200, 0, 30, 30], false, ClaimVerdict::Contradicted),
        ("cut-out failures", [220, 200, 4, 4], false, ClaimVerdict::Holds),
    ] {
        assert_eq!(verdict(id, failing, is_d_bad), expected, "{id}, {failing:?}");
    }
}

#[test]
fn the_interval_covers_the_value_and_shrinks_with_the_number_of_scenarios() {
    let width = |units| {
        let plan = plan(&[(Category::Lvd, units, LVD)]);
        let (_, table) = scored(&plan, &noisy(&plan, &[100, 100, 100, 100, 100]));
        let scores = &table.categories[0];
        let cell = &scores.cells[scores.index(2, ModelId::Rss, Criterion::Btn).unwrap()];
        let (value, interval) = (f1(&cell.counts).unwrap(), cell.f1_interval.unwrap());
        assert!(interval.low < value && value < interval.high, "{value} {interval:?}");
        interval.high - interval.low
    };
    let (few, many) = (width(14), width(90));
    assert!(many < 0.6 * few, "{few} to {many}");
}

#[test]
fn the_best_of_equals_is_the_first_and_no_data_tells_it_from_the_others() {
    // iii, iv and v repeat each other's lanes.
    let plan = plan(&[(Category::Lvd, 60, LVD)]);
    let twins = |lane: u64| {
        let key = plan.key(lane).unwrap();
        let variant = key.variant.min(3);
        noisy(&plan, &[400, 400, 50, 50, 50])(plan.lane(&LaneKey { variant, ..key }))
    };
    let (counts, table) = scored(&plan, &twins);
    for best in best_parameterizations(&table, &plan, &counts, Criterion::Ttc) {
        assert_eq!(best.data_for_decision, None, "no data does");
        let score = best.score.unwrap();
        assert_eq!((score.variant.as_str(), &score.rivals[..]), ("iii", &["iv".to_owned(), "v".to_owned()][..]));
        assert!(score.interval.low < score.f1);
    }
}

#[test]
fn a_best_parameterization_needs_ten_failing_scenarios() {
    let plan = plan(&[(Category::Lvd, 60, LVD)]);
    let best = |failing: u64| {
        let lane = |lane: u64| Verdicts(if plan.key(lane).unwrap().unit < failing { 7 } else { 0 });
        let (counts, table) = scored(&plan, &lane);
        assert!(failing > 0 || table.categories[0].cells[0].f1_interval.is_none(), "an interval of nothing");
        let best = best_parameterizations(&table, &plan, &counts, Criterion::Collision).swap_remove(0);
        (best.failures, best.failing_scenarios, best.score.is_some(), best.data_for_decision)
    };
    assert_eq!(best(8), (80, 8, false, Some(1.25)));
    assert_eq!(best(0), (0, 0, false, None), "no data of this kind");
    assert_eq!((best(9).2, best(10).2), (false, true));
}

#[test]
fn threads_do_not_change_a_bit() {
    let plan = plan(&[(Category::CutIn, 20, &["1", "2"]), (Category::Lvd, 15, LVD)]);
    let lane = noisy(&plan, &[100, 200, 300, 50, 10]);
    let counts = part(&plan, 0..35, &lane);
    let of = || score(&plan, &counts, &ScoreOptions::default()).unwrap();
    assert_eq!(with_threads(1, of), with_threads(2, of));
}

#[test]
fn an_incomplete_or_foreign_sweep_is_not_scored() {
    let plan = plan(&[(Category::Lvd, 6, LVD)]);
    let some = part(&plan, 2..4, &|_| Verdicts(0));
    let error = score(&plan, &some, &ScoreOptions::default()).unwrap_err().to_string();
    assert!(error.contains("2 of 6 units"), "{error}");
    let whole = part(&plan, 0..6, &|_| Verdicts(0));
    let other = plans::plan(&[(Category::Lvd, 6, &["i"])]);
    assert!(score(&other, &whole, &ScoreOptions::default()).is_err(), "as many units, but of another plan");
}

#[test]
fn the_papers_lvd_f1_follow_from_their_integer_counts() {
    let (golden, mut checked) = (golden_json("paper_lvd_f1.json"), 0);
    for cell in golden["lvd"].as_object().unwrap().values().flat_map(|v| v.as_object().unwrap()) {
        let (name, cell) = cell;
        let expected = cell["F1"].as_f64().unwrap();
        for candidate in cell["TP_FN_FP_candidates"].as_array().unwrap() {
            let [both, fn_, fp] = [0, 1, 2].map(|k| candidate[k].as_u64().unwrap());
            let ours = Confusion { tp: both, fn_, fp, tn: 4820 - both - fn_ - fp };
            assert_eq!(both + fn_, cell["baseline_fails"].as_u64().unwrap(), "{name}");
            assert!((f1(&ours).unwrap() - expected).abs() < 1e-9, "{name}: {:?} {expected}", f1(&ours));
            checked += 1;
        }
    }
    assert!(checked >= 60, "{checked}");
}

#[test]
fn a_plan_without_variants_or_with_one_scenario_scores_without_a_panic() {
    for blocks in [&[(Category::Lvd, 1, LVD)][..], &[(Category::CutIn, 1, &[])], &[(Category::Lvd, 0, LVD)]] {
        let plan = plan(blocks);
        let (counts, table) = scored(&plan, &|lane| Verdicts((lane % 8) as u8));
        check_claims(&table, &plan, &counts);
    }
}
