// How another vehicle moves, decoded from its record and the shared tables: twin of src/model/motion.rs.

const SPEED_SAMPLED: u32 = 1u;
const LATERAL_SAMPLED: u32 = 2u;

// What is known of a motion before it is read: twin of `MotionKind` in src/engine/scene.rs.
const MOTION_ANALYTIC: u32 = 0u;
const MOTION_SAMPLED: u32 = 1u;
const MOTION_MIXED: u32 = 2u;
// In the middle of the ego's lane, always.
const MOTION_CENTRED: u32 = 3u;
// Half a cosine between two speeds.
const MOTION_SINUSOID: u32 = 4u;
// Linear between instants of a reduced series, which a table holds.
const MOTION_INSTANTS: u32 = 5u;

// 1/s
override motion_inverse_dt: f32;

// sin(πx/2) on [0, 1] as x·p(x²).
const SINE_0: f32 = 1.5707963267948966f;
const SINE_1: f32 = -0.6459640975062463f;
const SINE_2: f32 = 0.07969262624616705f;
const SINE_3: f32 = -0.004681754135318688f;
const SINE_4: f32 = 0.00016044118478735982f;
const SINE_5: f32 = -3.598843235212085e-6f;

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

// The last entry of a series holds for all later steps.
fn entry(length: u32, step: u32) -> u32 {
    return select(length - 1u, step, step < length);
}

// sin(πx/2) for x in [0, 1].
fn quarter_sine(x: f32) -> f32 {
    let square = x * x;
    var sum = SINE_5;
    sum = sum * square + SINE_4;
    sum = sum * square + SINE_3;
    sum = sum * square + SINE_2;
    sum = sum * square + SINE_1;
    sum = sum * square + SINE_0;
    return x * sum;
}

// v0 − Δ·sin²(πt/2T) up to T, then v1 (paper, LVD ii), at an entry. `speed_per_step` is the phase.
fn sinusoidal_speed(motion: Motion, at: u32) -> f32 {
    let phase = f32(at) * motion.speed_per_step;
    let sine = quarter_sine(smaller(phase, 1.0));
    let change = motion.speed_initial - motion.speed_end;
    let speed = larger(motion.speed_initial - change * (sine * sine), 0.0);
    return select(motion.speed_end, speed, phase < 1.0);
}

// Position of a step between two instants of a reduced series.
struct Between {
    below: u32,
    share: f32,
}

// The position of a step in the series of a case, which the principal vehicle's motion holds: `speed_per_step` instants
// per step up to that of the last entry, `speed_end`.
fn series_place(principal: Motion, known: u32, step: u32) -> Between {
    var place = Between(0u, 0.0);
    if known == MOTION_INSTANTS {
        let position = smaller(f32(step) * principal.speed_per_step, principal.speed_end);
        let below = u32(position);
        place = Between(below, position - f32(below));
    }
    return place;
}

// A reduced series at a place: linear between its instants, which begin at `first`. The last one is there twice.
fn reduced_value(first: u32, place: Between) -> f32 {
    let below = speed_table[first + place.below];
    let above = speed_table[first + place.below + 1u];
    return below + (above - below) * place.share;
}

// Speed at a step, m/s, ≥ 0.
fn motion_speed(motion: Motion, known: u32, step: u32, place: Between) -> f32 {
    var speed = motion.speed_end;
    if known == MOTION_INSTANTS {
        speed = reduced_value(motion.speed_offset, place);
    } else if known == MOTION_SINUSOID {
        speed = sinusoidal_speed(motion, entry(motion.speed_len, step));
    } else if is_sampled(known, motion.kind & SPEED_SAMPLED) {
        speed = speed_table[motion.speed_offset + entry(motion.speed_len, step)];
    } else if step <= motion.speed_until {
        speed = larger(motion.speed_initial + f32(step) * motion.speed_per_step, 0.0);
    }
    return speed;
}

// Lateral position and speed at a step; `before` is the position one step before, m.
fn motion_lateral(motion: Motion, known: u32, step: u32, place: Between, before: f32) -> LateralState {
    var state = LateralState(motion.lateral_end, 0.0);
    if known == MOTION_CENTRED {
        state = LateralState(0.0, 0.0);
    } else if known == MOTION_INSTANTS {
        // w[i] = (|y[i−1]| − |y[i]|)/dt up to T, then 0.
        let position = reduced_value(motion.lateral_offset, place);
        let towards = (abs(before) - abs(position)) * motion_inverse_dt;
        state = LateralState(position, select(0.0, towards, step <= motion.lateral_until));
    } else if is_sampled(known, motion.kind & LATERAL_SAMPLED) {
        let sample = lateral_sample(motion.lateral_offset + entry(motion.lateral_len, step));
        state = LateralState(sample.x, select(0.0, sample.y, step < motion.lateral_len));
    } else if step <= motion.lateral_until {
        state = LateralState(motion.lateral_initial + f32(step) * motion.lateral_per_step, motion.lateral_towards);
    }
    return state;
}

// The same at step 0. A reduced series has w[0] = w[1].
fn motion_lateral_start(motion: Motion, known: u32, places: array<Between, 2>) -> LateralState {
    var state = motion_lateral(motion, known, 0u, places[0], 0.0);
    if known == MOTION_INSTANTS {
        let next = motion_lateral(motion, known, 1u, places[1], state.position);
        state.towards = select(0.0, next.towards, motion.lateral_len > 1u);
    }
    return state;
}
