//! Claims about the lane sets of `verify`: every kind of motion, every verdict, and both sides of every threshold.

use std::collections::{BTreeMap, HashSet};

use crate::common::lane_sets::{self, run_lane, swept_on_cpu};
use lanesweep::engine::verify::{SetOptions, Threshold, random_plan};
use lanesweep::engine::{Constants, EndReason, LaneCase, LanePlan, Start, Step};
use lanesweep::model::driver::View;
use lanesweep::prelude::*;
use lanesweep::scenario::{LATERAL_SAMPLED, SPEED_SAMPLED, Tables};

fn random(name: &str, lanes: u64) -> LanePlan {
    lane_sets::random(&Profile::load(name).unwrap(), lanes)
}

fn thresholds(name: &str, units_per_threshold: u64) -> LanePlan {
    lane_sets::thresholds(&Profile::load(name).unwrap(), units_per_threshold)
}

#[test]
fn the_key_of_a_random_lane_says_how_to_make_it_again() {
    let options = SetOptions { seed: 42, size: 400, ..SetOptions::default() };
    let plan = random_plan(&Profile::load("paper").unwrap(), &options).unwrap();
    assert_eq!(plan.blocks[1].units.name(9), "random-cut-out-seed42-0000009");
    let lane = plan.first_lane_of(plan.blocks[1].first_unit + 9) + 77;
    let text = plan.key_text(&plan.key(lane).unwrap());
    assert_eq!(plan.lane(&plan.parse_key(&text).unwrap()), lane);
}

#[test]
fn both_sets_hold_every_kind_of_motion_alone_and_in_pairs_in_each_category() {
    for plan in [random("paper", 4000), random("jrc-2021", 4000), thresholds("paper", 12)] {
        for (at, block) in plan.blocks.iter().enumerate() {
            let seen: HashSet<(u32, u32)> = (0..block.units.len())
                .flat_map(|unit| (0..block.variants.len()).map(move |variant| (unit, variant)))
                .map(|(unit, variant)| plan.case(at, unit, variant))
                .map(|case| (case.others[0].motion.kind, case.pair))
                .collect();
            let all = SPEED_SAMPLED | LATERAL_SAMPLED;
            for kind in 0..=all {
                for pair in 0..=1 {
                    assert!(seen.contains(&(kind, pair)), "{:?}: kind {kind}, pair {pair}", block.category);
                }
            }
        }
    }
}

#[test]
fn every_criterion_fails_and_passes_often_for_every_model_in_every_category() {
    for name in ["paper", "jrc-2021", "un-r157"] {
        let plan = random(name, 4000);
        let outcomes = swept_on_cpu(&plan, Wanted::Outcomes).outcomes;
        let (mut failed, mut lanes, mut steps, mut capped) = (BTreeMap::new(), BTreeMap::new(), 0.0, 0);
        for (lane, outcome) in outcomes.iter().enumerate() {
            let key = plan.key(lane as u64).unwrap();
            steps += f64::from(outcome.end_step) + 1.0;
            capped += usize::from(outcome.end == EndReason::Cap);
            for criterion in Criterion::ALL {
                let cell = (key.block, key.model, criterion);
                *lanes.entry(cell).or_insert(0_u32) += 1;
                *failed.entry(cell).or_insert(0_u32) += u32::from(outcome.verdicts.failed(criterion));
            }
        }
        for (cell, failed) in failed {
            let share = f64::from(failed) / f64::from(lanes[&cell]);
            assert!((0.05..=0.95).contains(&share), "{name}, {cell:?}: {share}");
        }
        let lanes = outcomes.len() as f64;
        // Without `end_when_settled` every lane without a contact runs to the cap.
        let frame = &plan.profile.frame;
        let ends = frame.end_when_settled;
        let (mean_s, max_s) = (steps / lanes * frame.dt_s, if ends { 16.0 } else { frame.time_cap_s });
        assert!(mean_s < max_s, "{name}: {mean_s} s");
        assert!(!ends || (capped as f64) < 0.1 * lanes, "{name}: {capped} of {lanes} at the cap");
    }
}

/// What a lane sees of its vehicles at step 0, in the lane arithmetic: views, lateral positions.
fn first_step(
    constants: &Constants<f32>,
    tables: &Tables<f32>,
    case: &LaneCase<f32>,
    start: Start<f32>,
) -> Vec<(View<f32>, f32)> {
    let mut first = Vec::new();
    let mut observer = |step: &Step<f32>| {
        if step.index == 0 {
            first = step.seen[..1 + case.pair as usize].iter().map(|seen| (seen.view, seen.lateral)).collect();
        }
    };
    run_lane(constants, ModelId::Fsm, (case, tables), start, &mut observer);
    first
}

