// CCHDM: the careful and competent human driver of UN R157, Annex 3. Twin of src/model/driver/cchdm.rs.

override driver_always_unsafe: bool;
// m
override driver_lateral_gate: f32;
// s
override driver_ttc: f32;
// m/s²
override driver_coasting: f32;
// m/s² per step
override driver_jerk_per_step: f32;
// m/s²
override driver_max_deceleration: f32;
override driver_delay_steps: u32;

// The ramp starts from the coasting deceleration: the first braking step is 0.4 + jerk·dt.
fn initial() -> DriverState {
    return DriverState(driver_coasting, driver_delay_steps);
}

// Unsafe iff h ≤ 0 and |g/dv| ≤ 2.0 s. Because of |TTC| the driver continues braking below the other's speed until
// the opening gap exceeds 2 s of |dv|.
fn check(view: View) -> Hazard {
    let dv = closing(view);
    let near = view.lateral_gap <= driver_lateral_gate;
    let soon = (dv != 0.0) & (abs(view.gap) <= driver_ttc * abs(dv));
    let is_unsafe = !is_behind(view) & (driver_always_unsafe | (near & soon));
    return Hazard(is_unsafe, driver_max_deceleration);
}

// Coast at 0.4 m/s² during the delay, then ramp at 12.65 m/s³ up to 0.774 g.
fn react(state: DriverState, hazard: Hazard, v_ego: f32) -> Reaction {
    let braking = smaller(state.deceleration + driver_jerk_per_step, hazard.demand);
    return latched_braking(state, driver_coasting, braking, v_ego);
}
