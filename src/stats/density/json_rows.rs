//! Readable JSON: objects over several lines, a row of numbers on one line.

use std::io::{self, Write};

use serde::Serialize;
use serde_json::ser::{Formatter, Serializer};

use lanesweep_support::{Error, Result};

/// JSON with one line per field and per row, ending in a line end.
///
/// # Errors
/// [`Error::Internal`] if a value has no JSON form.
pub(super) fn to_readable_json(value: &impl Serialize) -> Result<Vec<u8>> {
    let mut text = Vec::new();
    let mut serializer = Serializer::with_formatter(&mut text, Rows::default());
    value.serialize(&mut serializer).map_err(|e| Error::Internal(format!("cannot be written as JSON: {e}")))?;
    text.push(b'\n');
    Ok(text)
}

#[derive(Default)]
struct Rows {
    depth: usize,
    /// The last value was an object or an array, so the next one begins a line.
    after_compound: bool,
}

impl Rows {
    fn line<W: ?Sized + Write>(&self, out: &mut W) -> io::Result<()> {
        out.write_all(b"\n")?;
        out.write_all("  ".repeat(self.depth).as_bytes())
    }
}

impl Formatter for Rows {
    fn begin_array<W: ?Sized + Write>(&mut self, out: &mut W) -> io::Result<()> {
        self.depth += 1;
        self.after_compound = false;
        out.write_all(b"[")
    }

    fn end_array<W: ?Sized + Write>(&mut self, out: &mut W) -> io::Result<()> {
        self.depth -= 1;
        self.after_compound = true;
        out.write_all(b"]")
    }

    fn begin_array_value<W: ?Sized + Write>(&mut self, out: &mut W, first: bool) -> io::Result<()> {
        match (first, self.after_compound) {
            (true, _) => Ok(()),
            (false, false) => out.write_all(b", "),
            (false, true) => {
                out.write_all(b",")?;
                self.after_compound = false;
                self.line(out)
            }
        }
    }

    fn begin_object<W: ?Sized + Write>(&mut self, out: &mut W) -> io::Result<()> {
        self.depth += 1;
        self.after_compound = false;
        out.write_all(b"{")
    }

    fn end_object<W: ?Sized + Write>(&mut self, out: &mut W) -> io::Result<()> {
        self.depth -= 1;
        self.line(out)?;
        self.after_compound = true;
        out.write_all(b"}")
    }

    fn begin_object_key<W: ?Sized + Write>(&mut self, out: &mut W, first: bool) -> io::Result<()> {
        if !first {
            out.write_all(b",")?;
        }
        self.line(out)
    }

    fn begin_object_value<W: ?Sized + Write>(&mut self, out: &mut W) -> io::Result<()> {
        out.write_all(b": ")
    }

    fn end_object_value<W: ?Sized + Write>(&mut self, _: &mut W) -> io::Result<()> {
        self.after_compound = false;
        Ok(())
    }
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