/// The two sides of a threshold's comparison, written down once more and in f32, constants rounded once.
/// `None` for thresholds in time.
fn sides(
    threshold: Threshold,
    (p, category): (&Profile, Category),
    (view, y): &(View<f32>, f32),
    ego_width: f32,
) -> Option<(f32, f32)> {
    let (v, vo, g, h, w, half) =
        (view.v_ego, view.v_other, view.gap, view.lateral_gap, view.lateral_towards, view.half_lengths);
    let dv = v - vo;
    let (rss, fsm, c) = (&p.rss, &p.fsm, &p.criteria);
    let rho = rss.response_time_s;
    let f = |x: f64| x as f32;
    let square = |x: f32| x * x;
    let tau = f(fsm.reaction_time_s);
    let comfortable = f(1.0 / (2.0 * fsm.comfortable_deceleration_mps2));
    let full = f(1.0 / (2.0 * fsm.max_surrogate_deceleration_mps2));
    let lead = vo * vo * f(1.0 / (2.0 * fsm.lead_deceleration_mps2));
    let room = g - dv * f(c.max_deceleration_mps2 / (2.0 * c.jerk_mps3));
    Some(match threshold {
        Threshold::Ttc => (g, f(c.ttc_threshold_s) * dv),
        Threshold::Btn => (dv * dv, f(2.0 * c.btn_threshold * c.max_deceleration_mps2) * room),
        Threshold::BtnRoom => (room, 0.0),
        Threshold::Reg157Ttc => {
            let constant = f(p.reg157.reaction_and_margin_s(p.frame.dt_s));
            (g.abs(), dv.abs() * (dv * f(1.0 / (2.0 * p.reg157.deceleration_mps2)) + constant))
        }
        Threshold::Reg157Gate if p.reg157.lane_intrusion_m > 0.0 => {
            (h, view.marking_gap - f(p.reg157.lane_intrusion_m))
        }
        Threshold::Reg157Gate => (h, f(p.reg157.lateral_gate_m)),
        Threshold::CchdmTtc if category == Category::CutOut && p.cchdm.cut_out_headway_s > 0.0 => {
            (g, f(p.cchdm.cut_out_headway_s) * v + f(p.cchdm.cut_out_headway_tolerance_m))
        }
        Threshold::CchdmTtc => (g.abs(), f(p.cchdm.ttc_s) * dv.abs()),
        Threshold::CchdmGate => (h, f(p.cchdm.lateral_gate_m)),
        Threshold::RssLongitudinal => {
            let ego = square(v + f(rho * rss.max_acceleration_mps2)) * f(1.0 / (2.0 * rss.ego_deceleration_mps2));
            let other = vo * vo * f(1.0 / (2.0 * rss.other_deceleration_mps2));
            (g, v * f(rho) + f(rss.max_acceleration_mps2 * rho * rho / 2.0) + ego - other)
        }
        Threshold::RssLateral => {
            let after = w.abs() + f(rss.lateral_acceleration_mps2 * rho);
            let brake = after * after * f(1.0 / (2.0 * rss.lateral_acceleration_mps2));
            (h, f(rss.lateral_margin_m) + (w.abs() + after) * f(rho / 2.0) + brake)
        }
        Threshold::PfsSafe => (g - f(fsm.margin_m), v * tau + v * v * comfortable - lead + f(fsm.margin_m)),
        Threshold::PfsUnsafe => (g - f(fsm.margin_m), v * tau + v * v * full - lead),
        Threshold::CfsSafe => (g, dv * tau + dv * dv * comfortable),
        Threshold::CfsUnsafe => (g, dv * tau + dv * dv * full),
        Threshold::FsmGate => (h * dv, w * (g + half + half + f(fsm.lateral_gate_margin_s) * dv)),
        Threshold::LateralSpeed => (w, 0.0),
        Threshold::LateralGap => (h, 0.0),
        Threshold::EgoWidth => (y.abs(), ego_width),
        Threshold::Gap => (g, 0.0),
        Threshold::Behind => (g + half + half, 0.0),
        Threshold::Centres => (g + half, 0.0),
        Threshold::EqualSpeeds => (v, vo),
        Threshold::StandingEgo => (v, 0.0),
        _ => return None,
    })
}

/// Units of each threshold; each has four headways.
const UNITS: u64 = 24;

#[test]
fn lanes_sit_exactly_on_each_threshold_with_a_neighbour_on_either_side() {
    for name in ["paper", "jrc-2021", "un-r157"] {
        let plan = thresholds(name, UNITS);
        let (tables, mut ends_at_once) = (plan.tables().cast(), plan.profile.clone());
        ends_at_once.frame.time_cap_s = ends_at_once.frame.dt_s;
        for block in 0..plan.blocks.len() {
            let constants = Constants::resolve(&ends_at_once, plan.blocks[block].category);
            for threshold in Threshold::ALL {
                let (mut on, mut between, mut in_time) = (0, 0, false);
                let units = (0..plan.blocks[block].units.len()).filter(|&unit| Threshold::of_unit(unit) == threshold);
                for (unit, headway) in units.flat_map(|unit| (0..plan.headways.len()).map(move |h| (unit, h))) {
                    // Per side, per vehicle.
                    let seen = [0, 1, 2].map(|side| {
                        let case = plan.case(block, unit, side);
                        let of = (&plan.profile, plan.blocks[block].category);
                        let both = |seen: &(View<f32>, f32)| sides(threshold, of, seen, case.ego_width as f32);
                        let start = plan.headways[headway].start();
                        first_step(&constants, &tables, &case.cast(), start)
                            .iter()
                            .map(both)
                            .collect::<Option<Vec<_>>>()
                    });
                    let [Some(exact), Some(below), Some(above)] = seen else {
                        in_time = true;
                        continue;
                    };
                    let equal = |k: usize| exact[k].0 == exact[k].1;
                    let turns = |k: usize| {
                        let (low, high) = (below[k].0 - below[k].1, above[k].0 - above[k].1);
                        // Where products round, or a speed has nothing below 0, one side may be equal too.
                        equal(k) && low * high <= 0.0 && low != high
                    };
                    on += u64::from((0..exact.len()).any(equal));
                    between += u64::from((0..exact.len()).any(turns));
                }
                if in_time {
                    continue;
                }
                assert!(on >= UNITS, "{name}, block {block}, {}: {on} lanes", threshold.name());
                assert!(between >= UNITS / 2, "{name}, block {block}, {}: {between} lanes between", threshold.name());
            }
        }
    }
}
