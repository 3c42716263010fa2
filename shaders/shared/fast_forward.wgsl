// Quiescent steps, which verdict-only lanes skip between two bursts: twin of src/engine/cpu/fast_forward.rs, which has the
// reasons. Skipping changes no verdict; which steps are skipped need not be the same on both sides.

// Fewer steps are cheaper to make than to skip.
const MIN_SKIPPED: u32 = 64u;
// The longest burst remains, so that the lane ends in the regular way.
const LAST_STEPS: u32 = 32u;
// After a look in vain the next one is later.
const LOOK_AGAIN: u32 = 64u;
const BINADE: u32 = 0x800000u;
// More additions than a gap passes powers of two.
const MAX_ADDITIONS: u32 = 96u;

// Verdict-only lanes of a model that promises where it is safe.
override frame_skip: bool;
// 1/(2·threshold·a_max)
override btn_inverse_two_a_limit: f32;

// Where a vehicle stands between two steps.
struct Approach {
    // No contact, criterion or reaction is possible at any gap, or the vehicle is gone.
    out_of_the_way: bool,
    // No event is possible down to `lowest`, m.
    quiescent: bool,
    lowest: f32,
}

// First step from which the motions of all vehicles stay as they are.
fn still_from(lane: LaneCase) -> u32 {
    var still = motion_still_from(lane.others[0].motion, scene_speed_0, scene_lateral_0);
    if scene_paired {
        let other = motion_still_from(lane.others[1].motion, scene_speed_1, scene_lateral_1);
        still = select(still, other, is_pair(lane) & (other > still));
    }
    return still;
}

fn motion_still_from(motion: Motion, speed: u32, lateral: u32) -> u32 {
    var still = 0u;
    if (speed == MOTION_INSTANTS) | (speed == MOTION_SINUSOID) | is_sampled(speed, motion.kind & SPEED_SAMPLED) {
        still = motion.speed_len;
    } else if (motion.speed_per_step != 0.0) | (motion.speed_initial != motion.speed_end) {
        still = after_last(motion.speed_until);
    }
    var lateral_still = 0u;
    if (lateral == MOTION_INSTANTS) | is_sampled(lateral, motion.kind & LATERAL_SAMPLED) {
        lateral_still = motion.lateral_len;
    } else if lateral != MOTION_CENTRED {
        let rests = (motion.lateral_per_step == 0.0) & (motion.lateral_towards == 0.0)
            & (motion.lateral_initial == motion.lateral_end);
        lateral_still = select(after_last(motion.lateral_until), 0u, rests);
    }
    return select(still, lateral_still, lateral_still > still);
}

fn after_last(step: u32) -> u32 {
    return select(step, step + 1u, step < NO_STEP);
}

// The state after the quiescent steps that come next; the same state if there are too few. The other vehicles keep their
// motions for good.
fn skip_quiescent(before: LaneState, lane: LaneCase) -> LaneState {
    var state = before;
    state.look_from = before.index + LOOK_AGAIN;
    let v_ego = before.v_ego;
    let ego = EgoState(v_ego, 0.0, lane.ego_width, (lane.lane_width - lane.ego_width) * 0.5);
    let first = see(ego, lane.others[0], before.other_0, scene_lateral_0, before.gap_0, before.index);
    if keeps_braking(before.driver, first.view) {
        return state;
    }
    var steps = less(frame_step_cap, before.index + LAST_STEPS);
    steps = until_event(lane.others[0], before.index, steps);
    let approach = approach_of(before, ego, lane.others[0], before.other_0, scene_lateral_0, before.gap_0);
    var settled = approach.out_of_the_way | (v_ego <= before.other_0.speed);
    var is_quiescent = approach.out_of_the_way | approach.quiescent;
    var second = Approach(true, false, 0.0);
    if scene_paired {
        if is_pair(lane) {
            steps = until_event(lane.others[1], before.index, steps);
            second = approach_of(before, ego, lane.others[1], before.other_1, scene_lateral_1, before.gap_1);
            settled = settled & (second.out_of_the_way | (v_ego <= before.other_1.speed));
            is_quiescent = is_quiescent & (second.out_of_the_way | second.quiescent);
        }
    }
    if frame_end_when_settled & (settled | (v_ego <= 0.0)) {
        // The step at the horizon ends the lane.
        let left = less(lane.horizon, before.index);
        steps = select(steps, left, left < steps);
    }
    if !is_quiescent | (steps < MIN_SKIPPED) {
        return state;
    }
    // The gap of a vehicle out of the way is never read again.
    var carried_0 = Carried(steps, before.gap_0);
    if !approach.out_of_the_way {
        carried_0 = carried(before.gap_0, change_of(v_ego, before.other_0), steps, approach.lowest);
        steps = carried_0.steps;
    }
    var carried_1 = Carried(steps, before.gap_1);
    if !second.out_of_the_way & (steps >= MIN_SKIPPED) {
        carried_1 = carried(before.gap_1, change_of(v_ego, before.other_1), steps, second.lowest);
        if (carried_1.steps < steps) & !approach.out_of_the_way {
            carried_0 = carried(before.gap_0, change_of(v_ego, before.other_0), carried_1.steps, approach.lowest);
        }
        steps = carried_1.steps;
    }
    if steps < MIN_SKIPPED {
        return state;
    }
    state.index = before.index + steps;
    state.look_from = state.index;
    state.gap_0 = carried_0.gap;
    state.gap_1 = carried_1.gap;
    return state;
}

