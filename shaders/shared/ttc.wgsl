// Time to collision: gap over closing speed, 0 at contact. Twin of src/model/criterion/ttc.rs.

// s
override criteria_ttc_threshold: f32;

// Minimum TTC so far, as a quotient, so that a step never divides.
struct TtcMinimum {
    gap: f32,
    closing: f32,
    failed: bool,
}

// Initial value: infinite.
fn ttc_nothing() -> TtcMinimum {
    return TtcMinimum(1.0, 0.0, false);
}

// The value's bits, s, ≥ 0; infinite if the ego never closed in.
fn ttc_value_bits(minimum: TtcMinimum) -> u32 {
    var bits = INFINITY_BITS;
    if minimum.closing > 0.0 {
        bits = bitcast<u32>(exact_div(minimum.gap, minimum.closing));
    }
    return bits;
}

// Takes one step of a vehicle that is `seen` into account: fails iff max(g, 0) < threshold·dv, dv > 0. A threshold is
// not negative, so that the product is positive only if dv is.
fn ttc_update(minimum: TtcMinimum, seen: bool, signed_gap: f32, closing: f32) -> TtcMinimum {
    let limit = criteria_ttc_threshold * closing;
    let fails = seen & (limit > 0.0) & (signed_gap < limit);
    let gap = larger(signed_gap, 0.0);
    let is_smaller = frame_values & seen & (closing > 0.0) & (gap * minimum.closing < minimum.gap * closing);
    return TtcMinimum(
        select(minimum.gap, gap, is_smaller),
        select(minimum.closing, closing, is_smaller),
        minimum.failed | fails,
    );
}
