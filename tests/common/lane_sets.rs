//! Lanes to compare backends with: profiles in which every option takes every form, and plans.
use super::mined::scenarios_of;
use lanesweep::engine::verify::{Comparison, SetOptions, compare, random_plan, threshold_plan};
use lanesweep::engine::{Backend, Chunk, Constants, LaneCase, LanePlan, Start, Step, same_words};
use lanesweep::model::criterion::{BtnContact, BtnForm, LateralGate};
use lanesweep::model::profile::{CutOutEvaluated, CutOutTarget};
use lanesweep::model::scalar::Real;
use lanesweep::prelude::*;
use lanesweep::run::study::plan_study;
use lanesweep::scenario::{Case, Tables};

/// Every form of every option that decides how a lane runs, and other time steps and caps.
pub fn forms() -> Vec<Profile> {
    let paper = Profile::load("paper").unwrap();
    let of = |base: &Profile, change: &dyn Fn(&mut Profile)| {
        let mut profile = base.clone();
        change(&mut profile);
        profile
    };
    let with = |change: &dyn Fn(&mut Profile)| of(&paper, change);
    let mut profiles = vec![paper.clone().with_dt(0.1).unwrap(), paper.clone().with_dt(0.01).unwrap()];
    for btn in [BtnForm::EquivalentDelay, BtnForm::Exact, BtnForm::DistanceRatio] {
        for gate in [LateralGate::EgoWidth, LateralGate::Overlap] {
            for (btn_contact, aborts) in [(BtnContact::Any, false), (BtnContact::Gated, true)] {
                profiles.push(with(&|of| {
                    (of.criteria.btn, of.criteria.gate, of.criteria.btn_contact) = (btn, gate, btn_contact);
                    of.cchdm.abort_on_large_ttc = aborts;
                }));
            }
        }
    }
    profiles.push(with(&|of| of.frame.cut_out_evaluated = CutOutEvaluated::Ahead));
    profiles.push(with(&|of| of.frame.cut_out_target = CutOutTarget::Exposed));
    profiles.push(with(&|of| of.frame.cut_out_target = CutOutTarget::LargestDemand));
    profiles.push(with(&|of| {
        of.frame.end_when_settled = !of.frame.end_when_settled;
        of.frame.start_shift = !of.frame.start_shift;
        of.frame.time_cap_s = 8.0;
    }));
    profiles.push(with(&|of| of.frame.time_cap_s = 2.0 * of.frame.dt_s));
    // Steps in which vehicles drive past one another, up to the longest: with every gate and rule of its own.
    let patient = with(&|of| {
        (of.reg157.reaction_time_s, of.reg157.margin_s, of.cchdm.delay_s) = (1.2, 0.5, 1.8);
        (of.rss.response_time_s, of.fsm.reaction_time_s) = (1.5, 1.2);
    });
    let overlap = of(&patient, &|of| of.criteria.gate = LateralGate::Overlap);
    let aborting = of(&patient, &|of| of.cchdm.abort_on_large_ttc = true);
    let shifted = of(&overlap, &|of| of.frame.start_shift = true);
    let exposed = of(&shifted, &|of| of.frame.cut_out_target = CutOutTarget::Exposed);
    profiles.extend(
        [(&patient, 0.2), (&patient, 0.35), (&overlap, 0.35), (&aborting, 0.35), (&shifted, 0.35), (&exposed, 0.3)]
            .map(|(profile, dt_s)| profile.clone().with_dt(dt_s).unwrap()),
    );
    profiles
}

/// One lane of a case by itself, in the arithmetic of its start; an observer sees its steps.
pub fn run_case<R: Real>(
    profile: &Profile,
    case: &Case,
    model: ModelId,
    start: Start<R>,
    observer: &mut dyn FnMut(&Step<R>),
) -> Outcome<f64> {
    let mut tables = Tables::default();
    let lane = LaneCase::encode(case, profile, &mut tables);
    let constants = Constants::<R>::resolve(profile, case.category);
    run_lane(&constants, model, (&lane.cast(), &tables.cast()), start, observer).widen()
}

