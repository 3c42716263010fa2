//! Round steps: 1, 2 or 5 times a power of ten.

/// 1, 2 or 5 times a power of ten, as digit and exponent.
pub(crate) type OneTwoFive = (u8, i32);

/// The largest 1, 2 or 5 times a power of ten that is not above `value` (positive, finite).
pub(crate) fn one_two_five(value: f64) -> OneTwoFive {
    // The shortest decimal text splits a float without rounding.
    let written = format!("{value:e}");
    let (mantissa, exponent) = written.split_once('e').unwrap_or((&written, "0"));
    let mantissa: f64 = mantissa.parse().unwrap_or(1.0);
    let digit = if mantissa >= 5.0 {
        5
    } else if mantissa >= 2.0 {
        2
    } else {
        1
    };
    (digit, exponent.parse().unwrap_or(0))
}

/// The neighbour above (`way` = 1) or below (-1).
pub(crate) fn next((digit, exponent): OneTwoFive, way: i32) -> OneTwoFive {
    match (digit, way > 0) {
        (1, true) => (2, exponent),
        (2, true) => (5, exponent),
        (_, true) => (1, exponent + 1),
        (1, false) => (5, exponent - 1),
        (2, false) => (1, exponent),
        (_, false) => (2, exponent),
    }
}

/// The smallest 1, 2 or 5 times a power of ten that is not below `step` (positive).
pub(crate) fn plain_step(step: f64) -> f64 {
    let step = step.max(f64::MIN_POSITIVE);
    let (digit, exponent) = one_two_five(step);
    let value = |(digit, exponent): OneTwoFive| format!("{digit}e{exponent}").parse().unwrap_or(step);
    let below: f64 = value((digit, exponent));
    if below >= step { below } else { value(next((digit, exponent), 1)) }
}
