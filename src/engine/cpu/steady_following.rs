//! Lanes in which the driver follows in steady state.
//!
//! A driver who keeps a comfortable distance from a vehicle at constant speed often closes in ever more slowly.
//! Hundreds of steps then change the speed, but no contact and no criterion is possible. Only
//! [`DriverModel::check_steady`], a part of the driver's check, can trigger, however hard the driver brakes.
//! Verdict-only batches make these steps together with similar lanes, with that part only. [`steady_steps`] returns for
//! how long this equals the whole step, to the bit.

use lanesweep_model::driver::DriverModel;
use lanesweep_model::scalar::Real;

use crate::cpu::ROWS;
use crate::frame::Simulation;
use crate::lane_step::{LaneConstants, LaneState, OtherState, criteria_safe_gap};

/// Maximum number of steps predicted at once; it bounds the rounding error of their gaps.
const MAX_STEPS: u32 = 1024;

/// Number of a lane's next steps that certainly follow steadily, at most `MAX_STEPS`. `state` is between two steps, at
/// `state.index` at least 1. The only other vehicle keeps the speed and lateral position in `place` forever.
pub(crate) fn steady_steps<M: DriverModel<f32>>(
    simulation: &Simulation<f32, M>,
    lane: &LaneConstants<f32>,
    state: &LaneState<f32>,
    place: &OtherState<f32>,
) -> u32 {
    let &Simulation { frame, criteria, model, scene, .. } = simulation;
    let (other, index, gap) = (&lane.others[0], state.index, state.gaps[0]);
    let in_lane = scene.in_lane || place.position.abs() - other.half_widths < 0.0 && index >= other.attend_from;
    let there = scene.always_there || index >= other.present_from && other.present_until >= frame.step_cap;
    // Behind a vehicle that drives backwards a lane can stop without being settled; steady-following steps do not test
    // this.
    if !in_lane || !there || state.driver.delay_steps > 0 || place.speed < 0.0 {
        return 0;
    }
    // The closing speed does not grow from here on, so a gap that is safe now is safe at every later closing speed.
    let closing = (state.v_ego - place.speed).max(0.0);
    let of_criteria = criteria_safe_gap(criteria, &state.record, closing);
    // `larger` returns its second operand when unordered, so NaN propagates.
    let safe = of_criteria.larger(model.steady_gap(state.v_ego, place.speed));
    // A relative margin of 1/1000 and a margin of 1 mm bound the rounding of distances and sums.
    let room = gap - (1.001 * safe + 0.001 * gap + 0.001);
    let by = 1.001 * closing * frame.dt;
    let max_steps = MAX_STEPS.min(frame.step_cap.saturating_sub(index + ROWS as u32));
    // Zero if there is no room or the bound is NaN.
    ((room / by) as u32).min(max_steps)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drivers::Constants;
    use crate::lane_step::{OtherConstants, Record, advance};
    use crate::outcome::NO_STEP;
    use crate::scene::Scene;
    use lanesweep_model::criterion::{BrakeThreatMaximum, Criteria, TtcMinimum};
    use lanesweep_model::driver::{DriverProfile, DriverState};
    use lanesweep_model::profile::Profile;
    use lanesweep_model::scalar::Flag;
    use lanesweep_model::scenario::Category;
    use lanesweep_random::philox4x32_10;

    /// A lane behind a vehicle that keeps its speed, at some step of its run: the ego brakes or has braked.
    fn lane(number: u32) -> (LaneConstants<f32>, LaneState<f32>, OtherState<f32>) {
        let mut drawn = 0;
        let mut between = |min: f32, max: f32| {
            drawn += 1;
            min + (max - min) * philox4x32_10([drawn, number, 0, 0], [11, 0])[0] as f32 / 2_f32.powi(32)
        };
        let speed = between(0.0, 40.0);
        let place = OtherState { speed, position: between(-2.2, 2.2), towards: 0.0 };
        let other = OtherConstants {
            half_lengths: 4.5,
            half_widths: 1.9,
            present_from: 0,
            present_until: Flag::LATEST_STEP,
            attend_from: if between(0.0, 1.0) < 0.9 { 0 } else { between(0.0, 3000.0) as u32 },
            judged: Flag::of(between(0.0, 1.0) < 0.9),
        };
        let horizon = if between(0.0, 1.0) < 0.5 { between(0.0, 3000.0) as u32 } else { Flag::LATEST_STEP };
        let lane = LaneConstants { others: [other; 2], ego_width: 1.9, marking_gap: 0.8, horizon };
        let v_ego = (speed + between(-0.2, 1.0) * between(0.0, 10.0)).max(0.0);
        let deceleration = between(0.0, 4.0);
        let state = LaneState {
            index: between(1.0, 2900.0) as u32,
            v_ego,
            v_before: v_ego + between(0.0, 1.0) * deceleration * 0.04,
            gaps: [v_ego * between(0.3, 3.0); 2],
            driver: DriverState { deceleration, delay_steps: u32::from(between(0.0, 1.0) < 0.05) },
            reaction_step: NO_STEP,
            record: Record {
                ttc: TtcMinimum { failed: Flag::of(between(0.0, 1.0) < 0.3), ..TtcMinimum::start() },
                btn: BrakeThreatMaximum { failed: Flag::of(between(0.0, 1.0) < 0.3), ..BrakeThreatMaximum::start() },
                ..Record::new()
            },
            over: Flag::FALSE,
        };
        (lane, state, place)
    }

    /// Steady-following steps equal whole steps: same speed, gap and deceleration, to the bit, and no verdict changes.
    /// A lane that ends during these steps is settled, at the first such step past the horizon.
    #[test]
    fn steady_following_steps_equal_the_whole_step() {
        for name in Profile::names() {
            let constants = Constants::<f32>::resolve(&Profile::load(name).unwrap(), Category::Lvd);
            let criteria = &Criteria { keeps_values: false, ..constants.criteria };
            let frame = &crate::frame::Frame { step_cap: 3000, abort_above_ttc: 0.0, ..constants.frames[3] };
            let whole =
                Simulation { frame, criteria, model: &constants.fsm, model_index: 3, scene: Scene::unknown(false) };
            let short = Simulation { scene: Scene { is_steady: true, ..Scene::in_lane() }, ..whole };
            let (mut steady_ones, mut braking, mut settled) = (0, 0, 0);
            for number in 0..20_000 {
                let (lane, start, place) = lane(number);
                let steps = steady_steps(&whole, &lane, &start, &place);
                let what = |index: u32| format!("{name}, lane {number}, step {index} of {}+{steps}", start.index);
                let mut state = start;
                for _ in 0..steps {
                    let index = state.index;
                    let of_steady = LaneState {
                        index: 1,
                        v_before: state.v_ego,
                        driver: DriverState { delay_steps: 0, ..state.driver },
                        ..state
                    };
                    let steady_ones = advance(&short, &lane, &of_steady, &[place; 2]).state;
                    let next = advance(&whole, &lane, &state, &[place; 2]).state;
                    let is_settled = state.v_ego <= place.speed && index >= lane.horizon;
                    assert_eq!(next.over.holds(), is_settled, "{}", what(index));
                    let failed = |state: &LaneState<f32>| [state.record.ttc.failed, state.record.btn.failed];
                    assert_eq!(failed(&next), failed(&start), "{}", what(index));
                    let moved = |state: &LaneState<f32>| (state.v_ego, state.gaps[0], state.driver.deceleration);
                    assert_eq!(moved(&steady_ones), moved(&next), "{}", what(index));
                    assert!(next.v_ego <= state.v_ego, "{}", what(index));
                    braking += u32::from(next.v_ego < state.v_ego);
                    state = next;
                    if is_settled {
                        settled += 1;
                        break;
                    }
                }
                steady_ones += u32::from(steps > 0);
            }
            assert!(
                steady_ones > 5000 && braking > 200_000 && settled > 200,
                "{name}: {steady_ones} {braking} {settled}"
            );
        }
    }

    /// A lane does not follow steadily if its driver does not attend yet or is delayed, if its leader is beside the lane
    /// or drives backwards, or near the step cap.
    #[test]
    fn a_driver_that_does_not_follow_is_not_steady() {
        let constants = Constants::<f32>::resolve(&Profile::load("paper").unwrap(), Category::Lvd);
        let frame = &constants.frames[3];
        let (criteria, model) = (&constants.criteria, &constants.fsm);
        let simulation = Simulation { frame, criteria, model, model_index: 3, scene: Scene::unknown(false) };
        let (lane, state, place) = lane(1);
        let lane = LaneConstants { others: [OtherConstants { attend_from: 0, ..lane.others[0] }; 2], ..lane };
        let driver = DriverState { deceleration: 0.0, delay_steps: 0 };
        let state = LaneState { index: 100, gaps: [80.0; 2], v_ego: 20.0, v_before: 20.0, driver, ..state };
        let place = OtherState { speed: 19.0, position: 0.0, ..place };
        let steps = |lane: &LaneConstants<f32>, state: &LaneState<f32>, place: &OtherState<f32>| {
            steady_steps(&simulation, lane, state, place)
        };
        assert!(steps(&lane, &state, &place) > 500);
        let with = |other: OtherConstants<f32>| LaneConstants { others: [other; 2], ..lane };
        let other = lane.others[0];
        assert_eq!(steps(&with(OtherConstants { attend_from: 101, ..other }), &state, &place), 0);
        assert_eq!(steps(&with(OtherConstants { present_from: 101, ..other }), &state, &place), 0);
        assert_eq!(steps(&with(OtherConstants { present_until: 150, ..other }), &state, &place), 0);
        assert_eq!(steps(&lane, &LaneState { driver: DriverState { delay_steps: 1, ..driver }, ..state }, &place), 0);
        assert_eq!(steps(&lane, &state, &OtherState { position: 3.5, ..place }), 0);
        assert_eq!(steps(&lane, &state, &OtherState { speed: -1.0, ..place }), 0);
        assert_eq!(steps(&lane, &LaneState { index: frame.step_cap - ROWS as u32, ..state }, &place), 0);
        // A smaller gap or a higher speed gives fewer steps.
        let nearer = LaneState { gaps: [10.0; 2], ..state };
        let faster = LaneState { v_ego: 25.0, ..state };
        let near = (steps(&lane, &nearer, &place), steps(&lane, &faster, &place));
        assert!(near.0 > 10 && near.0 < 250 && near.1 > 100 && near.1 < 500, "{near:?}");
        // A model makes no promise if its distance is NaN.
        let mut profile = Profile::load("paper").unwrap().fsm;
        profile.comfortable_deceleration_mps2 = 0.0;
        let model = &profile.resolve::<f32>(0.04, Category::Lvd);
        let place = OtherState { speed: state.v_ego, ..place };
        assert!(model.steady_gap(state.v_ego, place.speed).is_nan());
        assert_eq!(steady_steps(&Simulation { model, ..simulation }, &lane, &state, &place), 0);
        for gap in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert_eq!(steps(&lane, &LaneState { gaps: [gap; 2], ..state }, &place), 0, "{gap}");
        }
    }
}
