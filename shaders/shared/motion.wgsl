// How another vehicle moves, decoded from its record and the shared tables: twin of src/model/motion.rs.

const SPEED_SAMPLED: u32 = 1u;
const LATERAL_SAMPLED: u32 = 2u;

// What is known of a motion before it is read: twin of `MotionKind` in src/engine/scene.rs.
const MOTION_ANALYTIC: u32 = 0u;
const MOTION_SAMPLED: u32 = 1u;
const MOTION_MIXED: u32 = 2u;
// In the middle of the ego's lane, always.
const MOTION_CENTRED: u32 = 3u;

struct LateralState {
    // m, signed.
    position: f32,
    // m/s, > 0 towards the ego.
    towards: f32,
}

// Whether a motion is sampled: by what is known, or by its own bit.
fn is_sampled(known: u32, bit: u32) -> bool {
    return (known == MOTION_SAMPLED) | ((known == MOTION_MIXED) & (bit != 0u));
}

// Speed at a step, m/s, ≥ 0.
fn motion_speed(motion: Motion, known: u32, step: u32) -> f32 {
    var speed = motion.speed_end;
    if is_sampled(known, motion.kind & SPEED_SAMPLED) {
        let at = select(motion.speed_len - 1u, step, step < motion.speed_len);
        speed = speed_table[motion.speed_offset + at];
    } else if step <= motion.speed_until {
        speed = larger(motion.speed_initial + f32(step) * motion.speed_per_step, 0.0);
    }
    return speed;
}

// Lateral position and speed at a step.
fn motion_lateral(motion: Motion, known: u32, step: u32) -> LateralState {
    var state = LateralState(motion.lateral_end, 0.0);
    if known == MOTION_CENTRED {
        state = LateralState(0.0, 0.0);
    } else if is_sampled(known, motion.kind & LATERAL_SAMPLED) {
        let inside = step < motion.lateral_len;
        let at = select(motion.lateral_len - 1u, step, inside);
        let sample = lateral_table[motion.lateral_offset + at];
        state = LateralState(sample.x, select(0.0, sample.y, inside));
    } else if step <= motion.lateral_until {
        state = LateralState(motion.lateral_initial + f32(step) * motion.lateral_per_step, motion.lateral_towards);
    }
    return state;
}
