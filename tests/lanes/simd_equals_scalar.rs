//! Lanes in batches give the bits of lanes one by one, on every instruction set of this machine, however they are cut.

use crate::common::lane_sets::{self, assert_same_in_calls, forms, random, small_study, swept, thresholds};
use crate::common::mined::scenarios_of;
use crate::common::with_threads;
use lanesweep::engine::{Backend, Instructions, LanePlan, RecheckBy, RecheckOptions};
use lanesweep::prelude::*;
use lanesweep::run::study::plan_study;

/// Batches on every instruction set of this machine.
fn in_batches() -> Vec<CpuBackend> {
    let sets = Instructions::available().into_iter().filter(|set| *set != Instructions::Scalar);
    sets.map(|set| CpuBackend::with_instructions(set).unwrap()).collect()
}

fn assert_equal(what: &str, plan: &LanePlan) {
    let scalar = swept(plan, &CpuBackend::scalar(), Wanted::Outcomes).outcomes;
    in_batches().iter().for_each(|backend| assert_same_in_calls(plan, backend, plan.unit_count(), &scalar, what));
}

#[test]
fn this_machine_runs_what_it_says_and_refuses_the_rest() {
    for set in Instructions::ALL {
        let backend = CpuBackend::with_instructions(set);
        assert_eq!(backend.is_ok(), Instructions::available().contains(&set));
        match backend {
            Ok(backend) => assert!(backend.describe().contains(set.name())),
            Err(error) => assert!(error.to_string().contains(set.name())),
        }
    }
    assert!(CpuBackend::lane_arithmetic().describe().contains(Instructions::best().name()));
}

#[test]
fn a_small_study_random_lanes_and_lanes_on_thresholds_are_equal_under_every_profile() {
    assert_equal("study", &small_study());
    for name in Profile::names() {
        let profile = Profile::load(name).unwrap();
        assert_equal(name, &random(&profile, 500));
        assert_equal(name, &thresholds(&profile, 3));
    }
}

#[test]
fn lanes_are_equal_under_every_form_of_every_option_and_at_other_time_steps() {
    for profile in forms() {
        let what = format!("{:?} {:?}", profile.criteria, profile.frame);
        assert_equal(&what, &random(&profile, 50));
        assert_equal(&what, &thresholds(&profile, 1));
    }
}

/// More headways than lanes wait at once, and numbers of them around those that a batch has: at the usual cap, and at
/// one that most lanes reach, so that slots stay free beside lanes that go on.
#[test]
fn any_number_of_headways_gives_the_same_words() {
    let of = |category| scenarios_of(1).iter().filter(move |s| s.category == category).take(2).cloned();
    let scenarios: Vec<Scenario> = Category::ALL.into_iter().flat_map(of).collect();
    let mut short = Profile::load("paper").unwrap();
    short.frame.time_cap_s = 2.5;
    for (profile, count) in
        [(&short, 1), (&short, 15), (&short, 17), (&short, 300), (&Profile::load("paper").unwrap(), 600)]
    {
        let headways = (1..=count).map(|k| Headway::ThwS(3.0 * f64::from(k) / f64::from(count))).collect();
        let options = StudyOptions { headways, ..StudyOptions::default() };
        assert_equal(&format!("{count} headways"), &plan_study(&scenarios, profile, &options).unwrap());
    }
}

/// One in a hundred of the lanes of batches that skip steps; others are not recomputed.
#[test]
fn a_sample_of_the_lanes_is_recomputed_and_passes() {
    let (plan, cpu) = (random(&Profile::load("paper").unwrap(), 3000), CpuBackend::lane_arithmetic());
    for wanted in [Wanted::Verdicts, Wanted::Outcomes] {
        let executor = Executor { recheck: Some(RecheckOptions { seed: 7, one_in: 100 }), ..Executor::new(&cpu) };
        let summary = executor.sweep(&plan, 0..plan.unit_count(), wanted, |_| Ok(())).unwrap();
        let is_checked = cpu.rechecked_by(wanted) != RecheckBy::Nothing;
        assert_eq!(summary.rechecked_lanes, if is_checked { plan.lane_count().div_ceil(100) } else { 0 }, "{wanted:?}");
    }
}

#[test]
fn neither_threads_nor_calls_change_a_word() {
    let plan = random(&Profile::load("paper").unwrap(), 800);
    let scalar = swept(&plan, &CpuBackend::scalar(), Wanted::Outcomes).outcomes;
    for threads in [1, 2, 3] {
        // Sizes that fill no batch, and all at once.
        for units in [1, 7, plan.unit_count()] {
            for backend in in_batches() {
                let what = format!("{threads} threads, {units} units");
                with_threads(threads, || assert_same_in_calls(&plan, &backend, units, &scalar, &what));
            }
        }
    }
}

/// Minutes: `cargo test --release --test library simd_equals_scalar:: -- --ignored`.
#[test]
#[ignore = "minutes: 10^6 lanes per model and category"]
fn a_million_random_lanes_per_model_and_category_are_equal() {
    let plan = random(&Profile::load("paper").unwrap(), 1_000_000);
    assert!(plan.lane_count() >= 1_000_000 * (ModelId::ALL.len() * Category::ALL.len()) as u64);
    in_batches().iter().for_each(|backend| lane_sets::assert_equal("a million", &plan, backend));
}
