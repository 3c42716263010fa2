// The frame: the start, one step and the outcome of a lane, with the latched step of all models. Twin of
// src/engine/lane_step.rs and src/engine/lane.rs.
//
// Order inside a step: the gap moves to i (a contact between two steps holds it), the state at i gives the criteria and
// the contact, then the check, then v[i+1] (semi-implicit Euler). The state is the gap, not the positions.

// s
override frame_dt: f32;
// 1/s
override frame_inverse_dt: f32;
// At least 1.
override frame_step_cap: u32;
override frame_start_shift: bool;
override frame_end_when_settled: bool;
// s; off unless positive
override frame_abort_above_ttc: f32;
// Position of the model in the registry.
override frame_model: u32;
// At least one case has a second vehicle.
override frame_paired: bool;
// The sweep returns continuous values, not only verdicts.
override frame_values: bool;
// An invocation whose lane has ended takes the next one of its workgroup.
override frame_queue: bool;

const NO_STEP: u32 = 0xffffffffu;

const END_CONTACT: u32 = 0u;
const END_SETTLED: u32 = 1u;
const END_STANDSTILL: u32 = 2u;
const END_CAP: u32 = 3u;
const END_ABORTED: u32 = 4u;
const END_NOT_YET: u32 = 5u;

// One other vehicle at one step.
struct Seen {
    view: View,
    present: bool,
    judged: bool,
}

// The ego at one step.
struct EgoState {
    v: f32,
    a: f32,
    width: f32,
    // From the ego's side to the marking of its lane, m.
    marking_gap: f32,
}

// A lane at the beginning of a step; after its last step, at that step.
struct LaneState {
    gap_0: f32,
    gap_1: f32,
    driver: DriverState,
    v_ego: f32,
    v_before: f32,
    reaction_step: u32,
    record: Record,
    index: u32,
    // END_NOT_YET before the last step.
    end: u32,
    // The vehicle of a contact, and the closing speed at it.
    touched: u32,
    v_closing: f32,
}

// The initial gap, m, at the ego's initial speed, m/s.
fn start_gap(start: Start, v_ego: f32) -> f32 {
    let by_value = select(start.value * v_ego, start.value, start.kind == 1u);
    return select(by_value, min_following_gap(v_ego), start.kind == 2u);
}

// UN R157, 5.2.3.3.
fn min_following_gap(v: f32) -> f32 {
    let slow = 0.74285714286 + 0.12857142857 * v;
    let line = 1.0 + 0.036 * v;
    let thw = smaller(smaller(slow, line), 2.0);
    return larger(thw * v, 2.0);
}

fn start_lane(lane: LaneCase, start: Start) -> LaneState {
    let gap_start = start_gap(start, lane.ego_speed);
    return LaneState(
        gap_start + lane.others[0].gap_offset,
        gap_start + lane.others[1].gap_offset,
        initial(),
        lane.ego_speed,
        lane.ego_speed,
        NO_STEP,
        Record(ttc_nothing(), btn_nothing(), UNBOUNDED),
        0u,
        END_NOT_YET,
        0u,
        0.0,
    );
}

// One step.
fn advance(before: LaneState, lane: LaneCase) -> LaneState {
    var state = before;
    let index = state.index;
    let v_ego = state.v_ego;
    let ego = EgoState(v_ego, (v_ego - state.v_before) * frame_inverse_dt, lane.ego_width,
        (lane.lane_width - lane.ego_width) * 0.5);
    let first = see(ego, lane.others[0], state.gap_0, index);
    state.gap_0 = first.view.gap;
    state.record = update_record(state.record, first);
    var hazard = attentive_check(first, lane.others[0], index);
    var touching = is_touched(first, lane.others[0]);
    var touching_second = false;
    var v_closing = closing(first.view);
    var settled = is_settled(first);
    var aborting = aborts(first);
    if frame_paired {
        if lane.pair != 0u {
            let second = see(ego, lane.others[1], state.gap_1, index);
            state.gap_1 = second.view.gap;
            state.record = update_record(state.record, second);
            let other_hazard = attentive_check(second, lane.others[1], index);
            // The nearest unsafe vehicle determines the reaction.
            let nearer = other_hazard.is_unsafe & (!hazard.is_unsafe | (state.gap_1 < state.gap_0));
            hazard.is_unsafe = hazard.is_unsafe | nearer;
            hazard.demand = select(hazard.demand, other_hazard.demand, nearer);
            touching_second = !touching & is_touched(second, lane.others[1]);
            v_closing = select(v_closing, closing(second.view), touching_second);
            touching = touching | touching_second;
            settled = settled & is_settled(second);
            aborting = aborting | aborts(second);
        }
    }

    hazard.is_unsafe = hazard.is_unsafe | keeps_braking(state.driver, first.view);
    state.reaction_step = select(state.reaction_step, index, hazard.is_unsafe & (state.reaction_step == NO_STEP));
    let over = (index >= lane.horizon) & frame_end_when_settled;
    let is_capped = index + 1u >= frame_step_cap;
    // The reason for the end is evaluated once, not at every step.
    if touching | aborting | (over & (settled | (v_ego <= 0.0))) | is_capped {
        state.end = END_CAP;
        state.end = select(state.end, END_SETTLED, over & settled);
        state.end = select(state.end, END_STANDSTILL, over & (v_ego <= 0.0));
        state.end = select(state.end, END_ABORTED, aborting);
        state.end = select(state.end, END_CONTACT, touching);
        state.touched = select(0u, 1u, touching_second);
        state.v_closing = select(0.0, v_closing, touching);
    } else {
        let reaction = react(state.driver, hazard, v_ego);
        state.v_before = v_ego;
        state.v_ego = select(v_ego, reaction.v_next, hazard.is_unsafe);
        state.driver.deceleration = select(state.driver.deceleration, reaction.state.deceleration, hazard.is_unsafe);
        state.driver.delay_steps = select(state.driver.delay_steps, reaction.state.delay_steps, hazard.is_unsafe);
        state.index = index + 1u;
    }
    return state;
}

