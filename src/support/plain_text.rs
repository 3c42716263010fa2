//! Makes foreign text (file names, ids, contents) safe for a terminal, a page and a spreadsheet: characters that act
//! instead of being shown become escapes. Also quotes words for a shell, finds the known name closest to an unknown one, and formats
//! digests.

use std::borrow::Cow;

use sha2::{Digest, Sha256};

/// Whether a terminal or a browser acts on the character instead of showing it: control characters (C0, DEL, C1), marks
/// of the reading direction, line separators, and zero-width characters.
pub fn acts(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{61c}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{2069}' | '\u{feff}')
}

/// Maximum characters of a name in a message: an id, a key, a value.
const MAX_NAME: usize = 80;
/// Maximum characters of a word in a message that may be a path; the limit of systems.
pub(super) const MAX_PATH: usize = 4096;
/// Maximum characters of a message.
const MAX_MESSAGE: usize = 16_384;

/// Shortens a name to `MAX_NAME` characters by keeping its beginning and end.
pub fn cut(name: &str) -> Cow<'_, str> {
    cut_to(name, MAX_NAME)
}

fn cut_to(text: &str, max_chars: usize) -> Cow<'_, str> {
    // The byte length is an upper bound of the character count.
    if text.len() <= max_chars || text.chars().count() <= max_chars {
        return Cow::Borrowed(text);
    }
    let tail = max_chars / 3;
    let at = |(at, _): (usize, char)| at;
    let end = text.char_indices().nth(max_chars - tail - 1).map_or(text.len(), at);
    let begin = text.char_indices().nth_back(tail - 1).map_or(0, at);
    Cow::Owned(format!("{}\u{2026}{}", &text[..end], &text[begin..]))
}

/// Limits a message: quoted text, and every word that is not a path, is shortened like a name.
pub fn cut_names(message: &str) -> String {
    let mut out = String::with_capacity(message.len().min(MAX_MESSAGE));
    let mut rest = message;
    while let Some(at) = rest.find(['`', '"']) {
        let (quote, inside) = (&rest[at..=at], &rest[at + 1..]);
        let Some(end) = inside.find(quote) else { break };
        out += &cut_words(&rest[..at]);
        out.extend([quote, &cut(&inside[..end]), quote]);
        rest = &inside[end + 1..];
    }
    out += &cut_words(rest);
    cut_to(&out, MAX_MESSAGE).into_owned()
}

fn cut_words(text: &str) -> String {
    let max_chars = |word: &str| if word.contains(['/', '\\']) { MAX_PATH } else { MAX_NAME };
    let cut = |word| {
        let name = str::trim_end(word);
        [cut_to(name, max_chars(name)), Cow::Borrowed(&word[name.len()..])]
    };
    text.split_inclusive(char::is_whitespace).flat_map(cut).collect()
}

/// Replaces the characters that act, except some.
fn escaped<'a>(text: &'a str, stays: &[char], escape: impl Fn(char) -> String) -> Cow<'a, str> {
    let is_escaped = |c: &char| acts(*c) && !stays.contains(c);
    if !text.chars().any(|c| is_escaped(&c)) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match is_escaped(&c) {
            true => shown.push_str(&escape(c)),
            false => shown.push(c),
        }
    }
    Cow::Owned(shown)
}

/// Escapes a text of several lines: line breaks stay, all other acting characters become `\u{1b}`.
pub fn shown(text: &str) -> Cow<'_, str> {
    escaped(text, &['\n', '\t'], |c| c.escape_default().to_string())
}

/// Escapes a name within a line, line breaks included.
pub fn shown_in_line(text: &str) -> String {
    escaped(text, &[], |c| c.escape_default().to_string()).into_owned()
}

/// Escapes a JSON document: acting characters become `\u001b`, which reads back unchanged. Line breaks between tokens
/// stay; those in texts are already escapes.
pub fn shown_json(json: &str) -> Cow<'_, str> {
    escaped(json, &['\n'], |c| format!("\\u{:04x}", u32::from(c)))
}

/// Escapes a text for HTML and XML 1.0, as content or attribute. Tabs and carriage returns become references.
/// Characters on which a browser acts, and those that XML never allows, become U+FFFD; a line break stays.
pub fn escape_markup(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out += "&amp;",
            '<' => out += "&lt;",
            '>' => out += "&gt;",
            '"' => out += "&quot;",
            '\'' => out += "&apos;",
            '\t' | '\r' => out += &format!("&#{};", u32::from(c)),
            '\u{FFFE}' | '\u{FFFF}' => out.push('\u{FFFD}'),
            c if acts(c) && c != '\n' => out.push('\u{FFFD}'),
            c => out.push(c),
        }
    }
    out
}

/// One word of a POSIX shell, for commands in messages: as it is where nothing in it is special, else in single quotes.
pub fn quoted_word(word: &str) -> String {
    // `=` is special: before a command it makes an assignment.
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "_-./:,+@%".contains(c);
    match !word.is_empty() && word.chars().all(is_plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', r"'\''")),
    }
}

/// The most similar name, if its similarity (0 to 1) is above `min_likeness`. Case and separators are ignored. A text
/// longer than any name resembles none.
pub fn nearest<'a>(wrong: &str, names: impl IntoIterator<Item = &'a str>, min_likeness: f64) -> Option<&'a str> {
    if wrong.len() > 4 * MAX_NAME {
        return None;
    }
    let plain = |text: &str| text.trim().to_ascii_lowercase().replace(['_', '-', ' ', '.'], "");
    let wrong = plain(wrong);
    // The first knows no exchanged letters in short words.
    let likeness = |name: &str| {
        let name = plain(name);
        strsim::jaro_winkler(&wrong, &name).max(strsim::normalized_damerau_levenshtein(&wrong, &name))
    };
    let scored = names.into_iter().map(|name| (likeness(name), name)).filter(|&(likeness, _)| likeness > min_likeness);
    scored.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, name)| name)
}

/// Bytes as lower-case hexadecimal digits.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// SHA-256 of some bytes, as [`hex`].
pub fn sha256(bytes: impl AsRef<[u8]>) -> String {
    hex(&Sha256::digest(bytes))
}
