//! Cases as the JRC's simulator of 2021 makes them: vehicles of 4.3 m × 1.9 m, and lateral motion as a running sum that
//! begins one step after the nominal start. Its comparison sweep adds a lateral run-up before the start. The
//! simulator's time step is 0.1 s; here cases are given in seconds, and their steps follow from the time step.
//! Conformance tests replay the JRC's tables with these cases; maps sweep its grids.

use lanesweep_model::driver::ModelId;
use lanesweep_model::profile::Profile;
use lanesweep_model::scenario::{Ahead, Case, Category, LANE_WIDTH_M, Lateral, Participant, Speed};

/// Length of a vehicle, m.
pub(super) const LENGTH_M: f64 = 4.3;
/// Width of a vehicle, m.
pub(super) const WIDTH_M: f64 = 1.9;
/// Length of a stationary vehicle ahead of a cutting-out one, m.
pub(super) const STANDING_LENGTH_M: f64 = 5.0;
/// Lateral distance that a cut-in covers, m.
pub(super) const CUT_IN_LATERAL_M: f64 = 3.5;
/// Lateral distance that a cut-out covers, m.
pub(super) const CUT_OUT_LATERAL_M: f64 = 4.0;
/// Time headway at which a following Reg157 or CCHDM starts, s.
pub const NATIVE_THW_S: f64 = 2.0;
/// Lateral acceleration of the run-up, m/s².
const RUN_UP_MPS2: f64 = 1.5;

/// A vehicle of the simulator's width.
fn vehicle(length_m: f64, speed: Speed, lateral: Lateral) -> Participant {
    Participant { length_m, width_m: WIDTH_M, speed, lateral }
}

/// A case in which the principal vehicle has the simulator's length.
fn case(category: Category, ego_mps: f64, speed: Speed, lateral: Lateral, ahead: Option<Ahead>) -> Case {
    Case {
        category,
        ego_length_m: LENGTH_M,
        ego_width_m: WIDTH_M,
        lane_width_m: LANE_WIDTH_M,
        ego_speed_mps: ego_mps,
        principal: vehicle(LENGTH_M, speed, lateral),
        ahead,
        horizon_s: 0.0,
    }
}

/// A cut-in at constant speeds; `run_up` is the number of steps before the nominal start.
pub fn cut_in(ego_mps: f64, cutter_mps: f64, lateral_mps: f64, run_up: u32, dt_s: f64) -> Case {
    let lateral = cut_in_lateral(lateral_mps, run_up, dt_s);
    case(Category::CutIn, ego_mps, Speed::constant(cutter_mps), lateral, None)
}

/// The gap at the frame's nominal start. The last step of the run-up has the case's gap `gap_m`, and the frame's start
/// shift adds one step.
pub fn gap_before_run_up(gap_m: f64, ego_mps: f64, cutter_mps: f64, run_up: u32, dt_s: f64) -> f64 {
    gap_m - f64::from(run_up) * (cutter_mps - ego_mps) * dt_s
}

/// Number of steps of the comparison sweep's run-up: lateral speeds that increase from 0 to below the full speed (0,
/// 0.15, 0.30, … m/s at 0.1 s), then one step at the full speed.
pub(super) fn run_up_steps(lateral_mps: f64, dt_s: f64) -> u32 {
    // Rounding may put the quotient of 0.3 and 0.15 above 2.
    (lateral_mps / run_up_step_mps(dt_s) - 1e-9).ceil().max(0.0) as u32 + 1
}

/// Increase of the lateral speed per step of the run-up, m/s.
fn run_up_step_mps(dt_s: f64) -> f64 {
    RUN_UP_MPS2 / rate_hz(dt_s)
}

/// Steps per second: exactly 10 at 0.1 s, so that products and quotients with it equal the JRC's.
fn rate_hz(dt_s: f64) -> f64 {
    1.0 / dt_s
}

/// Number of steps of a lateral change; the last one is at its end or beyond.
fn change_steps(distance_m: f64, lateral_mps: f64, dt_s: f64) -> usize {
    if lateral_mps > 0.0 { (rate_hz(dt_s) * distance_m / lateral_mps).floor() as usize + 1 } else { 1 }
}

