//! Uses of a device that the study never makes: sessions side by side, and one that outlives its device.

use crate::common::device::open;
use lanesweep::engine::gpu::GpuOptions;
use lanesweep::engine::verify::{SetOptions, random_plan};
use lanesweep::engine::{Backend, CpuBackend, LanePlan, Wanted, same_words};
use lanesweep::model::driver::ModelId;
use lanesweep::model::profile::Profile;

const ALL_WANTED: [Wanted; 2] = [Wanted::Verdicts, Wanted::Outcomes];

fn random(lanes: u64, seed: u64, models: &[ModelId]) -> LanePlan {
    let options = SetOptions { size: lanes, seed, models: models.to_vec(), ..Default::default() };
    random_plan(&Profile::load("paper").unwrap(), &options).unwrap()
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
                for round in 0..3 {
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
