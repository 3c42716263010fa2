//! Plans and uses of a device that the study never makes: subsets of the models in any order, blocks without
//! units and of the same category, sessions side by side, and going on after an error.

use std::sync::Arc;

use crate::common::device::{open, out_of_memory_at, tampered};
use lanesweep::engine::gpu::{GpuBackend, GpuOptions};
use lanesweep::engine::verify::{SetOptions, random_plan};
use lanesweep::engine::{Backend, Block, CaseSource, CpuBackend, Headway, LaneCase, LanePlan, Wanted, same_words};
use lanesweep::model::driver::ModelId;
use lanesweep::model::profile::Profile;
use lanesweep::scenario::Tables;

const ALL_WANTED: [Wanted; 2] = [Wanted::Verdicts, Wanted::Outcomes];

fn random(lanes: u64, seed: u64, models: &[ModelId]) -> LanePlan {
    let options = SetOptions { size: lanes, seed, models: models.to_vec(), ..Default::default() };
    random_plan(&Profile::load("paper").unwrap(), &options).unwrap()
}

/// Blocks of another plan, in any order and number.
struct Borrowed {
    from: LanePlan,
    /// Block of the other plan and its first unit.
    blocks: Vec<(usize, u64)>,
}

impl CaseSource for Borrowed {
    fn case(&self, block: usize, unit: u64, variant: usize) -> LaneCase<f64> {
        let (at, first) = self.blocks[block];
        self.from.case(at, first + unit, variant)
    }

    fn tables(&self) -> &Tables<f64> {
        self.from.tables()
    }
}

/// Of each block of another plan: which one, from which unit, how many units and variants.
fn borrowed(from: LanePlan, models: &[ModelId], headways: &[Headway], parts: &[(usize, u64, u64, usize)]) -> LanePlan {
    let block = |&(at, first, units, variants): &(usize, u64, u64, usize)| Block {
        category: from.blocks[at].category,
        units: (first..first + units).map(|u| from.blocks[at].units.name(u).into_owned()).collect(),
        variants: from.blocks[at].variants[..variants].to_vec(),
        first_unit: 0,
        first_lane: 0,
    };
    let blocks = parts.iter().map(block).collect();
    let profile = from.profile.clone();
    let source = Arc::new(Borrowed { blocks: parts.iter().map(|p| (p.0, p.1)).collect(), from });
    LanePlan::new(profile, models.to_vec(), headways.to_vec(), blocks, source).unwrap()
}

fn assert_equal(gpu: &GpuBackend, plan: &LanePlan, what: &str) {
    let cpu = CpuBackend::lane_arithmetic();
    let (mut ours, mut theirs) = (cpu.prepare(plan).unwrap(), gpu.prepare(plan).unwrap());
    let n = plan.unit_count();
    for wanted in ALL_WANTED {
        for units in [0..n, 1.min(n)..n, n / 3..n / 2 + 1, n..n, 0..0] {
            let units = units.start..units.end.min(n);
            let (a, b) = (ours.run(units.clone(), wanted).unwrap(), theirs.run(units.clone(), wanted).unwrap());
            a.check(plan).unwrap();
            b.check(plan).unwrap();
            assert!(a.verdicts == b.verdicts, "{what} {units:?} {wanted:?}");
            assert_eq!(a.outcomes.len(), b.outcomes.len(), "{what} {units:?} {wanted:?}");
            assert!(a.outcomes.iter().zip(&b.outcomes).all(|(a, b)| same_words(a, b)), "{what} {units:?} {wanted:?}");
        }
    }
}

#[test]
fn subsets_of_the_models_in_any_order_are_computed_as_on_the_cpu() {
    let Some(gpu) = open(GpuOptions { first_lanes: 64, ..Default::default() }) else { return };
    let mut reversed = ModelId::ALL.to_vec();
    reversed.reverse();
    let lists: [&[ModelId]; 4] = [&[ModelId::Fsm], &[ModelId::Rss, ModelId::Reg157], &reversed, &[ModelId::Cchdm]];
    for models in lists {
        assert_equal(&gpu, &random(400, 3, models), &format!("{models:?}"));
    }
}

