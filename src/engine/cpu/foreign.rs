//! Lanes of a [`VectorDriver`]: they run side by side, so that the driver is called once per step. Frame, criteria and
//! order are those of the built-in drivers' lanes, in binary32.

use std::borrow::Cow;

use rayon::prelude::*;

use crate::cpu::lane_result::conclude;
use crate::frame::{Frame, Simulation, Start};
use crate::lane::{Observer, Step};
use crate::lane_case::LaneCase;
use crate::lane_step::{LaneConstants, LaneState, Moved, OtherState, Seen, advance};
use crate::outcome::{NO_STEP, Outcome};
use crate::scene::Scene;
use lanesweep_model::criterion::Criteria;
use lanesweep_model::driver::{
    DriverModel, DriverState, Hazard, LaneColumns, MAX_ACCELERATION_MPS2, ModelId, VectorDriver, VehicleColumns, View,
};
use lanesweep_model::scalar::{Flag, Real};
use lanesweep_model::scenario::Tables;
use lanesweep_support::{Error, Place, Result};

/// Lanes that run side by side: enough for whole-array arithmetic, few enough that a run is cancelled within seconds.
pub(crate) const BATCH_LANES: u64 = 1 << 15;

/// The place of the driver's model in a step that the engine makes without it: it never reacts. The caller changes the
/// speed afterwards.
#[derive(Debug, Clone, Copy)]
struct Unreacting;

impl<R: Real> DriverModel<R> for Unreacting {
    fn initial(&self) -> DriverState<R> {
        DriverState { deceleration: R::ZERO, delay_steps: 0 }
    }

    fn check(&self, _view: &View<R>) -> Hazard<R> {
        Hazard { is_unsafe: Flag::FALSE, demand: R::ZERO }
    }

    fn shader_constants(&self) -> Vec<(&'static str, f64)> {
        Vec::new()
    }

    fn react(&self, state: DriverState<R>, _hazard: &Hazard<R>, v_ego: R) -> (DriverState<R>, R) {
        (state, v_ego)
    }
}

/// What all lanes of a driver in one category share.
pub(crate) struct Setting<'d, R> {
    model: ModelId,
    driver: &'d dyn VectorDriver,
    dt_s: f64,
    frame: Frame<R>,
    criteria: Criteria<R>,
}

impl<'d, R: Real> Setting<'d, R> {
    /// A driver with the frame and the criteria of its category, and the time step.
    pub fn new(
        (model, driver): (ModelId, &'d dyn VectorDriver),
        mut frame: Frame<R>,
        criteria: Criteria<R>,
        dt_s: f64,
    ) -> Self {
        frame.end_when_settled &= !driver.may_accelerate();
        Setting { model, driver, dt_s, frame, criteria }
    }

    fn simulation(&self, case: &LaneCase<R>) -> Simulation<'_, R, Unreacting> {
        let Setting { frame, criteria, model, .. } = self;
        let scene = Scene::unknown(case.pair != 0);
        Simulation { frame, criteria, model: &Unreacting, model_index: model.index(), scene }
    }
}

/// A lane of a batch.
struct BatchLane<R> {
    /// Index of its case in the batch.
    case: usize,
    constants: LaneConstants<R>,
    state: LaneState<R>,
}

impl<R: Real> BatchLane<R> {
    fn new(setting: &Setting<'_, R>, at: usize, case: &LaneCase<R>, start: Start<R>) -> Self {
        let simulation = setting.simulation(case);
        let constants = LaneConstants::new(&simulation, case);
        BatchLane { case: at, constants, state: LaneState::new(&simulation, case, start) }
    }

    /// Moves the lane to its next step, without the driver.
    fn moved(&self, setting: &Setting<R>, case: &LaneCase<R>, tables: &Tables<R>) -> (Moved<R>, [OtherState<R>; 2]) {
        let places = places(case, tables, self.state.index);
        (advance(&setting.simulation(case), &self.constants, &self.state, &places), places)
    }

