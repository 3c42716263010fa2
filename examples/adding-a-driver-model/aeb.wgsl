// AEB: an automatic emergency brake after UN R152. Twin of src/model/driver/aeb.rs.

// s
override driver_trigger_ttc: f32;
// m/s² per step
override driver_jerk_per_step: f32;
// m/s²
override driver_max_deceleration: f32;
override driver_delay_steps: u32;

fn initial() -> DriverState {
    return DriverState(0.0, driver_delay_steps);
}

// Unsafe iff h ≤ 0 and dv > 0 and (g/dv ≤ trigger, multiplied out, or the ego is braking already): an intervention
// ends with the closing, not with a TTC that braking has just made longer.
fn check(view: View) -> bool {
    let dv = closing(view);
    let in_path = (view.lateral_gap <= 0.0) & (dv > 0.0);
    let soon = view.gap <= driver_trigger_ttc * dv;
    let intervening = view.a_ego < 0.0;
    return !is_behind(view) & in_path & (soon | intervening);
}

// Hold the speed for the delay, then ramp up to the largest deceleration.
fn react(state: DriverState, view: View) -> Reaction {
    let braking = smaller(state.deceleration + driver_jerk_per_step, driver_max_deceleration);
    return latched_braking(state, 0.0, braking, view.v_ego);
}
