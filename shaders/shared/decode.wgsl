// Point → validity and case: twin of src/engine/generated/decode.rs. The instants of a reduced
// sample's series are in its own part of a table.

// An event up to this many steps after a step counts as at that step.
const STEP_TOLERANCE: f32 = 1e-4f;
// Latest step of an event.
const MAX_STEPS: f32 = 1e6f;

// What is known of the principal vehicle's motions.
fn made_speed() -> u32 {
    return select(select(MOTION_ANALYTIC, MOTION_SINUSOID, recipe_path == PATH_SINUSOID), MOTION_INSTANTS,
        recipe_path == PATH_REDUCED);
}

fn made_lateral() -> u32 {
    return select(MOTION_ANALYTIC, MOTION_INSTANTS, (recipe_path == PATH_REDUCED) & recipe_changes_lane);
}

// Is the point inside the valid region?
fn is_valid(point: array<f32, MAX_PARAMETERS>) -> bool {
    for (var j = 0u; j < recipe_dimensions; j++) {
        if !((point[j] >= recipe.lower[j]) & (point[j] <= recipe.upper[j])) {
            return false;
        }
    }
    for (var k = 0u; k < recipe_bounded; k++) {
        let bound = recipe.bounds[k];
        var value = reduced_column(point, bound.column);
        if bound.is_distance != 0u {
            value = abs(value);
        }
        if !((value >= bound.lower) & (value <= bound.upper)) {
            return false;
        }
    }
    if recipe_decelerates {
        let initial = quantity(point, TARGET_SPEED);
        let end = quantity(point, FINAL_SPEED);
        if end >= initial {
            return false;
        }
        let duration = exact_div(initial - end, quantity(point, MEAN_DECELERATION));
        return (duration >= recipe.min_duration) & (duration <= recipe.longest_duration);
    }
    return true;
}

// The case of a valid point; its instants begin at this entry of the table.
fn decode_case(point: array<f32, MAX_PARAMETERS>, table_at: u32) -> LaneCase {
    var principal: Motion;
    var ahead: Motion;
    var ego_speed = 0.0;
    var lead_gap = 0.0;
    var horizon = 0u;
    if recipe_path == PATH_REDUCED {
        let duration = reduced_column(point, recipe.columns.duration);
        reduced_speed(point, recipe.columns.speed, duration, &principal, table_at);
        if recipe_changes_lane {
            reduced_lateral(point, duration, &principal, table_at + recipe_instants + 1u);
        }
        if recipe_pair {
            reduced_speed(point, recipe.columns.lead_speed, duration, &ahead, table_at + 2u * (recipe_instants + 1u));
        }
        ego_speed = reduced_column(point, recipe.columns.ego_speed);
        if recipe_pair {
            lead_gap = reduced_column(point, recipe.columns.lead_gap);
        }
        horizon = steps_up(duration * recipe.inverse_dt);
    } else {
        let initial = quantity(point, TARGET_SPEED);
        var duration = quantity(point, DURATION);
        if recipe_decelerates {
            let end = quantity(point, FINAL_SPEED);
            let deceleration = quantity(point, MEAN_DECELERATION);
            duration = exact_div(initial - end, deceleration);
            if recipe_path == PATH_SINUSOID {
                make_sinusoidal(initial, end, duration, &principal);
            } else {
                kinematic_speed(initial, -deceleration, duration, &principal);
                principal.speed_end = end;
            }
        } else {
            kinematic_speed(initial, quantity(point, TARGET_ACCELERATION), duration, &principal);
        }
        kinematic_speed(quantity(point, LEAD_SPEED), quantity(point, LEAD_ACCELERATION), duration, &ahead);
        let change = kinematic_lateral(quantity(point, LATERAL_SPEED), &principal);
        ego_speed = initial;
        if slot_of(EGO_SPEED) != NO_SLOT {
            ego_speed = quantity(point, EGO_SPEED);
        }
        lead_gap = quantity(point, LEAD_GAP);
        horizon = steps_up(larger(duration, change) * recipe.inverse_dt);
    }
    let headway_gap = quantity(point, TIME_HEADWAY) * ego_speed;
    var first = lane_other(principal, 0u, headway_gap, recipe.judged);
    var second = first;
    second.used = 0u;
    second.present_until = 0u;
    if recipe_pair {
        second = lane_other(ahead, 1u, headway_gap + (recipe.principal_length + lead_gap), 1u);
    }
    let steps = steps_seen(first.motion);
    let marking_gap = (recipe.lane_width - recipe.ego_width) * 0.5;
    let geometry = LaneGeometry(first.half_widths, recipe.lane_width, marking_gap);
    for (var model = 0u; model < MODELS; model++) {
        let begin = attend_from(recipe.attention[model], steps, geometry, first.motion);
        first.attend_from[model] = begin.x;
        second.attend_from[model] = begin.y;
    }
    var lane: LaneCase;
    lane.others[0] = first;
    lane.others[1] = second;
    lane.ego_speed = ego_speed;
    lane.ego_width = recipe.ego_width;
    lane.lane_width = recipe.lane_width;
    lane.horizon = horizon;
    lane.pair = select(0u, 1u, recipe_pair);
    return lane;
}

