//! Settings in TOML: one reader, so that an error in any such file names its line.

use std::path::Path;

use serde::de::DeserializeOwned;

use crate::{Error, Place, Result, input_file};

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
        }
        Error::usage(place, e.message().to_owned(), help)
    })
}

/// The settings in a regular file.
///
/// # Errors
/// As [`parse`]; [`Error::Io`]; [`Error::Input`] for what is no text file of a few megabytes at most.
pub(crate) fn read<T: DeserializeOwned>(path: &Path, help: &str) -> Result<T> {
    parse(&input_file::read_text(path, input_file::LARGEST_SETTINGS_BYTES)?, &Place::file(path), help)
}

#[cfg(test)]
mod tests {
    use super::*;

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
