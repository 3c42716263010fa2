// FSM: the Fuzzy Safety Model (Mattas et al. 2020; UN R157, Annex 3). Twin of src/driver/fsm.rs.

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

// How dangerous a distance is. Not divided yet: only one of two surrogates is braked for.
struct Fuzzy {
    // What is missing to the safe distance, m; not positive where it is safe.
    short: f32,
    // From the safe distance down to the dangerous one, m.
    way: f32,
}

// 0 beyond the safe distance, 1 below the dangerous one, linear between.
fn fuzzy(distance: f32, safe: f32, dangerous: f32) -> Fuzzy {
    return Fuzzy(safe - distance, safe - dangerous);
}

// 0 (safe) to 1.
fn value(fuzzy: Fuzzy) -> f32 {
    var share = 0.0;
    if fuzzy.short > 0.0 {
        share = exact_div(fuzzy.short, larger(fuzzy.short, fuzzy.way));
    }
    return share;
}

// Proactive fuzzy surrogate of the leader's possible braking, 0…1.
fn pfs(v_ego: f32, v_other: f32, gap: f32) -> Fuzzy {
    let reaction = v_ego * driver_tau;
    let lead_stop = v_other * v_other * driver_half_inverse_lead;
    let d_safe = reaction + v_ego * v_ego * driver_half_inverse_comf - lead_stop + driver_margin;
    let d_unsafe = reaction + v_ego * v_ego * driver_half_inverse_max - lead_stop;
    return fuzzy(gap - driver_margin, d_safe, d_unsafe);
}

// Critical fuzzy surrogate of the present closing, 0…1.
fn cfs(v_ego: f32, v_other: f32, gap: f32, a_ego: f32) -> Fuzzy {
    let a_limited = larger(a_ego, -driver_b_comf);
    let v_new = v_ego + driver_tau * a_limited;
    let dv = v_ego - v_other;
    let a_step = select(a_ego, a_limited, driver_limited_step);
    let dv_new = v_new - v_other;
    let d_new = (v_ego + a_limited * driver_half_tau - v_other) * driver_tau;
    let d_safe = d_new + dv_new * dv_new * driver_half_inverse_comf;
    let d_unsafe = d_new + dv_new * dv_new * driver_half_inverse_max;
    // g < dv²/(2|a|), multiplied out.
    let is_short = (gap + gap) * abs(a_step) < dv * dv;
    let slower_then = Fuzzy(select(0.0, 1.0, is_short), 0.0);
    let faster_then = fuzzy(gap, d_safe, d_unsafe);
    let closes = v_ego > v_other;
    let is_slower = v_new < v_other;
    return Fuzzy(
        select(0.0, select(faster_then.short, slower_then.short, is_slower), closes),
        select(faster_then.way, slower_then.way, is_slower),
    );
}

// Lateral gate, only for h > 0: closed while the other vehicle moves away, while it is faster, or while it
// needs longer to come in than the ego needs to pass it: h/w > (D + (L_e+L_o)/2)/dv + 0.1.
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
    let is_critical = cfs.short > 0.0;
    let braked_for = Fuzzy(select(pfs.short, cfs.short, is_critical), select(pfs.way, cfs.way, is_critical));
    let surrogate = value(braked_for);
    let demand = select(surrogate * driver_b_comf, surrogate * driver_b_span + driver_b_comf, is_critical);
    return Hazard(!is_behind(view) & (surrogate > 0.0) & gate_is_open(view), demand);
}

// Hold the speed for τ, then the demand: reached with 12.65 m/s³ upwards, at once downwards.
fn react(state: DriverState, hazard: Hazard, v_ego: f32) -> Reaction {
    let ramp = smaller(state.deceleration + driver_jerk_per_step, driver_max_deceleration);
    return latched_braking(state, 0.0, smaller(ramp, hazard.demand), v_ego);
}
