// CCHDM: the careful and competent human driver of UN R157, Annex 3. Twin of src/model/driver/cchdm.rs.

override driver_always_unsafe: bool;
override driver_until_equal_speeds: bool;
override driver_only_while_closing: bool;
// m
override driver_lateral_gate: f32;
// s
override driver_ttc: f32;
// s; 0 where the danger is a TTC
override driver_headway: f32;
// m
override driver_headway_tolerance: f32;
// m/s²
override driver_coasting: f32;
// m/s² per step
override driver_jerk_per_step: f32;
// m/s²
override driver_max_deceleration: f32;
override driver_delay_steps: u32;

// The gap that is a danger, m, at the ego's speed and a closing speed `dv`: from a headway, or from a TTC.
fn danger_gap(v_ego: f32, dv: f32) -> f32 {
    let closes = select(abs(dv), larger(dv, 0.0), driver_only_while_closing);
    return select(driver_ttc * closes, driver_headway * v_ego + driver_headway_tolerance, driver_headway > 0.0);
}

// Distance beyond which `check` is safe, m.
fn safe_gap(v_ego: f32, v_other: f32) -> f32 {
    return select(danger_gap(v_ego, v_ego - v_other), UNBOUNDED, driver_always_unsafe);
}

// A vehicle beside the ego is safe at every gap.
fn ignores(lateral_gap: f32, lateral_towards: f32, marking_gap: f32) -> bool {
    return !driver_always_unsafe & !(lateral_gap <= driver_lateral_gate);
}

// The ramp starts from the coasting deceleration: the first braking step is 0.4 + jerk·dt.
fn initial() -> DriverState {
    return DriverState(driver_coasting, driver_delay_steps);
}

// Unsafe iff h ≤ gate and |g/dv| ≤ 2.0 s. Where |TTC| of an opening gap counts, the driver keeps braking below the
// other's speed until that gap exceeds 2 s of |dv|. With a headway: unsafe iff h ≤ gate and g ≤ 2.0 s · v_e.
fn check(view: View) -> bool {
    let dv = closing(view);
    let near = view.lateral_gap <= driver_lateral_gate;
    let near_gap = danger_gap(view.v_ego, dv);
    let moves = (dv > 0.0) | ((dv < 0.0) & !driver_only_while_closing);
    let soon = select(moves & (abs(view.gap) <= near_gap), view.gap <= near_gap, driver_headway > 0.0);
    return !is_behind(view) & (driver_always_unsafe | (near & soon));
}

// A reaction that has begun goes on: to standstill in a cut-out, in a cut-in until the ego is no faster.
fn keeps_braking(state: DriverState, view: View) -> bool {
    let has_begun = (state.delay_steps != driver_delay_steps) | (state.deceleration > driver_coasting);
    let is_faster = driver_until_equal_speeds & (closing(view) > 0.0) & !is_behind(view);
    return ((driver_headway > 0.0) | is_faster) & has_begun;
}

// Coast at 0.4 m/s² during the delay, then ramp at 12.65 m/s³ up to 0.774 g.
fn react(state: DriverState, view: View) -> Reaction {
    let braking = smaller(state.deceleration + driver_jerk_per_step, driver_max_deceleration);
    return latched_braking(state, driver_coasting, braking, view.v_ego);
}
