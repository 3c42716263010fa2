//! The known name that an unknown one was probably meant to be, for messages.

use super::plain_text::MAX_NAME;

/// The likeliest of some names, if its likeness, 0 to 1, is above `least`. Case and separators do not count. A text that is
/// longer than any name resembles none.
pub(crate) fn nearest<'a>(wrong: &str, names: impl IntoIterator<Item = &'a str>, least: f64) -> Option<&'a str> {
    if wrong.len() > 4 * MAX_NAME {
        return None;
    }
    let plain = |text: &str| text.trim().to_ascii_lowercase().replace(['_', '-', ' ', '.'], "");
    let wrong = plain(wrong);
    let likeness = |name: &str| strsim::jaro_winkler(&wrong, &plain(name));
    let scored = names.into_iter().map(|name| (likeness(name), name)).filter(|&(likeness, _)| likeness > least);
    scored.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, name)| name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_that_was_meant_is_found_and_a_strange_one_is_not() {
        let names = ["laneId", "precedingId", "xVelocity"];
        assert_eq!(nearest("lane_id", names, 0.75), Some("laneId"));
        assert_eq!(nearest("X-Velocty", names, 0.75), Some("xVelocity"));
        assert_eq!(nearest("weather", names, 0.75), None);
        assert_eq!(nearest("laneId", [], 0.0), None);
    }
}
