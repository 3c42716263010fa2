//! Claims about the lane sets of `verify`: what they hold, and that they hold it whatever is asked for.

use std::collections::{BTreeMap, HashSet};
use std::ops::Range;

use lanesweep::engine::verify::{
    RandomOptions, SIDES, Threshold, ThresholdOptions, VARIANTS, random_plan, threshold_plan,
};
use lanesweep::engine::{
    Backend, Constants, CpuBackend, EndReason, LaneCase, LanePlan, NO_STEP, Outcome, Step, Wanted,
};
use lanesweep::model::criterion::Criterion;
use lanesweep::model::driver::{ModelId, View};
use lanesweep::model::profile::Profile;
use lanesweep::scenario::{Category, LATERAL_SAMPLED, Motion, SPEED_SAMPLED};

fn profile(name: &str) -> Profile {
    Profile::load(name).unwrap()
}

fn random(name: &str, seed: u64, lanes: u64) -> LanePlan {
    let options = RandomOptions { seed, lanes_per_model_and_category: lanes, ..RandomOptions::default() };
    random_plan(&profile(name), &options).unwrap()
}

fn thresholds(name: &str, seed: u64, units_per_threshold: u64) -> LanePlan {
    let options = ThresholdOptions { seed, units_per_threshold, ..ThresholdOptions::default() };
    threshold_plan(&profile(name), &options).unwrap()
}

fn outcomes(plan: &LanePlan, units: Range<u64>) -> Vec<Outcome<f64>> {
    CpuBackend::lane_arithmetic().prepare(plan).unwrap().run(units, Wanted::Outcomes).unwrap().outcomes
}

/// All (block, unit, variant) of a plan.
fn cases(plan: &LanePlan) -> impl Iterator<Item = (usize, u64, usize)> + '_ {
    plan.blocks.iter().enumerate().flat_map(|(at, block)| {
        (0..block.units.len()).flat_map(move |unit| (0..block.variants.len()).map(move |v| (at, unit, v)))
    })
}

#[test]
fn a_unit_is_the_same_whatever_the_size_and_the_categories_asked_for() {
    for (few, many, lvd) in [
        (random("jrc-2021", 7, 200), random("jrc-2021", 7, 4000), {
            let options = RandomOptions {
                seed: 7,
                lanes_per_model_and_category: 40,
                categories: vec![Category::Lvd],
                models: vec![ModelId::Fsm],
            };
            random_plan(&profile("jrc-2021"), &options).unwrap()
        }),
        (thresholds("paper", 7, 1), thresholds("paper", 7, 3), {
            let options = ThresholdOptions {
                seed: 7,
                units_per_threshold: 1,
                categories: vec![Category::Lvd],
                models: vec![ModelId::Fsm],
            };
            threshold_plan(&profile("paper"), &options).unwrap()
        }),
    ] {
        assert!(few.unit_count() < many.unit_count());
        for (block, unit, variant) in cases(&few) {
            assert_eq!(few.blocks[block].units.name(unit), many.blocks[block].units.name(unit));
            assert_eq!(few.case(block, unit, variant), many.case(block, unit, variant));
        }
        let of_lvd = few.blocks.iter().position(|b| b.category == Category::Lvd).unwrap();
        for (_, unit, variant) in cases(&lvd) {
            assert_eq!(lvd.blocks[0].units.name(unit), few.blocks[of_lvd].units.name(unit));
            // Freezing pairs stand behind the series of all cut-outs; nothing before them moves.
            assert_eq!(lvd.case(0, unit, variant), few.case(of_lvd, unit, variant));
        }
    }
}

#[test]
fn another_seed_gives_other_lanes() {
    for (one, other) in
        [(random("paper", 1, 400), random("paper", 2, 400)), (thresholds("paper", 1, 2), thresholds("paper", 2, 2))]
    {
        assert_ne!(one.hash(), other.hash());
        assert_ne!(one.blocks[0].units.name(0), other.blocks[0].units.name(0));
        let same = cases(&one).filter(|&(b, u, v)| one.case(b, u, v) == other.case(b, u, v)).count();
        assert_eq!(same, 0);
    }
}

