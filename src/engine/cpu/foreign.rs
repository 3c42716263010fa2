//! Lanes of a [`VectorDriver`]: it is called once per step of a batch. Frame, criteria and order are those of the built-in
//! drivers' lanes, in binary32.

use crate::cpu::batch_arrays::VehicleTracks;
use crate::cpu::lane_result::conclude;
use crate::cpu::side_by_side::SideBySide;
use crate::frame::{Frame, Simulation, Start};
use crate::lane::Step;
use crate::lane_case::LaneCase;
use crate::lane_step::{LaneConstants, LaneState, OtherState, advance};
use crate::outcome::{NO_STEP, Outcome};
use crate::scene::Scene;
use lanesweep_model::criterion::Criteria;
use lanesweep_model::driver::{
    DriverModel, DriverState, Hazard, LaneColumns, MAX_ACCELERATION_MPS2, ModelId, VectorDriver, View, row,
};
use lanesweep_model::scalar::{Flag, Real};
use lanesweep_model::scenario::Tables;
use lanesweep_support::{Error, Place, Result};

/// Lanes that run side by side: enough for whole-array arithmetic, few enough that a run is cancelled within seconds.
pub(crate) const BATCH_LANES: u64 = 1 << 15;

/// The place of the driver's model in a step that the engine makes without it: it never reacts. The caller changes the
/// speed afterwards.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Unreacting;

impl<R: Real> DriverModel<R> for Unreacting {
    const KEEPS_DECELERATION: bool = false;

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
    pub(crate) fn new(
        (model, driver): (ModelId, &'d dyn VectorDriver),
        mut frame: Frame<R>,
        criteria: Criteria<R>,
        dt_s: f64,
    ) -> Self {
        frame.end_when_settled &= !driver.may_accelerate();
        Setting { model, driver, dt_s, frame, criteria }
    }

    fn simulation(&self, is_pair: bool) -> Simulation<'_, R, Unreacting> {
        let Setting { frame, criteria, model, .. } = self;
        let scene = Scene::unknown(is_pair);
        Simulation { frame, criteria, model: &Unreacting, model_index: model.index(), scene }
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
    mut observer: impl FnMut(&Step<R>),
) -> Result<Outcome<R>> {
    let Setting { driver, dt_s, frame, .. } = *setting;
    let simulation = setting.simulation(case.pair != 0);
    let constants = LaneConstants::new(&simulation, case);
    let mut state = LaneState::new(&simulation, case, start);
    let mut accelerations = driver.start(1, dt_s)?;
    let mut columns = LaneColumns { dt_s, lane: vec![0], stride: 1, ..LaneColumns::default() };
    columns.state = vec![0.0; driver.state_rows()];
    loop {
        let LaneState { index, v_ego, reaction_step, .. } = state;
        let first = OtherState::of(&case.others[0].motion, tables, index);
        let second = if case.pair != 0 { OtherState::of(&case.others[1].motion, tables, index) } else { first };
        let moved = advance(&simulation, &constants, &state, &[first, second]);
        observer(&Step { index, v_ego, seen: moved.seen, hazard: moved.hazard });
        columns.step = index;
        columns.rows = vec![0.0; row::COUNT];
        // Exact in the lane arithmetic.
        let mut set = |row: usize, value: R| columns.rows[row] = value.to_f64() as f32;
        set(row::EGO_SPEED, moved.seen[0].view.v_ego);
        set(row::EGO_ACCELERATION, moved.seen[0].view.a_ego);
        for (vehicle, first) in row::VEHICLES.into_iter().enumerate().take(1 + case.pair as usize) {
            let view = moved.seen[vehicle].view;
            let present = moved.seen[vehicle].present;
            let attended = present & Flag::reached(index, constants.others[vehicle].attend_from);
            set(first + row::PRESENT, present.choose(R::ONE, R::ZERO));
            set(first + row::ATTENDED, attended.choose(R::ONE, R::ZERO));
            set(first + row::SPEED, view.v_other);
            set(first + row::GAP, view.gap);
            set(first + row::LATERAL_GAP, view.lateral_gap);
            set(first + row::LATERAL_SPEED, view.lateral_towards);
            set(first + row::HALF_LENGTHS, view.half_lengths);
        }
        let mut decided = [0.0];
        accelerations(&mut columns, &mut decided)?;
        check(setting, &decided, index, |_| "of a single run".to_owned())?;
        state = moved.state;
        if decided[0] < 0.0 && reaction_step == NO_STEP {
            state.reaction_step = index;
        }
        if state.over.holds() || state.index >= frame.step_cap {
            return Ok(conclude(&simulation, &constants, &state, &[first, second]));
        }
        state.v_ego = (v_ego + R::from_f64(decided[0].into()) * frame.dt).larger(R::ZERO);
    }
}

/// Outcomes of a batch of lanes side by side, by case and start; `key` names a lane.
///
/// # Errors
/// Those of the driver; [`Error::Input`] for accelerations that are NaN or above the maximum.
pub(crate) fn run_lanes(
    setting: &Setting<f32>,
    cases: &[LaneCase<f32>],
    (tracks, entries): (&[[VehicleTracks; 2]], &[f32]),
    starts: &[Start<f32>],
    key: impl Fn(usize) -> String,
) -> Result<Vec<Outcome<f64>>> {
    let simulation = &setting.simulation(cases.iter().any(|case| case.pair != 0));
    let mut lanes = SideBySide::new(simulation, cases.iter().zip(tracks), entries, starts);
    // Every lane gets its outcome below.
    let mut outcomes = vec![Outcome::default(); lanes.count()];
    let mut accelerations = setting.driver.start(lanes.count(), setting.dt_s)?;
    lanes.columns.dt_s = setting.dt_s;
    lanes.columns.state = vec![0.0; setting.driver.state_rows() * lanes.columns.stride];
    let mut step = 0;
    while lanes.count() > 0 {
        lanes.step(simulation, step);
        let running = lanes.count();
        let decided = &mut lanes.accelerations[..running];
        accelerations(&mut lanes.columns, decided)?;
        check(setting, decided, step, |at| key(lanes.columns.lane[at] as usize))?;
        lanes.take_finished(simulation, |lane, outcome| outcomes[lane] = outcome.widen());
        step += 1;
    }
    Ok(outcomes)
}

/// Checks what the driver decided for the running lanes; `key` names one of them.
fn check<R>(setting: &Setting<R>, decided: &[f32], step: u32, key: impl Fn(usize) -> String) -> Result<()> {
    let maximum = if setting.driver.may_accelerate() { MAX_ACCELERATION_MPS2 } else { 0.0 };
    // A NaN is wrong too.
    let is_right = |acceleration: &f32| (-MAX_ACCELERATION_MPS2..=maximum).contains(acceleration);
    if decided.iter().fold(true, |all, acceleration| all & is_right(acceleration)) {
        return Ok(());
    }
    let Some(at) = decided.iter().position(|acceleration| !is_right(acceleration)) else { return Ok(()) };
    let problem = format!("its acceleration is {} m/s² in lane {}", decided[at], key(at));
    let help = if decided[at] > 0.0 && maximum == 0.0 {
        "say that the driver may accelerate, or return at most 0".to_owned()
    } else {
        format!("return finite numbers of at most {MAX_ACCELERATION_MPS2} m/s²")
    };
    Err(Error::input(Place::item(format!("driver {}, step {step}", setting.model.name())), problem, help))
}
