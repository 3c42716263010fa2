// RSS: Responsibility-Sensitive Safety. Twin of src/model/driver/rss.rs.

// ρ, s
override driver_response_time: f32;
// a_acc·ρ²/2, m
override driver_response_distance: f32;
// ρ·a_acc, m/s
override driver_response_speed: f32;
// 1/(2·b_ego), s²/m
override driver_half_inverse_ego: f32;
// 1/(2·b_other), s²/m
override driver_half_inverse_other: f32;
// a_lat·ρ, m/s
override driver_lateral_response_speed: f32;
// 1/(2·a_lat), s²/m
override driver_half_inverse_lateral: f32;
// ρ/2, s
override driver_half_response_time: f32;
// m
override driver_lateral_margin: f32;
// m/s² per step
override driver_jerk_per_step: f32;
// m/s²
override driver_max_deceleration: f32;
override driver_delay_steps: u32;

// d_lon = v_e ρ + a_acc ρ²/2 + (v_e + ρ a_acc)²/(2 b_ego) − v_o²/(2 b_other), m; may be negative.
fn longitudinal_distance(v_ego: f32, v_other: f32) -> f32 {
    let v_response = v_ego + driver_response_speed;
    return v_ego * driver_response_time + driver_response_distance + v_response * v_response * driver_half_inverse_ego
        - v_other * v_other * driver_half_inverse_other;
}

// d_lat = μ + (2|v_y| + a_lat ρ) ρ/2 + (|v_y| + a_lat ρ)²/(2 a_lat), m; direction ignored.
fn lateral_distance(lateral_speed: f32) -> f32 {
    let v_y = abs(lateral_speed);
    let v_response = v_y + driver_lateral_response_speed;
    return driver_lateral_margin
        + (v_y + v_response) * driver_half_response_time
        + v_response * v_response * driver_half_inverse_lateral;
}

// Distance beyond which `check` is safe, m.
fn safe_gap(v_ego: f32, v_other: f32) -> f32 {
    return longitudinal_distance(v_ego, v_other);
}

// A vehicle beside the ego is safe at every gap.
fn ignores(lateral_gap: f32, lateral_towards: f32, marking_gap: f32) -> bool {
    return !(lateral_gap < lateral_distance(lateral_towards));
}

fn initial() -> DriverState {
    return DriverState(0.0, driver_delay_steps);
}

// Unsafe iff g < d_lon and h < d_lat.
fn check(view: View) -> bool {
    let close = view.gap < longitudinal_distance(view.v_ego, view.v_other);
    let beside = view.lateral_gap < lateral_distance(view.lateral_towards);
    return !is_behind(view) & close & beside;
}

// Keep the speed for ρ, then ramp from 0 at 12.65 m/s³ up to 0.774 g.
fn react(state: DriverState, view: View) -> Reaction {
    let braking = smaller(state.deceleration + driver_jerk_per_step, driver_max_deceleration);
    return latched_braking(state, 0.0, braking, view.v_ego);
}
