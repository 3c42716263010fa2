//! A small XML document as a tree of elements with their lines. Size and depth are limited. It has no custom entities
//! and nothing else that the files read here do not need.

use std::path::Path;

use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;

use crate::support::input_file;
use crate::{Error, Place, Result};

/// An element.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Node {
    pub name: String,
    /// Line of its start, from 1.
    pub line: u64,
    /// Names and values, in order; names are unique.
    pub attributes: Vec<(String, String)>,
    pub children: Vec<Node>,
    /// Text directly inside it, trimmed.
    pub text: String,
}

/// Maximum nesting of elements.
const DEEPEST: usize = 32;
/// Maximum number of elements.
const MAX_ELEMENTS: usize = 500_000;

const NOT_XML: &str = "give a whole file of ASAM OpenSCENARIO XML 1.1 to 1.3 with a ParameterValueDistribution";

/// The root element of a file.
///
/// # Errors
/// As [`input_file::read_text`]; [`Error::Input`] with the line for XML that is not well-formed, too deep, too large,
/// or has a document type.
pub(super) fn read_tree(path: &Path) -> Result<Node> {
    let text = input_file::read_text(path, input_file::MAX_XML_BYTES)?;
    parse_tree(&text, path)
}

/// Parses a text; `path` is for messages.
pub(super) fn parse_tree(text: &str, path: &Path) -> Result<Node> {
    let text = text.trim_start_matches('\u{feff}');
    let wrong = |line: u64, problem: String, help: &str| Error::input(Place::file(path).row(line), problem, help);
    let mut reader = Reader::from_str(text);
    reader.config_mut().enable_all_checks(true);
    let mut lines = Lines { text: text.as_bytes(), at: 0, line: 1 };
    let (mut open, mut root, mut count): (Vec<Node>, Option<Node>, usize) = (Vec::new(), None, 0);
    loop {
        let line = lines.at(reader.buffer_position());
        let event = reader.read_event().map_err(|e| {
            let line = lines.at(reader.error_position());
            wrong(line, format!("not well-formed XML: {e}"), NOT_XML)
        })?;
        match event {
            Event::Start(start) => {
                let node = element(&start, line).map_err(|problem| wrong(line, problem, NOT_XML))?;
                count += 1;
                if open.len() >= DEEPEST {
                    return Err(wrong(line, format!("more than {DEEPEST} elements within one another"), NOT_XML));
                }
                open.push(node);
            }
            Event::Empty(start) => {
                let node = element(&start, line).map_err(|problem| wrong(line, problem, NOT_XML))?;
                count += 1;
                close(node, &mut open, &mut root).map_err(|problem| wrong(line, problem, NOT_XML))?;
            }
            Event::End(_) => {
                let Some(node) = open.pop() else { continue };
                close(node, &mut open, &mut root).map_err(|problem| wrong(line, problem, NOT_XML))?;
            }
            Event::Text(piece) => {
                let piece = piece.into_inner();
                let piece = piece.trim();
                if let Some(node) = open.last_mut() {
                    node.text.push_str(piece);
                } else if !piece.is_empty() {
                    return Err(wrong(line, "text outside of the root element".to_owned(), NOT_XML));
                }
            }
            Event::CData(piece) => {
                if let Some(node) = open.last_mut() {
                    node.text.push_str(&piece.into_inner());
                }
            }
            Event::GeneralRef(_) => {
                if let Some(node) = open.last_mut() {
                    node.text.push('\u{fffd}');
                }
            }
            Event::DocType(_) => {
                let problem = "it has a document type, and with it could have entities of its own".to_owned();
                return Err(wrong(line, problem, "leave the line <!DOCTYPE …> out: OpenSCENARIO has none"));
            }
            Event::Decl(_) | Event::PI(_) | Event::Comment(_) => {}
            Event::Eof => break,
        }
        if count > MAX_ELEMENTS {
            return Err(wrong(line, format!("more than {MAX_ELEMENTS} elements"), "split the file"));
        }
    }
    if let Some(node) = open.last() {
        return Err(wrong(node.line, format!("the element `{}` does not end", node.name), NOT_XML));
    }
    root.ok_or_else(|| wrong(1, "there is no element".to_owned(), NOT_XML))
}

/// Adds a finished element to its parent.
fn close(node: Node, open: &mut [Node], root: &mut Option<Node>) -> std::result::Result<(), String> {
    match open.last_mut() {
        Some(parent) => parent.children.push(node),
        None if root.is_none() => *root = Some(node),
        None => return Err(format!("a second root element `{}`", node.name)),
    }
    Ok(())
}

fn element(start: &BytesStart, line: u64) -> std::result::Result<Node, String> {
    let name = start.name().as_ref().to_owned();
    let mut attributes = Vec::new();
    for attribute in start.attributes() {
        let attribute = attribute.map_err(|e| format!("the attributes of `{name}` are broken: {e}"))?;
        let key = attribute.key.as_ref().to_owned();
        // Only the five predefined entities of XML are replaced, once.
        let value = attribute
            .normalized_value(XmlVersion::Implicit1_0)
            .map_err(|e| format!("the attribute `{key}` of `{name}` is broken: {e}"))?;
        attributes.push((key, value.into_owned()));
    }
    Ok(Node { name, line, attributes, children: Vec::new(), text: String::new() })
}

/// Converts ascending byte positions to lines.
struct Lines<'a> {
    text: &'a [u8],
    at: usize,
    line: u64,
}

impl Lines<'_> {
    fn at(&mut self, position: u64) -> u64 {
        let to = (position as usize).min(self.text.len());
        if to > self.at {
            self.line += self.text[self.at..to].iter().filter(|b| **b == b'\n').count() as u64;
            self.at = to;
        }
        self.line
    }
}
