//! Numbers of the files: parsed from bytes, and written with a given number of decimals.
//!
//! Most of the reading time is spent here, so plain decimals have a fast path; the
//! standard library parses all others. Both round correctly, so the values are equal.

/// Powers of ten that `f64` holds exactly, for every number of decimals of a short number.
const EXACT_POWERS: [f64; EXACT_DIGITS + 1] =
    [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];

/// Digits below which any integer is exact in `f64` (10^15 < 2^53).
const EXACT_DIGITS: usize = 15;

/// Maximum magnitude of a recording's numbers. Sums and products of a few such numbers stay finite, and hundredths
/// are exact.
pub(super) const REAL_LIMIT: f64 = 1e12;

/// The number in a field; `None` if it is not a number. Infinities and NaN count as numbers. Blanks around the number
/// are allowed.
pub(super) fn real(field: &[u8]) -> Option<f64> {
    short_decimal(field).or_else(|| std::str::from_utf8(field).ok()?.trim().parse().ok())
}

/// The whole number in a field; `7.0` counts as 7, because data frames often write it so.
pub(super) fn integer(field: &[u8]) -> Option<i64> {
    let whole = |value: f64| (value.fract() == 0.0 && value.abs() < 1e15).then_some(value as i64);
    short_decimal(field).and_then(whole).or_else(|| {
        let text = std::str::from_utf8(field).ok()?.trim();
        text.parse().ok().or_else(|| whole(text.parse().ok()?))
    })
}

/// Clinger's exact case: a mantissa and a power of ten that `f64` both holds exactly give, by one
/// division, the correctly rounded value.
pub(super) fn short_decimal(field: &[u8]) -> Option<f64> {
    let (negative, digits) = match field {
        [b'-', rest @ ..] => (true, rest),
        _ => (false, field),
    };
    // One more byte than digits for the decimal point.
    if digits.is_empty() || digits.len() > EXACT_DIGITS + 1 {
        return None;
    }
    let mut mantissa = 0u64;
    let mut point = None;
    for (at, &byte) in digits.iter().enumerate() {
        let digit = byte.wrapping_sub(b'0');
        if digit < 10 {
            mantissa = mantissa * 10 + u64::from(digit);
        } else if byte == b'.' && point.is_none() {
            point = Some(at);
        } else {
            return None;
        }
    }
    let decimals = match point {
        Some(_) if digits.len() == 1 => return None,
        Some(at) => digits.len() - 1 - at,
        None if digits.len() > EXACT_DIGITS => return None,
        None => 0,
    };
    let value = mantissa as f64 / EXACT_POWERS[decimals];
    Some(if negative { -value } else { value })
}

/// The value that the text of `value` reads as; `value` within ±10¹².
pub(super) fn rounded(value: f64) -> f64 {
    // One correctly rounded division of two exact integers equals the result of any correct parser.
    hundredths(value) as f64 / 100.0
}

/// Appends a number with two decimals, as highD has.
pub(super) fn push_hundredths(line: &mut Vec<u8>, value: f64) {
    let count = hundredths(value);
    if count < 0 {
        line.push(b'-');
    }
    let count = count.unsigned_abs();
    push_integer(line, count / 100);
    line.extend([b'.', b'0' + (count / 10 % 10) as u8, b'0' + (count % 10) as u8]);
}

/// Appends a whole number; a recording has millions of them.
pub(super) fn push_integer(line: &mut Vec<u8>, value: impl itoa::Integer) {
    line.extend_from_slice(itoa::Buffer::new().format(value).as_bytes());
}

/// Nearest number of hundredths of `value`; an integer has no negative zero.
fn hundredths(value: f64) -> i64 {
    (value.clamp(-REAL_LIMIT, REAL_LIMIT) * 100.0).round() as i64
}