fn lane_other(motion: Motion, which: u32, gap_offset: f32, judged: u32) -> LaneOther {
    var other: LaneOther;
    other.motion = motion;
    other.half_lengths = recipe.half_lengths[which];
    other.half_widths = recipe.half_widths[which];
    other.gap_offset = gap_offset;
    other.present_until = NEVER;
    other.used = 1u;
    other.judged = judged;
    return other;
}

// The value of a quantity; 0 if no parameter has it.
fn quantity(point: array<f32, MAX_PARAMETERS>, which: u32) -> f32 {
    return value_of(point, slot_of(which));
}

// The value of a parameter; 0 if there is none.
fn value_of(point: array<f32, MAX_PARAMETERS>, slot: u32) -> f32 {
    var values = point;
    if slot == NO_SLOT {
        return 0.0;
    }
    return values[slot];
}

// A column of the vector that the coefficients of a point give.
fn reduced_column(point: array<f32, MAX_PARAMETERS>, column: u32) -> f32 {
    var coefficients = point;
    var value = number(column);
    for (var k = 0u; k < recipe_coefficients; k++) {
        value = value + coefficients[k] * number((k + 1u) * recipe.columns.width + column);
    }
    return value;
}

// A time in steps, rounded up.
fn steps_up(time: f32) -> u32 {
    let late = larger(smaller(time, MAX_STEPS) - STEP_TOLERANCE, 0.0);
    let below = u32(late);
    return select(below, below + 1u, late > f32(below));
}

fn less_one(steps: u32) -> u32 {
    return select(0u, steps - 1u, steps > 0u);
}

// Number of steps that contain all events of a motion, and a few more.
fn steps_seen(motion: Motion) -> u32 {
    var last = motion.speed_len;
    last = select(last, motion.lateral_len, motion.lateral_len > last);
    last = select(last, motion.speed_until, motion.speed_until > last);
    last = select(last, motion.lateral_until, motion.lateral_until > last);
    return select(recipe.step_cap, last + 2u, last + 2u < recipe.step_cap);
}

// Constant `acceleration` until `duration`, then constant speed.
fn kinematic_speed(initial: f32, acceleration: f32, duration: f32, motion: ptr<function, Motion>) {
    let until_step = less_one(steps_up(duration * recipe.inverse_dt));
    (*motion).speed_initial = initial;
    (*motion).speed_per_step = acceleration * recipe.dt;
    (*motion).speed_until = select(until_step, recipe.step_cap, recipe_unlimited);
    (*motion).speed_end = larger(initial + acceleration * duration, 0.0);
}

