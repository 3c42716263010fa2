// The frame: the start, one step and the outcome of a lane, with the latched step of all models. Twin of
// src/engine/lane_step.rs and src/engine/lane.rs.
//
// Order inside a step: the state at i gives the criteria and the contact, then the check, then v[i+1] (semi-implicit
// Euler), then the gap moves to i+1 (a contact between two steps holds it). The twin moves the gap first; the
// operations of a lane and their order are the same. The state is the gap, not the positions.

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
// Of two unsafe vehicles the one with the larger demand counts, not the nearer one.
override frame_largest_demand: bool;
// Position of the model in the registry.
override frame_model: u32;
// The sweep returns continuous values, not only verdicts.
override frame_values: bool;
// An invocation whose lane has ended takes the next one of its workgroup.
override frame_queue: bool;
// Steps between two looks for lanes that have ended, at most.
override frame_longest_burst: u32;
// What all lanes of a pipeline share: twin of `DeviceScene` in src/engine/scene.rs.
// Some cases have a second vehicle.
override scene_paired: bool;
// All have one.
override scene_all_paired: bool;
// Every vehicle is present from the first step to the last, and evaluated by the criteria.
override scene_always_there: bool;
// Drivers may react to every vehicle from the first step on.
override scene_attends: bool;
// A step may move a vehicle's centre past the ego's, so contacts between two steps are tested.
override scene_may_cross: bool;
// MOTION_… of the principal vehicle and of the one ahead.
override scene_speed_0: u32;
override scene_speed_1: u32;
override scene_lateral_0: u32;
override scene_lateral_1: u32;

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
    // The vehicles overlap across the road.
    across: bool,
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

// One other vehicle's motion at one step.
struct OtherState {
    speed: f32,
    lateral: LateralState,
}

// A lane at a step, before anything happens there; after its last step, at that step.
struct LaneState {
    gap_0: f32,
    gap_1: f32,
    other_0: OtherState,
    other_1: OtherState,
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
    // First step from which steps may be skipped.
    look_from: u32,
}

// What happens at a step.
struct Moment {
    first: Seen,
    second: Seen,
    record: Record,
    is_unsafe: bool,
    // The second vehicle determines the reaction.
    second_decides: bool,
    // Both are unsafe.
    both_unsafe: bool,
    touching: bool,
    touching_second: bool,
    aborting: bool,
    // The horizon is reached, and no further event is possible.
    is_settled: bool,
    is_standing: bool,
    ends: bool,
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
    let places = array<Between, 2>(place_at(lane, 0u), place_at(lane, 1u));
    var state = LaneState(
        gap_start + lane.others[0].gap_offset,
        gap_start + lane.others[1].gap_offset,
        other_at_start(lane.others[0], scene_speed_0, scene_lateral_0, places),
        other_at_start(lane.others[1], scene_speed_1, scene_lateral_1, places),
        initial(),
        lane.ego_speed,
        lane.ego_speed,
        NO_STEP,
        Record(ttc_nothing(), btn_nothing(), UNBOUNDED, measures_nothing()),
        0u,
        END_NOT_YET,
        0u,
        0.0,
        still_from(lane),
    );
    // Index 0 is the start itself, or one step after it.
    if frame_start_shift {
        state = move_gaps(state, lane);
    }
    return state;
}

fn place_at(lane: LaneCase, index: u32) -> Between {
    return series_place(lane.others[0].motion, scene_speed_0, index);
}

fn other_at_start(other: LaneOther, speed: u32, lateral: u32, places: array<Between, 2>) -> OtherState {
    let v = motion_speed(other.motion, speed, 0u, places[0]);
    return OtherState(v, motion_lateral_start(other.motion, lateral, places));
}

fn other_at(other: LaneOther, speed: u32, lateral: u32, index: u32, place: Between, before: OtherState) -> OtherState {
    let v = motion_speed(other.motion, speed, index, place);
    return OtherState(v, motion_lateral(other.motion, lateral, index, place, before.lateral.position));
}

fn is_pair(lane: LaneCase) -> bool {
    return scene_all_paired | (lane.pair != 0u);
}