    /// Takes the step over, with the driver's acceleration, m/s². Returns the outcome if it was the last step.
    fn steer(
        &mut self,
        setting: &Setting<R>,
        case: &LaneCase<R>,
        (moved, places): &(Moved<R>, [OtherState<R>; 2]),
        acceleration: f32,
    ) -> Option<Outcome<R>> {
        let LaneState { index, v_ego, reaction_step, .. } = self.state;
        self.state = moved.state;
        if acceleration < 0.0 && reaction_step == NO_STEP {
            self.state.reaction_step = index;
        }
        let is_over = self.state.over.holds();
        if !is_over {
            self.state.v_ego = (v_ego + R::from_f64(acceleration.into()) * setting.frame.dt).larger(R::ZERO);
        }
        let is_last = is_over || self.state.index >= setting.frame.step_cap;
        is_last.then(|| conclude(&setting.simulation(case), &self.constants, &self.state, places))
    }
}

/// Runs one lane, as [`run_lane`](crate::run_lane) does with a built-in driver.
///
/// # Errors
/// Those of the driver; [`Error::Input`] for an acceleration that is missing, NaN or above the maximum.
pub(crate) fn run_one<R: Real>(
    setting: &Setting<R>,
    case: &LaneCase<R>,
    tables: &Tables<R>,
    start: Start<R>,
    observer: &mut impl Observer<R>,
) -> Result<Outcome<R>> {
    let mut lane = BatchLane::new(setting, 0, case, start);
    let mut accelerations = setting.driver.start(1, setting.dt_s)?;
    loop {
        let moved = lane.moved(setting, case, tables);
        let LaneState { index, v_ego, .. } = lane.state;
        observer.step(&Step { index, v_ego, seen: moved.0.seen, hazard: moved.0.hazard });
        let seen = std::iter::once((0, &lane, case));
        let found = accelerations(columns_of(index, setting.dt_s, seen, std::slice::from_ref(&moved)))?;
        check(setting, &found, 1, index, |_| "of a single run".to_owned())?;
        if let Some(outcome) = lane.steer(setting, case, &moved, found[0]) {
            return Ok(outcome);
        }
    }
}