fn less(a: u32, b: u32) -> u32 {
    return select(0u, a - b, a > b);
}

// Steps up to the next one at which the vehicle appears, leaves or is attended to.
fn until_event(other: LaneOther, index: u32, steps: u32) -> u32 {
    var until = steps;
    if !scene_always_there {
        // A vehicle that is not there yet is waited for step by step.
        until = select(until, 0u, (other.used != 0u) & (index < other.present_from));
        let leaves = less(other.present_until, index);
        until = select(until, leaves, (leaves > 0u) & (leaves < until));
    }
    if !scene_attends {
        let attends = less(other.attend_from[frame_model], index);
        until = select(until, attends, (attends > 0u) & (attends < until));
    }
    return until;
}

// Change of the gap per step, m.
fn change_of(v_ego: f32, place: OtherState) -> f32 {
    return -((v_ego - place.speed) * frame_dt);
}

fn approach_of(
    state: LaneState,
    ego: EgoState,
    other: LaneOther,
    place: OtherState,
    lateral: u32,
    gap: f32,
) -> Approach {
    let is_gone = !scene_always_there & ((other.used == 0u) | (state.index >= other.present_until));
    let closing = ego.v - place.speed;
    var safe = larger(safe_gap(ego.v, place.speed), 0.0);
    if closing > 0.0 {
        safe = select(larger(safe, criteria_ttc_threshold * closing), safe, state.record.ttc.failed);
        let of_btn = closing * btn_ramp_delay + closing * closing * btn_inverse_two_a_limit;
        safe = select(larger(safe, of_btn), safe, state.record.btn.failed);
    }
    // A margin for rounding. The safe distances only propose a gap; the step's own check decides.
    let lowest = 1.001 * safe + 0.001;
    let seen = see(ego, other, place, lateral, lowest, state.index);
    let view = seen.view;
    // At any gap: evaluated as if the vehicle were just ahead.
    let near = criteria_sees(View(view.v_ego, 0.0, view.v_other, 0.0, view.lateral_gap, view.lateral_towards,
        view.half_lengths, view.marking_gap), seen.across, lateral == MOTION_CENTRED, place.lateral.position, ego.width);
    let beside = !seen.across & !near & ignores(view.lateral_gap, view.lateral_towards, view.marking_gap);
    let record = update_record(state.record, Seen(view, seen.across, true, true));
    let fails = (record.ttc.failed & !state.record.ttc.failed) | (record.btn.failed & !state.record.btn.failed);
    // A gap that falls below within the least number of steps is not worth a jump.
    let is_far = gap + change_of(ego.v, place) * f32(MIN_SKIPPED) >= lowest;
    let quiescent = seen.across & (lowest <= gap) & is_far & !fails & !check(view);
    return Approach(is_gone | beside, quiescent, lowest);
}

// Steps made, and the gap after them, m.
struct Carried {
    steps: u32,
    gap: f32,
}

// Adds `change` repeatedly to a positive gap, with the rounding of a step, up to a maximum count and while the gap is at
// least `lowest`.
fn carried(start: f32, change: f32, max_steps: u32, lowest: f32) -> Carried {
    var gap = start;
    var made = 0u;
    for (var k = 0u; k < MAX_ADDITIONS; k++) {
        let next = gap + change;
        if (made >= max_steps) | (next < lowest) | (next <= 0.0) {
            break;
        }
        // This addition resolves ties; the next one gives the advance of every later addition.
        let before = bitcast<u32>(gap);
        let bits = bitcast<u32>(next);
        let after = bitcast<u32>(next + change);
        if (bits == before) | (bits == after) {
            // Rounding absorbs the change from here on.
            return Carried(max_steps, next);
        }
        gap = next;
        made = made + 1u;
        let binade = bits / BINADE;
        if (before / BINADE == binade) & (after / BINADE == binade) {
            // The sum stays between the two powers of two, rounded or not, if it is one spacing inside both.
            let grows = after > bits;
            let floor_bits = select(binade * BINADE + 1u, bitcast<u32>(lowest), bitcast<u32>(lowest) > binade * BINADE + 1u);
            let way = select(less(bits, floor_bits), (binade + 1u) * BINADE - 1u - bits, grows);
            let by = select(bits - after, after - bits, grows);
            let whole = way / by;
            let times = select(max_steps - made, whole, whole < max_steps - made);
            gap = bitcast<f32>(select(bits - times * by, bits + times * by, grows));
            made = made + times;
        }
    }
    return Carried(made, gap);
}
