//! Solvers in lane arithmetic: the f32 for which a rounded expression equals a value, and the two neighbours between
//! which a decision changes.

/// The number nearest to `guess` for which the non-decreasing `f` equals `target`; `None` if there is none or only a
/// subnormal one, which devices may flush.
pub(super) fn hit(target: f32, guess: f64, f: impl Fn(f32) -> f32) -> Option<f32> {
    let mut x = guess as f32;
    for _ in 0..8 {
        let y = f(x);
        if y == target {
            return (!x.is_subnormal()).then_some(x);
        }
        x = if y < target { x.next_up() } else { x.next_down() };
    }
    None
}

/// The nearest number below (`up` false) or above `x` with another value of `f`: if `f` rounds more coarsely than its
/// argument, one ULP changes nothing.
pub(super) fn next_other(x: f32, up: bool, f: impl Fn(f32) -> f32) -> f32 {
    let mut other = x;
    for _ in 0..1024 {
        other = if up { other.next_up() } else { other.next_down() };
        if f(other) != f(x) {
            break;
        }
    }
    other
}

/// The two neighbours in [low, high] between which `holds` changes from its value at `low` to that at `high`; `None`
/// if both are equal.
pub(super) fn turn(low: f32, high: f32, holds: impl Fn(f32) -> bool) -> Option<(f32, f32)> {
    let first = holds(low);
    if low >= high || holds(high) == first {
        return None;
    }
    let (mut from, mut to) = (ordered(low), ordered(high));
    while to - from > 1 {
        let middle = from + (to - from) / 2;
        if holds(number(middle)) == first { from = middle } else { to = middle }
    }
    Some((number(from), number(to)))
}

/// f32 as integers in the order of their values; both zeros are 0.
fn ordered(x: f32) -> i64 {
    let magnitude = i64::from(x.to_bits() & 0x7FFF_FFFF);
    if x.is_sign_negative() { -magnitude } else { magnitude }
}

fn number(ordered: i64) -> f32 {
    let magnitude = f32::from_bits(ordered.unsigned_abs() as u32);
    if ordered < 0 { -magnitude } else { magnitude }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_is_found_between_neighbours_on_either_side_of_zero() {
        for at in [-7.3_f32, -0.0, 0.25, 31.7] {
            let (below, above) = turn(-50.0, 90.0, |x| x < at).unwrap();
            assert!(below < at && above >= at && below.next_up() == above, "{at}: {below} {above}");
        }
        assert_eq!(turn(0.0, 1.0, |_| true), None);
    }

    #[test]
    fn the_next_other_number_is_past_the_rounding() {
        assert_eq!(next_other(1.0, true, |x| x), 1.0_f32.next_up());
        let other = next_other(0.5, true, |x| 4.0 - x);
        assert!(other > 0.5_f32.next_up() && 4.0 - other != 3.5 && 4.0 - other.next_down() == 3.5);
    }

    #[test]
    fn a_hit_is_exact_or_none() {
        let x = hit(0.1, 0.1 - 10.0, |x| x + 10.0);
        assert!(x.is_none_or(|x| x + 10.0 == 0.1));
        assert_eq!(hit(12.5, 2.5, |x| x + 10.0), Some(2.5));
        assert_eq!(hit(f32::MIN_POSITIVE, 0.0, |x| x + 10.0), None);
    }
}