// What happens at the state's step.
fn observe(state: LaneState, lane: LaneCase) -> Moment {
    let v_ego = state.v_ego;
    let ego = EgoState(v_ego, (v_ego - state.v_before) * frame_inverse_dt, lane.ego_width,
        (lane.lane_width - lane.ego_width) * 0.5);
    var moment: Moment;
    moment.first = see(ego, lane.others[0], state.other_0, scene_lateral_0, state.gap_0, state.index);
    moment.second = moment.first;
    moment.record = update_record(state.record, moment.first);
    moment.is_unsafe = attentive_check(moment.first, lane.others[0], state.index);
    moment.touching = is_touched(moment.first, lane.others[0]);
    moment.aborting = aborts(moment.first);
    var settled = is_settled(moment.first);
    var nearest = ttc_nothing();
    if frame_values {
        nearest = nearest_ttc(nearest, moment.first);
    }
    if scene_paired {
        if is_pair(lane) {
            let second = see(ego, lane.others[1], state.other_1, scene_lateral_1, state.gap_1, state.index);
            moment.second = second;
            moment.record = update_record(moment.record, second);
            if frame_values {
                nearest = nearest_ttc(nearest, second);
            }
            let other_is_unsafe = attentive_check(second, lane.others[1], state.index);
            // Of two unsafe vehicles the nearer one determines the reaction, or (`advance`) the one that demands more.
            moment.both_unsafe = moment.is_unsafe & other_is_unsafe;
            moment.second_decides = other_is_unsafe & (!moment.is_unsafe | (state.gap_1 < state.gap_0));
            moment.is_unsafe = moment.is_unsafe | other_is_unsafe;
            moment.touching_second = !moment.touching & is_touched(second, lane.others[1]);
            moment.touching = moment.touching | moment.touching_second;
            moment.aborting = moment.aborting | aborts(second);
            settled = settled & is_settled(second);
        }
    }
    if frame_values {
        let is_ahead = moment.first.present & (state.gap_0 >= 0.0) & (state.index >= 1u);
        let exposed = measures_expose(moment.record.measures, nearest);
        moment.record.measures =
            measures_encroach(exposed, moment.first.across, is_ahead, state.gap_0, v_ego, v_ego * frame_dt);
    }
    moment.is_unsafe = moment.is_unsafe | keeps_braking(state.driver, moment.first.view);
    let over = (state.index >= lane.horizon) & frame_end_when_settled;
    moment.is_settled = over & settled;
    moment.is_standing = over & (v_ego <= 0.0);
    moment.ends = moment.touching | moment.aborting | moment.is_settled | moment.is_standing
        | (state.index + 1u >= frame_step_cap);
    return moment;
}

// The state of a lane that ends at its step. The reason is evaluated once.
fn ended(before: LaneState, moment: Moment) -> LaneState {
    var state = before;
    state.end = END_CAP;
    state.end = select(state.end, END_SETTLED, moment.is_settled);
    state.end = select(state.end, END_STANDSTILL, moment.is_standing);
    state.end = select(state.end, END_ABORTED, moment.aborting);
    state.end = select(state.end, END_CONTACT, moment.touching);
    state.touched = select(0u, 1u, moment.touching_second);
    let v_closing = select(closing(moment.first.view), closing(moment.second.view), moment.touching_second);
    state.v_closing = select(0.0, v_closing, moment.touching);
    state.reaction_step = first_reaction(before, moment);
    return state;
}

fn first_reaction(state: LaneState, moment: Moment) -> u32 {
    return select(state.reaction_step, state.index, moment.is_unsafe & (state.reaction_step == NO_STEP));
}

// The state one step later.
fn advance(before: LaneState, moment: Moment, lane: LaneCase) -> LaneState {
    var state = before;
    state.reaction_step = first_reaction(before, moment);
    state.v_before = before.v_ego;
    if moment.is_unsafe {
        var view = moment.first.view;
        if scene_paired & moment.second_decides {
            view = moment.second.view;
        }
        var reaction = react(before.driver, view);
        if scene_paired & frame_largest_demand & moment.both_unsafe {
            // A driver brakes harder where the demand is larger, so the demands themselves are not compared.
            reaction = react(before.driver, moment.first.view);
            let other = react(before.driver, moment.second.view);
            if other.state.deceleration > reaction.state.deceleration {
                reaction = other;
            }
        }
        state.v_ego = reaction.v_next;
        state.driver = reaction.state;
    }
    state.index = before.index + 1u;
    let place = place_at(lane, state.index);
    state.other_0 = other_at(lane.others[0], scene_speed_0, scene_lateral_0, state.index, place, before.other_0);
    if scene_paired {
        state.other_1 = other_at(lane.others[1], scene_speed_1, scene_lateral_1, state.index, place, before.other_1);
    }
    return move_gaps(state, lane);
}

