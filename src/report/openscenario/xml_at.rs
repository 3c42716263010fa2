//! An XML element with its place: typed access, and errors that name file, line and element.

use std::path::Path;

use roxmltree::{Attribute, Document, Node, ParsingOptions, TextPos};

use super::distribution::Range;
use crate::support::plain_text;
use crate::{Error, Place, Result};

/// Maximum number of elements, texts between them and comments.
const MAX_NODES: u32 = 500_000;

/// Attributes of this namespace are for checkers of schemas.
const XSI: &str = "http://www.w3.org/2001/XMLSchema-instance";

const NOT_XML: &str = "give a whole file of ASAM OpenSCENARIO XML 1.1 to 1.3 with a ParameterValueDistribution";

/// Parses a text; `path` is for messages.
///
/// # Errors
/// [`Error::Input`] with the line for XML that is not well-formed, too large, or has a document type.
pub(super) fn parse<'a>(text: &'a str, path: &Path) -> Result<Document<'a>> {
    // Without document types there are no entities to expand. The parser does not recurse, so depth needs no limit.
    let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    Document::parse_with_options(text, options).map_err(|error| {
        let file = Place::file(path);
        match error {
            roxmltree::Error::DtdDetected => {
                let line = text.lines().take_while(|line| !line.contains("<!DOCTYPE")).count() as u64 + 1;
                let problem = "it has a document type, and with it could have entities of its own";
                Error::input(file.row(line), problem, "leave the line <!DOCTYPE …> out: OpenSCENARIO has none")
            }
            roxmltree::Error::NodesLimitReached => {
                let problem = format!("more than {MAX_NODES} elements, texts and comments");
                Error::input(file, problem, "split the file")
            }
            _ => {
                // Errors about the whole file stand at its start.
                let place = match error.pos() {
                    TextPos { row: 1, col: 1 } => file,
                    at => file.row(u64::from(at.row)),
                };
                Error::input(place, format!("not well-formed XML: {error}"), NOT_XML)
            }
        }
    })
}

/// An element and its place.
#[derive(Clone, Copy)]
pub(super) struct At<'a> {
    pub node: Node<'a, 'a>,
    pub path: &'a Path,
}

impl<'a> At<'a> {
    pub(super) fn name(&self) -> &'a str {
        self.node.tag_name().name()
    }

    /// Line of its start, from 1.
    pub(super) fn line(&self) -> u64 {
        u64::from(self.node.document().text_pos_at(self.node.range().start).row)
    }

    pub(super) fn wrong(&self, problem: impl Into<String>, help: impl Into<String>) -> Error {
        let place = Place::file(self.path).row(self.line()).of(format!("element `{}`", self.name()));
        Error::input(place, problem, help)
    }

    pub(super) fn all(self) -> impl Iterator<Item = At<'a>> {
        self.node.children().filter(Node::is_element).map(move |node| At { node, path: self.path })
    }

    /// Checks that there are only these attributes and child elements.
    pub(super) fn shape(&self, attributes: &[&str], children: &[&str]) -> Result<()> {
        self.attributes(attributes)?;
        self.children(children)
    }

    /// Checks that there are only these attributes (except those for schemas), and no text.
    pub(super) fn attributes(&self, known: &[&str]) -> Result<()> {
        let is_known = |a: &Attribute| match a.namespace() {
            None => known.contains(&a.name()),
            Some(namespace) => namespace == XSI,
        };
        if let Some(unknown) = self.node.attributes().find(|attribute| !is_known(attribute)) {
            let key = &self.node.document().input_text()[unknown.range_qname()];
            let help = match known {
                [] => "leave it out: the element has no attributes".to_owned(),
                list => format!("it has {}{}", list.join(", "), nearest(key, list)),
            };
            return Err(self.wrong(format!("there is no attribute `{key}`"), help));
        }
        let is_text = |child: Node| child.is_text() && !child.text().unwrap_or_default().trim().is_empty();
        if self.node.children().any(is_text) {
            return Err(self.wrong("text stands in it", "leave the text out: values are attributes"));
        }
        Ok(())
    }

    /// Checks that there are only these child elements.
    pub(super) fn children(&self, known: &[&str]) -> Result<()> {
        match self.all().find(|child| !known.contains(&child.name())) {
            None => Ok(()),
            Some(child) => {
                let inside = format!("inside `{}`", self.name());
                let help = match known {
                    [] => format!("leave it out: nothing stands {inside}"),
                    list => format!("{inside} stand {}{}", list.join(", "), nearest(child.name(), list)),
                };
                Err(child.wrong("this element is not known here", help))
            }
        }
    }

    /// The only child of this name.
    pub(super) fn only(self, name: &str) -> Result<At<'a>> {
        let found: Vec<At> = self.all().filter(|child| child.name() == name).collect();
        match found[..] {
            [one] => Ok(one),
            _ => Err(self.wrong(format!("it has {} elements `{name}`", found.len()), format!("give one `{name}`"))),
        }
    }

    /// The children, all of this name; at least one.
    pub(super) fn some(self, name: &str) -> Result<Vec<At<'a>>> {
        self.children(&[name])?;
        let found: Vec<At> = self.all().collect();
        if found.is_empty() {
            return Err(self.wrong(format!("it has no `{name}`"), format!("give at least one `{name}`")));
        }
        Ok(found)
    }

    /// The only child, with one of these names.
    pub(super) fn choice(self, names: &[&str]) -> Result<At<'a>> {
        self.children(names)?;
        let found: Vec<At> = self.all().collect();
        match found[..] {
            [one] => Ok(one),
            _ => Err(self
                .wrong(format!("it has {} distributions", found.len()), format!("give one of {}", names.join(", ")))),
        }
    }

    /// The value of an attribute without a namespace.
    pub(super) fn value(&self, name: &str) -> Option<&'a str> {
        let mut own = self.node.attributes().filter(|attribute| attribute.namespace().is_none());
        own.find(|attribute| attribute.name() == name).map(|attribute| attribute.value())
    }

    pub(super) fn text(&self, name: &str) -> Result<&'a str> {
        let value = self
            .value(name)
            .ok_or_else(|| self.wrong(format!("the attribute `{name}` is missing"), format!("write {name}=\"…\"")))?;
        if value.starts_with('$') {
            let problem = format!("the attribute `{name}` is `{value}`");
            return Err(self.wrong(problem, "parameters and expressions are not evaluated: write the value itself"));
        }
        Ok(value)
    }

    pub(super) fn number(&self, name: &str) -> Result<f64> {
        let text = self.text(name)?;
        text.trim().parse::<f64>().ok().filter(|value| value.abs() <= 1e15).ok_or_else(|| {
            let problem = format!("the attribute `{name}` is `{text}`");
            self.wrong(problem, "write a number: every parameter of lanesweep is one")
        })
    }

    /// Range from `lowerLimit` to `upperLimit`.
    pub(super) fn range(&self) -> Result<Range> {
        self.shape(&["lowerLimit", "upperLimit"], &[])?;
        let range = Range { low: self.number("lowerLimit")?, high: self.number("upperLimit")? };
        if range.low <= range.high {
            return Ok(range);
        }
        let problem = format!("the lower limit {} is above the upper limit {}", range.low, range.high);
        Err(self.wrong(problem, "give the smaller one as lowerLimit"))
    }
}

/// `; did you mean …?` if a name of the list is similar.
fn nearest(name: &str, list: &[&str]) -> String {
    plain_text::nearest(name, list.iter().copied(), 0.8)
        .map_or(String::new(), |near| format!("; did you mean `{near}`?"))
}
