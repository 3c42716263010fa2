//! Settings in TOML: one reader, so that an error in any such file names its line.

use std::path::Path;

use serde::de::DeserializeOwned;

use crate::support::input_file;
use crate::support::near_name::nearest;
use crate::support::plain_text::cut_names;
use crate::{Error, Place, Result};

/// The settings in a text; `place` is what errors name, `help` tells where the keys are described.
///
/// # Errors
/// [`Error::Usage`] with the line for what is not TOML, an unknown key or a value of another type.
pub(crate) fn parse<T: DeserializeOwned>(text: &str, place: &Place, help: &str) -> Result<T> {
    toml::from_str(text).map_err(|e| {
        let mut place = place.clone();
        if let Some(span) = e.span() {
            let before = text.bytes().take(span.start);
            place.row = Some(1 + before.filter(|&byte| byte == b'\n').count() as u64);
            if place.item.is_none() {
                place.item = key_before(text, span.start).map(|key| format!("`{key}`"));
            }
        }
        let message = cut_names(e.message());
        let problem = in_words(&message);
        match meant(&message) {
            Some(name) => Error::usage(place, problem, format!("did you mean `{name}`? {help}")),
            None => Error::usage(place, problem, help),
        }
    })
}

/// The key whose value begins at `at`.
fn key_before(text: &str, at: usize) -> Option<String> {
    let line = text.get(..at)?.lines().next_back()?;
    let key = line.strip_suffix(['=', ' ']).and_then(|_| line.split('=').next())?.trim();
    (!key.is_empty() && !key.starts_with(['#', '['])).then(|| key.to_owned())
}

/// The reader's types in a user's words.
fn in_words(message: &str) -> String {
    let words = [("floating point", "number"), ("f64", "a number"), ("f32", "a number"), ("usize", "a whole number")];
    let whole = ["u8", "u16", "u32", "u64"].map(|name| (name, "a whole number of at least 0"));
    let mut text = message.to_owned();
    for (name, word) in words.into_iter().chain(whole) {
        text = text.replace(&format!("expected {name}"), &format!("expected {word}"));
    }
    text
}

/// The name that an unknown one resembles, of those that the message lists.
fn meant(message: &str) -> Option<&str> {
    let mut names = message.strip_prefix("unknown field `")?.split('`').step_by(2);
    let unknown = names.next()?;
    nearest(unknown, names, 0.75)
}

/// The settings in a regular file.
///
/// # Errors
/// As [`parse`]; [`Error::Io`]; [`Error::Input`] where it is not a text file, or larger than a few megabytes.
pub(crate) fn read<T: DeserializeOwned>(path: &Path, help: &str) -> Result<T> {
    parse(&input_file::read_text(path, input_file::MAX_SETTINGS_BYTES)?, &Place::file(path), help)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Lengths {
        #[allow(dead_code)]
        gap_m: f64,
        #[allow(dead_code)]
        rows: Option<u32>,
    }

    #[test]
    fn an_error_names_the_key_and_what_was_meant() {
        let problem = |text: &str| {
            let error = parse::<Lengths>(text, &Place::file("a.toml"), "see there").unwrap_err();
            (error.to_string(), error.help().unwrap_or_default())
        };
        let (text, _) = problem("# far\ngap_m = 'far'\n");
        assert!(text.contains("line 2") && text.contains("`gap_m`") && text.ends_with("expected a number"), "{text}");
        let (text, _) = problem("gap_m = 1.0\nrows = -1\n");
        assert!(text.contains("`rows`") && text.contains("a whole number"), "{text}");
        let (text, help) = problem("gap = 1.0\n");
        assert!(text.contains("unknown field `gap`") && help == "did you mean `gap_m`? see there", "{text}; {help}");
        let (_, help) = problem("colour = 1.0\n");
        assert_eq!(help, "see there");
    }

    #[test]
    fn an_error_names_the_line_also_after_letters_of_several_bytes() {
        #[derive(Debug, serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Settings {
            #[allow(dead_code)]
            gap: f64,
        }
        for text in ["# größer als 1 µm\ngap = 'é'\n", "gap = 1\nspeed = 2\n", "gap = 1\n\u{e9} ="] {
            let error = parse::<Settings>(text, &Place::item("here"), "see there").unwrap_err();
            assert!(error.to_string().starts_with("line 2, here: "), "{error}");
            assert_eq!(error.help().unwrap(), "see there");
        }
    }
}
