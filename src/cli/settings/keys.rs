//! The keys of a configuration, from the schema of the settings types.
//!
//! Values come from TOML or from the command line, and are checked against the key's type and range. The commented default configuration defines the order of the keys.

use serde_json::{Number, Value};
use toml::de::DeValue;

use super::schema::settings_schema;
use lanesweep_support::plain_text::nearest;
use lanesweep_support::ranges::Range;
use lanesweep_support::{Error, Place, Result};

/// One key with its type, range and default.
#[derive(Debug, Clone, PartialEq)]
pub struct Key {
    /// Tables and name, joined by dots: `mining.cut_in.max_thw_s`.
    pub name: String,
    /// Meaning.
    pub description: String,
    /// Valid values.
    pub kind: KeyKind,
    /// Default; `None` if the key has none.
    pub default: Option<Value>,
    /// Its flag, if it has one.
    pub flag: Option<KeyFlag>,
}

/// The flag of a key, from `x-flag`, `x-verbs`, `x-heading` and `x-value` in the schema. Range, default and help are the
/// key's.
#[derive(Debug, Clone, PartialEq)]
pub struct KeyFlag {
    /// Its name, with `_`.
    pub name: String,
    /// The verbs that have it; `lanesweep` means all.
    pub verbs: Vec<String>,
    /// The heading in the help.
    pub heading: String,
    /// Name of a value that is any text.
    pub value: String,
}

/// Valid values of a key.
#[derive(Debug, Clone, PartialEq)]
pub enum KeyKind {
    /// A number in a range.
    Number(Range),
    /// True or false.
    Boolean,
    /// One of several words.
    Choice(Vec<Choice>),
    /// Any text.
    Text,
}

/// A valid word of a key.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// The word.
    pub word: String,
    /// Meaning; empty if the word is clear.
    pub description: String,
}

impl Key {
    /// All keys, unordered.
    pub fn all() -> Vec<Key> {
        let mut keys = Vec::new();
        collect(&settings_schema(), "", &mut keys);
        keys
    }

    /// The valid values in words: `a number above 0 and at most 1000000`.
    fn expected(&self) -> String {
        match &self.kind {
            KeyKind::Boolean => "true or false".to_owned(),
            KeyKind::Text => "a text in quotes".to_owned(),
            KeyKind::Choice(choices) => {
                let words: Vec<String> = choices.iter().map(|choice| format!("\"{}\"", choice.word)).collect();
                format!("one of {}", words.join(", "))
            }
            KeyKind::Number(range) => range.to_string(),
        }
    }
}

fn collect(schema: &Value, prefix: &str, keys: &mut Vec<Key>) {
    let Some(properties) = schema["properties"].as_object() else { return };
    for (name, property) in properties {
        let name = if prefix.is_empty() { name.clone() } else { format!("{prefix}.{name}") };
        if property["properties"].is_object() {
            collect(property, &name, keys);
            continue;
        }
        keys.push(Key {
            description: property["description"].as_str().unwrap_or_default().to_owned(),
            kind: kind_of(property),
            flag: flag_of(property),
            default: property.get("default").filter(|value| !value.is_null()).cloned(),
            name,
        });
    }
}

fn flag_of(property: &Value) -> Option<KeyFlag> {
    let text = |name: &str| property[name].as_str().unwrap_or_default().to_owned();
    let verbs = property["x-verbs"].as_array()?.iter().filter_map(|verb| Some(verb.as_str()?.to_owned())).collect();
    Some(KeyFlag { name: text("x-flag"), verbs, heading: text("x-heading"), value: text("x-value") })
}

fn kind_of(property: &Value) -> KeyKind {
    let word = |choice: &Value, word: &Value| Choice {
        word: word.as_str().unwrap_or_default().to_owned(),
        description: choice["description"].as_str().unwrap_or_default().to_owned(),
    };
    if let Some(words) = property["enum"].as_array() {
        return KeyKind::Choice(words.iter().map(|w| word(&Value::Null, w)).collect());
    }
    if let Some(choices) = property["oneOf"].as_array() {
        // In the schema, words without a description are in one common branch.
        let of_branch = |choice: &Value| match choice["enum"].as_array() {
            Some(words) => words.iter().map(|w| word(&Value::Null, w)).collect(),
            None => vec![word(choice, &choice["const"])],
        };
        return KeyKind::Choice(choices.iter().flat_map(of_branch).collect());
    }
    match property["type"].as_str() {
        Some("boolean") => KeyKind::Boolean,
        Some("integer" | "number") => KeyKind::Number(Range::of(property)),
        _ => KeyKind::Text,
    }
}

/// The error for an invalid value, with what to write instead.
fn refused(key: &Key, found: &str, place: Place) -> Error {
    let near = match &key.kind {
        KeyKind::Choice(choices) => nearest(found.trim_matches(['"', '`']), choices.iter().map(|c| &*c.word), 0.7),
        _ => None,
    };
    let near = near.map_or(String::new(), |word| format!("did you mean \"{word}\"? "));
    let problem = format!("{found} cannot be used; expected {}", key.expected());
    Error::usage(place, problem, near + &key.description)
}

