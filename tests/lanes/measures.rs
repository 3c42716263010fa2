//! Values without a verdict: smallest THW, largest DRAC, TET, TIT, and the PET of a cut-in.

use lanesweep::engine::{Constants, LaneRunner, Start, Step};
use lanesweep::model::criterion::BtnContact;
use lanesweep::model::scalar::Real;
use lanesweep::prelude::*;
use lanesweep::scenario::{Case, Lateral, Speed};

use crate::common;
use crate::common::lane_sets::{random, run_case, run_lane};
use crate::common::plans::beside;

/// A profile whose FSM keeps its speed: its reaction time is longer than any run.
fn unreacting(time_cap_s: f64) -> Profile {
    let mut profile = Profile::load("paper").unwrap();
    profile.fsm.reaction_time_s = 1000.0;
    profile.frame.time_cap_s = time_cap_s;
    profile
}

fn run_in<R: Real>(profile: &Profile, case: &Case, model: ModelId, gap_m: f64) -> Outcome<f64> {
    run_case(profile, case, model, Start::Gap(R::from_f64(gap_m)), &mut |_| ())
}

/// In binary64, and in binary32 with the same result but for rounding.
fn run(profile: &Profile, case: &Case, model: ModelId, gap_m: f64) -> Outcome<f64> {
    let (exact, narrow) = (run_in::<f64>(profile, case, model, gap_m), run_in::<f32>(profile, case, model, gap_m));
    let pair = |of: fn(&Outcome<f64>) -> f64| near(of(&narrow), of(&exact), 1e-4);
    pair(|o| o.min_thw);
    pair(|o| o.max_drac);
    pair(|o| o.tit);
    assert_eq!(narrow.tet_steps, exact.tet_steps);
    exact
}

fn near(value: f64, expected: f64, relative: f64) {
    let is_near = value == expected || (value - expected).abs() <= relative * expected.abs().max(1.0);
    assert!(is_near, "{value} is not {expected}");
}

/// 20 m/s towards a vehicle that stands 100.4 m ahead: gap 100.4 m − 0.8 m·i, up to step 99.
#[test]
fn an_obstacle_at_constant_speed_has_the_values_of_the_closed_forms() {
    let mut obstacle = beside(0.0);
    (obstacle.principal.speed, obstacle.horizon_s) = (Speed::constant(0.0), 100.0);
    let found = run(&unreacting(4.0), &obstacle, ModelId::Fsm, 100.4);
    let last_gap_m = 100.4 - 0.8 * 99.0;
    near(found.min_thw, last_gap_m / 20.0, 1e-12);
    near(found.max_drac, 20.0 * 20.0 / (2.0 * last_gap_m), 1e-12);
    // TTC = 5.02 s − 0.04 s·i is below 3 s from step 51 on, and 3 s − TTC has the mean of its first and last term.
    assert_eq!(found.tet_steps, 49);
    near(found.tit, 0.04 * 49.0 * ((0.04 * 51.0 - 2.02) + (0.04 * 99.0 - 2.02)) / 2.0, 1e-9);
    assert_eq!(found.pet, None, "the leader was there from the first step on");
    // Another threshold: 2 s, reached at step 76.
    let mut profile = unreacting(4.0);
    profile.criteria.tet_threshold_s = 2.0;
    let found = run(&profile, &obstacle, ModelId::Fsm, 100.4);
    assert_eq!(found.tet_steps, 24);
    near(found.tit, 0.04 * 24.0 * ((0.04 * 76.0 - 3.02) + (0.04 * 99.0 - 3.02)) / 2.0, 1e-9);
    // Step 126 is the contact: no gap, no braking helps, and the step counts with a TTC of 0.
    let hit = run(&unreacting(60.0), &obstacle, ModelId::Fsm, 100.4);
    assert_eq!((hit.contact_step, hit.min_thw, hit.max_drac), (126, 0.0, f64::INFINITY));
    assert_eq!(hit.tet_steps, 126 - 50);
}

/// Values by their definitions from the steps of a lane, in binary64.
#[derive(Default)]
struct Defined {
    min_thw: Option<f64>,
    max_drac: f64,
    ttc_s: Vec<f64>,
    /// Speed and, of the principal vehicle, gap, overlap and presence.
    steps: Vec<(f64, f64, bool, bool)>,
}

impl Defined {
    fn take(&mut self, step: &Step<f64>, is_pair: bool) {
        let mut ttc_s = f64::INFINITY;
        for seen in &step.seen[..1 + usize::from(is_pair)] {
            let (gap_m, closing) = (seen.view.gap, seen.view.closing());
            if !seen.judged.holds() {
                continue;
            }
            if step.v_ego > 0.0 {
                let thw_s = gap_m.max(0.0) / step.v_ego;
                self.min_thw = Some(self.min_thw.map_or(thw_s, |least| least.min(thw_s)));
            }
            if closing > 0.0 {
                let drac = if gap_m > 0.0 { closing * closing / (2.0 * gap_m) } else { f64::INFINITY };
                self.max_drac = self.max_drac.max(drac);
                ttc_s = ttc_s.min(gap_m.max(0.0) / closing);
            }
        }
        self.ttc_s.push(ttc_s);
        let view = &step.seen[0].view;
        self.steps.push((step.v_ego, view.gap, view.lateral_gap < 0.0, step.seen[0].present.holds()));
    }