#[test]
fn no_two_random_cases_are_equal() {
    let plan = random("paper", 3, 4000);
    let all: Vec<String> = cases(&plan).map(|(b, u, v)| format!("{:?}", plan.case(b, u, v))).collect();
    assert_eq!(all.iter().collect::<HashSet<_>>().len(), all.len());
}

#[test]
fn the_key_of_a_random_lane_says_how_to_make_it_again() {
    let plan = random("paper", 42, 400);
    assert_eq!(plan.blocks[1].units.name(9), "random-cut-out-seed42-0000009");
    let lane = plan.first_lane_of(plan.blocks[1].first_unit + 9) + 77;
    let text = plan.key_text(&plan.key(lane).unwrap());
    assert_eq!(plan.lane(&plan.parse_key(&text).unwrap()), lane);
}

#[test]
fn every_number_is_finite_and_every_series_lies_within_the_tables() {
    for name in ["paper", "jrc-2021", "un-r157"] {
        for plan in [random(name, 157, 8000), thresholds(name, 157, 12)] {
            let tables = plan.tables();
            assert!(tables.speed.iter().all(|v| v.is_finite() && *v >= 0.0));
            assert!(tables.lateral.iter().flatten().all(|v| v.is_finite()));
            let mut entries = tables.speed.iter().chain(tables.lateral.iter().flatten());
            assert!(!entries.any(|&v| (v as f32).is_subnormal()));
            assert!(tables.speed.len() < 100_000 && tables.lateral.len() < 100_000);
            for (block, unit, variant) in cases(&plan) {
                let case = plan.case(block, unit, variant);
                assert_sound(&case, tables.speed.len(), tables.lateral.len());
                assert_eq!(case.others[1].used, case.pair);
            }
        }
    }
}

fn assert_sound(case: &LaneCase<f64>, speeds: usize, laterals: usize) {
    assert!(case.ego_speed >= 0.0 && case.ego_speed.is_finite() && case.ego_width > 0.0);
    for other in &case.others {
        let m = &other.motion;
        let numbers = [
            other.half_lengths,
            other.half_widths,
            other.gap_offset,
            m.speed_initial,
            m.speed_per_step,
            m.speed_end,
            m.lateral_initial,
            m.lateral_per_step,
            m.lateral_end,
            m.lateral_towards,
        ];
        // Devices may flush subnormals: no input is one.
        assert!(numbers.iter().all(|&x| x.is_finite() && !(x as f32).is_subnormal()), "{case:?}");
        assert!(other.half_lengths > 0.0 && other.half_widths > 0.0);
        if m.kind & SPEED_SAMPLED != 0 {
            assert!(m.speed_len > 0 && (m.speed_offset + m.speed_len) as usize <= speeds, "{case:?}");
        }
        if m.kind & LATERAL_SAMPLED != 0 {
            assert!(m.lateral_len > 0 && (m.lateral_offset + m.lateral_len) as usize <= laterals, "{case:?}");
        }
    }
}