/// Outcomes of lanes side by side, by case and start; `key` names a lane.
///
/// # Errors
/// Those of the driver; [`Error::Input`] for accelerations that are missing, NaN or above the maximum.
pub(crate) fn run_lanes(
    setting: &Setting<f32>,
    cases: &[(LaneCase<f32>, Cow<'_, Tables<f32>>)],
    starts: &[Start<f32>],
    key: impl Fn(usize) -> String,
) -> Result<Vec<Outcome<f64>>> {
    let of_case = |at: usize| starts.iter().map(move |start| (at, *start));
    let lanes = (0..cases.len()).flat_map(of_case);
    let mut lanes: Vec<BatchLane<f32>> =
        lanes.map(|(at, start)| BatchLane::new(setting, at, &cases[at].0, start)).collect();
    // Every lane gets its outcome below.
    let mut outcomes = vec![Outcome::NONE; lanes.len()];
    let mut running: Vec<usize> = (0..lanes.len()).collect();
    let mut accelerations = setting.driver.start(lanes.len(), setting.dt_s)?;
    let mut step = 0;
    while !running.is_empty() {
        let moved = |&at: &usize| {
            let lane: &BatchLane<f32> = &lanes[at];
            let (case, tables) = &cases[lane.case];
            lane.moved(setting, case, tables)
        };
        let moved: Vec<_> = running.par_iter().map(moved).collect();
        let seen = running.iter().map(|&at| (at, &lanes[at], &cases[lanes[at].case].0));
        let found = accelerations(columns_of(step, setting.dt_s, seen, &moved))?;
        check(setting, &found, running.len(), step, |at| key(running[at]))?;
        let mut still_running = Vec::with_capacity(running.len());
        for ((&at, moved), acceleration) in running.iter().zip(&moved).zip(found) {
            let lane = &mut lanes[at];
            match lane.steer(setting, &cases[lane.case].0, moved, acceleration) {
                Some(outcome) => outcomes[at] = outcome.widen(),
                None => still_running.push(at),
            }
        }
        running = still_running;
        step += 1;
    }
    Ok(outcomes)
}

/// Checks what the driver returned for the running lanes; `key` names one of them.
fn check<R>(setting: &Setting<R>, found: &[f32], lanes: usize, step: u32, key: impl Fn(usize) -> String) -> Result<()> {
    let place = || Place::item(format!("driver {}, step {step}", setting.model.name()));
    if found.len() != lanes {
        let problem = format!("it returned {} accelerations for {lanes} lanes", found.len());
        return Err(Error::input(place(), problem, "return one number per lane, in m/s²"));
    }
    let most = if setting.driver.may_accelerate() { MAX_ACCELERATION_MPS2 } else { 0.0 };
    // A NaN is wrong too.
    let is_right = |acceleration: &f32| (-MAX_ACCELERATION_MPS2..=most).contains(acceleration);
    let Some(at) = found.iter().position(|acceleration| !is_right(acceleration)) else { return Ok(()) };
    let problem = format!("its acceleration is {} m/s² in lane {}", found[at], key(at));
    let help = if found[at] > 0.0 && most == 0.0 {
        "say that the driver may accelerate, or return at most 0".to_owned()
    } else {
        format!("return finite numbers of at most {MAX_ACCELERATION_MPS2} m/s²")
    };
    Err(Error::input(place(), problem, help))
}

/// The other vehicles of a case at a step.
fn places<R: Real>(case: &LaneCase<R>, tables: &Tables<R>, step: u32) -> [OtherState<R>; 2] {
    let first = OtherState::of(&case.others[0].motion, tables, step);
    [first, if case.pair != 0 { OtherState::of(&case.others[1].motion, tables, step) } else { first }]
}

/// What the drivers of the running lanes see after these moved to a step.
fn columns_of<'a, R: Real>(
    step: u32,
    dt_s: f64,
    lanes: impl Iterator<Item = (usize, &'a BatchLane<R>, &'a LaneCase<R>)>,
    moved: &[(Moved<R>, [OtherState<R>; 2])],
) -> LaneColumns {
    let mut columns = LaneColumns { step, time_s: f64::from(step) * dt_s, ..LaneColumns::default() };
    for ((at, lane, case), (moved, _)) in lanes.zip(moved) {
        columns.lane.push(at as i64);
        columns.ego_speed.push(narrow(moved.seen[0].view.v_ego));
        columns.ego_acceleration.push(narrow(moved.seen[0].view.a_ego));
        for (k, vehicle) in columns.vehicles.iter_mut().enumerate() {
            let exists = k == 0 || case.pair != 0;
            push(vehicle, &moved.seen[k], exists, lane.constants.others[k].attend_from <= step);
        }
    }
    columns
}

/// Exact in the lane arithmetic.
fn narrow<R: Real>(value: R) -> f32 {
    value.to_f64() as f32
}

fn push<R: Real>(vehicle: &mut VehicleColumns, seen: &Seen<R>, exists: bool, may_attend: bool) {
    let present = exists && seen.present.holds();
    vehicle.present.push(present);
    vehicle.attended.push(present && may_attend);
    vehicle.speed.push(narrow(seen.view.v_other));
    vehicle.gap.push(narrow(seen.view.gap));
    vehicle.lateral_gap.push(narrow(seen.view.lateral_gap));
    vehicle.lateral_speed.push(narrow(seen.view.lateral_towards));
    vehicle.half_lengths.push(narrow(seen.view.half_lengths));
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    use crate::verify::{SetOptions, random_plan};
    use crate::{Backend, Chunk, CpuBackend, Executor, LanePlan, LaneRunner, Wanted};
    use lanesweep_model::driver::{Accelerations, DriverProfile};
    use lanesweep_model::profile::Profile;
    use lanesweep_model::scenario::Category;

    /// A built-in driver behind the interface of foreign ones.
    struct Wrapped {
        profile: Profile,
        wrong: Option<f32>,
    }

    impl VectorDriver for Wrapped {
        fn stands_for(&self) -> ModelId {
            ModelId::Rss
        }

        fn may_accelerate(&self) -> bool {
            false
        }

        fn start(&self, lanes: usize, dt_s: f64) -> Result<Accelerations<'_>> {
            // The constants of RSS do not depend on the category.
            let rss = self.profile.rss.resolve::<f32>(dt_s, Category::CutIn);
            let mut states = vec![DriverModel::<f32>::initial(&rss); lanes];
            Ok(Box::new(move |columns| {
                let one = |row: usize| {
                    let state = &mut states[columns.lane[row] as usize];
                    let v_ego = columns.ego_speed[row];
                    let mut nearest: Option<(f32, Hazard<f32>)> = None;
                    for vehicle in &columns.vehicles {
                        let view = View {
                            v_ego,
                            a_ego: columns.ego_acceleration[row],
                            v_other: vehicle.speed[row],
                            gap: vehicle.gap[row],
                            lateral_gap: vehicle.lateral_gap[row],
                            lateral_towards: vehicle.lateral_speed[row],
                            half_lengths: vehicle.half_lengths[row],
                            // RSS does not read it.
                            marking_gap: 0.0,
                        };
                        let hazard = rss.check(&view);
                        let reacts = vehicle.attended[row] && hazard.is_unsafe.holds();
                        if reacts && nearest.is_none_or(|(gap, _)| view.gap < gap) {
                            nearest = Some((view.gap, hazard));
                        }
                    }
                    let Some((_, hazard)) = nearest else { return 0.0 };
                    let (next, _) = rss.react(*state, &hazard, v_ego);
                    let delayed = state.delay_steps > 0;
                    *state = next;
                    // Coasts at its present speed for the reaction time, or brakes.
                    if delayed { 0.0 } else { -next.deceleration }
                };
                let mut found: Vec<f32> = (0..columns.lane.len()).map(one).collect();
                if let Some(wrong) = self.wrong.filter(|_| columns.step == 3) {
                    found[0] = wrong;
                }
                Ok(found)
            }))
        }
    }

    fn plan(models: Vec<ModelId>) -> LanePlan {
        let options = SetOptions { size: 2000, models, ..Default::default() };
        random_plan(&Profile::load("paper").unwrap(), &options).unwrap()
    }

    fn outcomes(plan: &LanePlan, backend: impl Backend) -> Result<Vec<Outcome<f64>>> {
        let mut all = Vec::new();
        let executor = Executor::new(backend);
        executor.sweep(plan, 0..plan.unit_count(), Wanted::Outcomes, |chunk| {
            all.extend(chunk.outcomes);
            Ok(())
        })?;
        Ok(all)
    }

    fn wrapped(name: &str, wrong: Option<f32>) -> ModelId {
        let driver = Wrapped { profile: Profile::load("paper").unwrap(), wrong };
        ModelId::register(name, "1", Arc::new(driver)).unwrap()
    }

    /// Beside a built-in model in one plan, with verdicts and outcomes.
    #[test]
    fn a_built_in_driver_behind_the_interface_gives_its_own_lanes() {
        let plan = plan(vec![ModelId::Rss, wrapped("wrapped", None)]);
        for backend in [CpuBackend::lane_arithmetic(), CpuBackend::scalar()] {
            let all = outcomes(&plan, &backend).unwrap();
            assert!(all.len() > 10_000 && all.iter().any(|outcome| outcome.verdicts.0 != 0));
            for (lane, pair) in all.chunks(2).enumerate() {
                // The step of the first reaction differs: the interface has no word for coasting.
                let wrapped = Outcome { reaction_step: pair[0].reaction_step, ..pair[1] };
                assert_eq!(wrapped, pair[0], "lane {lane}");
            }
            let executor = Executor::new(&backend).with_recheck(1);
            let verdicts = |chunk: Chunk| {
                assert!(chunk.verdicts.chunks(2).all(|pair| pair[0] == pair[1]));
                Ok(())
            };
            executor.sweep(&plan, 0..plan.unit_count(), Wanted::Verdicts, verdicts).unwrap();
        }
        // Single lanes, as traces run them.
        let runner = LaneRunner::<f32>::new(&plan);
        let all = outcomes(&plan, CpuBackend::lane_arithmetic()).unwrap();
        for lane in (1..plan.lane_count()).step_by(2 * 97) {
            assert_eq!(runner.run(&plan.key(lane).unwrap()).widen(), all[lane as usize], "lane {lane}");
        }
        let error = outcomes(&plan, CpuBackend::reference()).unwrap_err().to_string();
        assert!(error.contains("driver wrapped"), "{error}");
    }

    #[test]
    fn a_wrong_acceleration_names_driver_step_and_lane() {
        for wrong in [f32::NAN, f32::NEG_INFINITY, 101.0, 0.5] {
            let plan = plan(vec![wrapped("wrong", Some(wrong))]);
            let error = outcomes(&plan, CpuBackend::lane_arithmetic()).unwrap_err().to_string();
            assert!(error.starts_with("driver wrong, step 3: its acceleration is "), "{error}");
        }
    }

    #[test]
    fn a_name_is_a_word_that_no_built_in_model_has_and_a_plan_knows_its_fingerprint() {
        let driver = || Arc::new(Wrapped { profile: Profile::load("paper").unwrap(), wrong: None });
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
}
