// View and state of a driver: twin of src/model/driver/mod.rs. A model defines `initial`, `check` and `react`, and its
// constants as `override driver_…`. Here `check` says only whether the view is unsafe, and `react` computes the demand of
// that view, because few steps need it.

struct View {
    v_ego: f32,
    a_ego: f32,
    v_other: f32,
    gap: f32,
    lateral_gap: f32,
    lateral_towards: f32,
    half_lengths: f32,
    marking_gap: f32,
}

struct DriverState {
    deceleration: f32,
    delay_steps: u32,
}

// A driver's answer to one unsafe step: the new state and the ego's next speed, m/s.
struct Reaction {
    state: DriverState,
    v_next: f32,
}

// dv = v_e − v_o: closing speed, m/s.
fn closing(view: View) -> f32 {
    return view.v_ego - view.v_other;
}

// x_e > x_o: the other vehicle's centre is behind the ego's.
fn is_behind(view: View) -> bool {
    return view.gap + view.half_lengths < 0.0;
}

// One unsafe step of any model. The ego coasts during the reaction time, which occurs once; then the deceleration is
// `braking`. The speed stops at 0.
fn latched_braking(state: DriverState, coasting: f32, braking: f32, v_ego: f32) -> Reaction {
    let is_delayed = state.delay_steps > 0u;
    let applied = select(braking, coasting, is_delayed);
    let deceleration = select(braking, state.deceleration, is_delayed);
    let delay_steps = select(0u, state.delay_steps - 1u, is_delayed);
    let v_next = larger(v_ego - applied * frame_dt, 0.0);
    return Reaction(DriverState(deceleration, delay_steps), v_next);
}
