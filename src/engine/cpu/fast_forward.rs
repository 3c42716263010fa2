//! Quiescent steps, which batches skip in verdict-only sweeps.
//!
//! When the other vehicles have ended their manoeuvres and the ego keeps its speed, only the gap changes, by the same
//! amount each step. This often lasts for minutes, until the gap is small enough for the driver or a criterion. The
//! lane skips these steps: [`quiescent_gap`] is the gap down to which no event is possible, and [`carried`] counts the
//! steps above it and computes the resulting gap to the bit.
//!
//! This needs two promises of a driver model, [`DriverModel::safe_gap`] and [`DriverModel::ignores`]. Steps that change
//! no bit of a lane need no promise: no later step changes a bit either.

use lanesweep_model::criterion::{BrakeThreatMaximum, TtcMinimum};
use lanesweep_model::driver::{DriverModel, DriverState};
use lanesweep_model::scalar::{Flag, Real};

use crate::cpu::ROWS;
use crate::frame::Simulation;
use crate::lane_step::{
    Ego, LaneConstants, LaneState, OtherConstants, OtherState, Record, advance, check, criteria_safe_gap, see,
    update_record,
};

/// Fewer steps are cheaper to make than to skip.
const MIN_STEPS: u32 = 4 * ROWS as u32;

/// Quiescent steps, and the gaps after them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Quiescent {
    pub steps: u32,
    pub gaps: [f32; 2],
}

/// Number of a lane's next steps that can be skipped, if that saves time: no reaction, criterion or end occurs before.
/// `state` is between two steps, at `state.index` at least 1. The other vehicles keep the speed and lateral position in
/// `places` forever.
pub(crate) fn quiescent_steps<M: DriverModel<f32>>(
    simulation: &Simulation<f32, M>,
    lane: &LaneConstants<f32>,
    state: &LaneState<f32>,
    places: &[OtherState<f32>; 2],
) -> Option<Quiescent> {
    let index = state.index;
    // One burst of steps remains, so that the lane ends in the regular way.
    let mut max_steps = simulation.frame.step_cap.saturating_sub(index + ROWS as u32);
    let vehicles = if simulation.scene.is_pair { 2 } else { 1 };
    for other in &lane.others[..vehicles] {
        if index < other.present_from {
            return None;
        }
        for event in [other.present_until, other.attend_from] {
            if event > index {
                max_steps = max_steps.min(event - index);
            }
        }
    }
    if is_still(simulation, lane, state, places) {
        let steps = if lane.horizon > index { max_steps.min(lane.horizon - index) } else { max_steps };
        return (steps >= MIN_STEPS).then_some(Quiescent { steps, gaps: state.gaps });
    }
    let ego = Ego::of(lane, state.v_ego, 0.0);
    let first = see(simulation, &ego, &lane.others[0], &places[0], state.gaps[0], index, Flag::TRUE);
    if simulation.model.keeps_braking(&state.driver, &first.view).holds() {
        return None;
    }
    // For a model that does not read its acceleration, the state does not hold the previous speed.
    if M::SEES_OWN_ACCELERATION && state.v_before != state.v_ego {
        return None;
    }
    let mut lowest = [None; 2];
    let mut settled = true;
    for vehicle in 0..vehicles {
        let (other, place) = (&lane.others[vehicle], &places[vehicle]);
        if index >= other.present_until {
            continue;
        }
        if is_out_of_the_way(simulation, lane, other, place).holds() {
            continue;
        }
        settled &= state.v_ego <= place.speed;
        lowest[vehicle] = Some(quiescent_gap(simulation, lane, state, places, vehicle)?);
    }
    if settled || state.v_ego <= 0.0 {
        // The step at the horizon ends the lane.
        max_steps = max_steps.min(lane.horizon.saturating_sub(index));
    }
    let mut gaps = state.gaps;
    let mut steps = max_steps;
    for vehicle in 0..vehicles {
        // The gap of a vehicle outside the ego's lane is never read again.
        let Some(lowest) = lowest[vehicle] else { continue };
        let by = |vehicle: usize| (places[vehicle].speed - state.v_ego) * simulation.frame.dt;
        if steps < MIN_STEPS || gaps[vehicle] + by(vehicle) * (MIN_STEPS as f32) < lowest {
            return None;
        }
        let max_steps = steps;
        (steps, gaps[vehicle]) = carried(gaps[vehicle], by(vehicle), max_steps, lowest);
        if steps < max_steps && vehicle == 1 && gaps[0] != state.gaps[0] {
            gaps[0] = carried(state.gaps[0], by(0), steps, 0.0).1;
        }
    }
    (steps >= MIN_STEPS).then_some(Quiescent { steps, gaps })
}