// Lateral motion at constant speed; returns the time of the lane change, s.
fn kinematic_lateral(lateral_speed: f32, motion: ptr<function, Motion>) -> f32 {
    let way = recipe.lane_change;
    if recipe_lateral == LATERAL_GONE {
        (*motion).lateral_initial = way;
        (*motion).lateral_end = way;
    }
    if recipe_lateral == LATERAL_GONE || recipe_lateral == LATERAL_CENTRED {
        return 0.0;
    }
    let change = exact_div(way, lateral_speed);
    let enters = recipe_lateral == LATERAL_ENTERING;
    let per_step = lateral_speed * recipe.dt;
    (*motion).lateral_until = less_one(steps_up(change * recipe.inverse_dt));
    (*motion).lateral_initial = select(0.0, way, enters);
    (*motion).lateral_per_step = select(per_step, -per_step, enters);
    (*motion).lateral_end = select(way, 0.0, enters);
    (*motion).lateral_towards = select(-lateral_speed, lateral_speed, enters);
    return change;
}

// Entries of a series of this duration.
fn entries(duration: f32) -> u32 {
    let steps = steps_up(duration * recipe.inverse_dt);
    return select(recipe.step_cap, steps, steps < recipe.step_cap) + 1u;
}

// v0 − Δ·sin²(πt/2T) up to T, then v1 (paper, LVD ii).
fn make_sinusoidal(initial: f32, end: f32, duration: f32, motion: ptr<function, Motion>) {
    (*motion).kind = (*motion).kind | SPEED_SAMPLED;
    (*motion).speed_len = entries(duration);
    (*motion).speed_initial = initial;
    (*motion).speed_end = end;
    (*motion).speed_per_step = exact_div(recipe.dt, duration);
}

// Instants per step of a series of this duration.
fn instants_per_step(duration: f32) -> f32 {
    return exact_div(f32(recipe_instants - 1u) * recipe.dt, duration);
}

// A speed series of the reduction: its instants, never below 0, the last one twice.
fn reduced_speed(
    point: array<f32, MAX_PARAMETERS>,
    first: u32,
    duration: f32,
    motion: ptr<function, Motion>,
    table_at: u32,
) {
    (*motion).kind = (*motion).kind | SPEED_SAMPLED;
    (*motion).speed_offset = table_at;
    (*motion).speed_len = entries(duration);
    let per_step = instants_per_step(duration);
    let last = recipe_instants - 1u;
    (*motion).speed_per_step = per_step;
    (*motion).speed_end = smaller(f32((*motion).speed_len - 1u) * per_step, f32(last));
    for (var instant = 0u; instant < recipe_instants; instant++) {
        speed_table[table_at + instant] = larger(reduced_column(point, first + instant), 0.0);
    }
    speed_table[table_at + recipe_instants] = larger(reduced_column(point, first + last), 0.0);
}

// The lateral series of the reduction: its instants, the last one twice, and the last step that moves, f32(step)·dt ≤ T.
fn reduced_lateral(
    point: array<f32, MAX_PARAMETERS>,
    duration: f32,
    motion: ptr<function, Motion>,
    table_at: u32,
) {
    let count = entries(duration);
    (*motion).kind = (*motion).kind | LATERAL_SAMPLED;
    (*motion).lateral_offset = table_at;
    (*motion).lateral_len = count;
    // The last entry is less than two steps after it.
    var last = count - 1u;
    for (var k = 0u; k < 2u; k++) {
        last = select(last, less_one(last), f32(last) * recipe.dt > duration);
    }
    (*motion).lateral_until = last;
    let first = recipe.columns.lateral;
    for (var instant = 0u; instant < recipe_instants; instant++) {
        speed_table[table_at + instant] = reduced_column(point, first + instant);
    }
    speed_table[table_at + recipe_instants] = reduced_column(point, first + recipe_instants - 1u);
}
