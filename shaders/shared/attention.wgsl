// First step at which a driver may react, from the other vehicle's motion alone: twin of
// src/model/driver/attention.rs.

const NEVER: u32 = 0xffffffffu;

const ATTENTION_ALWAYS: u32 = 0u;
const ATTENTION_VISIBLE_MOVEMENT: u32 = 1u;
const ATTENTION_WANDERING: u32 = 2u;
const ATTENTION_DECELERATION: u32 = 3u;

// A vehicle moves laterally above this change per step, m.
const MOVEMENT: f32 = 1e-9f;

// Condition on the principal vehicle's motion before a driver may react.
struct AttentionRule {
    kind: u32,
    delay_steps: u32,
    with_ahead: u32,
    threshold: f32,
    travel: f32,
}

// First step at which the driver may react to the principal vehicle and to the one ahead of it.
fn attend_from(rule: AttentionRule, steps: u32, half_widths: f32, motion: Motion) -> vec2<u32> {
    if rule.kind == ATTENTION_ALWAYS || steps == 0u {
        return vec2<u32>(0u, 0u);
    }
    let start = motion_lateral(motion, 0u).position;
    if rule.kind == ATTENTION_VISIBLE_MOVEMENT && abs(start) - half_widths <= rule.threshold {
        return vec2<u32>(0u, 0u);
    }
    let is_in_path = abs(start) <= half_widths;
    let comes_in = rule.with_ahead == 0u;
    if (rule.kind == ATTENTION_WANDERING) & (is_in_path == comes_in) {
        return vec2<u32>(0u, 0u);
    }
    var event = NEVER;
    var early = NEVER;
    var lateral_before = start;
    var speed_before = motion_speed(motion, 0u);
    for (var step = 0u; step < steps; step++) {
        let position = motion_lateral(motion, step).position;
        let v = motion_speed(motion, step);
        var happens = speed_before - v > rule.threshold;
        if rule.kind == ATTENTION_VISIBLE_MOVEMENT {
            happens = abs(position - lateral_before) > MOVEMENT;
        } else if rule.kind == ATTENTION_WANDERING {
            happens = abs(position - start) > rule.threshold;
        }
        if happens && event == NEVER {
            // Movement counts from the step before its first change.
            let begins_before = (rule.kind == ATTENTION_VISIBLE_MOVEMENT) & (step > 0u);
            event = select(step, step - 1u, begins_before) + rule.delay_steps;
        }
        if rule.kind == ATTENTION_WANDERING && early == NEVER && abs(position - start) > rule.travel {
            early = step;
        }
        // No later step can change which of the two comes first.
        if early != NEVER || (event != NEVER && (rule.kind != ATTENTION_WANDERING || step >= event)) {
            break;
        }
        lateral_before = position;
        speed_before = v;
    }
    let from_step = select(early, event, event < early);
    return vec2<u32>(from_step, select(0u, from_step, rule.with_ahead != 0u));
}
