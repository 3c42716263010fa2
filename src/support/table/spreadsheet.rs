//! Texts as fields of CSV. A spreadsheet takes a field that begins with `=`, `+`, `-` or `@` for a formula, and an id
//! may come from anybody: such a text gets an apostrophe in front, which our readers take away again. Numbers stay.

use std::borrow::Cow;

/// What makes a formula of a field, directly or (tab, carriage return) once the blank before it is skipped.
const BEGINS_FORMULA: [char; 6] = ['=', '+', '-', '@', '\t', '\r'];

/// Does a text begin as a formula does, after apostrophes that are there already?
fn begins_formula(text: &str) -> bool {
    text.trim_start_matches('\'').starts_with(BEGINS_FORMULA)
}

/// The text as a spreadsheet shows it and computes nothing: `=1+1` is `'=1+1`. What is a number stays.
pub(crate) fn cell_text(text: &str) -> Cow<'_, str> {
    match begins_formula(text) && text.parse::<f64>().is_err() {
        true => Cow::Owned(format!("'{text}")),
        false => Cow::Borrowed(text),
    }
}

/// The text that [`cell_text`] made a field of.
pub(crate) fn text_of_cell(field: &str) -> &str {
    field.strip_prefix('\'').filter(|text| begins_formula(text)).unwrap_or(field)
}

/// A text as a field of CSV, in quotes where it needs them.
pub(crate) fn csv_field(text: &str) -> String {
    let field = cell_text(text);
    match field.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", field.replace('"', "\"\"")),
        false => field.into_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_text_begins_a_formula_and_each_reads_back_the_same() {
        for text in ["=1+1", "+a", "-b", "@SUM(A1)", "\t=1", "\r=1", "'=1", "''-x", "-2+3+cmd|' /C calc'!A0"] {
            let field = cell_text(text);
            assert!(field.starts_with('\''), "{field}");
            assert_eq!(text_of_cell(&field), text);
        }
        for text in ["", "a", "1", "-1.5", "+2e3", "-inf", "it's", "'a", "01_cut_in_24_22_1/2/1.2s/RSS"] {
            assert_eq!(cell_text(text), text);
            assert_eq!(text_of_cell(text), text);
        }
        assert_eq!(csv_field("=a,b"), "\"'=a,b\"");
    }
}
