//! Lanes in batches give the same output words as lanes run one by one, bit for bit, on every instruction set of
//! this machine, whatever the profile, the number of threads and the cut into calls.

use lanesweep::criterion::{BtnContact, BtnForm, LateralGate};
use lanesweep::driver::ModelId;
use lanesweep::mining::{MiningOptions, mine_generated};
use lanesweep::profile::Profile;
use lanesweep::scenario::Category;
use lanesweep::sweep::{
    Backend, CpuBackend, Instructions, LanePlan, LaneRunner, Outcome, StudyOptions, Verdicts, Wanted, plan_study,
    same_words,
};
use lanesweep::trajectory::generator::GeneratorOptions;
use lanesweep::verify::{Comparison, RandomOptions, ThresholdOptions, compare, random_plan, threshold_plan};

/// Batches on every instruction set of this machine.
fn in_batches() -> Vec<CpuBackend<f32>> {
    let sets = Instructions::available().into_iter().filter(|set| *set != Instructions::Scalar);
    sets.map(|set| CpuBackend::with_instructions(set).unwrap()).collect()
}

fn random(profile: &Profile, lanes: u64) -> LanePlan {
    random_plan(profile, &RandomOptions { lanes_per_model_and_category: lanes, ..Default::default() }).unwrap()
}

fn thresholds(profile: &Profile, units: u64) -> LanePlan {
    threshold_plan(profile, &ThresholdOptions { units_per_threshold: units, ..Default::default() }).unwrap()
}

fn small_study() -> LanePlan {
    let generator = GeneratorOptions { recordings: 2, ..GeneratorOptions::default() };
    let collection = mine_generated(&generator, &MiningOptions::default(), || ()).unwrap();
    plan_study(&collection.scenarios, &Profile::load("paper").unwrap(), &StudyOptions::default()).unwrap().plan
}

/// Outcomes, verdicts and counts of every instruction set against the scalar lanes.
fn assert_equal(what: &str, plan: &LanePlan) {
    for backend in in_batches() {
        let Comparison { worst, modes_differing, .. } = &compare(what, plan, &backend, |_| ()).unwrap();
        let worst: Vec<String> = worst.iter().map(|l| format!("{} {:?}", l.key, l.names())).collect();
        assert!(worst.is_empty() && *modes_differing == 0, "{what}, {}: {worst:#?}", backend.describe());
    }
}

/// Every form of every option that decides which loop a batch runs.
fn forms() -> Vec<Profile> {
    let paper = Profile::load("paper").unwrap();
    let mut profiles = vec![paper.clone().with_dt(0.1).unwrap(), paper.clone().with_dt(0.01).unwrap()];
    for btn in [BtnForm::EquivalentDelay, BtnForm::Exact, BtnForm::DistanceRatio] {
        for gate in [LateralGate::EgoWidth, LateralGate::Overlap] {
            for (btn_contact, aborts) in [(BtnContact::Any, false), (BtnContact::Gated, true)] {
                let mut profile = paper.clone();
                profile.criteria.btn = btn;
                profile.criteria.gate = gate;
                profile.criteria.btn_contact = btn_contact;
                profile.cchdm.abort_on_large_ttc = aborts;
                profiles.push(profile);
            }
        }
    }
    let mut unsettled = paper.clone();
    unsettled.frame.end_when_settled = !paper.frame.end_when_settled;
    unsettled.frame.start_shift = !paper.frame.start_shift;
    unsettled.frame.time_cap_s = 8.0;
    profiles.push(unsettled);
    let mut shortest = paper.clone();
    shortest.frame.time_cap_s = 2.0 * paper.frame.dt_s;
    profiles.push(shortest);
    profiles
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
fn random_lanes_and_lanes_on_thresholds_are_equal_under_every_profile() {
    for name in Profile::names() {
        let profile = Profile::load(name).unwrap();
        assert_equal(name, &random(&profile, 1000));
        assert_equal(name, &thresholds(&profile, 3));
    }
}

#[test]
fn lanes_are_equal_under_every_form_of_every_option_and_at_other_time_steps() {
    for profile in forms() {
        let what = format!("{:?} {:?}", profile.criteria, profile.frame);
        assert_equal(&what, &random(&profile, 200));
        assert_equal(&what, &thresholds(&profile, 1));
    }
}

#[test]
fn every_word_of_a_small_study_is_equal() {
    assert_equal("study", &small_study());
}

#[test]
fn neither_threads_nor_calls_change_a_word() {
    let plan = random(&Profile::load("paper").unwrap(), 2000);
    let runner = LaneRunner::<f32>::new(&plan);
    let scalar: Vec<Outcome<f64>> =
        (0..plan.lane_count()).map(|lane| runner.run(&plan.key(lane).unwrap()).widen()).collect();
    let scalar_verdicts: Vec<Verdicts> = scalar.iter().map(|o| o.verdicts).collect();
    for threads in [1, 2, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        // Sizes that fill no batch, and all at once.
        for units in [1, 7, plan.unit_count()] {
            for backend in in_batches() {
                let (outcomes, verdicts) = pool.install(|| in_calls(&plan, &backend, units));
                let what = format!("{threads} threads, {units} units, {}", backend.describe());
                assert!(outcomes.iter().zip(&scalar).all(|(a, b)| same_words(a, b)), "{what}");
                assert!(outcomes.len() == scalar.len() && verdicts == scalar_verdicts, "{what}");
            }
        }
    }
}

/// So many units at a time: outcomes and, asked for separately, verdicts.
fn in_calls(plan: &LanePlan, backend: &CpuBackend<f32>, units: u64) -> (Vec<Outcome<f64>>, Vec<Verdicts>) {
    let mut session = backend.prepare(plan).unwrap();
    let (mut from, mut outcomes, mut verdicts) = (0, Vec::new(), Vec::new());
    while from < plan.unit_count() {
        let to = (from + units).min(plan.unit_count());
        outcomes.extend(session.run(from..to, Wanted::Outcomes).unwrap().outcomes);
        verdicts.extend(session.run(from..to, Wanted::Verdicts).unwrap().verdicts);
        from = to;
    }
    (outcomes, verdicts)
}

/// Minutes: `cargo test --release --test simd_equals_scalar -- --ignored`.
#[test]
#[ignore = "minutes: 10^6 lanes per model and category"]
fn a_million_random_lanes_per_model_and_category_are_equal() {
    let plan = random(&Profile::load("paper").unwrap(), 1_000_000);
    assert!(plan.lane_count() >= 1_000_000 * (ModelId::ALL.len() * Category::ALL.len()) as u64);
    assert_equal("a million", &plan);
}