// The gaps one step after those of the state.
fn move_gaps(before: LaneState, lane: LaneCase) -> LaneState {
    var state = before;
    state.gap_0 = moved_gap(before.v_ego, lane.others[0], before.other_0, scene_lateral_0, before.gap_0, before.index);
    if scene_paired {
        if is_pair(lane) {
            state.gap_1 = moved_gap(before.v_ego, lane.others[1], before.other_1, scene_lateral_1, before.gap_1, before.index);
        }
    }
    return state;
}

// The gap one step after `before`; a contact between the two steps holds it.
fn moved_gap(v_ego: f32, other: LaneOther, place: OtherState, lateral: u32, before: f32, index: u32) -> f32 {
    let way = (v_ego - place.speed) * frame_dt;
    var after = before - way;
    if scene_may_cross {
        // With a smaller change, no centre passes another.
        if abs(way + way) > other.half_lengths {
            let across = is_across(abs(place.lateral.position) - other.half_widths, lateral);
            let stops = is_present(other, index) & is_judged(other) & across;
            after = select(after, held_in_contact(before, after, other.half_lengths), stops);
        }
    }
    return after;
}

fn is_present(other: LaneOther, index: u32) -> bool {
    return scene_always_there
        | ((other.used != 0u) & (index >= other.present_from) & (index < other.present_until));
}

fn is_judged(other: LaneOther) -> bool {
    return scene_always_there | (other.judged != 0u);
}

fn is_across(lateral_gap: f32, lateral: u32) -> bool {
    return (lateral == MOTION_CENTRED) | (lateral_gap < 0.0);
}

// `lateral`: what is known of the vehicle's lateral motion.
fn see(ego: EgoState, other: LaneOther, place: OtherState, lateral: u32, gap: f32, index: u32) -> Seen {
    let lateral_gap = abs(place.lateral.position) - other.half_widths;
    let view = View(ego.v, ego.a, place.speed, gap, lateral_gap, place.lateral.towards, other.half_lengths,
        ego.marking_gap);
    let across = is_across(lateral_gap, lateral);
    let present = is_present(other, index);
    let is_seen = criteria_sees(view, across, lateral == MOTION_CENTRED, place.lateral.position, ego.width);
    return Seen(view, across, present, present & is_judged(other) & is_seen);
}

fn update_record(record: Record, seen: Seen) -> Record {
    let gap = seen.view.gap;
    let dv = closing(seen.view);
    var measures = record.measures;
    if frame_values {
        measures = measures_update(measures, seen.judged, seen.view.v_ego, gap, dv);
    }
    return Record(
        ttc_update(record.ttc, seen.judged, gap, dv),
        btn_update(record.btn, seen.judged, gap, dv),
        select(record.min_gap, smaller(gap, record.min_gap), seen.judged & frame_values),
        measures,
    );
}

// The smaller TTC of the vehicles at one step.
fn nearest_ttc(nearest: TtcMinimum, seen: Seen) -> TtcMinimum {
    return ttc_update(nearest, seen.judged, seen.view.gap, closing(seen.view));
}

fn attentive_check(seen: Seen, other: LaneOther, index: u32) -> bool {
    let attends = scene_attends | (index >= other.attend_from[frame_model]);
    return check(seen.view) & seen.present & attends;
}

fn is_touched(seen: Seen, other: LaneOther) -> bool {
    let is_overlapping = overlaps(seen.view.gap, other.half_lengths, seen.across);
    return is_overlapping & seen.present & is_judged(other);
}

// No further event is possible with this vehicle: it is behind, out of the lane, or not slower.
fn is_settled(seen: Seen) -> bool {
    let in_lane = seen.judged | (seen.present & seen.across);
    return is_behind(seen.view) | !in_lane | (closing(seen.view) <= 0.0);
}

fn aborts(seen: Seen) -> bool {
    let overlap = seen.present & seen.across & !is_behind(seen.view);
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
        measures_min_thw_bits(state.record.measures),
        measures_max_drac_bits(state.record.measures),
        state.record.measures.tet_steps,
        state.record.measures.tit_sum * frame_dt,
        measures_pet_bits(state.record.measures),
    );
}