#[test]
fn both_sets_hold_every_kind_of_motion_alone_and_in_pairs_in_each_category() {
    for plan in [random("paper", 157, 4000), random("jrc-2021", 157, 4000), thresholds("paper", 157, 12)] {
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
fn the_random_set_holds_what_is_rare_on_roads() {
    let plan = random("jrc-2021", 157, 8000);
    let all: Vec<LaneCase<f64>> = cases(&plan).map(|(b, u, v)| plan.case(b, u, v)).collect();
    let stands = |motion: &Motion<f64>| motion.kind & SPEED_SAMPLED == 0 && motion.speed_initial == 0.0;
    let found = [
        ("standing ego", all.iter().filter(|c| c.ego_speed == 0.0).count()),
        ("standing vehicle", all.iter().filter(|c| stands(&c.others[0].motion)).count()),
        ("truck", all.iter().filter(|c| c.others[0].half_lengths > 7.0).count()),
        ("motorcycle", all.iter().filter(|c| c.others[0].half_widths < 1.5).count()),
        ("from the right", all.iter().filter(|c| c.others[0].motion.lateral_initial < -1.0).count()),
        ("from the left", all.iter().filter(|c| c.others[0].motion.lateral_initial > 1.0).count()),
        ("late start", all.iter().filter(|c| !matches!(c.others[0].present_from, 0 | NO_STEP)).count()),
        (
            "frozen pair",
            all.iter().filter(|c| c.pair == 1 && c.others[1].present_until == c.others[0].present_from).count(),
        ),
        ("no horizon", all.iter().filter(|c| c.horizon == 0).count()),
    ];
    for (what, count) in found {
        assert!(count >= 8, "{what}: {count}");
    }
}
#[test]
fn every_criterion_fails_and_passes_often_for_every_model_in_every_category() {
    for name in ["paper", "jrc-2021", "un-r157"] {
        let plan = random(name, 157, 4000);
        let outcomes = outcomes(&plan, 0..plan.unit_count());
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

#[test]
fn outcomes_do_not_depend_on_threads() {
    for plan in [random("paper", 157, 1000), thresholds("paper", 157, 4)] {
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| outcomes(&plan, 0..plan.unit_count()))
        };
        assert_eq!(with(1), with(2));
    }
}

#[test]
fn empty_sets_and_categories_named_twice_are_refused() {
    let paper = profile("paper");
    let none = RandomOptions { lanes_per_model_and_category: 0, ..RandomOptions::default() };
    assert!(random_plan(&paper, &none).is_err());
    let twice = RandomOptions { categories: vec![Category::Lvd, Category::Lvd], ..RandomOptions::default() };
    assert!(random_plan(&paper, &twice).err().unwrap().to_string().contains("`LVD` is given twice"));
    let no_category = ThresholdOptions { categories: vec![], ..ThresholdOptions::default() };
    assert!(threshold_plan(&paper, &no_category).is_err());
    let no_unit = ThresholdOptions { units_per_threshold: 0, ..ThresholdOptions::default() };
    assert!(threshold_plan(&paper, &no_unit).is_err());
    assert_eq!((VARIANTS[0], SIDES[0]), ("S", "S"));
}

/// What a lane sees of its vehicles at step 0, in the lane arithmetic: views, lateral positions.
fn first_step(plan: &LanePlan, block: usize, case: &LaneCase<f64>, headway: usize) -> Vec<(View<f32>, f32)> {
    let constants = Constants::<f32>::resolve(&plan.profile, plan.blocks[block].category);
    let case = case.cast::<f32>();
    let mut first = Vec::new();
    let mut observer = |step: &Step<f32>| {
        if step.index == 0 {
            first = step.seen[..1 + case.pair as usize].iter().map(|seen| (seen.view, seen.lateral)).collect();
        }
    };
    constants.run(ModelId::Fsm, &case, &plan.tables().cast(), plan.headways[headway].start(), &mut observer);
    first
}

/// The two sides of a threshold's comparison, written down once more and in f32, constants rounded once.
/// `None` for thresholds in time.
fn sides(
    threshold: Threshold,
    category: Category,
    p: &Profile,
    view: &View<f32>,
    y: f32,
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

/// Units of each threshold in the tests below; each has four headways.
const UNITS: u64 = 24;

/// Units of a threshold in a block.
fn units_of(plan: &LanePlan, block: usize, threshold: Threshold) -> impl Iterator<Item = u64> {
    (0..plan.blocks[block].units.len()).filter(move |&unit| Threshold::of_unit(unit) == threshold)
}

#[test]
fn lanes_sit_exactly_on_each_threshold_with_a_neighbour_on_either_side() {
    for name in ["paper", "jrc-2021", "un-r157"] {
        let plan = thresholds(name, 157, UNITS);
        for block in 0..plan.blocks.len() {
            for threshold in Threshold::ALL {
                let (mut on, mut between, mut in_time) = (0, 0, false);
                for (unit, headway) in
                    units_of(&plan, block, threshold).flat_map(|u| (0..plan.headways.len()).map(move |h| (u, h)))
                {
                    // Per side, per vehicle.
                    let seen = [0, 1, 2].map(|side| {
                        let case = plan.case(block, unit, side);
                        let both = |(view, y): &(View<f32>, f32)| {
                            sides(
                                threshold,
                                plan.blocks[block].category,
                                &plan.profile,
                                view,
                                *y,
                                case.ego_width as f32,
                            )
                        };
                        first_step(&plan, block, &case, headway).iter().map(both).collect::<Option<Vec<_>>>()
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

#[test]
fn one_unit_in_the_last_place_decides_somewhere_at_every_threshold() {
    for name in ["paper", "un-r157"] {
        // The speed at its last step is the end speed up to rounding, so that few motions show that step.
        let plan = thresholds(name, 157, 4 * UNITS);
        let all = outcomes(&plan, 0..plan.unit_count());
        for (at, block) in plan.blocks.iter().enumerate() {
            let per_variant = plan.headways.len() * plan.models.len();
            for threshold in Threshold::ALL {
                // Differences between the sides of one lane.
                let differ = |of: &dyn Fn(&Outcome<f64>) -> String| {
                    let lanes = units_of(&plan, at, threshold).flat_map(|unit| {
                        let first = plan.first_lane_of(block.first_unit + unit) as usize;
                        (0..per_variant).map(move |k| [0, 1, 2].map(|side| first + side * per_variant + k))
                    });
                    lanes.filter(|&[s, b, a]| of(&all[s]) != of(&all[b]) || of(&all[s]) != of(&all[a])).count()
                };
                let count = match threshold {
                    // The verdict failed long before the room is gone; only the number becomes infinite.
                    Threshold::BtnRoom => differ(&|o| o.max_btn.is_infinite().to_string()),
                    // Kinks of the demand, which only counts after the reaction time.
                    Threshold::PfsUnsafe | Threshold::CfsSafe | Threshold::CfsUnsafe => continue,
                    // One step more of an acceleration is rarely a verdict.
                    Threshold::SpeedEvent => differ(&|o| format!("{o:?}")),
                    Threshold::Horizon => differ(&|o| o.end_step.to_string()),
                    _ => differ(&|o| format!("{:?} {}", o.verdicts, o.reaction_step)),
                };
                // Braked from the first moment on, whatever the check says.
                let always = match threshold {
                    Threshold::Reg157Ttc | Threshold::Reg157Gate => &plan.profile.reg157.always_unsafe,
                    Threshold::CchdmTtc | Threshold::CchdmGate => &plan.profile.cchdm.always_unsafe,
                    _ => &Vec::new(),
                };
                let enough = count >= UNITS as usize / 2 || always.contains(&block.category);
                assert!(enough, "{name}, {:?}, {}: {count} lanes", block.category, threshold.name());
            }
        }
    }
}

#[test]
fn thresholds_in_time_are_met_to_the_step() {
    let plan = thresholds("paper", 157, UNITS);
    let all = outcomes(&plan, 0..plan.unit_count());
    let cap = plan.profile.step_cap();
    let met = |threshold: Threshold, holds: &dyn Fn(&LaneCase<f64>, &Outcome<f64>) -> bool| {
        for (at, block) in plan.blocks.iter().enumerate() {
            for side in 0..SIDES.len() {
                let met = units_of(&plan, at, threshold).filter(|&unit| {
                    let from = plan.first_lane_of(block.first_unit + unit) as usize;
                    let per_variant = plan.headways.len() * plan.models.len();
                    let lanes = &all[from + side * per_variant..from + (side + 1) * per_variant];
                    let case = plan.case(at, unit, side);
                    lanes.iter().any(|outcome| holds(&case, outcome))
                });
                let (met, side) = (met.count() as u64, SIDES[side]);
                assert!(met >= UNITS / 2, "{:?} {} {side}: {met}", block.category, threshold.name());
            }
        }
    };
    // The vehicle that decides is the one that is noticed at all.
    let noticed = |c: &LaneCase<f64>| c.others.map(|o| o.attend_from[0]).into_iter().min().unwrap();
    met(Threshold::Attention, &|case, o| o.reaction_step == noticed(case));
    let appears = |c: &LaneCase<f64>| c.others.map(|o| o.present_from).into_iter().max().unwrap();
    met(Threshold::Appearance, &|case, o| o.reaction_step == appears(case));
    met(Threshold::Horizon, &|case, o| o.end_step == case.horizon && o.end == EndReason::Settled);
    met(Threshold::StepCap, &|case, o| (o.end == EndReason::Cap) == (case.horizon >= cap));
    for (at, block) in plan.blocks.iter().enumerate() {
        // The vehicle leaves in the step of the contact, or one step later.
        let hit = units_of(&plan, at, Threshold::Disappearance).filter(|&unit| {
            let per_variant = plan.headways.len() * plan.models.len();
            let from = plan.first_lane_of(block.first_unit + unit) as usize;
            (from..from + per_variant).any(|lane| {
                let [exact, above] = [all[lane], all[lane + 2 * per_variant]];
                exact.contact_step == NO_STEP && above.contact_step != NO_STEP
            })
        });
        assert!(hit.count() as u64 >= UNITS / 2);
    }
}

#[test]
#[ignore = "measures; run with --ignored --nocapture"]
fn measures_of_the_sets() {
    for name in ["paper", "jrc-2021", "un-r157"] {
        let plan = random(name, 157, 20_000);
        let began = std::time::Instant::now();
        let all = outcomes(&plan, 0..plan.unit_count());
        let took = began.elapsed().as_secs_f64();
        println!("{name}: {:.0} lanes per second", all.len() as f64 / took);
        for (at, block) in plan.blocks.iter().enumerate() {
            for (m, model) in plan.models.iter().enumerate() {
                let of = |(lane, _): &(usize, &Outcome<f64>)| {
                    plan.key(*lane as u64).is_some_and(|key| key.block == at && key.model == m)
                };
                let lanes: Vec<&Outcome<f64>> = all.iter().enumerate().filter(of).map(|(_, o)| o).collect();
                let share = |holds: &dyn Fn(&Outcome<f64>) -> bool| {
                    100.0 * lanes.iter().filter(|o| holds(o)).count() as f64 / lanes.len() as f64
                };
                let [collision, ttc, btn] = Criterion::ALL.map(|c| share(&|o| o.verdicts.failed(c)));
                let steps = lanes.iter().map(|o| f64::from(o.end_step) + 1.0).sum::<f64>() / lanes.len() as f64;
                let capped = share(&|o| o.end == EndReason::Cap);
                print!("  {:8} {:7} collision {collision:5.1}, TTC {ttc:5.1}, ", block.category.key(), model.name());
                println!("BTN {btn:5.1} %; {steps:6.1} steps, {capped:4.1} % at the cap");
            }
        }
        let began = std::time::Instant::now();
        let lanes = random(name, 157, 1_000_000).lane_count();
        println!("  planning {lanes} lanes: {:.2} s", began.elapsed().as_secs_f64());
        let began = std::time::Instant::now();
        let on = threshold_plan(&profile(name), &ThresholdOptions::default()).unwrap();
        println!("  planning {} lanes on thresholds: {:.2} s", on.lane_count(), began.elapsed().as_secs_f64());
        for (what, plan) in [("random", &plan), ("threshold", &on)] {
            let lanes = outcomes(plan, 0..plan.unit_count());
            let mut session = CpuBackend::reference().prepare(plan).unwrap();
            let reference = session.run(0..plan.unit_count(), Wanted::Verdicts).unwrap().verdicts;
            let differ = lanes.iter().zip(&reference).filter(|(lane, f64)| lane.verdicts != **f64).count();
            let steps = lanes.iter().map(|o| f64::from(o.end_step) + 1.0).sum::<f64>() / lanes.len() as f64;
            println!("  {what} set: {differ} of {} lanes differ from the f64 reference; {steps:.0} steps", lanes.len());
        }
    }
}
