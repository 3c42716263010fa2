//! Partial results are the same however a sweep is cut and in whatever order its parts come together.

use crate::common::dice::cases;
use crate::common::plans::{self, chunk, mixed, plan};
use lanesweep::engine::{Chunk, LanePlan, Partial, Verdicts};
use lanesweep::prelude::*;
use lanesweep::run::parts::seal;

fn study() -> LanePlan {
    plan(&[(Category::CutIn, 4, &["1", "2"]), (Category::CutOut, 0, &["a"]), (Category::Lvd, 5, &["i"])])
}

/// Random verdicts, also capped ones; min TTC with many ties and infinities, in
/// eighths: short decimals, of which no changed digit reads back as the same number.
fn lane(seed: u64) -> impl Fn(u64) -> (Verdicts, f64) {
    move |lane| {
        let word = mixed(seed, lane);
        let coarse = (word >> 8) % 50;
        (Verdicts((word & 0xf) as u8), if coarse > 45 { f64::INFINITY } else { coarse as f64 / 8.0 })
    }
}

fn whole(plan: &LanePlan, seed: u64) -> Partial {
    Partial::from_chunk(plan, &chunk(plan, 0..plan.unit_count(), &lane(seed), true)).unwrap()
}

fn text_of(partial: &Partial) -> String {
    String::from_utf8(seal("part", partial).unwrap().0).unwrap()
}

#[test]
fn any_cut_and_any_order_gives_the_same_partial() {
    let plan = study();
    cases(48, |dice| {
        let seed = dice.next();
        let mut borders = [dice.list([0, 5], |dice| dice.below(10) as u64), vec![0, plan.unit_count()]].concat();
        borders.sort_unstable();
        let part = |w: &[u64]| Partial::from_chunk(&plan, &chunk(&plan, w[0]..w[1], &lane(seed), true)).unwrap();
        let mut parts: Vec<Partial> = borders.windows(2).map(part).collect();
        // Merge any two, again and again: any order and any bracketing.
        while parts.len() > 1 {
            let a = parts.swap_remove(dice.below(parts.len()));
            let b = parts.swap_remove(dice.below(parts.len()));
            parts.push(a.merge(b).unwrap());
        }
        let (merged, expected) = (parts.pop().unwrap(), whole(&plan, seed));
        assert_eq!(merged, expected);
        assert_eq!(text_of(&merged), text_of(&expected));
        assert!(merged.is_complete(&plan));
    });
}

#[test]
fn counts_are_over_the_headways_of_one_scenario() {
    let plan = study();
    // S of the model at index 0 fails collision at every headway; variant 1 at the first three of ten.
    let lane = |lane: u64| {
        let key = plan.key(lane).unwrap();
        let fails = key.model == 0 && (key.variant == 0 || (key.variant == 1 && key.headway < 3));
        (Verdicts(u8::from(fails)), 1.0)
    };
    let partial = Partial::from_chunk(&plan, &chunk(&plan, 0..9, &lane, false)).unwrap();
    let unit = &partial.units()[2];
    assert_eq!(unit.unit, 2);
    let cell = |variant: usize| unit.cells[variant * plan.models.len() * Criterion::ALL.len()];
    assert_eq!((cell(0).tp, cell(0).tn), (10, 0), "S against itself");
    assert_eq!((cell(1).tp, cell(1).fn_, cell(1).fp, cell(1).tn), (3, 7, 0, 0));
    assert_eq!((cell(2).tp, cell(2).fn_), (0, 10));
    assert_eq!(unit.cells[1].tn, 10, "TTC never fails");
    // Over the four cut-ins, headway by headway: S fails everywhere, variant 1 at the first three.
    let by_headway = partial.headway_failures(&plan, 0).unwrap();
    let width = plan.models.len() * Criterion::ALL.len();
    let first: Vec<u64> = by_headway.iter().step_by(width).copied().collect();
    assert_eq!(first[..10], [4; 10]);
    assert_eq!(first[10..20], [4, 4, 4, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(by_headway.iter().sum::<u64>(), first.iter().sum::<u64>());
}

#[test]
fn overlaps_and_strangers_are_refused() {
    let plan = study();
    let part = |plan: &LanePlan, units| Partial::from_chunk(plan, &chunk(plan, units, &lane(1), true)).unwrap();
    let error = part(&plan, 0..5).merge(part(&plan, 4..6)).unwrap_err();
    assert!(error.to_string().contains("unit 4"), "{error}");
    let other = plans::plan(&[(Category::Lvd, 9, &["i"])]);
    let error = part(&plan, 0..5).merge(part(&other, 5..6)).unwrap_err();
    assert!(error.to_string().contains("belongs to plan"), "{error}");
}

#[test]
fn a_chunk_that_does_not_fit_its_plan_is_an_error_and_no_panic() {
    let plan = study();
    let good = chunk(&plan, 2..6, &lane(1), true);
    let spoils: [fn(&mut Chunk); 5] = [
        |chunk| chunk.verdicts.truncate(chunk.verdicts.len() - 1),
        |chunk| chunk.outcomes.truncate(chunk.outcomes.len() - 1),
        |chunk| chunk.first_lane += 1,
        |chunk| chunk.units.end = 99,
        |chunk| (chunk.units.start, chunk.units.end) = (6, 2),
    ];
    for spoil in spoils {
        let mut bad = good.clone();
        spoil(&mut bad);
        let error = Partial::from_chunk(&plan, &bad).unwrap_err();
        assert!(matches!(error, lanesweep::Error::Internal(_)), "{error}");
    }
    assert!(Partial::from_chunk(&plan, &good).is_ok());
}
