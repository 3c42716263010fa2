//! The keys of a configuration, as the types' own schema tells them.

use serde_json::Value;

use super::schema::settings_schema;
use crate::support::plain_text;
use crate::support::ranges::Range;

/// One key with what it takes.
#[derive(Debug, Clone, PartialEq)]
pub struct Key {
    /// Tables and name, joined by dots: `mining.cut_in.max_thw_s`.
    pub name: String,
    /// What it means.
    pub description: String,
    /// What it takes.
    pub kind: KeyKind,
    /// Its default; `None` where it is not set unless somebody sets it.
    pub default: Option<Value>,
}

/// What a key takes.
#[derive(Debug, Clone, PartialEq)]
pub enum KeyKind {
    /// A number.
    Number(Range),
    /// True or false.
    Boolean,
    /// One of some words.
    Choice(Vec<Choice>),
    /// Any text.
    Text,
}

/// A word that a key takes.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// The word.
    pub word: String,
    /// What it means; empty where the word says it.
    pub description: String,
}

impl Key {
    /// All keys, in no order that means anything.
    pub fn all() -> Vec<Key> {
        let mut keys = Vec::new();
        collect(&settings_schema(), "", &mut keys);
        keys
    }

    /// A key by its name.
    pub fn find<'a>(keys: &'a [Key], name: &str) -> Option<&'a Key> {
        keys.iter().find(|key| key.name == name)
    }

    /// What it expects, in words: `a number above 0 and at most 1000000`.
    pub fn expected(&self) -> String {
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

/// The name nearest to a wrong one, where one is near.
pub(super) fn nearest<'a>(wrong: &str, names: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    plain_text::nearest(wrong, names, 0.7)
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
            default: property.get("default").filter(|value| !value.is_null()).cloned(),
            name,
        });
    }
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
        // Words without a description share one branch.
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
