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

// A surrogate as a quotient, 0…1: only a lane that brakes divides.
struct Surrogate {
    is_positive: bool,
    numerator: f32,
    denominator: f32,
}

// 0 beyond the safe distance, 1 below the unsafe one, linear between.
fn fuzzy(distance: f32, safe: f32, dangerous: f32) -> Surrogate {
    let is_dangerous = distance <= dangerous;
    return Surrogate(
        distance < safe,
        select(distance - safe, 1.0, is_dangerous),
        select(dangerous - safe, 1.0, is_dangerous),
    );
}

// Proactive fuzzy surrogate of the leader's possible braking.
fn pfs(v_ego: f32, v_other: f32, gap: f32) -> Surrogate {
    let reaction = v_ego * driver_tau;
    let lead_stop = v_other * v_other * driver_half_inverse_lead;
    let d_safe = reaction + v_ego * v_ego * driver_half_inverse_comf - lead_stop + driver_margin;
    let d_unsafe = reaction + v_ego * v_ego * driver_half_inverse_max - lead_stop;
    return fuzzy(gap - driver_margin, d_safe, d_unsafe);
}

// Critical fuzzy surrogate of the present closing.
fn cfs(v_ego: f32, v_other: f32, gap: f32, a_ego: f32) -> Surrogate {
    let a_limited = larger(a_ego, -driver_b_comf);
    let v_new = v_ego + driver_tau * a_limited;
    let dv = v_ego - v_other;
    let a_step = select(a_ego, a_limited, driver_limited_step);
    let dv_new = v_new - v_other;
    let d_new = (v_ego + a_limited * driver_half_tau - v_other) * driver_tau;
    let d_safe = d_new + dv_new * dv_new * driver_half_inverse_comf;
    let d_unsafe = d_new + dv_new * dv_new * driver_half_inverse_max;
    var value = fuzzy(gap, d_safe, d_unsafe);
    if v_new < v_other {
        // 1 if g < dv²/(2|a|), multiplied out, else 0.
        value = Surrogate((gap + gap) * abs(a_step) < dv * dv, 1.0, 1.0);
    }
    value.is_positive = value.is_positive & (v_ego > v_other);
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

// Distance beyond which CFS is 0 at every deceleration of the ego, rounding aside.
fn steady_gap(v_ego: f32, v_other: f32) -> f32 {
    let dv = larger(v_ego - v_other, 0.0);
    return dv * driver_tau + dv * dv * driver_half_inverse_comf;
}

fn initial() -> DriverState {
    return DriverState(0.0, driver_delay_steps);
}

// Unsafe iff the gate is open and CFS + PFS ≠ 0.
fn check(view: View) -> bool {
    var surrogate = pfs(view.v_ego, view.v_other, view.gap).is_positive;
    // With more room than any rounding takes, CFS is not computed.
    if !surrogate & (view.gap <= 1.001 * steady_gap(view.v_ego, view.v_other) + 0.001) {
        surrogate = cfs(view.v_ego, view.v_other, view.gap, view.a_ego).is_positive;
    }
    return !is_behind(view) & surrogate & gate_is_open(view);
}

// Demand CFS (b_max − b_comf) + b_comf if CFS > 0, else PFS·b_comf.
fn demand(view: View) -> f32 {
    var surrogate = pfs(view.v_ego, view.v_other, view.gap);
    let critical = cfs(view.v_ego, view.v_other, view.gap, view.a_ego);
    if critical.is_positive {
        surrogate = critical;
    }
    let value = exact_div(surrogate.numerator, surrogate.denominator);
    return select(value * driver_b_comf, value * driver_b_span + driver_b_comf, critical.is_positive);
}

// Keep the speed for τ, then apply the demand: increases are limited to 12.65 m/s³, decreases act at once.
fn react(state: DriverState, view: View) -> Reaction {
    var braking = 0.0;
    if state.delay_steps == 0u {
        let ramp = smaller(state.deceleration + driver_jerk_per_step, driver_max_deceleration);
        braking = smaller(ramp, demand(view));
    }
    return latched_braking(state, 0.0, braking, view.v_ego);
}
