// Reg157: the performance model of UN R157, 5.2.5.2. Twin of src/model/driver/reg157.rs.

override driver_always_unsafe: bool;
override driver_only_while_closing: bool;
// m
override driver_lateral_gate: f32;
// m; 0: none
override driver_lane_intrusion: f32;
// 1/(2·deceleration), s²/m
override driver_half_inverse_deceleration: f32;
// reaction time + margin, s
override driver_constant: f32;
// m/s²
override driver_deceleration: f32;
override driver_delay_steps: u32;

// Lateral gap at the lane intrusion, m.
fn intrusion_gap(marking_gap: f32) -> f32 {
    return select(driver_lateral_gate, marking_gap - driver_lane_intrusion, driver_lane_intrusion > 0.0);
}

// TTC threshold dv/(2·6) + 0.35 + margin, s, at closing speed `dv`.
fn ttc_threshold(dv: f32) -> f32 {
    return dv * driver_half_inverse_deceleration + driver_constant;
}

// Distance beyond which `check` is safe, m.
fn safe_gap(v_ego: f32, v_other: f32) -> f32 {
    let dv = v_ego - v_other;
    return select(abs(dv) * ttc_threshold(dv), UNBOUNDED, driver_always_unsafe);
}

// A vehicle beside the ego is safe at every gap.
fn ignores(lateral_gap: f32, lateral_towards: f32, marking_gap: f32) -> bool {
    return !driver_always_unsafe & !(lateral_gap <= intrusion_gap(marking_gap));
}

fn initial() -> DriverState {
    return DriverState(0.0, driver_delay_steps);
}

// Unsafe iff h ≤ gate and |g/dv| ≤ dv/(2·6) + 0.35 + margin: absolute TTC, signed dv on the right; where a TTC exists
// only while the gap closes, dv > 0.
fn check(view: View) -> bool {
    let dv = closing(view);
    let near = view.lateral_gap <= intrusion_gap(view.marking_gap);
    let moves = (dv > 0.0) | ((dv < 0.0) & !driver_only_while_closing);
    let soon = moves & (abs(view.gap) <= abs(dv) * ttc_threshold(dv));
    return !is_behind(view) & (driver_always_unsafe | (near & soon));
}

// Hold the speed for 0.35 s, then brake at 6 m/s² at once, without a jerk limit.
fn react(state: DriverState, view: View) -> Reaction {
    return latched_braking(state, 0.0, driver_deceleration, view.v_ego);
}
