// First step at which a driver may react, from the other vehicle's motion alone: twin of
// src/model/driver/attention.rs.

const NEVER: u32 = 0xffffffffu;

const ATTENTION_ALWAYS: u32 = 0u;
const ATTENTION_VISIBLE_MOVEMENT: u32 = 1u;
const ATTENTION_CUTTING_IN: u32 = 2u;
const ATTENTION_CUTTING_OUT: u32 = 3u;
const ATTENTION_DECELERATION: u32 = 4u;

const BELOW_TRIGGER_DELAY_ONLY: u32 = 1u;

// A vehicle moves laterally above this change per step, m.
const MOVEMENT: f32 = 1e-9f;

// Sizes across the road that decide when the principal vehicle is perceived.
struct LaneGeometry {
    half_widths: f32,
    lane_width: f32,
    marking_gap: f32,
}

// Condition on the principal vehicle's motion before a driver may react.
struct AttentionRule {
    kind: u32,
    delay_steps: u32,
    below_trigger: u32,
    threshold: f32,
}

// Distance from the ego's path to the centre of the lane that a cutter comes from, m; from beyond the neighbouring lane,
// to its start.
fn lane_centre(start: f32, lane_width: f32) -> f32 {
    return select(lane_width, abs(start), abs(start) - lane_width > lane_width * 0.5);
}

// First step at which the driver may react to the principal vehicle and to the one ahead of it. Nothing after a step
// decides whether the driver reacts at that step.
fn attend_from(rule: AttentionRule, steps: u32, geometry: LaneGeometry, motion: Motion) -> vec2<u32> {
    if rule.kind == ATTENTION_ALWAYS || steps == 0u {
        return vec2<u32>(0u, 0u);
    }
    let place_start = series_place(motion, made_speed(), 0u);
    let start = motion_lateral(motion, made_lateral(), 0u, place_start, 0.0).position;
    let is_in_path = abs(start) <= geometry.half_widths;
    let has_intruded = abs(start) - geometry.half_widths <= geometry.marking_gap - rule.threshold;
    let is_seen = ((rule.kind == ATTENTION_VISIBLE_MOVEMENT) & has_intruded)
        | ((rule.kind == ATTENTION_CUTTING_IN) & is_in_path)
        | ((rule.kind == ATTENTION_CUTTING_OUT) & !is_in_path);
    if is_seen {
        return vec2<u32>(0u, 0u);
    }
    let centre = lane_centre(start, geometry.lane_width);
    let delay_only = (rule.kind == ATTENTION_DECELERATION) & (rule.below_trigger == BELOW_TRIGGER_DELAY_ONLY);
    var event = NEVER;
    var lateral_before = start;
    var speed_before = motion_speed(motion, made_speed(), 0u, place_start);
    for (var step = 0u; step < steps; step++) {
        let place = series_place(motion, made_speed(), step);
        let position = motion_lateral(motion, made_lateral(), step, place, 0.0).position;
        let v = motion_speed(motion, made_speed(), step, place);
        var happens = centre - abs(position) > rule.threshold;
        if rule.kind == ATTENTION_VISIBLE_MOVEMENT {
            happens = abs(position - lateral_before) > MOVEMENT;
        } else if rule.kind == ATTENTION_DECELERATION {
            happens = speed_before - v > rule.threshold;
        } else if rule.kind == ATTENTION_CUTTING_OUT {
            happens = abs(position) > rule.threshold;
        }
        if delay_only & !happens & (speed_before - v > 0.0) {
            event = step;
            break;
        }
        if happens {
            // Movement counts from the step before its first change.
            let begins_before = (rule.kind == ATTENTION_VISIBLE_MOVEMENT) & (step > 0u);
            event = select(step, step - 1u, begins_before) + rule.delay_steps;
            break;
        }
        lateral_before = position;
        speed_before = v;
    }
    let waits_with_ahead = (rule.kind == ATTENTION_CUTTING_OUT) | (rule.kind == ATTENTION_DECELERATION);
    return vec2<u32>(event, select(0u, event, waits_with_ahead));
}
