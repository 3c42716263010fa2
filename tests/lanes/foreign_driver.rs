//! Drivers of users, whose lanes are those of a built-in driver behind the same interface.

use std::sync::Arc;

use lanesweep::engine::verify::{SetOptions, random_plan};
use lanesweep::engine::{Backend, Chunk, LanePlan, LaneRunner};
use lanesweep::model::driver::{DriverModel, DriverProfile, DriverState, Hazard, View, row};
use lanesweep::prelude::*;

/// A built-in driver behind the interface of foreign ones.
struct Wrapped {
    profile: Profile,
    batch_lanes: usize,
    wrong: Option<f32>,
}

impl VectorDriver for Wrapped {
    fn stands_for(&self) -> ModelId {
        ModelId::Rss
    }

    fn may_accelerate(&self) -> bool {
        false
    }

    fn batch_lanes(&self) -> usize {
        self.batch_lanes
    }

    fn state_rows(&self) -> usize {
        2
    }

    fn start(&self, _lanes: usize, dt_s: f64) -> Result<Accelerations<'_>> {
        // The constants of RSS do not depend on the category.
        let rss = self.profile.rss.resolve::<f32>(dt_s, Category::CutIn);
        let initial = DriverModel::<f32>::initial(&rss);
        Ok(Box::new(move |columns, decided| {
            if columns.step == 0 {
                let (delay_steps, deceleration) = columns.state.split_at_mut(columns.stride);
                delay_steps.fill(initial.delay_steps as f32);
                deceleration.fill(initial.deceleration);
            }
            let mut one = |at: usize| {
                let see = |row: usize| columns.row(row)[at];
                let v_ego = see(row::EGO_SPEED);
                let mut nearest: Option<(f32, Hazard<f32>)> = None;
                for first in row::VEHICLES {
                    let view = View {
                        v_ego,
                        a_ego: see(row::EGO_ACCELERATION),
                        v_other: see(first + row::SPEED),
                        gap: see(first + row::GAP),
                        lateral_gap: see(first + row::LATERAL_GAP),
                        lateral_towards: see(first + row::LATERAL_SPEED),
                        half_lengths: see(first + row::HALF_LENGTHS),
                        // RSS does not read it.
                        marking_gap: 0.0,
                    };
                    let hazard = rss.check(&view);
                    let reacts = see(first + row::ATTENDED) != 0.0 && hazard.is_unsafe.holds();
                    if reacts && nearest.is_none_or(|(gap, _)| view.gap < gap) {
                        nearest = Some((view.gap, hazard));
                    }
                }
                let Some((_, hazard)) = nearest else { return 0.0 };
                let [delay_steps, deceleration] = [at, columns.stride + at];
                let state = DriverState {
                    delay_steps: columns.state[delay_steps] as u32,
                    deceleration: columns.state[deceleration],
                };
                let (next, _) = rss.react(state, &hazard, v_ego);
                columns.state[delay_steps] = next.delay_steps as f32;
                columns.state[deceleration] = next.deceleration;
                // Coasts at its present speed for the reaction time, or brakes.
                if state.delay_steps > 0 { 0.0 } else { -next.deceleration }
            };
            (0..decided.len()).for_each(|at| decided[at] = one(at));
            if let Some(wrong) = self.wrong.filter(|_| columns.step == 3) {
                decided[0] = wrong;
            }
            Ok(())
        }))
    }
}

fn plan(models: Vec<ModelId>) -> LanePlan {
    let options = SetOptions { size: 2000, models, ..Default::default() };
    random_plan(&Profile::load("paper").unwrap(), &options).unwrap()
}

fn outcomes(plan: &LanePlan, backend: &dyn Backend) -> Result<Vec<Outcome<f64>>> {
    Ok(backend.prepare(plan)?.run(0..plan.unit_count(), Wanted::Outcomes)?.outcomes)
}

fn driver(wrong: Option<f32>, batch_lanes: usize) -> Arc<Wrapped> {
    Arc::new(Wrapped { profile: Profile::load("paper").unwrap(), batch_lanes, wrong })
}

fn wrapped(name: &str, wrong: Option<f32>) -> ModelId {
    ModelId::register(name, "1", driver(wrong, usize::MAX)).unwrap()
}

/// Beside a built-in model in one plan, with verdicts and outcomes.
#[test]
fn a_built_in_driver_behind_the_interface_gives_its_own_lanes() {
    let in_small_batches = ModelId::register("small", "1", driver(None, 100)).unwrap();
    let plan = plan(vec![ModelId::Rss, wrapped("wrapped", None), in_small_batches]);
    for backend in [CpuBackend::lane_arithmetic(), CpuBackend::scalar()] {
        let all = outcomes(&plan, &backend).unwrap();
        assert!(all.len() > 10_000 && all.iter().any(|outcome| outcome.verdicts.0 != 0));
        for (lane, own) in all.chunks(3).enumerate() {
            // The step of the first reaction differs: the interface has no word for coasting.
            let wrapped = Outcome { reaction_step: own[0].reaction_step, ..own[1] };
            assert_eq!((wrapped, own[2]), (own[0], own[1]), "lane {lane}");
        }
        let executor = Executor::new(&backend).with_recheck(1);
        let verdicts = |chunk: Chunk| {
            assert!(chunk.verdicts.chunks(3).all(|own| own[0] == own[1] && own[0] == own[2]));
            Ok(())
        };
        executor.sweep(&plan, 0..plan.unit_count(), Wanted::Verdicts, verdicts).unwrap();
    }
    // Single lanes, as traces run them.
    let runner = LaneRunner::<f32>::new(&plan);
    let all = outcomes(&plan, &CpuBackend::lane_arithmetic()).unwrap();
    for lane in (1..plan.lane_count()).step_by(3 * 97) {
        assert_eq!(runner.run(&plan.key(lane).unwrap()).widen(), all[lane as usize], "lane {lane}");
    }
    let error = outcomes(&plan, &CpuBackend::reference()).unwrap_err().to_string();
    assert!(error.contains("driver wrapped"), "{error}");
}

#[test]
fn a_wrong_acceleration_names_driver_step_and_lane() {
    for wrong in [f32::NAN, f32::NEG_INFINITY, 101.0, 0.5] {
        let plan = plan(vec![wrapped("wrong", Some(wrong))]);
        let error = outcomes(&plan, &CpuBackend::lane_arithmetic()).unwrap_err().to_string();
        assert!(error.starts_with("driver wrong, step 3: its acceleration is "), "{error}");
    }
}

#[test]
fn a_name_is_a_word_that_no_built_in_model_has_and_a_plan_knows_its_fingerprint() {
    let driver = || driver(None, usize::MAX);
    for name in ["", "rss", "CC", "all", "a b", "a/b"] {
        assert!(ModelId::register(name, "1", driver()).is_err(), "{name}");
    }
    let first = ModelId::register("named", "1", driver()).unwrap();
    let text = serde_json::to_string(&first).unwrap();
    assert_eq!((text.as_str(), first.name()), ("\"named@1\"", "named"));
    assert_eq!(serde_json::from_str::<ModelId>(&text).unwrap(), first);
    let second = ModelId::register("named", "2", driver()).unwrap();
    assert_eq!((ModelId::parse("NAMED"), serde_json::from_str(&text).ok()), (Some(second), Some(first)));
    assert!(serde_json::from_str::<ModelId>("\"named@3\"").is_err());
    assert!(serde_json::from_str::<ModelId>("\"named\"").is_err());
}
