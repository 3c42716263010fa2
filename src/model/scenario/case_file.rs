//! A concrete case in a TOML file: the keys are the flags of `simulate` with `_`, with or without the unit at the end.

use std::fmt;

use serde::Deserialize;
use serde::de::{DeserializeSeed, Deserializer, Error as _, MapAccess, Visitor};

use super::case_parameters::{CaseParameters, NamedNumber};
use super::case_quantity::NUMBERS;
use super::units::Written;
use lanesweep_support::Error;

/// The values of a file.
#[derive(Debug, Default)]
pub struct CaseFile {
    /// Driver models, as `--models` lists them.
    pub models: Option<String>,
    /// The numbers of the case.
    pub parameters: CaseParameters,
}

/// A key of a file.
#[derive(Deserialize)]
#[serde(try_from = "String")]
enum Key {
    Category,
    Models,
    Number(NamedNumber, String),
}

impl TryFrom<String> for Key {
    type Error = String;

    fn try_from(name: String) -> Result<Key, String> {
        match (name.as_str(), NamedNumber::find(&name).map_err(|error| message(&error))?) {
            ("category", _) => Ok(Key::Category),
            ("models", _) => Ok(Key::Models),
            (_, Some(number)) => Ok(Key::Number(number, name)),
            (_, None) => {
                let known = ["category", "models"].into_iter().chain(NUMBERS.iter().map(|number| number.key));
                let known: Vec<String> = known.map(|key| format!("`{key}`")).collect();
                Err(format!("unknown field `{name}`, expected one of {}", known.join(", ")))
            }
        }
    }
}

impl<'de> Deserialize<'de> for CaseFile {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<CaseFile, D::Error> {
        deserializer.deserialize_map(Keys)
    }
}

struct Keys;

impl<'de> Visitor<'de> for Keys {
    type Value = CaseFile;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the keys of a case")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<CaseFile, A::Error> {
        let (mut file, mut seen) = (CaseFile::default(), Vec::new());
        while let Some(key) = map.next_key()? {
            match key {
                Key::Category => file.parameters.category = Some(map.next_value()?),
                Key::Models => file.models = Some(map.next_value()?),
                Key::Number(number, name) => {
                    map.next_value_seed(Number { number, name: &name, seen: &seen, case: &mut file.parameters })?;
                    seen.push((number, name));
                }
            }
        }
        Ok(file)
    }
}

/// Reads the value of a number into its field, after other numbers. Errors have the line of the value.
struct Number<'a> {
    number: NamedNumber,
    name: &'a str,
    seen: &'a [(NamedNumber, String)],
    case: &'a mut CaseParameters,
}

/// The value of a number.
#[derive(Deserialize)]
#[serde(untagged, expecting = "expected a number, or a text with its unit")]
enum Value {
    Number(f64),
    Text(String),
}

impl<'de> DeserializeSeed<'de> for Number<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        let Number { number, name, seen, case } = self;
        if let Some((_, other)) = seen.iter().find(|(other, _)| other.key() == number.key()) {
            return Err(D::Error::custom(format!("`{name}` says the same as `{other}`: leave out one of the two")));
        }
        let set = match &Value::deserialize(deserializer)? {
            Value::Number(value) => number.set(case, Written::Number(*value)),
            Value::Text(text) => number.set(case, Written::Text(text)),
        };
        set.map_err(|error| D::Error::custom(message(&error)))
    }
}

/// The message of an error, with what to do; the reader adds the place.
fn message(error: &Error) -> String {
    match error {
        Error::Usage { problem, help, .. } => format!("{problem}; {help}"),
        other => other.to_string(),
    }
}
