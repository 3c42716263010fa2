// The frame: one lane from start to end, with the latched step of all models. Twin of src/engine/lane_step.rs and
// src/engine/lane.rs.
//
// Order inside a step: the gap moves to i (a contact on the way holds it), the state at i gives the criteria and the
// contact, then the check, then v[i+1] (semi-implicit Euler). The state is the gap, not the positions.

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
}

// How a lane ended.
struct Last {
    end: u32,
    index: u32,
    touch: u32,
    touched: u32,
    v_ego: f32,
    closing: f32,
}

// Runs one lane.
fn run_lane(lane: LaneCase, start: Start) -> OutcomeRecord {
    let gap_start = select(start.value * lane.ego_speed, start.value, start.is_gap != 0u);
    var gap_0 = gap_start + lane.others[0].gap_offset;
    var gap_1 = gap_start + lane.others[1].gap_offset;
    var state = initial();
    var v_ego = lane.ego_speed;
    var v_before = v_ego;
    var reaction_step = NO_STEP;
    var record = Record(ttc_nothing(), btn_nothing(), UNBOUNDED);
    // Remains only if a device leaves the loop early.
    var last = Last(END_NOT_YET, 0u, CONTACT_NONE, 0u, 0.0, 0.0);
    for (var index = 0u; index < frame_step_cap; index++) {
        let a_ego = (v_ego - v_before) * frame_inverse_dt;
        let ego = EgoState(v_ego, a_ego, lane.ego_width);
        let first = see(ego, lane.others[0], gap_0, index);
        gap_0 = first.view.gap;
        record = judge(record, first);
        var hazard = attentive_check(first, lane.others[0], index);
        var touch = touches(first, lane.others[0]);
        var settled = is_settled(first);
        var touched = 0u;
        var aborting = aborts(first);
        var touched_closing = closing(first.view);
        if frame_paired {
            if lane.pair != 0u {
                let second = see(ego, lane.others[1], gap_1, index);
                gap_1 = second.view.gap;
                record = judge(record, second);
                let other_hazard = attentive_check(second, lane.others[1], index);
                // The nearest unsafe vehicle determines the reaction.
                let nearer = other_hazard.is_unsafe & (!hazard.is_unsafe | (gap_1 < gap_0));
                hazard.is_unsafe = hazard.is_unsafe | nearer;
                hazard.demand = select(hazard.demand, other_hazard.demand, nearer);
                let other_touch = touches(second, lane.others[1]);
                let by_other = touch == CONTACT_NONE;
                touched = select(0u, 1u, by_other);
                touched_closing = select(touched_closing, closing(second.view), by_other);
                touch = select(touch, other_touch, by_other);
                settled = settled & is_settled(second);
                aborting = aborting | aborts(second);
            }
        }

        let reaction = react(state, hazard, v_ego);
        let v_next = select(v_ego, reaction.v_next, hazard.is_unsafe);
        reaction_step = select(reaction_step, index, hazard.is_unsafe & (reaction_step == NO_STEP));
        let over = (index >= lane.horizon) & frame_end_when_settled;
        var end = END_NOT_YET;
        end = select(end, END_CAP, index + 1u >= frame_step_cap);
        end = select(end, END_SETTLED, over & settled);
        end = select(end, END_STANDSTILL, over & (v_ego <= 0.0));
        end = select(end, END_ABORTED, aborting);
        end = select(end, END_CONTACT, touch != CONTACT_NONE);
        if end != END_NOT_YET {
            last = Last(end, index, touch, touched, v_ego, touched_closing);
            break;
        }
        state.deceleration = select(state.deceleration, reaction.state.deceleration, hazard.is_unsafe);
        state.delay_steps = select(state.delay_steps, reaction.state.delay_steps, hazard.is_unsafe);
        v_before = v_ego;
        v_ego = v_next;
    }
    return outcome(record, reaction_step, last);
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
    let view = View(ego.v, ego.a, v_other, gap, lateral_gap, lateral.towards, other.half_lengths);
    let judged = present & (other.judged != 0u)
        & criteria_sees(gap, other.half_lengths, lateral_gap, lateral.position, ego.width);
    return Seen(view, present, judged);
}

fn judge(record: Record, seen: Seen) -> Record {
    let gap = seen.view.gap;
    let dv = closing(seen.view);
    return Record(
        ttc_update(record.ttc, seen.judged, gap, dv),
        btn_update(record.btn, seen.judged, gap, dv),
        select(record.min_gap, smaller(gap, record.min_gap), seen.judged),
    );
}

fn attentive_check(seen: Seen, other: LaneOther, index: u32) -> Hazard {
    let hazard = check(seen.view);
    let attentive = seen.present & (index >= other.attend_from[frame_model]);
    return Hazard(hazard.is_unsafe & attentive, hazard.demand);
}

fn touches(seen: Seen, other: LaneOther) -> u32 {
    let touch = contact(seen.view.gap, other.half_lengths, seen.view.lateral_gap);
    return select(CONTACT_NONE, touch, seen.present & (other.judged != 0u));
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

fn outcome(record: Record, reaction_step: u32, last: Last) -> OutcomeRecord {
    let collided = last.touch != CONTACT_NONE;
    var btn = record.btn;
    if collided & criteria_any_contact {
        btn = btn_fail();
    }
    let verdicts = select(0u, 1u, collided) | select(0u, 2u, record.ttc.failed) | select(0u, 4u, btn.failed)
        | select(0u, 8u, last.end == END_CAP);
    let touched = select(0u, last.touched, collided);
    return OutcomeRecord(
        verdicts | (last.touch << 4u) | (touched << 6u) | (last.end << 8u),
        reaction_step,
        last.index,
        select(0.0, last.v_ego, collided),
        select(0.0, last.closing, collided),
        ttc_value_bits(record.ttc),
        btn.numerator,
        btn.denominator,
        bounded_bits(record.min_gap),
    );
}