/// Whether the next step changes nothing. A driver often follows so closely that rounding absorbs both the braking and
/// the change of the gap. Then no step changes anything before an event.
fn is_still<M: DriverModel<f32>>(
    simulation: &Simulation<f32, M>,
    lane: &LaneConstants<f32>,
    state: &LaneState<f32>,
    places: &[OtherState<f32>; 2],
) -> bool {
    // The rarest condition comes first: it decides most calls.
    let change = (places[0].speed - state.v_ego) * simulation.frame.dt;
    if state.gaps[0] + change != state.gaps[0] {
        return false;
    }
    // Destructures every field, so that a new field must be compared here or explicitly excluded.
    let bits = |state: &LaneState<f32>| {
        let &LaneState { index: _, v_ego, v_before, gaps, driver, reaction_step: _, record, over } = state;
        let (DriverState { deceleration, delay_steps }, Record { ttc, btn, min_gap: _, measures: _ }) =
            (driver, record);
        let TtcMinimum { failed: ttc_failed, gap: _, closing: _ } = ttc;
        let BrakeThreatMaximum { failed: btn_failed, numerator: _, denominator: _ } = btn;
        // A field that a model does not read is not stored: see `StateArrays::set`.
        let v_before = if M::SEES_OWN_ACCELERATION { v_before } else { 0.0 };
        let deceleration = if M::KEEPS_DECELERATION { deceleration } else { 0.0 };
        let numbers = [v_ego, v_before, gaps[0], gaps[1], deceleration];
        (numbers.map(f32::to_bits), delay_steps, [ttc_failed, btn_failed, over].map(Flag::holds))
    };
    bits(&advance(simulation, lane, state, places).state) == bits(state)
}

/// The vehicle is beside the ego's lane, where no contact, criterion or reaction is possible at any gap.
#[inline(always)]
pub(crate) fn is_out_of_the_way<M: DriverModel<f32>>(
    simulation: &Simulation<f32, M>,
    lane: &LaneConstants<f32>,
    other: &OtherConstants<f32>,
    place: &OtherState<f32>,
) -> Flag {
    let lateral_gap = place.position.abs() - other.half_widths;
    let judged = simulation.criteria.sees(0.0, other.half_lengths, lateral_gap, place.position, lane.ego_width);
    !lateral_gap.is_negative() & !judged & simulation.model.ignores(lateral_gap, place.towards, lane.marking_gap)
}

/// The gap down to which no event with a vehicle is possible; `None` if it is not in the ego's lane or already too
/// near.
fn quiescent_gap<M: DriverModel<f32>>(
    simulation: &Simulation<f32, M>,
    lane: &LaneConstants<f32>,
    state: &LaneState<f32>,
    places: &[OtherState<f32>; 2],
    vehicle: usize,
) -> Option<f32> {
    let (other, place) = (&lane.others[vehicle], &places[vehicle]);
    let (record, criteria, index) = (&state.record, simulation.criteria, state.index);
    if place.position.abs() - other.half_widths >= 0.0 {
        return None;
    }
    let of_criteria = criteria_safe_gap(criteria, record, state.v_ego - place.speed);
    // `larger` returns its second operand when unordered, so NaN propagates.
    let safe = of_criteria.larger(simulation.model.safe_gap(state.v_ego, place.speed));
    // A margin for rounding. A gap that does not shrink remains safe if it is safe now.
    let lowest = 1.001 * safe + 0.001;
    if lowest.is_nan() || lowest > state.gaps[vehicle] {
        return None;
    }
    // The safe distances only propose a gap; the step's own check decides.
    let ego = Ego::of(lane, state.v_ego, 0.0);
    let seen = see(simulation, &ego, other, place, lowest, index, Flag::TRUE);
    // Evaluates every criterion that the record holds.
    let Record { ttc, btn, .. } = update_record(criteria, record, &seen);
    let fails = (ttc.failed & !record.ttc.failed) | (btn.failed & !record.btn.failed);
    // The driver may not attend to the vehicle yet; then this underestimates the quiescent steps.
    let reacts = check(simulation, &seen, other, Flag::LATEST_STEP).is_unsafe;
    (!(fails | reacts).holds()).then_some(lowest)
}

