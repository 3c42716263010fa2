//! XML elements, one per line, indented; `quick-xml` escapes the text.

use std::borrow::Cow;

use quick_xml::events::{BytesDecl, BytesEnd, BytesStart, BytesText, Event};
use quick_xml::writer::Writer;

use crate::{Error, Result};

/// An attribute.
pub(super) type Attribute<'a> = (&'a str, String);

/// An element with its attributes.
pub(super) type Element<'a> = (&'a str, Vec<Attribute<'a>>);

/// A document under construction.
pub(super) struct Elements {
    writer: Writer<Vec<u8>>,
    open: Vec<&'static str>,
}

impl Elements {
    /// Starts a document.
    pub(super) fn new() -> Result<Elements> {
        let mut elements = Elements { writer: Writer::new(Vec::new()), open: Vec::new() };
        elements.event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
        elements.event(Event::Text(BytesText::from_escaped("\n")))?;
        Ok(elements)
    }

    /// Opens an element; the following elements are inside it.
    pub(super) fn open(&mut self, name: &'static str, attributes: Vec<Attribute>) -> Result<()> {
        self.indent()?;
        self.event(Event::Start(start(name, &attributes)))?;
        self.open.push(name);
        self.line_end()
    }

    /// Closes the innermost open element.
    pub(super) fn close(&mut self) -> Result<()> {
        let name = self.open.pop().ok_or_else(|| Error::Internal("no element of XML is open".to_owned()))?;
        self.indent()?;
        self.event(Event::End(BytesEnd::new(name)))?;
        self.line_end()
    }

    /// Adds an element without content.
    pub(super) fn empty(&mut self, name: &str, attributes: Vec<Attribute>) -> Result<()> {
        self.nested(&[(name, attributes)])
    }

    /// Adds elements on one line, each inside the previous one; the last is empty.
    pub(super) fn nested(&mut self, chain: &[Element]) -> Result<()> {
        self.indent()?;
        let Some(((last, attributes), outer)) = chain.split_last() else { return Ok(()) };
        for (name, attributes) in outer {
            self.event(Event::Start(start(name, attributes)))?;
        }
        self.event(Event::Empty(start(last, attributes)))?;
        for (name, _) in outer.iter().rev() {
            self.event(Event::End(BytesEnd::new(*name)))?;
        }
        self.line_end()
    }

    /// Returns the document.
    pub(super) fn finish(mut self) -> Result<Vec<u8>> {
        while !self.open.is_empty() {
            self.close()?;
        }
        Ok(self.writer.into_inner())
    }

    fn indent(&mut self) -> Result<()> {
        let text = "  ".repeat(self.open.len());
        self.event(Event::Text(BytesText::from_escaped(text)))
    }

    fn line_end(&mut self) -> Result<()> {
        self.event(Event::Text(BytesText::from_escaped("\n")))
    }

    fn event(&mut self, event: Event) -> Result<()> {
        self.writer.write_event(event).map_err(|e| Error::Internal(format!("an element cannot be written: {e}")))
    }
}

fn start<'a>(name: &'a str, attributes: &'a [Attribute]) -> BytesStart<'a> {
    BytesStart::new(name).with_attributes(attributes.iter().map(|(key, value)| (*key, value.as_str())))
}

/// Formats a number as the shortest text that reads back to the same bits, without negative zero.
pub(super) fn number(value: f64) -> String {
    (value + 0.0).to_string()
}

/// Makes text valid for XML 1.0 and OpenSCENARIO, where a leading `$` would be a parameter.
pub(super) fn plain(text: &str) -> Cow<'_, str> {
    let is_allowed = |c: char| matches!(c, '\t' | '\n' | '\r') || (c >= ' ' && !matches!(c, '\u{fffe}' | '\u{ffff}'));
    let text: Cow<str> = if text.chars().all(is_allowed) {
        Cow::Borrowed(text)
    } else {
        text.chars().map(|c| if is_allowed(c) { c } else { '\u{fffd}' }).collect::<String>().into()
    };
    if text.starts_with('$') { format!(" {text}").into() } else { text }
}
