//! Foreign text (names of files, ids, contents) as a terminal, a page and a spreadsheet may show it: characters that
//! would act instead of being seen are written as escapes.

use std::borrow::Cow;

/// Does a terminal or a browser act on it instead of showing it? Control characters (C0, DEL, C1), marks that turn the
/// direction of reading, line separators, and what has no width.
pub(crate) fn acts(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{61c}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{2069}' | '\u{feff}')
}

fn escaped(text: &str, stays: &[char]) -> String {
    let mut shown = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match c {
            c if acts(c) && !stays.contains(&c) => shown.extend(c.escape_default()),
            c => shown.push(c),
        }
    }
    shown
}

/// A text of several lines: line breaks stay, all else that acts is written as `\u{1b}`.
pub(crate) fn shown(text: &str) -> Cow<'_, str> {
    let stays = ['\n', '\t'];
    match text.chars().any(|c| acts(c) && !stays.contains(&c)) {
        true => Cow::Owned(escaped(text, &stays)),
        false => Cow::Borrowed(text),
    }
}

/// A name in a line: a line break in it begins no new line.
pub(crate) fn shown_in_line(text: &str) -> String {
    escaped(text, &[])
}

/// A JSON document with everything that acts as `\u001b`, which reads back the same. Line breaks between its tokens
/// stay; those in its texts are escapes already.
pub(crate) fn shown_json(json: &str) -> Cow<'_, str> {
    if !json.chars().any(|c| acts(c) && c != '\n') {
        return Cow::Borrowed(json);
    }
    let mut shown = String::with_capacity(json.len() + 16);
    for c in json.chars() {
        match c {
            c if acts(c) && c != '\n' => shown.push_str(&format!("\\u{:04x}", u32::from(c))),
            c => shown.push(c),
        }
    }
    Cow::Owned(shown)
}

#[cfg(test)]
mod tests {
    use super::*;

    const STRANGE: &str = "a\u{1b}[2Jb\rc\u{9b}d\u{202e}e\u{7f}f\u{feff}g\u{2028}h\u{2066}";

    #[test]
    fn nothing_that_acts_is_left_and_what_is_seen_stays() {
        let text = shown(STRANGE);
        assert!(!text.chars().any(acts), "{text:?}");
        assert!(text.starts_with("a\\u{1b}[2Jb\\rc\\u{9b}d\\u{202e}e"), "{text}");
        for plain in ["", "µm, 日本語, é, ∞, “x”", "two\nlines\tand a tab"] {
            assert!(matches!(shown(plain), Cow::Borrowed(same) if same == plain), "{plain}");
        }
        assert_eq!(shown_in_line("a\nb"), "a\\nb");
    }

    #[test]
    fn json_reads_back_the_same() {
        let json = serde_json::to_string_pretty(&serde_json::json!({ "id": STRANGE, "b": [1, 2] })).unwrap();
        let text = shown_json(&json);
        assert!(!text.chars().any(|c| acts(c) && c != '\n'), "{text:?}");
        let read = |text: &str| serde_json::from_str::<serde_json::Value>(text).unwrap();
        assert_eq!(read(&text), read(&json));
    }
}