// `before`: the gap one step before. Step 0 is the start itself, unless index 0 is one step after it.
fn see(ego: EgoState, other: LaneOther, before: f32, index: u32) -> Seen {
    let v_other = motion_speed(other.motion, index);
    let lateral = motion_lateral(other.motion, index);
    let lateral_gap = abs(lateral.position) - other.half_widths;
    let present = (other.used != 0u) & (index >= other.present_from) & (index < other.present_until);
    let way = (v_other - ego.v) * frame_dt;
    var after = before + way;
    // With a smaller change, no centre passes another.
    if abs(way + way) > other.half_lengths {
        let stops = present & (other.judged != 0u) & (lateral_gap < 0.0);
        after = select(after, held_in_contact(before, after, other.half_lengths), stops);
    }
    let gap = select(before, after, (index > 0u) | frame_start_shift);
    let view = View(ego.v, ego.a, v_other, gap, lateral_gap, lateral.towards, other.half_lengths,
        ego.marking_gap);
    let judged = present & (other.judged != 0u)
        & criteria_sees(gap, other.half_lengths, lateral_gap, lateral.position, ego.width);
    return Seen(view, present, judged);
}

fn update_record(record: Record, seen: Seen) -> Record {
    let gap = seen.view.gap;
    let dv = closing(seen.view);
    return Record(
        ttc_update(record.ttc, seen.judged, gap, dv),
        btn_update(record.btn, seen.judged, gap, dv),
        select(record.min_gap, smaller(gap, record.min_gap), seen.judged & frame_values),
    );
}

fn attentive_check(seen: Seen, other: LaneOther, index: u32) -> Hazard {
    let hazard = check(seen.view);
    let attentive = seen.present & (index >= other.attend_from[frame_model]);
    return Hazard(hazard.is_unsafe & attentive, hazard.demand);
}

fn is_touched(seen: Seen, other: LaneOther) -> bool {
    let is_overlapping = overlaps(seen.view.gap, other.half_lengths, seen.view.lateral_gap);
    return is_overlapping & seen.present & (other.judged != 0u);
}

// No further event is possible with this vehicle: it is behind, out of the lane, or not slower.
fn is_settled(seen: Seen) -> bool {
    let in_lane = seen.judged | (seen.present & (seen.view.lateral_gap < 0.0));
    return is_behind(seen.view) | !in_lane | (closing(seen.view) <= 0.0);
}

fn aborts(seen: Seen) -> bool {
    let overlap = seen.present & (seen.view.lateral_gap < 0.0) & !is_behind(seen.view);
    let far = abs(seen.view.gap) > frame_abort_above_ttc * abs(closing(seen.view));
    return (frame_abort_above_ttc > 0.0) & overlap & far;
}

// The outcome of a lane after its last step.
fn outcome(state: LaneState, lane: LaneCase) -> OutcomeRecord {
    let collided = state.end == END_CONTACT;
    var touch = CONTACT_NONE;
    if collided {
        if state.touched == 0u {
            touch = contact(state.gap_0, lane.others[0].half_lengths);
        } else {
            touch = contact(state.gap_1, lane.others[1].half_lengths);
        }
    }
    var btn = state.record.btn;
    if collided & criteria_any_contact {
        btn = btn_fail();
    }
    let verdicts = select(0u, 1u, collided) | select(0u, 2u, state.record.ttc.failed) | select(0u, 4u, btn.failed)
        | select(0u, 8u, state.end == END_CAP);
    return OutcomeRecord(
        verdicts | (touch << 4u) | (state.touched << 6u) | (state.end << 8u),
        state.reaction_step,
        state.index,
        select(0.0, state.v_ego, collided),
        state.v_closing,
        ttc_value_bits(state.record.ttc),
        btn.numerator,
        btn.denominator,
        bounded_bits(state.record.min_gap),
    );
}