/// Adds `change` repeatedly to a positive gap, with the rounding of a step, up to a maximum count and while the gap is
/// at least `lowest`. Returns the number of additions and the result.
///
/// Between two powers of two, binary32 numbers are equally spaced, so every addition advances by the same whole number
/// of spacings. A tie rounds to even, so ties end after one addition. Hence only a few additions per power of two are
/// computed.
fn carried(gap: f32, change: f32, max_steps: u32, lowest: f32) -> (u32, f32) {
    const BINADE: u32 = 1 << f32::MANTISSA_DIGITS >> 1;
    let (mut gap, mut made) = (gap, 0);
    while made < max_steps {
        let next = gap + change;
        if next < lowest || next <= 0.0 {
            break;
        }
        // This addition resolves ties; the next one gives the advance of every later addition.
        let (before, bits, after) = (gap.to_bits(), next.to_bits(), (next + change).to_bits());
        if bits == before || bits == after {
            // Rounding absorbs the change from here on.
            return (max_steps, next);
        }
        (gap, made) = (next, made + 1);
        let binade = bits / BINADE;
        if before / BINADE != binade || after / BINADE != binade {
            continue;
        }
        // The sum stays between the two powers of two, rounded or not, if it is one spacing inside both.
        let way = if after > bits {
            (binade + 1) * BINADE - 1 - bits
        } else {
            bits - (binade * BINADE + 1).max(lowest.to_bits()).min(bits)
        };
        let by = after.abs_diff(bits);
        let times = (way / by).min(max_steps - made);
        gap = f32::from_bits(if after > bits { bits + times * by } else { bits - times * by });
        made += times;
    }
    (made, gap)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drivers::Constants;
    use crate::frame::Frame;
    use crate::lane_case::NEVER;
    use crate::scene::Scene;
    use lanesweep_model::criterion::Criteria;
    use lanesweep_model::profile::Profile;
    use lanesweep_model::scenario::Category;

    /// Reference: the same by repeated addition.
    fn added(gap: f32, change: f32, max_steps: u32, lowest: f32) -> (u32, f32) {
        let mut gap = gap;
        for made in 0..max_steps {
            let next = gap + change;
            if next < lowest || next <= 0.0 {
                return (made, gap);
            }
            gap = next;
        }
        (max_steps, gap)
    }

    /// A pseudorandom word for each number.
    fn mixed(number: u64) -> u64 {
        let word = (number ^ number >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let word = (word ^ word >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        word ^ word >> 31
    }

    #[test]
    fn carried_gaps_are_the_sums_to_the_bit() {
        for number in 0..200_000_u64 {
            let word = mixed(number + 1);
            let unit = |shift: u32| f32::from((word >> shift) as u16) / 65536.0;
            let gap = 2f32.powf(unit(0) * 12.0 - 3.0);
            // From changes that rounding absorbs to changes that close the gap in one step.
            let size = 2f32.powf(unit(16) * 30.0 - 26.0);
            let change = if word >> 63 == 0 { size } else { -size };
            let lowest = if number % 3 == 0 { 0.0 } else { gap * unit(32) };
            let max_steps = (word >> 48) as u32 % 3000;
            assert_eq!(
                carried(gap, change, max_steps, lowest),
                added(gap, change, max_steps, lowest),
                "{gap:e} {change:e} {max_steps}"
            );
        }
    }

    /// Ties: changes of a whole number of spacings plus one half, from even and odd gaps, across powers of two.
    #[test]
    fn ties_are_settled_as_sums_settle_them() {
        for odd in 0..4_u32 {
            for whole in 0..40_i32 {
                for sign in [1.0, -1.0] {
                    let gap = f32::from_bits(8f32.to_bits() + 200 + odd);
                    let change = sign * (whole as f32 + 0.5) * (f32::from_bits(8f32.to_bits() + 1) - 8.0);
                    for max_steps in [0, 1, 2, 3, 7, 100, 1000] {
                        assert_eq!(
                            carried(gap, change, max_steps, 0.0),
                            added(gap, change, max_steps, 0.0),
                            "{odd} {change:e}"
                        );
                    }
                }
            }
        }
    }

    /// A lane with vehicles that keep speed and lateral position, at some step of its run.
    fn lane(number: u64) -> (LaneConstants<f32>, LaneState<f32>, [OtherState<f32>; 2]) {
        let mut drawn = 0;
        let mut between = |min: f32, max: f32| {
            drawn += 1;
            min + (max - min) * f32::from(mixed(64 * number + drawn) as u16) / 65536.0
        };
        let v_ego = between(0.0, 40.0);
        let place = |between: &mut dyn FnMut(f32, f32) -> f32| OtherState {
            speed: (v_ego + between(-8.0, 6.0)).max(0.0),
            position: if between(0.0, 1.0) < 0.6 { between(-1.0, 1.0) } else { between(-5.0, 5.0) },
            towards: if between(0.0, 1.0) < 0.8 { 0.0 } else { between(-1.0, 1.0) },
        };
        let places = [place(&mut between), place(&mut between)];
        let mut step = |never: f32, max: f32| if between(0.0, 1.0) < never { NEVER } else { between(0.0, max) as u32 };
        let mut other = || OtherConstants {
            half_lengths: 4.5,
            half_widths: 1.9,
            present_from: if step(0.9, 900.0) == NEVER { 0 } else { step(0.0, 900.0) },
            present_until: step(0.8, 2000.0).min(Flag::LATEST_STEP),
            attend_from: if step(0.8, 0.0) == NEVER { 0 } else { step(0.2, 2000.0).min(Flag::LATEST_STEP) },
            judged: Flag::of(step(0.8, 1.0) == NEVER),
        };
        let lane = LaneConstants {
            others: [other(), other()],
            ego_width: 1.9,
            marking_gap: 0.8,
            horizon: step(0.3, 2000.0).min(Flag::LATEST_STEP),
        };
        let first = between(-10.0, 150.0);
        let state = LaneState {
            index: between(1.0, 2990.0) as u32,
            v_ego,
            v_before: v_ego,
            gaps: [first, first + between(5.0, 60.0)],
            driver: DriverState { deceleration: 0.0, delay_steps: between(0.0, 5.0) as u32 },
            reaction_step: 0,
            record: Record {
                ttc: TtcMinimum { failed: Flag::of(between(0.0, 1.0) < 0.3), ..TtcMinimum::start() },
                btn: BrakeThreatMaximum { failed: Flag::of(between(0.0, 1.0) < 0.3), ..BrakeThreatMaximum::start() },
                ..Record::new()
            },
            over: Flag::FALSE,
        };
        (lane, state, places)
    }

    /// Skipped steps, made one by one, change only the gaps, and the gaps agree to the bit.
    fn nothing_happens<M: DriverModel<f32>>(simulation: &Simulation<f32, M>, name: &str) {
        let (mut found, mut lasting) = (0, 0);
        for number in 0..20_000 {
            let (lane, start, places) = lane(number);
            let quiescent = quiescent_steps(simulation, &lane, &start, &places);
            let slowing = LaneState { v_before: start.v_ego + 0.1, ..start };
            assert!(
                !M::SEES_OWN_ACCELERATION || quiescent_steps(simulation, &lane, &slowing, &places).is_none(),
                "{name}"
            );
            let Some(quiescent) = quiescent else { continue };
            make_one_by_one(simulation, &lane, &start, &places, &quiescent, &format!("{name}, lane {number}"));
            found += 1;
            lasting += u32::from(quiescent.steps > 500);
        }
        assert!(found > 200 && lasting > 20, "{name}: {found} found, {lasting} of them long");
    }

    /// Makes the skipped steps one by one; returns the lane after them.
    fn make_one_by_one<M: DriverModel<f32>>(
        simulation: &Simulation<f32, M>,
        lane: &LaneConstants<f32>,
        start: &LaneState<f32>,
        places: &[OtherState<f32>; 2],
        quiescent: &Quiescent,
        name: &str,
    ) -> LaneState<f32> {
        let mut state = *start;
        for _ in 0..quiescent.steps {
            state = advance(simulation, lane, &state, places).state;
            assert!(!state.over.holds(), "{name} ends at step {}: {quiescent:?}", state.index);
        }
        let failed = |state: &LaneState<f32>| [state.record.ttc.failed, state.record.btn.failed];
        assert_eq!(state.index, start.index + quiescent.steps);
        assert!(state.v_ego == start.v_ego && state.driver == start.driver, "{name}: {quiescent:?}");
        assert_eq!(failed(&state), failed(start), "{name}: {quiescent:?}");
        let vehicles = if simulation.scene.is_pair { 2 } else { 1 };
        for (vehicle, place) in places.iter().enumerate().take(vehicles) {
            let out_of_the_way = is_out_of_the_way(simulation, lane, &lane.others[vehicle], place).holds();
            let gone = start.index >= lane.others[vehicle].present_until;
            let gaps = (quiescent.gaps[vehicle], state.gaps[vehicle]);
            assert!(out_of_the_way || gone || gaps.0 == gaps.1, "{name}: {quiescent:?} {gaps:?}");
        }
        state
    }

    /// FSM approaches the leader's speed until rounding absorbs both braking and gap change. From there on one test
    /// skips all remaining steps, although every step is unsafe for the driver.
    #[test]
    fn one_who_follows_comes_to_stand_still_in_rounding() {
        let constants = Constants::<f32>::resolve(&Profile::load("paper").unwrap(), Category::Lvd);
        let frame = &Frame { step_cap: 6000, ..constants.frames[0] };
        let criteria = &Criteria { keeps_values: false, ..constants.criteria };
        let scene = Scene::in_lane();
        let simulation = Simulation { frame, criteria, model: &constants.fsm, model_index: 0, scene };
        let mut stood_still = 0;
        for number in 0..200 {
            let (lane, start, places) = lane(number);
            let speed = start.v_ego.max(5.0) - 0.01 * (number % 100) as f32;
            let place = OtherState { speed, position: 0.0, towards: 0.0 };
            let always =
                OtherConstants { present_from: 0, present_until: Flag::LATEST_STEP, attend_from: 0, ..lane.others[0] };
            let lane = LaneConstants { others: [always; 2], horizon: Flag::LATEST_STEP, ..lane };
            let mut state =
                LaneState { index: 1, v_ego: start.v_ego.max(5.0), v_before: start.v_ego.max(5.0), ..start };
            state.gaps = [state.v_ego * (1.5 + (number % 7) as f32 / 2.0); 2];
            let places = [place, places[1]];
            while !state.over.holds() && state.index < frame.step_cap {
                let Some(quiescent) = quiescent_steps(&simulation, &lane, &state, &places) else {
                    state = advance(&simulation, &lane, &state, &places).state;
                    continue;
                };
                let is_unsafe = advance(&simulation, &lane, &state, &places).hazard.is_unsafe.holds();
                stood_still += u32::from(is_unsafe);
                state = make_one_by_one(&simulation, &lane, &state, &places, &quiescent, &format!("lane {number}"));
                assert!(
                    !is_unsafe || state.index == frame.step_cap - ROWS as u32,
                    "lane {number}: {quiescent:?} is not all"
                );
            }
        }
        assert!(stood_still > 100, "{stood_still}");
    }

    #[test]
    fn in_steps_that_are_left_out_nothing_happens() {
        for name in Profile::names() {
            let profile = Profile::load(name).unwrap();
            let constants = Constants::<f32>::resolve(&profile, Category::CutIn);
            let frame = &Frame { abort_above_ttc: 0.0, step_cap: 3000, ..constants.frames[0] };
            let criteria = &Criteria { keeps_values: false, ..constants.criteria };
            for is_pair in [false, true] {
                let (model_index, scene) = (0, Scene::unknown(is_pair));
                macro_rules! check {
                    ($model:ident) => {
                        let model = &constants.$model;
                        let simulation = Simulation { frame, criteria, model, model_index, scene };
                        nothing_happens(&simulation, &format!("{name}, {}, pair {is_pair}", stringify!($model)));
                    };
                }
                check!(reg157);
                check!(cchdm);
                check!(rss);
                check!(fsm);
            }
        }
    }
}
