//! Values: from TOML, from a word of the environment or the command line; checked against what the key takes.

use serde_json::{Number, Value};
use toml::de::DeValue;

use super::keys::{Key, KeyKind, nearest};
use crate::{Error, Place, Result};

/// The complaint about a value, with what to write instead.
fn refused(key: &Key, found: &str, place: Place) -> Error {
    let near = match &key.kind {
        KeyKind::Choice(choices) => nearest(found.trim_matches(['"', '`']), choices.iter().map(|c| c.word.as_str())),
        _ => None,
    };
    let near = near.map_or(String::new(), |word| format!("did you mean \"{word}\"? "));
    let problem = format!("{found} cannot be used; expected {}", key.expected());
    Error::usage(place, problem, near + &key.description)
}

/// What stands in a file, as a value for a key.
///
/// # Errors
/// [`Error::Usage`] at `place` for a value that the key does not take.
pub(super) fn from_toml(key: &Key, found: &DeValue, place: Place) -> Result<Value> {
    let value = match found {
        DeValue::Boolean(b) => Some(Value::Bool(*b)),
        DeValue::String(s) => Some(Value::String(s.clone().into_owned())),
        DeValue::Integer(i) => i128::from_str_radix(i.as_str(), i.radix()).ok().and_then(whole),
        DeValue::Float(f) => f.as_str().parse().ok().and_then(Number::from_f64).map(Value::Number),
        DeValue::Datetime(_) | DeValue::Array(_) | DeValue::Table(_) => None,
    };
    value.and_then(|value| fitted(key, value)).ok_or_else(|| refused(key, &shown(found), place))
}

/// A word of the environment or the command line, as a value for a key; quotes around it may be there.
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

/// A value as TOML writes it.
pub fn text_of(value: &Value) -> String {
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

/// A value of the key's type and in its range: whole numbers stand for others, and 1e6 for a whole one.
fn fitted(key: &Key, value: Value) -> Option<Value> {
    match (&key.kind, value) {
        (KeyKind::Number(range), Value::Number(n)) => {
            let value = match n.as_f64().filter(|_| n.is_f64()) {
                _ if !range.is_whole => n.as_f64().map(Value::from),
                // Beyond 2^53 a floating-point number does not tell which whole one is meant.
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

/// What was found, as a message shows it.
fn shown(value: &DeValue) -> String {
    match value {
        DeValue::Boolean(b) => b.to_string(),
        DeValue::String(s) => format!("\"{s}\""),
        DeValue::Integer(i) => i.to_string(),
        DeValue::Float(f) => f.to_string(),
        DeValue::Datetime(_) => "a date".to_owned(),
        DeValue::Array(_) => "an array".to_owned(),
        DeValue::Table(_) => "a table".to_owned(),
    }
}
