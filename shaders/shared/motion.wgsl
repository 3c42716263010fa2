// How another vehicle moves, decoded from its record and the shared tables: twin of src/model/motion.rs.

const SPEED_SAMPLED: u32 = 1u;
const LATERAL_SAMPLED: u32 = 2u;

struct LateralState {
    // m, signed.
    position: f32,
    // m/s, > 0 towards the ego.
    towards: f32,
}

// Speed at a step, m/s, ≥ 0.
fn motion_speed(motion: Motion, step: u32) -> f32 {
    var speed = motion.speed_end;
    if (motion.kind & SPEED_SAMPLED) != 0u {
        let at = select(motion.speed_len - 1u, step, step < motion.speed_len);
        speed = speed_table[motion.speed_offset + at];
    } else if step <= motion.speed_until {
        speed = larger(motion.speed_initial + f32(step) * motion.speed_per_step, 0.0);
    }
    return speed;
}

// Lateral position and speed at a step.
fn motion_lateral(motion: Motion, step: u32) -> LateralState {
    var state = LateralState(motion.lateral_end, 0.0);
    if (motion.kind & LATERAL_SAMPLED) != 0u {
        let inside = step < motion.lateral_len;
        let at = select(motion.lateral_len - 1u, step, inside);
        let sample = lateral_table[motion.lateral_offset + at];
        state = LateralState(sample.x, select(0.0, sample.y, inside));
    } else if step <= motion.lateral_until {
        state = LateralState(motion.lateral_initial + f32(step) * motion.lateral_per_step, motion.lateral_towards);
    }
    return state;
}
