// FSM: the Fuzzy Safety Model (Mattas et al. 2020; UN R157, Annex 3). Twin of src/model/driver/fsm.rs.

// τ, s
override driver_tau: f32;
// τ/2, s
override driver_half_tau: f32;
// m/s²
override driver_b_comf: f32;
// b_max − b_comf, m/s²
override driver_b_span: f32;
// 1/(2·b_comf), s²/m
override driver_half_inverse_comf: f32;
// 1/(2·b_max), s²/m
override driver_half_inverse_max: f32;
// 1/(2·b_lead), s²/m
override driver_half_inverse_lead: f32;
// d1, m
override driver_margin: f32;
// s
override driver_gate_margin: f32;
// The CFS step divides by the limited acceleration (the regulation) instead of the present one (the JRC).
override driver_limited_step: bool;
// m/s² per step
override driver_jerk_per_step: f32;
// m/s²
override driver_max_deceleration: f32;
override driver_delay_steps: u32;

// 0 beyond the safe distance, 1 below the unsafe one, linear between.
fn fuzzy(distance: f32, safe: f32, dangerous: f32) -> f32 {
    var value = 0.0;
    if distance >= safe {
        value = 0.0;
    } else if distance <= dangerous {
        value = 1.0;
    } else {
        value = exact_div(distance - safe, dangerous - safe);
    }
    return value;
}

// Proactive fuzzy surrogate of the leader's possible braking, 0…1.
fn pfs(v_ego: f32, v_other: f32, gap: f32) -> f32 {
    let reaction = v_ego * driver_tau;
    let lead_stop = v_other * v_other * driver_half_inverse_lead;
    let d_safe = reaction + v_ego * v_ego * driver_half_inverse_comf - lead_stop + driver_margin;
    let d_unsafe = reaction + v_ego * v_ego * driver_half_inverse_max - lead_stop;
    return fuzzy(gap - driver_margin, d_safe, d_unsafe);
}

// Critical fuzzy surrogate of the present closing, 0…1.
fn cfs(v_ego: f32, v_other: f32, gap: f32, a_ego: f32) -> f32 {
    let a_limited = larger(a_ego, -driver_b_comf);
    let v_new = v_ego + driver_tau * a_limited;
    let dv = v_ego - v_other;
    let a_step = select(a_ego, a_limited, driver_limited_step);
    let dv_new = v_new - v_other;
    let d_new = (v_ego + a_limited * driver_half_tau - v_other) * driver_tau;
    let d_safe = d_new + dv_new * dv_new * driver_half_inverse_comf;
    let d_unsafe = d_new + dv_new * dv_new * driver_half_inverse_max;
    var value = 0.0;
    if v_ego <= v_other {
        value = 0.0;
    } else if v_new < v_other {
        // g < dv²/(2|a|), multiplied out.
        let twice = gap + gap;
        value = select(0.0, 1.0, twice * abs(a_step) < dv * dv);
    } else {
        value = fuzzy(gap, d_safe, d_unsafe);
    }
    return value;
}

// Lateral gate, only for h > 0: closed while the other vehicle moves away, is faster, or needs more time to enter
// than the ego needs to pass it: h/w > (D + (L_e+L_o)/2)/dv + 0.1.
fn gate_is_open(view: View) -> bool {
    let dv = closing(view);
    let w = view.lateral_towards;
    let passing = view.gap + view.half_lengths + view.half_lengths;
    let slow = view.lateral_gap * dv > w * (passing + driver_gate_margin * dv);
    let closed = (w <= 0.0) | (dv < 0.0) | ((dv > 0.0) & slow);
    return (view.lateral_gap <= 0.0) | !closed;
}

fn initial() -> DriverState {
    return DriverState(0.0, driver_delay_steps);
}

// Unsafe iff the gate is open and CFS + PFS ≠ 0; demand CFS (b_max − b_comf) + b_comf if CFS > 0, else
// PFS·b_comf.
fn check(view: View) -> Hazard {
    let pfs = pfs(view.v_ego, view.v_other, view.gap);
    let cfs = cfs(view.v_ego, view.v_other, view.gap, view.a_ego);
    let surrogate = (pfs > 0.0) | (cfs > 0.0);
    let demand = select(pfs * driver_b_comf, cfs * driver_b_span + driver_b_comf, cfs > 0.0);
    return Hazard(!is_behind(view) & surrogate & gate_is_open(view), demand);
}

// Keep the speed for τ, then apply the demand: increases are limited to 12.65 m/s³, decreases act at once.
fn react(state: DriverState, hazard: Hazard, v_ego: f32) -> Reaction {
    let ramp = smaller(state.deceleration + driver_jerk_per_step, driver_max_deceleration);
    return latched_braking(state, 0.0, smaller(ramp, hazard.demand), v_ego);
}