/// A lane whose case is encoded. All tests have one type of observers: for each, all drivers are compiled.
pub fn run_lane<R: Real>(
    constants: &Constants<R>,
    model: ModelId,
    (case, tables): (&LaneCase<R>, &Tables<R>),
    start: Start<R>,
    observer: &mut dyn FnMut(&Step<R>),
) -> Outcome<R> {
    constants.run(model, case, tables, start, observer)
}

/// All lanes of a plan at once.
pub fn swept(plan: &LanePlan, backend: &dyn Backend, wanted: Wanted) -> Chunk {
    let chunk = backend.prepare(plan).unwrap().run(0..plan.unit_count(), wanted).unwrap();
    chunk.check(plan).unwrap();
    chunk
}

pub fn swept_on_cpu(plan: &LanePlan, wanted: Wanted) -> Chunk {
    swept(plan, &CpuBackend::lane_arithmetic(), wanted)
}

/// Runs so many units at a time: outcomes, and verdicts asked for alone, equal those of `expected` bit for bit.
pub fn assert_same_in_calls(plan: &LanePlan, backend: &dyn Backend, units: u64, expected: &[Outcome<f64>], what: &str) {
    let mut session = backend.prepare(plan).unwrap();
    let (mut from, mut outcomes, mut verdicts) = (0, Vec::new(), Vec::new());
    while from < plan.unit_count() {
        let to = (from + units).min(plan.unit_count());
        outcomes.extend(session.run(from..to, Wanted::Outcomes).unwrap().outcomes);
        verdicts.extend(session.run(from..to, Wanted::Verdicts).unwrap().verdicts);
        from = to;
    }
    assert!([outcomes.len(), verdicts.len(), expected.len()] == [plan.lane_count() as usize; 3], "{what}");
    let differs = |at: &usize| !same_words(&outcomes[*at], &expected[*at]) || verdicts[*at] != expected[*at].verdicts;
    let first = (0..expected.len()).find(differs).map(|at| plan.key_text(&plan.key(at as u64).unwrap()));
    assert_eq!(first, None, "{what}, {}", backend.describe());
}

/// Outcomes, and verdicts asked for alone, of a backend are those of the scalar lanes.
pub fn assert_equal(what: &str, plan: &LanePlan, backend: &dyn Backend) {
    let found = compare(what, plan, backend, |_| ()).unwrap_or_else(|error| panic!("{what}: {error}"));
    let Comparison { worst, modes_differing, .. } = &found;
    let worst: Vec<String> = worst.iter().map(|l| format!("{} {:?}", l.key, l.names())).collect();
    assert!(found.is_equal(), "{what}, {}: {worst:#?}, modes {modes_differing}", backend.describe());
    assert_eq!(found.lanes(), plan.lane_count(), "{what}");
}

pub fn random(profile: &Profile, lanes: u64) -> LanePlan {
    random_plan(profile, &SetOptions { size: lanes, ..Default::default() }).unwrap()
}

/// The same of one model, and its lanes on thresholds.
pub fn of_model(profile: &Profile, model: ModelId, lanes: u64) -> [LanePlan; 2] {
    let options = |size| SetOptions { size, models: vec![model], ..Default::default() };
    [random_plan(profile, &options(lanes)).unwrap(), threshold_plan(profile, &options(8)).unwrap()]
}

/// Lanes on thresholds: so many units of each threshold and category.
pub fn thresholds(profile: &Profile, units: u64) -> LanePlan {
    threshold_plan(profile, &SetOptions { size: units, ..Default::default() }).unwrap()
}

pub fn small_study() -> LanePlan {
    small_study_of(StudyOptions::default())
}

pub fn small_study_of(options: StudyOptions) -> LanePlan {
    plan_study(scenarios_of(2), &Profile::load("paper").unwrap(), &options).unwrap()
}
