//! Rows of XML and JSON files: the attributes of elements, the objects of a list.

use std::collections::HashSet;
use std::io::{BufReader, Read};
use std::path::Path;

use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;
use serde_json::Value;

use crate::support::input_file;
use crate::{Error, Place, Result};

/// Maximum size of a JSON file, bytes: it is held in memory.
const MAX_JSON_BYTES: u64 = 1 << 30;
/// Maximum nesting of XML elements.
const DEEPEST: usize = 64;

/// Names and values of attributes; the values are texts.
type Attributes = Vec<(String, Value)>;

/// Receives the attributes of an element and its place; whether to go on.
type EachElement<'e> = dyn FnMut(&Attributes, &dyn Fn() -> Place) -> Result<bool> + 'e;

/// Gives the attributes of every element with this name, and those of the elements around it as `element.attribute`, until
/// `each` returns false.
pub(super) fn each_element(path: &Path, row: &str, each: &mut EachElement) -> Result<()> {
    let file = LimitedLine { inner: input_file::open_text(path)?, since: 0 };
    let mut reader = Reader::from_reader(BufReader::with_capacity(1 << 18, file));
    let mut buffer = Vec::new();
    let mut around: Vec<Attributes> = Vec::new();
    let wrong = |at: u64, problem: String| {
        let problem = format!("not well-formed XML at byte {at}: {problem}");
        Error::input(Place::file(path), problem, "export the file again")
    };
    loop {
        buffer.clear();
        let at = reader.buffer_position();
        let event = reader.read_event_into(&mut buffer).map_err(|error| wrong(at, error.to_string()))?;
        let (start, is_open) = match event {
            Event::Start(start) => (start, true),
            Event::Empty(start) => (start, false),
            Event::End(_) => {
                around.pop();
                continue;
            }
            Event::Eof => {
                let problem = "it ends inside an element: the file is truncated".to_owned();
                return if around.is_empty() { Ok(()) } else { Err(wrong(at, problem)) };
            }
            Event::DocType(_) => return Err(wrong(at, "a document type".to_owned())),
            _ => continue,
        };
        let name = start.name().as_ref().to_owned();
        let mut attributes = attributes(&start).map_err(|problem| wrong(at, problem))?;
        if name == row {
            attributes.extend(around.iter().flatten().cloned());
            if !each(&attributes, &|| Place::file(path).of(format!("byte {at}")))? {
                return Ok(());
            }
        }
        if is_open {
            if around.len() >= DEEPEST {
                return Err(wrong(at, format!("more than {DEEPEST} elements within one another")));
            }
            let qualified = attributes.into_iter().filter(|(key, _)| name != row && !key.contains('.'));
            around.push(qualified.map(|(key, value)| (format!("{name}.{key}"), value)).collect());
        }
    }
}

/// Refuses a file without an element end within this many bytes, which memory would have to hold.
const MAX_ELEMENT_BYTES: u64 = 1 << 26;

struct LimitedLine<R> {
    inner: R,
    since: u64,
}

impl<R: Read> Read for LimitedLine<R> {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        if self.since > MAX_ELEMENT_BYTES {
            return Err(std::io::Error::from(std::io::ErrorKind::InvalidData));
        }
        let count = self.inner.read(bytes)?;
        self.since = if bytes[..count].contains(&b'>') { 0 } else { self.since + count as u64 };
        Ok(count)
    }
}

fn attributes(start: &BytesStart) -> std::result::Result<Attributes, String> {
    let mut found = Vec::new();
    let mut names = HashSet::new();
    // Its own check of repeated names compares each with each.
    for attribute in start.attributes().with_checks(false) {
        let attribute = attribute.map_err(|error| error.to_string())?;
        let value = attribute.normalized_value(XmlVersion::Implicit1_0).map_err(|error| error.to_string())?;
        let name = attribute.key.as_ref().to_owned();
        if !names.insert(name.clone()) {
            return Err(format!("the attribute `{name}` is there twice"));
        }
        found.push((name, Value::from(value)));
    }
    Ok(found)
}

/// The objects of a JSON file: of the list under a key, or of the list that the file is, or one per line; of every document, where
/// several stand one after the other.
pub(super) fn json_rows(path: &Path, key: Option<&str>) -> Result<Vec<serde_json::Map<String, Value>>> {
    let text = input_file::read_unpacked(path, MAX_JSON_BYTES)?;
    let wrong = |problem: String| Error::input(Place::file(path), problem, "export the file again");
    let mut list = Vec::new();
    let mut is_empty = true;
    for document in serde_json::Deserializer::from_slice(&text).into_iter::<Value>() {
        is_empty = false;
        match document.map_err(|error| wrong(format!("not JSON: {error}")))? {
            Value::Array(vehicles) => list.extend(vehicles),
            Value::Object(mut object) => match key.and_then(|key| object.remove(key)) {
                Some(Value::Array(vehicles)) => list.extend(vehicles),
                Some(_) => return Err(wrong(format!("`{}` is no list", key.unwrap_or_default()))),
                None => list.push(Value::Object(object)),
            },
            _ => return Err(wrong("expected a list of vehicles".to_owned())),
        }
    }
    if is_empty {
        return Err(wrong("the file is empty".to_owned()));
    }
    let object = |value| match value {
        Value::Object(object) => Ok(object),
        _ => Err(wrong("a vehicle is not an object".to_owned())),
    };
    list.into_iter().map(object).collect()
}
