//! Times without a unit: what they are follows from their size or their text.

/// What times without a unit are, in words after the name of the column.
pub(super) type FoundTime = &'static str;
/// `08:15:30.25`: it begins again at midnight.
pub(super) const TIME_OF_DAY: FoundTime = "time of day";

/// What a time of this size is, and its factor to seconds; `None` for seconds. No recording is from the year 5138 or later.
pub(super) fn unit_of_time(value: f64) -> Option<(FoundTime, f64)> {
    match value.abs() {
        1e11..1e14 => Some(("ms since 1970", 1e-3)),
        1e14..1e17 => Some(("µs since 1970", 1e-6)),
        1e17..1e19 => Some(("ns since 1970", 1e-9)),
        _ => None,
    }
}

/// Seconds of a text, and what it is.
pub(super) fn time_of_text(text: &str) -> Option<(FoundTime, f64)> {
    let text = text.replace(',', ".");
    if let Some(seconds) = seconds_of_date(&text) {
        return Some(("dates", seconds));
    }
    let parts: Option<Vec<f64>> =
        text.split(':').map(|part| part.parse().ok().filter(|value: &f64| *value >= 0.0)).collect();
    // SUMO writes `0:08:15:30.25`, with days.
    let (found, [days, hours, minutes, seconds]) = match parts?[..] {
        [hours, minutes, seconds] => (TIME_OF_DAY, [0.0, hours, minutes, seconds]),
        [days, hours, minutes, seconds] => ("days:hours:minutes:seconds", [days, hours, minutes, seconds]),
        _ => return None,
    };
    let is_usual = hours.fract() == 0.0 && minutes.fract() == 0.0 && hours < 24.0 && minutes < 60.0 && seconds < 61.0;
    let of_day = 3600.0 * hours + 60.0 * minutes + seconds;
    is_usual.then_some((found, 86_400.0 * days + of_day))
}

/// Seconds since 1970 of `2024-10-07 06:00:00.05+00:00`, with `T` or a blank, with or without an offset.
fn seconds_of_date(text: &str) -> Option<f64> {
    let (date, time) = text.split_once(['T', ' '])?;
    let mut numbers = date.splitn(3, '-').map(|part| part.parse::<i64>().ok());
    let (year, month, day) = (numbers.next()??, numbers.next()??, numbers.next()??);
    if !(1..=12).contains(&month) || !(1..=31).contains(&day) || !(1..=9999).contains(&year) {
        return None;
    }
    let (clock, offset_s) = match time.rfind(['+', '-', 'Z']) {
        Some(at) if time[at..].starts_with('Z') => (&time[..at], 0.0),
        Some(at) => {
            let (hours, minutes) = time[at + 1..].split_once(':').unwrap_or((&time[at + 1..], "0"));
            let offset_s = 3600.0 * hours.parse::<f64>().ok()? + 60.0 * minutes.parse::<f64>().ok()?;
            (&time[..at], if time[at..].starts_with('-') { -offset_s } else { offset_s })
        }
        None => (time, 0.0),
    };
    let mut parts = clock.splitn(3, ':').map(|part| part.parse::<f64>().ok());
    let (hours, minutes, seconds) = (parts.next()??, parts.next()??, parts.next().unwrap_or(Some(0.0))?);
    // Days from civil dates (Hinnant, low-level date algorithms, 2013).
    let shifted = if month <= 2 { year - 1 } else { year };
    let era = shifted.div_euclid(400);
    let of_era = shifted.rem_euclid(400);
    let of_year = (153 * (month + if month > 2 { -3 } else { 9 }) + 2) / 5 + day - 1;
    let days = era * 146_097 + of_era * 365 + of_era / 4 - of_era / 100 + of_year - 719_468;
    let of_day = 3600.0 * hours + 60.0 * minutes + seconds - offset_s;
    of_day.is_finite().then_some(days as f64 * 86_400.0 + of_day)
}
