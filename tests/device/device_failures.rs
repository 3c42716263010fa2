//! A device that fails takes nothing with it; sessions side by side do not disturb one another.

use std::time::Duration;

use crate::common::device::{failing_at, open, patched};
use crate::common::lane_sets::{of_model, swept_on_cpu};
use lanesweep::engine::gpu::{GpuBackend, GpuOptions};
use lanesweep::engine::verify::{SetOptions, random_plan};
use lanesweep::engine::{Backend, LanePlan, Partial, RecheckOptions, SweepSummary, Verdicts, same_words};
use lanesweep::prelude::*;

/// Every pipeline takes its time to compile, and a failure is the same whatever the model.
const TWO: [ModelId; 2] = [ModelId::Rss, ModelId::Fsm];

fn plan() -> LanePlan {
    random(20_000, SetOptions::default().seed, &TWO)
}

fn random(lanes: u64, seed: u64, models: &[ModelId]) -> LanePlan {
    let options = SetOptions { size: lanes, seed, models: models.to_vec(), ..Default::default() };
    random_plan(&Profile::load("paper").unwrap(), &options).unwrap()
}

/// All verdicts and how the sweep went, with the CPU standing in.
fn swept(plan: &LanePlan, gpu: &GpuBackend) -> (Vec<Verdicts>, SweepSummary) {
    let cpu = CpuBackend::lane_arithmetic();
    let recheck = Some(RecheckOptions { seed: 157, one_in: 100 });
    let executor = Executor { recheck, ..Executor::new(gpu).with_fallback(&cpu) };
    let mut verdicts = Vec::new();
    let summary = executor.sweep(plan, 0..plan.unit_count(), Wanted::Verdicts, |chunk| {
        Partial::from_chunk(plan, &chunk)?;
        verdicts.extend(chunk.verdicts);
        Ok(())
    });
    (verdicts, summary.unwrap())
}

fn expected(plan: &LanePlan) -> Vec<Verdicts> {
    swept_on_cpu(plan, Wanted::Verdicts).verdicts
}

#[test]
fn a_healthy_device_computes_every_lane_itself_and_a_sample_is_checked() {
    let Some(gpu) = open(GpuOptions::default()) else { return };
    let plan = plan();
    let (verdicts, summary) = swept(&plan, &gpu);
    assert!(verdicts == expected(&plan));
    assert_eq!((summary.lanes, summary.redone_lanes), (plan.lane_count(), 0));
    assert_eq!(summary.rechecked_lanes, plan.lane_count() / 100);
    assert!(summary.device_s.unwrap() > 0.0);
}

#[test]
fn a_device_that_is_lost_has_no_memory_or_does_not_answer_in_time_leaves_complete_numbers() {
    let plan = plan();
    let expected = expected(&plan);
    let slow = GpuOptions { timeout: Duration::from_millis(1), first_lanes: 1 << 20, ..Default::default() };
    let lost = |at_job| failing_at(at_job, true);
    let all = [("lost", lost(0)), ("lost", lost(3)), ("no memory", failing_at(1, false)), ("slow", open(slow))];
    for (what, gpu) in all {
        let Some(gpu) = gpu else { return };
        let (verdicts, summary) = swept(&plan, &gpu);
        assert!(verdicts == expected && summary.lanes == plan.lane_count(), "{what}");
        assert!(summary.redone_lanes > 0, "{what}: {summary:?}");
        // A lost one stays lost, and says so.
        assert!(what != "lost" || matches!(gpu.prepare(&plan).err(), Some(Error::Device { .. })));
    }
    // Without a stand-in the failure is the user's to know.
    let gpu = lost(0).unwrap();
    let error = Executor::new(&gpu).sweep(&plan, 0..plan.unit_count(), Wanted::Verdicts, |_| Ok(())).unwrap_err();
    assert!(matches!(&error, Error::Device { .. }), "{error}");
    assert!(error.help().unwrap().contains("option `backend = cpu`"));
}

#[test]
fn a_lane_that_a_device_does_not_run_to_its_end_is_no_result() {
    let plan = plan();
    let few_turns = || {
        let turns = |turns, begin, end| {
            format!("turn < {turns}; turn++) {{\n        for (var step = {begin}; step < {end}; step++)")
        };
        patched(&turns("MAX_TURNS", "launch.burst_from", "frame_longest_burst"), &turns("1u", "0u", "100u"))
    };
    let Some(gpu) = few_turns() else { return };
    for wanted in [Wanted::Verdicts, Wanted::Outcomes] {
        let Some(gpu) = few_turns() else { return };
        let error = gpu.prepare(&plan).unwrap().run(0..plan.unit_count(), wanted).unwrap_err();
        assert!(error.to_string().contains("it completed") && error.to_string().contains("lanes of"), "{error}");
    }
    let (verdicts, summary) = swept(&plan, &gpu);
    assert!(verdicts == expected(&plan) && summary.redone_lanes > 0);
}

#[test]
fn lanes_of_more_steps_than_a_device_runs_are_computed_all_the_same() {
    // llvmpipe ends every loop after 65,535 turns: at a millisecond a lane may have 120,000 steps.
    let profile = Profile::load("jrc-2021").unwrap();
    let mut long = profile.with_dt(0.001).unwrap();
    long.frame.time_cap_s = 120.0;
    let [plan, _] = of_model(&long, ModelId::Fsm, 40);
    let Some(gpu) = open(GpuOptions::default()) else { return };
    let (verdicts, summary) = swept(&plan, &gpu);
    assert!(verdicts == expected(&plan));
    assert!(!gpu.card().name.starts_with("llvmpipe") || summary.redone_lanes > 0, "{summary:?}");
}

#[test]
fn a_wrong_lane_stops_the_run_and_is_named() {
    let plan = plan();
    // One model's verdict bit, always.
    let (right, wrong) = ("select(0u, 2u, state.record.ttc.failed)", "select(2u, 0u, state.record.ttc.failed)");
    let Some(gpu) = patched(right, wrong) else { return };
    let cpu = CpuBackend::lane_arithmetic();
    let executor = Executor::new(&gpu).with_fallback(&cpu).with_recheck(1);
    for wanted in [Wanted::Verdicts, Wanted::Outcomes] {
        let error = executor.sweep(&plan, 0..plan.unit_count(), wanted, |_| Ok(())).unwrap_err();
        assert!(matches!(&error, Error::Verification(_)), "{error}");
        assert!(error.to_string().contains("lane random-"), "{error}");
    }
}

#[test]
fn sessions_of_one_device_do_not_disturb_one_another() {
    let Some(gpu) = open(GpuOptions { first_lanes: 200, ..Default::default() }) else { return };
    let plans = [random(2000, 1, &TWO), random(1500, 2, &[ModelId::Rss]), random(900, 3, &TWO)];
    let cpu = CpuBackend::lane_arithmetic();
    std::thread::scope(|scope| {
        for plan in &plans {
            let (gpu, cpu) = (&gpu, &cpu);
            scope.spawn(move || {
                let mut ours = cpu.prepare(plan).unwrap();
                for round in 0..3 {
                    let mut theirs = gpu.prepare(plan).unwrap();
                    for wanted in [Wanted::Verdicts, Wanted::Outcomes] {
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
