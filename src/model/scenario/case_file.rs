//! A concrete case in a TOML file: the keys are the flags of `simulate` with `_`, with or without the unit at the end.

use std::fmt;

use serde::Deserialize;
use serde::de::{self, DeserializeSeed, Deserializer, Error as _, MapAccess, Visitor};

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
        let mut file = CaseFile::default();
        let mut seen: Vec<(NamedNumber, String)> = Vec::new();
        while let Some(key) = map.next_key_seed(Key(&seen))? {
            match key {
                FileKey::Category => file.parameters.category = Some(map.next_value()?),
                FileKey::Models => file.models = Some(map.next_value()?),
                FileKey::Number(number, name) => {
                    map.next_value_seed(Number(number, &mut file.parameters))?;
                    seen.push((number, name));
                }
            }
        }
        Ok(file)
    }
}

enum FileKey {
    Category,
    Models,
    Number(NamedNumber, String),
}

/// Reads a key; the numbers before it have these names.
struct Key<'a>(&'a [(NamedNumber, String)]);

impl<'de> DeserializeSeed<'de> for Key<'_> {
    type Value = FileKey;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<FileKey, D::Error> {
        let name = String::deserialize(deserializer)?;
        match (name.as_str(), NamedNumber::find(&name)) {
            ("category", _) => Ok(FileKey::Category),
            ("models", _) => Ok(FileKey::Models),
            (_, Ok(Some(number))) => match self.0.iter().find(|(other, _)| other.key() == number.key()) {
                Some((_, other)) => {
                    Err(D::Error::custom(format!("`{name}` says the same as `{other}`: leave out one of the two")))
                }
                None => Ok(FileKey::Number(number, name)),
            },
            (_, Err(error)) => Err(custom(&error)),
            (_, Ok(None)) => {
                let known: Vec<String> = ["category", "models"]
                    .into_iter()
                    .chain(NUMBERS.iter().map(|number| number.key))
                    .map(|key| format!("`{key}`"))
                    .collect();
                Err(D::Error::custom(format!("unknown field `{name}`, expected one of {}", known.join(", "))))
            }
        }
    }
}

/// Reads the value of a number into its field.
struct Number<'a>(NamedNumber, &'a mut CaseParameters);

impl<'de> DeserializeSeed<'de> for Number<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl Visitor<'_> for Number<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, or a text with its unit")
    }

    fn visit_f64<E: de::Error>(self, number: f64) -> Result<(), E> {
        self.0.set(self.1, Written::Number(number)).map_err(|error| custom(&error))
    }

    fn visit_i64<E: de::Error>(self, number: i64) -> Result<(), E> {
        self.visit_f64(number as f64)
    }

    fn visit_u64<E: de::Error>(self, number: u64) -> Result<(), E> {
        self.visit_f64(number as f64)
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<(), E> {
        self.0.set(self.1, Written::Text(text)).map_err(|error| custom(&error))
    }
}

/// The message of an error, with what to do; the reader adds the place.
fn custom<E: de::Error>(error: &Error) -> E {
    match error {
        Error::Usage { problem, help, .. } => E::custom(format!("{problem}; {help}")),
        other => E::custom(other.to_string()),
    }
}
