//! Numbers for people: thousands separators, at most four significant digits, ∞ and – instead of `inf` and `NaN`. Every
//! text and page uses them; files have every digit. Also round steps: 1, 2 or 5 times a power of ten.

/// Significant digits of a number for people.
const DIGITS: usize = 4;

/// Formats a whole number: `1,234,567`.
pub fn count(number: impl TryInto<i128> + ToString) -> String {
    grouped(&number.to_string())
}

/// Formats a count with its noun: `1 scenario`, `2 scenarios`.
pub fn counted(length: usize, noun: &str) -> String {
    format!("{} {noun}{}", count(length), if length == 1 { "" } else { "s" })
}

/// Formats a quantity with at most four significant digits and no trailing zeros: `0.45`, `36`, `1,235`, `3.2e-9`, `∞`.
pub fn value(value: f64) -> String {
    plain(value, DIGITS)
}

/// Formats a quantity with at most this many significant digits and without trailing zeros.
pub fn plain(value: f64, digits: usize) -> String {
    let text = significant(value, digits);
    let (digits, power) = text.split_at(text.find('e').unwrap_or(text.len()));
    match digits.contains('.') {
        true => format!("{}{power}", digits.trim_end_matches('0').trim_end_matches('.')),
        false => text,
    }
}

/// Formats a number in a unit, of which so many are in one SI unit, with the fewest digits that give the same SI value back.
pub fn exact(si: f64, per_si: f64) -> String {
    let with = |digits: usize| format!("{:.digits$e}", si * per_si).parse().unwrap_or(f64::NAN);
    let found = (0..17).map(with).find(|number: &f64| number / per_si == si);
    found.unwrap_or(si * per_si).to_string()
}

/// Formats a number with a fixed number of significant digits, so that columns align: `0.450`, `36.0`. Below 0.001 and
/// from 10⁹ it uses powers of ten.
pub fn significant(value: f64, digits: usize) -> String {
    if value.is_nan() {
        return "–".to_owned();
    }
    if value.is_infinite() {
        return if value > 0.0 { "∞" } else { "-∞" }.to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    // Round once, in decimal: 999.96 has the exponent of 1,000.
    let rounded = format!("{value:.*e}", digits.saturating_sub(1));
    let Some((mantissa, exponent)) = rounded.split_once('e') else { return rounded };
    match exponent.parse::<i32>() {
        Ok(exponent @ -3..=8) => {
            let whole: f64 = rounded.parse().unwrap_or(value);
            let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
            grouped(&format!("{whole:.decimals$}"))
        }
        _ => format!("{mantissa}e{exponent}"),
    }
}

/// Formats a time in the unit that a person uses: `0.30 s`, `61 s`, `15 min`, `10.0 h`, `3 days`.
pub fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 10.0 => format!("{s:.2} s"),
        s if s < 600.0 => format!("{s:.0} s"),
        s if s < 7200.0 => format!("{:.0} min", s / 60.0),
        s if s < 172_800.0 => format!("{:.1} h", s / 3600.0),
        s => format!("{} days", value(s / 86_400.0)),
    }
}

/// Inserts thousands separators into the integer part of a decimal number.
fn grouped(number: &str) -> String {
    let (sign, number) = number.split_at(usize::from(number.starts_with('-')));
    let (whole, fraction) = number.split_at(number.find('.').unwrap_or(number.len()));
    let head = whole.len() % 3;
    let mut groups: Vec<&str> = if head > 0 { vec![&whole[..head]] } else { Vec::new() };
    groups.extend((head..whole.len()).step_by(3).map(|at| &whole[at..at + 3]));
    format!("{sign}{}{fraction}", groups.join(","))
}

/// The smallest 1, 2 or 5 times a power of ten that is at least `step` (positive).
pub fn plain_step(step: f64) -> f64 {
    let step = step.max(f64::MIN_POSITIVE);
    // The shortest decimal text gives digits and exponent without rounding.
    let written = format!("{step:e}");
    let (mantissa, exponent) = written.split_once('e').unwrap_or((&written, "0"));
    let mantissa = mantissa.parse().unwrap_or(1.0);
    let digits = [1.0, 2.0, 5.0, 10.0].into_iter().find(|digits| *digits >= mantissa);
    format!("{}e{exponent}", digits.unwrap_or(10.0)).parse().unwrap_or(step)
}