/// Converts a TOML value to a value of a key.
///
/// # Errors
/// [`Error::Usage`] at `place` for an invalid value.
pub(super) fn from_toml(key: &Key, found: &DeValue, place: Place) -> Result<Value> {
    let (value, shown) = match found {
        DeValue::Boolean(b) => (Some(Value::Bool(*b)), b.to_string()),
        DeValue::String(s) => (Some(Value::String(s.to_string())), format!("\"{s}\"")),
        DeValue::Integer(i) => (i128::from_str_radix(i.as_str(), i.radix()).ok().and_then(whole), i.to_string()),
        DeValue::Float(f) => (f.as_str().parse().ok().and_then(Number::from_f64).map(Value::Number), f.to_string()),
        DeValue::Datetime(_) => (None, "a date".to_owned()),
        DeValue::Array(_) => (None, "an array".to_owned()),
        DeValue::Table(_) => (None, "a table".to_owned()),
    };
    value.and_then(|value| fitted(key, value)).ok_or_else(|| refused(key, &shown, place))
}

/// Converts a text of the command line to a value of a key; it may be in quotes.
///
/// # Errors
/// As [`from_toml`].
pub(super) fn from_word(key: &Key, word: &str, place: Place) -> Result<Value> {
    let word = word.trim();
    let unquoted = ['"', '\''].iter().find_map(|q| word.strip_prefix(*q)?.strip_suffix(*q)).unwrap_or(word);
    let digits = unquoted.replace('_', "");
    let value = match key.kind {
        KeyKind::Text | KeyKind::Choice(_) => (!unquoted.is_empty()).then(|| Value::String(unquoted.to_owned())),
        KeyKind::Boolean => word.parse().ok().map(Value::Bool),
        KeyKind::Number(_) => match digits.parse::<i128>() {
            Ok(i) => whole(i),
            Err(_) => digits.parse().ok().and_then(Number::from_f64).map(Value::Number),
        },
    };
    value.and_then(|value| fitted(key, value)).ok_or_else(|| refused(key, &format!("`{word}`"), place))
}

/// Formats a value as TOML.
pub(crate) fn text_of(value: &Value) -> String {
    match value {
        Value::String(text) => toml::Value::String(text.clone()).to_string(),
        Value::Number(number) => match number.as_f64().filter(|_| number.is_f64()) {
            Some(x) => toml::Value::Float(x).to_string(),
            None => number.to_string(),
        },
        other => other.to_string(),
    }
}

fn whole(i: i128) -> Option<Value> {
    u64::try_from(i).map(Value::from).or_else(|_| i64::try_from(i).map(Value::from)).ok()
}

/// Converts a value to the key's type and checks its range: integers are valid for floats, and 1e6 for an integer.
fn fitted(key: &Key, value: Value) -> Option<Value> {
    match (&key.kind, value) {
        (KeyKind::Number(range), Value::Number(n)) => {
            let value = match n.as_f64().filter(|_| n.is_f64()) {
                _ if !range.is_whole => n.as_f64().map(Value::from),
                // Above 2^53 a floating-point number no longer identifies one integer.
                Some(x) => (x.fract() == 0.0 && x.abs() < 9e15).then(|| whole(x as i128)).flatten(),
                None => Some(Value::Number(n)),
            };
            value.filter(|value| value.as_f64().is_some_and(|x| range.contains(x)))
        }
        (KeyKind::Choice(choices), Value::String(word)) => {
            choices.iter().any(|choice| choice.word == word).then_some(Value::String(word))
        }
        (KeyKind::Boolean, value @ Value::Bool(_)) | (KeyKind::Text, value @ Value::String(_)) => Some(value),
        _ => None,
    }
}

/// The default configuration: every key with its default; keys without a default are in comments.
pub(crate) const DEFAULT_FILE: &str = include_str!("../../../configs/default.toml");

/// Default file name of `lanesweep config init`.
pub(crate) const DEFAULT_FILE_NAME: &str = "lanesweep.toml";

/// All keys in the order of the default file, which is chosen for readers; keys that are not set are in comments there
/// (`# threads = 8`).
pub(crate) fn keys_in_order() -> Vec<Key> {
    let place = |key: &Key| {
        let (table, name) = key.name.rsplit_once('.').unwrap_or_default();
        let begin = DEFAULT_FILE.find(&format!("\n[{table}]"))?;
        let of_table = &DEFAULT_FILE[begin..];
        let at = ["", "# "].iter().filter_map(|mark| of_table.find(&format!("\n{mark}{name} = "))).min()?;
        Some(begin + at)
    };
    let mut keys = Key::all();
    keys.sort_by_cached_key(|key| place(key).unwrap_or(usize::MAX));
    keys
}