/// A leader that decelerates from `initial_mps` to `end_mps` from the start; the ego has the same initial speed.
pub fn lvd(initial_mps: f64, end_mps: f64, deceleration_mps2: f64) -> Case {
    let until_s = if deceleration_mps2 > 0.0 { (initial_mps - end_mps).max(0.0) / deceleration_mps2 } else { 0.0 };
    let speed = Speed::Kinematic { initial_mps, acceleration_mps2: -deceleration_mps2, until_s };
    Case { horizon_s: until_s, ..case(Category::Lvd, initial_mps, speed, Lateral::Centred, None) }
}

/// The vehicle ahead of a cutting-out one, as the JRC's tables give it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Front {
    /// Speed, m/s.
    pub speed_mps: f64,
    /// Length, m: `STANDING_LENGTH_M` if it is stationary.
    pub length_m: f64,
    /// Distance to it, m: between centres minus `LENGTH_M`, independent of its own length.
    pub distance_m: f64,
}

/// A cut-out: ego and cutting-out vehicle have the same speed, and the lateral motion begins at the start.
pub fn cut_out(speed_mps: f64, lateral_mps: f64, front: Front, dt_s: f64) -> Case {
    let ahead = Ahead {
        vehicle: vehicle(front.length_m, Speed::constant(front.speed_mps), Lateral::Centred),
        gap_m: front.distance_m - (front.length_m - LENGTH_M) / 2.0,
    };
    let lateral = cut_out_lateral(lateral_mps, dt_s);
    case(Category::CutOut, speed_mps, Speed::constant(speed_mps), lateral, Some(ahead))
}

/// The initial distance at which a following FSM does not react: v τ + v²/(2 b_comf) − v²/(2 b_lead) + 2 d1, m.
pub fn native_distance_fsm(profile: &Profile, v: f64) -> f64 {
    let p = &profile.fsm;
    v * p.reaction_time_s + v * v / (2.0 * p.comfortable_deceleration_mps2) - v * v / (2.0 * p.lead_deceleration_mps2)
        + 2.0 * p.margin_m
}

/// The same for RSS, with the leader's response, m: v ρ + a ρ²/2 + (v + ρ a)²/(2 b) − max(v − b ρ, 0)²/(2 b) + a ρ².
pub fn native_distance_rss(profile: &Profile, v: f64) -> f64 {
    let p = &profile.rss;
    let (rho, a, b) = (p.response_time_s, p.max_acceleration_mps2, p.ego_deceleration_mps2);
    let fast = v + rho * a;
    let slow = (v - p.other_deceleration_mps2 * rho).max(0.0);
    v * rho + a * rho * rho / 2.0 + fast * fast / (2.0 * b) - slow * slow / (2.0 * p.other_deceleration_mps2)
        + a * rho * rho
}

/// The initial distance of a following model in the JRC's simulator, m; both vehicles have `speed_mps`.
pub(super) fn native_distance(profile: &Profile, model: ModelId, speed_mps: f64) -> f64 {
    match model {
        ModelId::Fsm => native_distance_fsm(profile, speed_mps),
        ModelId::Rss => native_distance_rss(profile, speed_mps),
        _ => NATIVE_THW_S * speed_mps,
    }
}

/// Lateral speeds towards the ego: the run-up, one sample at full speed, then the constant speed.
fn cut_in_lateral(lateral_mps: f64, run_up: u32, dt_s: f64) -> Lateral {
    let m = run_up as usize;
    let plain = change_steps(CUT_IN_LATERAL_M, lateral_mps, dt_s);
    let mut towards: Vec<f64> = (0..m.saturating_sub(1)).map(|k| run_up_step_mps(dt_s) * k as f64).collect();
    towards.resize(m + plain, lateral_mps);
    let mut position = vec![0.0; towards.len()];
    if m > 0 {
        position[m - 1] = CUT_IN_LATERAL_M;
        for i in (0..m - 1).rev() {
            position[i] = position[i + 1] + towards[i] * dt_s;
        }
    }
    let mut y = CUT_IN_LATERAL_M;
    for i in m..towards.len() {
        y -= towards[i] * dt_s;
        position[i] = y;
    }
    Lateral::Sampled { position_m: position, towards_mps: towards }
}

/// From the lane centre to −4 m, from the start.
fn cut_out_lateral(lateral_mps: f64, dt_s: f64) -> Lateral {
    let steps = change_steps(CUT_OUT_LATERAL_M, lateral_mps, dt_s);
    let position: Vec<f64> = (1..=steps).map(|i| -lateral_mps * dt_s * i as f64).collect();
    Lateral::Sampled { towards_mps: vec![-lateral_mps; position.len()], position_m: position }
}
