// Brake Threat Number: required over maximum available deceleration. Twin of src/model/criterion/btn.rs, which has
// the formulas. The host computes the quotient.

const BTN_EQUIVALENT_DELAY: u32 = 0u;
const BTN_EXACT: u32 = 1u;
const BTN_DISTANCE_RATIO: u32 = 2u;

override btn_form: u32;
override btn_threshold: f32;
// m/s²
override btn_a_max: f32;
// 2·a_max
override btn_two_a_max: f32;
// 2·threshold·a_max
override btn_two_a_limit: f32;
// a_max/(2j), s
override btn_ramp_delay: f32;
// threshold·a_max
override btn_a_limit: f32;
// 1/j
override btn_inverse_jerk: f32;
// 1/(12 j²)
override btn_quartic: f32;
// 8/(9j)
override btn_short_ramp: f32;
// 2j
override btn_two_jerk: f32;

// Maximum so far. A step never divides: closed forms keep a quotient (the distance ratio one of squares), the exact
// form a deceleration.
struct BrakeThreatMaximum {
    numerator: f32,
    denominator: f32,
    failed: bool,
}

// Initial value: 0.
fn btn_nothing() -> BrakeThreatMaximum {
    return BrakeThreatMaximum(0.0, 1.0, false);
}

// Value of a collision that counts: infinite.
fn btn_fail() -> BrakeThreatMaximum {
    return BrakeThreatMaximum(1.0, 0.0, true);
}

fn btn_raise(
    maximum: BrakeThreatMaximum,
    counts: bool,
    numerator: f32,
    denominator: f32,
    fails: bool,
) -> BrakeThreatMaximum {
    let higher = frame_values & counts & (numerator * maximum.denominator > maximum.numerator * denominator);
    return BrakeThreatMaximum(
        select(maximum.numerator, numerator, higher),
        select(maximum.denominator, denominator, higher),
        maximum.failed | (counts & fails),
    );
}

// Takes one step of a vehicle that is `seen` into account: gap g, m, and closing speed v, m/s.
fn btn_update(maximum: BrakeThreatMaximum, seen: bool, gap: f32, closing: f32) -> BrakeThreatMaximum {
    let counts = seen & (closing > 0.0);
    let touches = gap <= 0.0;
    var raised = maximum;
    if btn_form == BTN_EQUIVALENT_DELAY {
        let room = gap - closing * btn_ramp_delay;
        let hopeless = touches | (room <= 0.0);
        let numerator = closing * closing;
        let denominator = btn_two_a_max * room;
        // dv² is positive: without room this fails too.
        let fails = numerator > btn_two_a_limit * room;
        raised = btn_raise(maximum, counts, select(numerator, 1.0, hopeless), select(denominator, 0.0, hopeless), fails);
    } else if btn_form == BTN_DISTANCE_RATIO {
        // The quotient of squares: no root in the lane.
        var squared = btn_short_ramp * closing * closing * closing;
        if btn_ramp_ends(btn_a_max, closing) {
            let twice = btn_twice_distance_times_a(btn_a_max, closing);
            let distance = exact_div(twice, btn_two_a_max);
            squared = distance * distance;
        }
        let limit = btn_threshold * gap;
        let fails = touches | (squared > limit * limit);
        raised = btn_raise(maximum, counts, select(squared, 1.0, touches), select(gap * gap, 0.0, touches), fails);
    } else {
        // If the maximum so far avoids this collision too, no new solution is needed.
        let known = (maximum.denominator == 0.0) | !btn_needs_more(maximum.numerator, gap, closing);
        let fails = touches | btn_needs_more(btn_a_limit, gap, closing);
        let hopeless = touches | (gap * gap < btn_short_ramp * closing * closing * closing);
        var required = 0.0;
        if frame_values & counts & !known & !hopeless {
            required = btn_solve(gap, closing);
        }
        let numerator = select(required, 1.0, hopeless);
        raised = btn_raise(maximum, counts & (hopeless | !known), numerator, select(1.0, 0.0, hopeless), fails);
    }
    return raised;
}

// v ≥ a²/(2j): the ramp ends before the closing speed is gone.
fn btn_ramp_ends(a: f32, v: f32) -> bool {
    return btn_two_jerk * v >= a * a;
}

// 2a·D(a, v) of the long branch: v² + v a²/j − a⁴/(12 j²).
fn btn_twice_distance_times_a(a: f32, v: f32) -> f32 {
    let a2 = a * a;
    return v * v + v * a2 * btn_inverse_jerk - a2 * a2 * btn_quartic;
}

// D(a, v) > g: this deceleration does not avoid the collision. `a = 0` never does.
fn btn_needs_more(a: f32, gap: f32, v: f32) -> bool {
    let long = btn_twice_distance_times_a(a, v) > (a + a) * gap;
    let short = btn_short_ramp * v * v * v > gap * gap;
    return select(short, long, btn_ramp_ends(a, v));
}

// An interval that contains the required deceleration.
struct Bracket {
    low: f32,
    high: f32,
}

fn btn_halve(bracket: Bracket, gap: f32, v: f32) -> Bracket {
    let middle = (bracket.low + bracket.high) * 0.5;
    let more = btn_needs_more(middle, gap, v);
    return Bracket(select(bracket.low, middle, more), select(middle, bracket.high, more));
}

// Bisection on (0, 1 + 2jv], which holds (0, sqrt(2jv)]; D decreases with a there, so it always converges. Eighty
// halvings, eight per iteration, because llvmpipe limits all loops of an invocation together to 65,535 iterations.
fn btn_solve(gap: f32, v: f32) -> f32 {
    var bracket = Bracket(0.0, 1.0 + btn_two_jerk * v);
    for (var k = 0u; k < 10u; k++) {
        bracket = btn_halve(btn_halve(btn_halve(btn_halve(bracket, gap, v), gap, v), gap, v), gap, v);
        bracket = btn_halve(btn_halve(btn_halve(btn_halve(bracket, gap, v), gap, v), gap, v), gap, v);
    }
    return bracket.high;
}