#[test]
fn blocks_without_units_and_blocks_of_one_category_are_kept_apart() {
    let Some(gpu) = open(GpuOptions { first_lanes: 30, ..Default::default() }) else { return };
    let one = [Headway::ThwS(0.6)];
    let two = [Headway::GapM(3.0), Headway::ThwS(1.2)];
    let parts: [&[(usize, u64, u64, usize)]; 5] = [
        &[(0, 0, 0, 4), (1, 0, 7, 4), (2, 2, 0, 1), (2, 0, 5, 1)],
        &[(0, 0, 5, 4), (0, 5, 3, 2), (0, 0, 5, 3), (0, 0, 0, 4)],
        &[(2, 0, 1, 1)],
        &[(1, 0, 3, 3), (0, 0, 9, 1), (1, 0, 3, 3), (2, 1, 1, 4)],
        &[(0, 0, 0, 4), (1, 0, 0, 4)],
    ];
    for part in parts {
        for headways in [&one[..], &two[..]] {
            let plan = borrowed(random(400, 9, &ModelId::ALL), &[ModelId::Fsm, ModelId::Cchdm], headways, part);
            assert_equal(&gpu, &plan, &format!("{part:?} {headways:?}"));
        }
    }
}

#[test]
fn sessions_of_one_device_do_not_disturb_one_another() {
    let Some(gpu) = open(GpuOptions { first_lanes: 200, ..Default::default() }) else { return };
    let plans = [random(2000, 1, &ModelId::ALL), random(1500, 2, &[ModelId::Rss]), random(900, 3, &ModelId::ALL)];
    let cpu = CpuBackend::lane_arithmetic();
    std::thread::scope(|scope| {
        for plan in &plans {
            let (gpu, cpu) = (&gpu, &cpu);
            scope.spawn(move || {
                let mut ours = cpu.prepare(plan).unwrap();
                for round in 0..6 {
                    let mut theirs = gpu.prepare(plan).unwrap();
                    for wanted in ALL_WANTED {
                        let from = round % plan.unit_count();
                        let a = ours.run(from..plan.unit_count(), wanted).unwrap();
                        let b = theirs.run(from..plan.unit_count(), wanted).unwrap();
                        assert!(a == b || wanted == Wanted::Outcomes, "{wanted:?}");
                        assert!(a.outcomes.iter().zip(&b.outcomes).all(|(a, b)| same_words(a, b)));
                    }
                }
            });
        }
    });
    // In turns on one thread.
    let mut sessions: Vec<_> = plans.iter().map(|p| gpu.prepare(p).unwrap()).collect();
    for unit in 0..10 {
        for (plan, session) in plans.iter().zip(&mut sessions) {
            let a = cpu.prepare(plan).unwrap().run(unit..unit + 3, Wanted::Verdicts).unwrap();
            assert!(a == session.run(unit..unit + 3, Wanted::Verdicts).unwrap());
        }
    }
}

#[test]
fn after_a_job_without_memory_nothing_wrong_is_computed() {
    let plan = random(4000, 157, &ModelId::ALL);
    let cpu = CpuBackend::lane_arithmetic();
    let expected = cpu.prepare(&plan).unwrap().run(0..plan.unit_count(), Wanted::Verdicts).unwrap();
    for at_job in [0, 1, 2] {
        let options = GpuOptions { first_lanes: 1000, ..Default::default() };
        let Some(gpu) = tampered(options, out_of_memory_at(at_job)) else { return };
        let mut session = gpu.prepare(&plan).unwrap();
        let mut failed = 0;
        for round in 0..3 {
            match session.run(0..plan.unit_count(), Wanted::Verdicts) {
                Ok(chunk) => assert!(chunk == expected, "fault at {at_job}: round {round} gives wrong lanes"),
                Err(_) => failed += 1,
            }
        }
        assert!(failed > 0);
    }
}

#[test]
fn a_device_may_go_before_its_sessions_which_then_hear_of_it() {
    let Some(gpu) = open(GpuOptions::default()) else { return };
    let plan = random(400, 5, &[ModelId::Rss]);
    let (sender, done) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let mut session = gpu.prepare(&plan).unwrap();
        drop(gpu);
        sender.send(session.run(0..1, Wanted::Verdicts).is_err()).unwrap();
    });
    assert!(done.recv_timeout(std::time::Duration::from_secs(20)).expect("the drop hangs"));
}
