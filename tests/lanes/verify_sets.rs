//! Claims about the lane sets of `verify`: what they hold, and that they hold it whatever is asked for.

use std::collections::{BTreeMap, HashSet};
use std::ops::Range;

use lanesweep::engine::verify::{SIDES, SetOptions, Threshold, VARIANTS, random_plan, threshold_plan};
use lanesweep::engine::{Backend, CpuBackend, EndReason, LaneCase, LanePlan, NO_STEP, Outcome, Wanted};
use lanesweep::model::criterion::Criterion;
use lanesweep::model::driver::ModelId;
use lanesweep::model::profile::Profile;
use lanesweep::scenario::{Category, LATERAL_SAMPLED, Motion, SPEED_SAMPLED};

fn profile(name: &str) -> Profile {
    Profile::load(name).unwrap()
}

fn random(name: &str, seed: u64, lanes: u64) -> LanePlan {
    let options = SetOptions { seed, size: lanes, ..SetOptions::default() };
    random_plan(&profile(name), &options).unwrap()
}

fn thresholds(name: &str, seed: u64, units_per_threshold: u64) -> LanePlan {
    let options = SetOptions { seed, size: units_per_threshold, ..SetOptions::default() };
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
    let (paper, jrc) = (profile("paper"), profile("jrc-2021"));
    let (categories, models) = (vec![Category::Lvd], vec![ModelId::Fsm]);
    let of_lvd = SetOptions { seed: 7, size: 40, categories, models };
    let of_lvd = random_plan(&jrc, &of_lvd).unwrap();
    let (categories, models) = (vec![Category::Lvd], vec![ModelId::Fsm]);
    let on_lvd = SetOptions { seed: 7, size: 1, categories, models };
    let on_lvd = threshold_plan(&paper, &on_lvd).unwrap();
    for (few, many, lvd) in [
        (random("jrc-2021", 7, 200), random("jrc-2021", 7, 4000), of_lvd),
        (thresholds("paper", 7, 1), thresholds("paper", 7, 3), on_lvd),
    ] {
        assert!(few.unit_count() < many.unit_count());
        let lvd_block = few.blocks.iter().position(|b| b.category == Category::Lvd).unwrap();
        for (block, unit, variant) in cases(&few) {
            assert_eq!(few.blocks[block].units.name(unit), many.blocks[block].units.name(unit));
            assert_eq!(few.case(block, unit, variant), many.case(block, unit, variant));
        }
        for (_, unit, variant) in cases(&lvd) {
            assert_eq!(lvd.blocks[0].units.name(unit), few.blocks[lvd_block].units.name(unit));
            // Freezing pairs stand behind the series of all cut-outs; nothing before them moves.
            assert_eq!(lvd.case(0, unit, variant), few.case(lvd_block, unit, variant));
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
    let holds = |what: &str, is_one: &dyn Fn(&LaneCase<f64>, &Motion<f64>) -> bool| {
        let count = all.iter().filter(|case| is_one(case, &case.others[0].motion)).count();
        assert!(count >= 8, "{what}: {count}");
    };
    holds("standing ego", &|c, _| c.ego_speed == 0.0);
    holds("standing vehicle", &|_, m| m.kind & SPEED_SAMPLED == 0 && m.speed_initial == 0.0);
    holds("truck", &|c, _| c.others[0].half_lengths > 7.0);
    holds("motorcycle", &|c, _| c.others[0].half_widths < 1.5);
    holds("from the right", &|_, m| m.lateral_initial < -1.0);
    holds("from the left", &|_, m| m.lateral_initial > 1.0);
    holds("late start", &|c, _| !matches!(c.others[0].present_from, 0 | NO_STEP));
    holds("frozen pair", &|c, _| c.pair == 1 && c.others[1].present_until == c.others[0].present_from);
    holds("no horizon", &|c, _| c.horizon == 0);
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
fn empty_sets_and_categories_named_twice_are_refused() {
    let paper = profile("paper");
    let none = SetOptions { size: 0, ..SetOptions::default() };
    assert!(random_plan(&paper, &none).is_err());
    let twice = SetOptions { categories: vec![Category::Lvd, Category::Lvd], ..SetOptions::default() };
    assert!(random_plan(&paper, &twice).err().unwrap().to_string().contains("`LVD` is given twice"));
    let no_category = SetOptions { categories: vec![], ..SetOptions::default() };
    assert!(threshold_plan(&paper, &no_category).is_err());
    let no_unit = SetOptions { size: 0, ..SetOptions::default() };
    assert!(threshold_plan(&paper, &no_unit).is_err());
    assert_eq!((VARIANTS[0], SIDES[0]), ("S", "S"));
}

/// Units of each threshold; each has four headways.
const UNITS: u64 = 24;

/// Units of a threshold in a block.
fn units_of(plan: &LanePlan, block: usize, threshold: Threshold) -> impl Iterator<Item = u64> {
    (0..plan.blocks[block].units.len()).filter(move |&unit| Threshold::of_unit(unit) == threshold)
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
