//! Readable JSON: objects over several lines, a row of numbers on one line.

use serde::Serialize;

use lanesweep_support::{Error, Result};

/// JSON with one line per field and per row, ending in a line end.
///
/// # Errors
/// [`Error::Internal`] if a value has no JSON form.
pub(super) fn to_readable_json(value: &impl Serialize) -> Result<Vec<u8>> {
    let dense = serde_json::to_string(value).map_err(|e| Error::Internal(format!("cannot be written as JSON: {e}")))?;
    let mut text = String::with_capacity(dense.len() * 5 / 4);
    let line = |depth: usize| format!("\n{}", "  ".repeat(depth));
    // The open brackets, the character before, and whether this one is within a text or after a backslash there.
    let (mut open, mut before, mut in_text, mut is_escaped) = (Vec::new(), ' ', false, false);
    for c in dense.chars() {
        if !in_text && matches!(c, ']' | '}') {
            open.pop();
        }
        if !in_text && (c == '}' || before == '{') {
            text += &line(open.len());
        }
        text.push(c);
        in_text ^= c == '"' && !is_escaped;
        is_escaped = in_text && c == '\\' && !is_escaped;
        if !in_text && matches!(c, '[' | '{') {
            open.push(c);
        }
        match c {
            _ if in_text => {}
            ',' if open.last() == Some(&'{') || matches!(before, ']' | '}') => text += &line(open.len()),
            ',' | ':' => text.push(' '),
            _ => {}
        }
        before = c;
    }
    text.push('\n');
    Ok(text.into_bytes())
}

#[cfg(test)]
mod tests {
    use super::to_readable_json;

    #[test]
    fn rows_of_numbers_stay_on_their_line() {
        let value = serde_json::json!({"a": [[1, 2], [3, 4]], "b": [], "c": [{"d": null}, {"e": [0.1]}]});
        let text = String::from_utf8(to_readable_json(&value).unwrap()).unwrap();
        let expected = "{\n  \"a\": [[1, 2],\n    [3, 4]],\n  \"b\": [],\n  \"c\": [{\n      \"d\": null\n    },\n    \
                        {\n      \"e\": [0.1]\n    }]\n}\n";
        assert_eq!(text, expected);
        assert_eq!(serde_json::from_str::<serde_json::Value>(&text).unwrap(), value);
    }
}
