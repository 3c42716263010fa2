//! An XML element with its place: typed access, and errors that name file, line and element.

use std::path::Path;

use super::distribution::Range;
use super::xml_tree::Node;
use crate::support::plain_text;
use crate::{Error, Place, Result};

/// An element and its place.
#[derive(Clone, Copy)]
pub(super) struct At<'a> {
    pub node: &'a Node,
    pub path: &'a Path,
}

impl<'a> At<'a> {
    pub fn wrong(&self, problem: impl Into<String>, help: impl Into<String>) -> Error {
        let place = Place::file(self.path).row(self.node.line).of(format!("element `{}`", self.node.name));
        Error::input(place, problem, help)
    }

    /// Adds this place to another check's error.
    pub fn because(&self, error: &Error) -> Error {
        self.wrong(error.to_string(), error.help().unwrap_or_default())
    }

    pub fn all(self) -> impl Iterator<Item = At<'a>> {
        self.node.children.iter().map(move |node| At { node, path: self.path })
    }

    /// Checks that there are only these attributes (except namespaces), and no text.
    pub fn attributes(&self, known: &[&str]) -> Result<()> {
        let is_foreign = |key: &str| key == "xmlns" || key.starts_with("xmlns:") || key.starts_with("xsi:");
        for (key, _) in self.node.attributes.iter().filter(|(key, _)| !is_foreign(key)) {
            if !known.contains(&key.as_str()) {
                let help = match known {
                    [] => "leave it out: the element has no attributes".to_owned(),
                    list => format!("it has {}{}", list.join(", "), nearest(key, list)),
                };
                return Err(self.wrong(format!("there is no attribute `{key}`"), help));
            }
        }
        if !self.node.text.is_empty() {
            return Err(self.wrong("text stands in it", "leave the text out: values are attributes"));
        }
        Ok(())
    }

    /// Checks that there are only these child elements.
    pub fn children(&self, known: &[&str]) -> Result<()> {
        match self.node.children.iter().find(|child| !known.contains(&child.name.as_str())) {
            None => Ok(()),
            Some(child) => {
                let inside = format!("inside `{}`", self.node.name);
                let help = match known {
                    [] => format!("leave it out: nothing stands {inside}"),
                    list => format!("{inside} stand {}{}", list.join(", "), nearest(&child.name, list)),
                };
                Err(At { node: child, path: self.path }.wrong("this element is not known here", help))
            }
        }
    }

    /// The only child of this name.
    pub fn only(self, name: &str) -> Result<At<'a>> {
        let found: Vec<At> = self.all().filter(|child| child.node.name == name).collect();
        match found[..] {
            [one] => Ok(one),
            _ => Err(self.wrong(format!("it has {} elements `{name}`", found.len()), format!("give one `{name}`"))),
        }
    }

    /// The children, all of this name; at least one.
    pub fn some(self, name: &str) -> Result<Vec<At<'a>>> {
        self.children(&[name])?;
        let found: Vec<At> = self.all().collect();
        if found.is_empty() {
            return Err(self.wrong(format!("it has no `{name}`"), format!("give at least one `{name}`")));
        }
        Ok(found)
    }

    /// The only child, with one of these names.
    pub fn choice(self, names: &[&str]) -> Result<At<'a>> {
        if let Some(child) =
            self.all().find(|c| matches!(c.node.name.as_str(), "UserDefinedDistribution" | "LogNormalDistribution"))
        {
            let help = format!("what it means is not told here: write one of {}", names.join(", "));
            return Err(child.wrong("this kind of distribution is not read", help));
        }
        self.children(names)?;
        let found: Vec<At> = self.all().collect();
        match found[..] {
            [one] => Ok(one),
            _ => Err(self
                .wrong(format!("it has {} distributions", found.len()), format!("give one of {}", names.join(", ")))),
        }
    }

    pub fn has(&self, name: &str) -> bool {
        self.node.attributes.iter().any(|(key, _)| key == name)
    }

    pub fn text(&self, name: &str) -> Result<&'a str> {
        let found = self.node.attributes.iter().find(|(key, _)| key == name);
        let (_, value) = found
            .ok_or_else(|| self.wrong(format!("the attribute `{name}` is missing"), format!("write {name}=\"…\"")))?;
        if value.starts_with('$') {
            let problem = format!("the attribute `{name}` is `{value}`");
            return Err(self.wrong(problem, "parameters and expressions are not evaluated: write the value itself"));
        }
        Ok(value)
    }

    pub fn number(&self, name: &str) -> Result<f64> {
        let text = self.text(name)?;
        text.trim().parse::<f64>().ok().filter(|value| value.abs() <= 1e15).ok_or_else(|| {
            let problem = format!("the attribute `{name}` is `{text}`");
            self.wrong(problem, "write a number: every parameter of lanesweep is one")
        })
    }

    /// Range from `lowerLimit` to `upperLimit`.
    pub fn range(&self) -> Result<Range> {
        self.attributes(&["lowerLimit", "upperLimit"])?;
        self.children(&[])?;
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