    fn pet_s(&self, dt_s: f64) -> Option<f64> {
        let first = self.steps.iter().position(|step| step.2)?;
        let (mut v, mut left_m, _, present) = self.steps[first];
        if first == 0 || left_m < 0.0 || !present {
            return None;
        }
        let mut time_s = 0.0;
        for (v_next, ..) in &self.steps[first + 1..] {
            v = *v_next;
            if v * dt_s >= left_m {
                break;
            }
            left_m -= v * dt_s;
            time_s += dt_s;
        }
        Some(if left_m == 0.0 { time_s } else { time_s + left_m / v })
    }
}

/// Random lanes of every category and model, vehicles that appear and leave among them.
#[test]
fn every_value_is_that_of_its_definition_and_keeps_its_bounds() {
    for name in ["paper", "jrc-2021"] {
        let profile = Profile::load(name).unwrap();
        let (dt_s, threshold_s) = (profile.frame.dt_s, profile.criteria.tet_threshold_s);
        let plan = random(&profile, 1500);
        let constants: Vec<_> =
            plan.blocks.iter().map(|block| Constants::<f64>::resolve(&profile, block.category)).collect();
        let (mut pets, mut exposed) = ([0; 3], 0);
        for key in (0..plan.lane_count()).map(|lane| plan.key(lane).unwrap()) {
            let case = plan.case(key.block, key.unit, key.variant);
            let mut defined = Defined::default();
            let mut see = |step: &Step<f64>| defined.take(step, case.pair != 0);
            let (model, start) = (plan.models[key.model], plan.headways[key.headway].start());
            let found = run_lane(&constants[key.block], model, (&case, plan.tables()), start, &mut see);
            let what = plan.key_text(&key);
            let same =
                |value, expected| assert!(common::near(value, expected, 1e-9), "{what}: {value} is not {expected}");
            same(found.min_thw, defined.min_thw.unwrap_or(f64::INFINITY));
            same(found.max_drac, defined.max_drac);
            let below: Vec<f64> = defined.ttc_s.iter().copied().filter(|ttc_s| *ttc_s < threshold_s).collect();
            assert_eq!(found.tet_steps as usize, below.len(), "{what}");
            same(found.tit, below.iter().map(|ttc_s| (threshold_s - ttc_s) * dt_s).sum());
            let pet_s = defined.pet_s(dt_s);
            assert_eq!(found.pet.is_some(), pet_s.is_some(), "{what}: {:?} {pet_s:?}", found.pet);
            same(found.pet.unwrap_or(0.0), pet_s.unwrap_or(0.0));
            pets[pet_s.map_or(0, |pet_s| 1 + usize::from(pet_s.is_infinite()))] += 1;
            // Bounds.
            assert!(found.tit >= 0.0 && found.tit <= threshold_s * f64::from(found.tet_steps) * dt_s * (1.0 + 1e-9));
            assert_eq!(found.tet_steps > 0, found.min_ttc < threshold_s, "{what}");
            exposed += u32::from(found.tet_steps > 0);
        }
        assert!(pets.iter().all(|count| *count > 20) && exposed > 1000, "{name}: {pets:?} {exposed}");
    }
}

/// BTN adds the ramp of the deceleration to DRAC: it is never smaller, and with a very large jerk it is DRAC over the
/// largest deceleration.
#[test]
fn the_btn_without_a_ramp_is_the_drac_over_the_largest_deceleration() {
    let mut profile = Profile::load("paper").unwrap();
    profile.criteria.btn_contact = BtnContact::Gated;
    let mut instant = profile.clone();
    instant.criteria.jerk_mps3 = 1e6;
    let a_max = profile.criteria.max_deceleration_mps2;
    for (profile, is_instant) in [(&profile, false), (&instant, true)] {
        let plan = random(profile, 1000);
        let runner = LaneRunner::<f64>::new(&plan);
        for key in (0..plan.lane_count()).map(|lane| plan.key(lane).unwrap()) {
            let found = runner.run(&key);
            let drac = found.max_drac / a_max;
            assert!(found.max_btn >= drac * (1.0 - 1e-12), "{}: {} {drac}", plan.key_text(&key), found.max_btn);
            if is_instant && drac < 10.0 {
                near(found.max_btn, drac, 1e-3);
            }
        }
    }
}

/// It comes in at 1 m/s from 3.5 m beside; half of both widths is 2 m, so it is in the path first at step 38 (1.52 s).
#[test]
fn the_pet_of_an_ego_that_keeps_its_speed_is_its_headway_at_the_encroachment() {
    for (ego_mps, other_mps, gap_m) in [(30.0, 20.0, 45.1), (20.0, 25.0, 20.1), (30.0, 20.0, 17.1)] {
        let (mut case, profile) = (beside(0.0), unreacting(60.0));
        (case.category, case.ego_speed_mps, case.horizon_s) = (Category::CutIn, ego_mps, 2.0);
        case.principal.speed = Speed::constant(other_mps);
        case.principal.lateral = Lateral::Kinematic { start_m: 3.5, rate_mps: -1.0, end_m: 0.0 };
        let pet_s = (gap_m + (other_mps - ego_mps) * 1.52) / ego_mps;
        near(run_in::<f64>(&profile, &case, ModelId::Fsm, gap_m).pet.unwrap(), pet_s, 1e-9);
        near(run_in::<f32>(&profile, &case, ModelId::Fsm, gap_m).pet.unwrap(), pet_s, 1e-5);
    }
}
