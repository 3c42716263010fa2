//! Decimals of written numbers, and the value after reading them.

use super::number::REAL_LIMIT;

/// Decimals of the measured values in written files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Precision {
    /// Two, as highD has.
    #[default]
    Hundredths,
    /// The minimum number that reads back to the same `f64`.
    Shortest,
}

impl Precision {
    /// The value that the text of `value` reads as; `value` within ±10¹².
    pub(super) fn rounded(self, value: f64) -> f64 {
        match self {
            // One correctly rounded division of two exact integers equals the result of any correct parser.
            Precision::Hundredths => hundredths(value) as f64 / 100.0,
            Precision::Shortest => value,
        }
    }

    /// Appends the text of `value`.
    pub(super) fn push(self, line: &mut Vec<u8>, value: f64) {
        match self {
            Precision::Hundredths => {
                let count = hundredths(value);
                if count < 0 {
                    line.push(b'-');
                }
                let count = count.unsigned_abs();
                push_integer(line, count / 100);
                line.extend([b'.', b'0' + (count / 10 % 10) as u8, b'0' + (count % 10) as u8]);
            }
            Precision::Shortest => line.extend(value.to_string().into_bytes()),
        }
    }
}

/// Appends a whole number. Own code, because a recording has millions of them.
pub(super) fn push_integer(line: &mut Vec<u8>, value: u64) {
    let (mut digits, mut at, mut rest) = ([0u8; 20], 20, value);
    loop {
        at -= 1;
        digits[at] = b'0' + (rest % 10) as u8;
        rest /= 10;
        if rest == 0 {
            break;
        }
    }
    line.extend_from_slice(&digits[at..]);
}

/// Nearest number of hundredths of `value`; an integer has no negative zero.
fn hundredths(value: f64) -> i64 {
    (value.clamp(-REAL_LIMIT, REAL_LIMIT) * 100.0).round() as i64
}

#[cfg(test)]
mod tests {
    use super::super::number;
    use super::*;
    use proptest::prelude::*;

    fn text(precision: Precision, value: f64) -> String {
        let mut line = Vec::new();
        precision.push(&mut line, value);
        String::from_utf8(line).unwrap()
    }

    proptest! {
        #[test]
        fn reading_the_text_gives_the_rounded_value_bit_for_bit(value in -1e6..1e6f64) {
            for precision in [Precision::Hundredths, Precision::Shortest] {
                let read = number::real(text(precision, value).as_bytes()).unwrap();
                prop_assert_eq!(read.to_bits(), precision.rounded(value).to_bits());
                prop_assert_eq!(precision.rounded(read).to_bits(), read.to_bits());
            }
        }

        #[test]
        fn a_whole_number_is_spelled_as_the_standard_library_spells_it(value: u64) {
            let mut line = Vec::new();
            push_integer(&mut line, value);
            prop_assert_eq!(String::from_utf8(line).unwrap(), value.to_string());
        }
    }

    #[test]
    fn hundredths_look_as_in_highd() {
        let texts = [0.0, -0.0, -0.004, -0.05, 12.0, 12.345, -3.456].map(|value| text(Precision::Hundredths, value));
        assert_eq!(texts, ["0.00", "0.00", "0.00", "-0.05", "12.00", "12.35", "-3.46"]);
    }
}
